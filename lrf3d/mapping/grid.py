"""Grid: a hashed grid of square cells that finds which segments come near which.

Each slot of a hash table holds a linked list of the rows whose segments pass through the cells that
share it: a search may find rows that are far away, and never misses one that is near. Only the
arrays of one :class:`Grid` are written, so that everything runs in compiled loops without Python.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Float, Int

GRID_CELL = 4.0
"""[m] Side of a cell: a few times what is searched around a wall, and a fraction of most walls. It
changes speed only."""

TAKEN, FREE, FULL, SEARCHES = range(4)
"""What `Grid.used` counts: entries ever taken, the first that was given back (−1 for none), whether
an entry was wanted when there was none, and searches."""


class Grid(NamedTuple):
    """Where the rows of a table of segments are.

    The first entry of each slot's list, −1 where it is empty; the row of each entry, and the next
    of the same list; the last search that met each row; the rows that the last search met; and
    `TAKEN`. The number of slots is a power of two.
    """

    heads: Int
    rows: Int
    following: Int
    stamps: Int
    found: Int
    used: Int

    @classmethod
    def of_size(cls, entries: int, rows: int) -> "Grid":
        """An empty grid with some entries (a power of two), for a table of some rows."""
        return cls(
            np.full(entries, -1), np.empty(entries, np.int64), np.empty(entries, np.int64),
            np.zeros(rows, np.int64), np.empty(rows, np.int64), np.array([0, -1, 0, 0]),
        )  # fmt: skip

    @property
    def is_full(self) -> bool:
        """Whether an entry was missing: rows may be found too seldom until it is filled again."""
        return bool(self.used[FULL])


def filled(segments: Float, points: Int, entries: int) -> Grid:
    """A grid of all rows of segments (rows, 4) that have points, with this many entries or more."""
    while True:
        grid = Grid.of_size(entries, len(points))
        insert_rows(grid, np.flatnonzero(points), segments)
        if not grid.is_full:
            return grid
        entries *= 2


@borrower
def _slot_of(grid: Grid, x: int, y: int) -> int:
    """The slot of a cell."""
    mixed = ((x << 31) + y) * 0x9E3779B97F4A7C1
    return (mixed ^ (mixed >> 29)) & (len(grid.heads) - 1)


@borrower
def _steps(segment: Float) -> int:
    """The number of parts of a segment (4,) that are no longer than a cell along an axis."""
    return int(max(abs(segment[2] - segment[0]), abs(segment[3] - segment[1])) / GRID_CELL) + 1


@borrower
def _box(segment: Float, step: int, steps: int, reach: float) -> tuple[int, int, int, int]:
    """First and last column, first and last row of the cells within a reach [m] of one part."""
    x, y = segment[0], segment[1]
    dx, dy = (segment[2] - x) / steps, (segment[3] - y) / steps
    left, right = min(step * dx, (step + 1) * dx) - reach, max(step * dx, (step + 1) * dx) + reach
    low, high = min(step * dy, (step + 1) * dy) - reach, max(step * dy, (step + 1) * dy) + reach
    return (
        int(np.floor((x + left) / GRID_CELL)), int(np.floor((x + right) / GRID_CELL)),
        int(np.floor((y + low) / GRID_CELL)), int(np.floor((y + high) / GRID_CELL)),
    )  # fmt: skip


@borrower
def insert(grid: Grid, row: int, segment: Float) -> None:
    """Put a row's segment (4,) into the cells that it passes through; notes where room ran out."""
    steps = _steps(segment)
    for step in range(steps):
        left, right, low, high = _box(segment, step, steps, 0.0)
        for x in range(left, right + 1):
            for y in range(low, high + 1):
                slot = _slot_of(grid, x, y)
                entry = grid.heads[slot]
                while entry >= 0 and grid.rows[entry] != row:
                    entry = grid.following[entry]
                if entry >= 0:
                    continue
                entry = grid.used[FREE]
                if entry >= 0:
                    grid.used[FREE] = grid.following[entry]
                elif grid.used[TAKEN] < len(grid.rows):
                    entry = grid.used[TAKEN]
                    grid.used[TAKEN] += 1
                else:
                    grid.used[FULL] = 1
                    return
                grid.rows[entry] = row
                grid.following[entry] = grid.heads[slot]
                grid.heads[slot] = entry


@borrower
def remove(grid: Grid, row: int, segment: Float) -> None:
    """Take a row out of the cells that its segment (4,) passes through."""
    steps = _steps(segment)
    for step in range(steps):
        left, right, low, high = _box(segment, step, steps, 0.0)
        for x in range(left, right + 1):
            for y in range(low, high + 1):
                slot = _slot_of(grid, x, y)
                before, entry = -1, grid.heads[slot]
                while entry >= 0 and grid.rows[entry] != row:
                    before, entry = entry, grid.following[entry]
                if entry < 0:
                    continue
                if before < 0:
                    grid.heads[slot] = grid.following[entry]
                else:
                    grid.following[before] = grid.following[entry]
                grid.following[entry] = grid.used[FREE]
                grid.used[FREE] = entry


@compiled
def insert_rows(grid: Grid, rows: Int, segments: Float) -> None:
    """Put rows (n,) of segments into a grid."""
    for k in range(len(rows)):
        insert(grid, rows[k], segments[rows[k]])


@borrower
def near(grid: Grid, segment: Float, reach: float) -> int:
    """Collect in `found` every row within reach [m] of a segment (4,), each once, and count them.

    Some may lie farther off.
    """
    grid.used[SEARCHES] += 1
    count, stamp = 0, grid.used[SEARCHES]
    steps = _steps(segment)
    for step in range(steps):
        left, right, low, high = _box(segment, step, steps, reach)
        for x in range(left, right + 1):
            for y in range(low, high + 1):
                entry = grid.heads[_slot_of(grid, x, y)]
                while entry >= 0:
                    row = grid.rows[entry]
                    if grid.stamps[row] != stamp:
                        grid.stamps[row] = stamp
                        grid.found[count] = row
                        count += 1
                    entry = grid.following[entry]
    return count
