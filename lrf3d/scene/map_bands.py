"""The map in 3D: slim bands on the mapped walls, which grow as walls are found.

Maps and the world enter; corners of solid bands and of their glow leave, in the film's frame. A
band keeps a least height in the picture: the vertex shader makes it higher where it is far away,
as high as its wall at the most.
"""

from typing import NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, Single
from lrf3d.scene.look import GLOW_REACH, GLOW_STRENGTH, MAP_BAND

BAND_SIZES = (2, 2, 3, 2, 4)
"""Floats of a corner: its place before and after it has grown [m]; which way it lies off the middle
of the band, to the side in half thicknesses and up in half heights; the height of the middle and
that of the wall [m]; colour and opacity."""

_ALONG = 0.35
"""Two segments of maps that are off each other's line by less than this [m] show one wall."""

_TURNED = 0.97
"""Cosine of the largest angle between two segments of one wall."""

_NEAR = 0.2
"""A wall farther than this from a segment of the map [m] is another one."""

_TALL = 2.0
"""Walls from this height on [m] are higher than any band."""


class Bands(NamedTuple):
    """The corners of a map's bands.

    Args:
        solid: (8 · m, 13) corners of each band, whose triangles are :data:`SOLID`.
        glow: (16 · m, 13) corners of the glow above and below them on both sides, whose triangles
            are :data:`GLOW`.
    """

    solid: Single
    glow: Single


class WallTops:
    """Finds the height of the wall that a segment of a map lies on, if that is low.

    Args:
        walls: (n, 4) the walls in the film's frame [m].
        heights: (n,) their heights [m].
    """

    def __init__(self, walls: Float, heights: Float) -> None:
        low = heights < _TALL
        self._heights = heights[low]
        self._tree = shapely.STRtree(shapely.linestrings(walls[low].reshape(-1, 2, 2)))

    def of(self, segments: Float) -> Float:
        """Heights (m,) of the walls [m]; infinite where no low wall is at a segment (m, 4)."""
        tops = np.full(len(segments), np.inf)
        if len(segments) and len(self._heights):
            middles = shapely.points(0.5 * (segments[:, :2] + segments[:, 2:]))
            found, wall = self._tree.query_nearest(middles, max_distance=_NEAR, all_matches=False)
            tops[found] = self._heights[wall]
        return tops

    def bands(self, segments: Float) -> Float:
        """How high (m,) the bands on segments (m, 4) reach [m]."""
        return np.asarray(np.minimum(self.of(segments), MAP_BAND[1]))


def map_bands(segments: Float, colours: Float, tops: Float, before: Float) -> Bands:
    """The bands of a map whose segments grow from those of the map before.

    Args:
        segments: (m, 4) segments of the map.
        colours: (m, 3) their colours.
        tops: (m,) heights of their walls [m].
        before: (n, 4) segments of the map before.
    """
    starts = _grown_from(segments, before)
    ends = np.stack([starts.reshape(-1, 2, 2), segments.reshape(-1, 2, 2)], axis=1)
    along = ends[:, 1, 1] - ends[:, 1, 0]
    along = along / np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    middles = np.minimum(0.5 * sum(MAP_BAND), tops - 0.5 * (MAP_BAND[1] - MAP_BAND[0]))
    heights = np.column_stack([middles, np.minimum(tops, 1e3)])
    return Bands(
        _corners(_SOLID, ends, left, heights, colours, 1.0),
        _corners(_GLOW, ends, left, heights, colours, GLOW_STRENGTH),
    )


_Corner = tuple[int, float, float]
"""A corner: the end of the segment that it is at, its side and its height."""


def _shape(faces: list[list[_Corner]]) -> tuple[Float, Int]:
    """Corners (c, 3) of faces, each once, and which of them (6 · faces,) make their triangles."""
    corners = list(dict.fromkeys(corner for face in faces for corner in face))
    number = {corner: place for place, corner in enumerate(corners)}
    triangles = [number[face[k]] for face in faces for k in (0, 1, 2, 0, 2, 3)]
    return np.array(corners, dtype=np.float64), np.array(triangles)


_REACH = 1.0 + 2.0 * GLOW_REACH / (MAP_BAND[1] - MAP_BAND[0])
"""How far the glow reaches from the middle of a band, in half heights."""

_SOLID, SOLID = _shape(
    [
        [(0, 1, -1), (1, 1, -1), (1, 1, 1), (0, 1, 1)],
        [(1, -1, -1), (0, -1, -1), (0, -1, 1), (1, -1, 1)],
        [(0, 1, 1), (1, 1, 1), (1, -1, 1), (0, -1, 1)],
        [(0, -1, -1), (0, 1, -1), (0, 1, 1), (0, -1, 1)],
        [(1, 1, -1), (1, -1, -1), (1, -1, 1), (1, 1, 1)],
    ]
)
_GLOW, GLOW = _shape(
    [
        [(0, side, low), (1, side, low), (1, side, high), (0, side, high)]
        for side in (0.5, -0.5)
        for low, high in ((-_REACH, -1.0), (1.0, _REACH))
    ]
)
"""Corners of a band and of its glow; and which of them make its triangles: both sides, the top and
both ends."""


def _corners(
    shape: Float, ends: Float, left: Float, heights: Float, colours: Float, strength: float
) -> Single:
    """Corners (m · corners, 13) of a shape, put to segments whose ends are (m, 2, 2, 2)."""
    end, side, up = shape[:, 0].astype(int), shape[:, 1], shape[:, 2]
    rows = np.empty((len(ends), len(shape), sum(BAND_SIZES)), np.float32)
    rows[..., 0:2], rows[..., 2:4] = ends[:, 0, end], ends[:, 1, end]
    rows[..., 4:6] = left[:, None] * side[:, None]
    rows[..., 6] = up
    rows[..., 7:9] = heights[:, None]
    rows[..., 9:12] = colours[:, None]
    rows[..., 12] = np.where(np.abs(up) <= 1.0, strength, 0.0)
    return rows.reshape(-1, sum(BAND_SIZES))


def _grown_from(segments: Float, before: Float) -> Float:
    """Where segments (m, 4) begin to grow from: what of them the map before (n, 4) showed."""
    known = {row.tobytes() for row in before}
    changed = [number for number, row in enumerate(segments) if row.tobytes() not in known]
    starts = segments.copy()
    if changed:
        starts[changed] = _shown_of(segments[changed], before)
    return starts


def _shown_of(segments: Float, before: Float) -> Float:
    """What of segments (m, 4) a map (n, 4) shows; the middle of one of which it shows nothing."""
    start, way = segments[:, :2], segments[:, 2:] - segments[:, :2]
    length = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
    along = way / length[:, None]
    first, last = np.full(len(segments), np.inf), np.full(len(segments), -np.inf)
    if len(before):
        old = before[:, 2:] - before[:, :2]
        old = old / np.maximum(np.hypot(old[:, 0], old[:, 1]), 1e-9)[:, None]
        parallel = np.abs(along @ old.T) > _TURNED
        places, offs = [], []
        for end in (before[:, :2], before[:, 2:]):
            gap = end[None] - start[:, None]
            places.append(np.einsum("mnk,mk->mn", gap, along))
            offs.append(np.abs(gap[..., 0] * along[:, None, 1] - gap[..., 1] * along[:, None, 0]))
        low, high = np.minimum(*places), np.maximum(*places)
        same = parallel & (np.maximum(*offs) < _ALONG) & (high > 0.0) & (low < length[:, None])
        first = np.where(same, low, np.inf).min(axis=1, initial=np.inf)
        last = np.where(same, high, -np.inf).max(axis=1, initial=-np.inf)
    known = first < last
    first = np.where(known, np.clip(first, 0.0, length), 0.5 * length)
    last = np.where(known, np.clip(last, 0.0, length), 0.5 * length)
    return np.concatenate([start + first[:, None] * along, start + last[:, None] * along], axis=1)
