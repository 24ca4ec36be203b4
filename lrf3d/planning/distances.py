"""Distances: a grid over a world with the distance of each cell to the nearest wall."""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Float, Int, lengths

SURROUNDINGS = 6.0
"""Width [m] of the land around the walls where a robot may drive."""

WIDEST_WINDOW, TILE = 500.0, 50.0
"""Largest side [m] of the part of a world that is planned in, as much as a drive can show, and the
side of the tiles of which it is made."""

CELLS = 900_000
"""Approximate number of cells, within the limits of their size."""

CELL_SIZES = (0.05, 0.35)
"""Smallest and largest side of a cell [m]: a doorway is some cells wide, a street many."""

BLOCK = 3
"""Cells along a side of a block; a block holds at most one place of the robot."""


@dataclass(frozen=True)
class Distances:
    """Square cells (columns, rows) of a size [m] over a box with a lower corner (2,) [m].

    Gaps are the distances of their middles to the nearest wall [m]; which wall that is stands
    beside them.
    """

    low: Float
    size: float
    gaps: Float
    nearest: Int

    def points(self, cells: Bool | tuple[Int, Int]) -> Float:
        """The middles (k, 2) [m] of cells, given by a mask or by columns and rows."""
        where = np.nonzero(cells) if isinstance(cells, np.ndarray) else cells
        return np.asarray(self.low + self.size * (np.column_stack(where) + 0.5))

    def cells(self, points: Float) -> tuple[Int, Int]:
        """Columns and rows of the cells of points (..., 2) [m], of the nearest ones from beyond."""
        columns, rows = np.moveaxis((points - self.low) / self.size, -1, 0).astype(np.int64)
        width, height = self.gaps.shape
        return np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)


def measure_distances(segments: Float, around: Float | None = None) -> Distances | None:
    """The grid over walls (n, 4) [m], or over their densest part or that around a position (2,).

    It is None if there is no wall in it.
    """
    import shapely
    from scipy.ndimage import distance_transform_edt

    low, high = _window(segments, around)
    size = float(np.clip(np.sqrt(np.prod(high - low) / CELLS), *CELL_SIZES))
    shape = BLOCK * np.ceil((high - low) / (BLOCK * size)).astype(int)
    lines = shapely.clip_by_rect(shapely.linestrings(segments.reshape(-1, 2, 2)), *low, *high)
    inside = np.flatnonzero(shapely.length(lines) > 0.0)
    if not len(inside):
        return None
    parts = shapely.get_coordinates(lines[inside]).reshape(-1, 4)
    wall_in = np.full(shape, -1, dtype=np.int64)
    grid = Distances(low, size, np.empty(shape), wall_in)
    points, part = samples(parts, 0.5 * size)
    wall_in[grid.cells(points)] = inside[part]
    columns, rows = distance_transform_edt(wall_in < 0, return_distances=False, return_indices=True)
    nearest = wall_in[columns, rows]
    middles = grid.points(np.ones(shape, dtype=np.bool_)).reshape(*shape, 2)
    return Distances(low, size, _apart(middles, segments[nearest]), nearest)


def _window(segments: Float, around: Float | None) -> tuple[Float, Float]:
    """Corners (2,) of the box around all walls, or where most walls end if that is too wide."""
    from scipy.spatial import cKDTree

    ends = segments.reshape(-1, 2)
    if around is not None:
        ends = np.vstack([ends, around])
    low, high = ends.min(axis=0) - SURROUNDINGS, ends.max(axis=0) + SURROUNDINGS
    if (high - low).max() <= WIDEST_WINDOW:
        return low, high
    if around is None:
        tiles = TILE * (np.unique(np.floor(ends / TILE), axis=0) + 0.5)
        reach = 0.5 * (WIDEST_WINDOW - TILE)
        counts = cKDTree(ends).query_ball_point(tiles, reach, p=np.inf, return_length=True)
        around = tiles[int(np.argmax(counts))]
    return np.maximum(low, around - WIDEST_WINDOW / 2), np.minimum(high, around + WIDEST_WINDOW / 2)


def samples(segments: Float, spacing: float) -> tuple[Float, Int]:
    """Points (k, 2) along segments (n, 4), with their ends, and the segment (k,) of each."""
    counts = np.ceil(lengths(segments) / spacing).astype(int) + 1
    segment = np.repeat(np.arange(len(segments)), counts)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (step / (counts[segment] - 1))[:, None]
    return segments[segment, :2] * (1.0 - share) + segments[segment, 2:] * share, segment


def _apart(points: Float, segments: Float) -> Float:
    """Distances (...,) of points (..., 2) from segments (..., 4) [m]."""
    start, span = segments[..., :2], segments[..., 2:] - segments[..., :2]
    offset = points - start
    share = np.einsum("...i,...i", offset, span) / np.einsum("...i,...i", span, span)
    rest = offset - np.clip(share, 0.0, 1.0)[..., None] * span
    return np.asarray(np.hypot(rest[..., 0], rest[..., 1]))


def connected(cells: Bool) -> tuple[Int, int]:
    """The connected part (columns, rows) of each of some cells, from 1, and the number of parts.

    Cells that touch at a corner are connected; 0 stands for the other cells.
    """
    from scipy.ndimage import label

    parts, count = label(cells, np.ones((3, 3)))
    return np.asarray(parts, dtype=np.int64), int(count)


def distinct(*columns: Int) -> tuple[Int, ...]:
    """The distinct rows of columns of numbers from 0, in ascending order, again as columns."""
    sizes = tuple(int(column.max(initial=0)) + 1 for column in columns)
    return np.unravel_index(np.unique(np.ravel_multi_index(columns, sizes)), sizes)
