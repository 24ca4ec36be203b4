"""The map in 3D: slim bands on the mapped walls, which at the end stand up as walls."""

from typing import TYPE_CHECKING

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.scene.look import MAP_BAND, MAP_STANDING, MAP_WIDTH
from lrf3d.scene.shapes import Faces, single

if TYPE_CHECKING:
    from lrf3d.scene.trail_and_map import DrawnMap

_NEAR = 0.2
"""A wall farther than this from a segment of the map [m] is another one."""

_LOWEST = 0.02
"""Height above the ground [m] that bands keep."""

_WIDEST = 3.0
"""Bands that are far away are drawn higher, and at most this number of times as thick."""

_CORNERS = np.array(
    [
        [[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]],
        [[1, -1, 0], [0, -1, 0], [0, -1, 1], [1, -1, 1]],
        [[0, 1, 1], [1, 1, 1], [1, -1, 1], [0, -1, 1]],
        [[0, -1, 0], [0, 1, 0], [0, 1, 1], [0, -1, 1]],
        [[1, 1, 0], [1, -1, 0], [1, -1, 1], [1, 1, 1]],
    ]
)[:, [0, 2, 1, 0, 3, 2]].reshape(-1, 3)
"""Both sides, the top and both ends of a band as triangles, of each corner: the end of the segment
that it is at, its side, and whether it is below or on top."""

_NORMALS = np.repeat([[0, 1, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [1, 0, 0]], 6, axis=0)
"""How far along, to the left and up each of these looks."""


class WallTops:
    """Finds the height of the wall that a segment of a map lies on.

    Args:
        walls: (n, 4) the walls in the film's frame [m].
        heights: (n,) their heights [m].
    """

    def __init__(self, walls: Float, heights: Float) -> None:
        self._heights = heights
        self._tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))

    def of(self, segments: Float) -> Float:
        """Heights (m,) of the walls [m]; infinite where no wall is at a segment (m, 4)."""
        tops = np.full(len(segments), np.inf)
        if len(segments) and len(self._heights):
            middles = shapely.points(0.5 * (segments[:, :2] + segments[:, 2:]))
            found, wall = self._tree.query_nearest(middles, max_distance=_NEAR, all_matches=False)
            tops[found] = self._heights[wall]
        return tops


def bands(drawn: "DrawnMap", walls: Float, eye: Float, *, least: float, raised: float) -> Faces:
    """The bands of a map on walls of heights (m,) [m], for an eye (3,).

    They are at least so high [m] for each metre that they are away from the eye.

    Raised by a share 0…1 they stand up to the tops of their walls.
    """
    ends = drawn.segments.reshape(-1, 2, 2)
    top = np.minimum(walls, MAP_BAND[1])
    half = 0.5 * (MAP_BAND[1] - MAP_BAND[0])
    middle = top - half
    away = np.linalg.norm(np.append(ends.mean(axis=1), middle[:, None], axis=1) - eye, axis=1)
    size = np.maximum(1.0, least * away / half)
    low = np.maximum(middle - half * size, _LOWEST)
    high = np.minimum(middle + half * size, walls)
    standing = np.where(np.isfinite(walls), walls, MAP_STANDING)
    low, high = low + raised * (_LOWEST - low), high + raised * (standing - high)
    along = ends[:, 1] - ends[:, 0]
    along = along / np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    thick = 0.5 * MAP_WIDTH * np.minimum(size, _WIDEST) * (1.0 + raised)
    corners = np.empty((len(ends), len(_CORNERS), 3), np.float32)
    end, side, up = _CORNERS.T
    corners[..., :2] = ends[:, end] + side[:, None] * (thick[:, None] * left)[:, None]
    corners[..., 2] = np.where(up == 1, high[:, None], low[:, None])
    normals = np.zeros_like(corners)
    if raised > 0.0:
        # Standing walls are lit, so that their sides differ; bands shine by themselves.
        normals[..., :2] = _NORMALS[:, :1] * along[:, None] + _NORMALS[:, 1:2] * left[:, None]
        normals[..., 2] = _NORMALS[:, 2]
    colours = np.repeat(drawn.colours[:, None], len(_CORNERS), axis=1)
    shape = (-1, 3, 3)
    return Faces(corners.reshape(shape), normals.reshape(shape), single(colours.reshape(shape)))
