"""The walls and roofs of a scene as Embree has them, and what is known of each triangle."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float
from lrf3d.render.traced.shading import (
    ALONG,
    BACK,
    COLOUR,
    COLUMNS,
    LAYER,
    LIGHT,
    NORMAL,
    OFFSET,
    UNDER,
    UP,
)
from lrf3d.scene.facades import TILE, light_on

Ids = NDArray[np.int32]


_PAST = 1e-3
"""How far past a face a ray goes on, in lengths of its direction."""

_MOST_PASSED = 4
"""Faces that a ray goes through at most: one that grazes them might go on for ever."""


class Surfaces:
    """Triangles that rays are cast at.

    Args:
        triangles: (t, 3, 13) their corners, in the rows that :mod:`lrf3d.render.parts` makes.
        painted: The levels of the texture that they are painted with.
        indoor: Whether this is the inside of a house.

    Attributes:
        faces: The table of them, see :func:`face_table`.
        painted: All texels of the texture, level after level.
        painted_levels: (n, 3) where each level starts, its width and its height.
    """

    def __init__(
        self,
        triangles: NDArray[np.float32],
        painted: tuple[NDArray[np.uint8], ...],
        *,
        indoor: bool,
    ) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.faces = face_table(triangles, indoor=indoor)
        self.painted = np.concatenate([level.ravel() for level in painted])
        sizes = np.array([level.size for level in painted])
        sides = np.array([level.shape[2:0:-1] for level in painted])
        self.painted_levels = np.column_stack([np.cumsum(sizes) - sizes, sides])
        self._level = self.faces[:, NORMAL + 2] > 0.5
        self._scene = EmbreeScene()
        self._kept = None
        if len(triangles):
            corners = np.ascontiguousarray(triangles[:, :, :3].reshape(-1, 3), np.float32)
            numbers = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
            self._kept = TriangleMesh(self._scene, corners, numbers)

    def nearest(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Ids:
        """The triangle (n,) that each ray meets first, or −1."""
        if self._kept is None:
            return np.full(len(origins), -1, np.int32)
        hits = np.asarray(self._scene.run(origins, directions), np.int32)
        # Level faces, on tops of walls, have no underside: rays go on through it.
        rising = np.flatnonzero((hits >= 0) & (directions[:, 2] > 0.0))
        for _ in range(_MOST_PASSED):
            rising = rising[(hits[rising] >= 0) & self._level[hits[rising]]]
            if not len(rising):
                break
            way, start = directions[rising], origins[rising]
            depth = (self.faces[hits[rising], OFFSET] - start[:, 2]) / way[:, 2] + _PAST
            through = np.ascontiguousarray(start + way * depth[:, None], np.float32)
            hits[rising] = self._scene.run(through, way)
        return hits


def face_table(triangles: NDArray[np.float32], *, indoor: bool) -> Float:
    """The table (t, COLUMNS) of triangles (t, 3, 13).

    Of each triangle: its plane; where along and up the texture a point is [texels], and how far
    under the edge of its shadow, as linear functions of the point; its colour, the light on it
    and on its back, and its layer of the texture.
    """
    corners = triangles[:, :, :3].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-30)[:, None]
    facing = normal / np.sqrt(square)
    table = np.zeros((len(triangles), COLUMNS))
    table[:, NORMAL:OFFSET] = facing
    table[:, OFFSET] = np.einsum("ij,ij->i", facing, corners[:, 0])
    for column, value, scale in ((ALONG, 3, TILE), (UP, 4, TILE), (UNDER, 12, 1.0)):
        values = scale * triangles[:, :, value].astype(np.float64)
        to_first, to_second = (values[:, k] - values[:, 0] for k in (1, 2))
        slope: Any = to_first[:, None] * np.cross(second, normal)
        slope = (slope + to_second[:, None] * np.cross(normal, first)) / square
        table[:, column : column + 3] = slope
        table[:, column + 3] = values[:, 0] - np.einsum("ij,ij->i", slope, corners[:, 0])
    table[:, COLOUR:LIGHT] = triangles[:, 0, 6:9]
    table[:, LIGHT:BACK] = triangles[:, 0, 9:12]
    # Of the two faces of a thin wall a ray may find the one that looks away.
    table[:, BACK:LAYER] = light_on(-facing, indoor=indoor)
    table[:, LAYER] = triangles[:, 0, 5]
    return table
