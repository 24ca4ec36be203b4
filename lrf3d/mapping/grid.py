"""Grid: a hashed grid of square cells that finds which segments come near which.

Each cell holds a linked list of the segments that pass through it. Nothing but the arrays of one
:class:`Grid` is written, so that inserting and asking run in compiled loops without Python.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int

EMPTY = -(2**62)
"""Key of a slot that no cell has taken."""


class Grid(NamedTuple):
    """A hash table of cells, each with a list of rows.

    Args:
        keys: (slots,) the cell that has each slot; slots is a power of two.
        heads: (slots,) the first entry of each cell's list, −1 where it is empty.
        rows: (entries,) the row of each entry.
        following: (entries,) the next entry of the same cell, −1 at the end.
        used: (3,) entries and slots that were taken, and the first entry that was given back.
    """

    keys: Int
    heads: Int
    rows: Int
    following: Int
    used: Int

    @classmethod
    def of_size(cls, entries: int) -> "Grid":
        """An empty grid with room for some entries (a power of two)."""
        return cls(
            np.full(2 * entries, EMPTY),
            np.full(2 * entries, -1),
            np.empty(entries, np.int64),
            np.empty(entries, np.int64),
            np.array([0, 0, -1]),
        )


class Search(NamedTuple):
    """What searches of a grid need.

    Args:
        number: (1,) number of the last one.
        stamps: (rows,) the last one that met each row.
        found: (rows,) room for the rows that are found.
    """

    number: Int
    stamps: Int
    found: Int

    @classmethod
    def of_size(cls, rows: int) -> "Search":
        """No search yet."""
        return cls(np.zeros(1, np.int64), np.zeros(rows, np.int64), np.empty(rows, np.int64))


@inner
def slot_of(keys: Int, x: int, y: int) -> int:
    """The slot of a cell in a hash table of cells, or the free one that it would take."""
    key = (x << 31) + y
    mask = len(keys) - 1
    mixed = key * 0x9E3779B97F4A7C1
    slot = (mixed ^ (mixed >> 29)) & mask
    while keys[slot] != key and keys[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@inner
def _steps(segment: Float, cell: float) -> int:
    """The number of parts of a segment (4,) that are no longer than a cell [m] along an axis."""
    return int(max(abs(segment[2] - segment[0]), abs(segment[3] - segment[1])) / cell) + 1


@inner
def _box(
    segment: Float, begin: float, end: float, reach: float, cell: float
) -> tuple[int, int, int, int]:
    """The first and last column, and the first and last row, of the cells near a part of a segment.

    Args:
        segment: (4,) the segment [m].
        begin: Where the part begins, as a share of the segment.
        end: Where it ends.
        reach: How far from it cells count as near [m].
        cell: Size of a cell [m].
    """
    x, y = segment[0], segment[1]
    dx, dy = segment[2] - x, segment[3] - y
    left, right = min(begin * dx, end * dx) - reach, max(begin * dx, end * dx) + reach
    low, high = min(begin * dy, end * dy) - reach, max(begin * dy, end * dy) + reach
    return (
        int(np.floor((x + left) / cell)), int(np.floor((x + right) / cell)),
        int(np.floor((y + low) / cell)), int(np.floor((y + high) / cell)),
    )  # fmt: skip


@compiled
def insert(grid: Grid, row: int, segment: Float, cell: float) -> bool:
    """Put a row's segment (4,) into the cells [m] it passes through; False where room ran out.

    Cells that hold the row already are passed over, so that a segment that grew can be put in
    again.
    """
    steps = _steps(segment, cell)
    for step in range(steps):
        left, right, low, high = _box(segment, step / steps, (step + 1) / steps, 0.0, cell)
        for x in range(left, right + 1):
            for y in range(low, high + 1):
                slot = slot_of(grid.keys, x, y)
                entry = grid.heads[slot]
                while entry >= 0 and grid.rows[entry] != row:
                    entry = grid.following[entry]
                if entry >= 0:
                    continue
                entry = grid.used[2]
                if entry >= 0:
                    grid.used[2] = grid.following[entry]
                elif grid.used[0] < len(grid.rows) and grid.used[1] < len(grid.rows):
                    entry = grid.used[0]
                    grid.used[0] += 1
                else:
                    return False
                if grid.keys[slot] == EMPTY:
                    grid.keys[slot] = (x << 31) + y
                    grid.used[1] += 1
                grid.rows[entry] = row
                grid.following[entry] = grid.heads[slot]
                grid.heads[slot] = entry
    return True


@compiled
def remove(grid: Grid, row: int, segment: Float, cell: float) -> None:
    """Take a row out of the cells [m] that its segment (4,) passes through."""
    steps = _steps(segment, cell)
    for step in range(steps):
        left, right, low, high = _box(segment, step / steps, (step + 1) / steps, 0.0, cell)
        for x in range(left, right + 1):
            for y in range(low, high + 1):
                slot = slot_of(grid.keys, x, y)
                before, entry = -1, grid.heads[slot]
                while entry >= 0 and grid.rows[entry] != row:
                    before, entry = entry, grid.following[entry]
                if entry < 0:
                    continue
                if before < 0:
                    grid.heads[slot] = grid.following[entry]
                else:
                    grid.following[before] = grid.following[entry]
                grid.following[entry] = grid.used[2]
                grid.used[2] = entry


@compiled
def insert_rows(grid: Grid, rows: Int, begin: int, segments: Float, cell: float) -> int:
    """Put rows (n,) of segments into the grid, from one on; returns the first without room."""
    for k in range(begin, len(rows)):
        if not insert(grid, rows[k], segments[rows[k]], cell):
            return k
    return len(rows)


@compiled
def find(
    grid: Grid, segment: Float, reach: float, cell: float, stamps: Int, stamp: int, found: Int
) -> int:
    """The same as `near`, for Python to call."""
    return near(grid, segment, reach, cell, stamps, stamp, found)


@inner
def near(
    grid: Grid, segment: Float, reach: float, cell: float, stamps: Int, stamp: int, found: Int
) -> int:
    """Collect every row with a segment within reach [m] of a segment (4,), each once.

    Args:
        grid: The grid.
        segment: (4,) the segment.
        reach: How far others may lie [m].
        cell: Size of a cell [m].
        stamps: (rows,) the last search that met each row; is written.
        stamp: The number of this search.
        found: (rows,) is filled with the rows; some may lie farther off, and some may be gone.

    Returns:
        How many there are.
    """
    count = 0
    steps = _steps(segment, cell)
    for step in range(steps):
        left, right, low, high = _box(segment, step / steps, (step + 1) / steps, reach, cell)
        for x in range(left, right + 1):
            for y in range(low, high + 1):
                entry = grid.heads[slot_of(grid.keys, x, y)]
                while entry >= 0:
                    row = grid.rows[entry]
                    if stamps[row] != stamp:
                        stamps[row] = stamp
                        found[count] = row
                        count += 1
                    entry = grid.following[entry]
    return count


@inner
def order_of(values: Float | Int) -> Int:
    """The rows of values (n,) by rising value, equal ones in their order: a merge sort.

    Numba's own takes longer to compile than most mappers run.
    """
    count = len(values)
    order, merged = np.arange(count), np.empty(count, np.int64)
    width = 1
    while width < count:
        for start in range(0, count, 2 * width):
            middle, stop = min(start + width, count), min(start + 2 * width, count)
            left, right = start, middle
            for k in range(start, stop):
                if right == stop or (left < middle and values[order[left]] <= values[order[right]]):
                    merged[k] = order[left]
                    left += 1
                else:
                    merged[k] = order[right]
                    right += 1
        order, merged = merged, order
        width *= 2
    return order
