"""WallStore: the walls of a growing map, in arrays that grow in place.

An update costs what it changes, however large the map is: a grid finds the partners of new walls.
"""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, insert_rows, remove
from lrf3d.mapping.robust.constants import MERGE_CELL
from lrf3d.mapping.robust.walls import Rule, Touched, Walls, unite_walls
from lrf3d.mapping.segment_table import SegmentTable

LEAST_ROWS = 256
"""Rows that a new store has room for."""


class WallStore:
    """The walls of a map, merged as they come in."""

    def __init__(self, rule: Rule, *, cell: float = MERGE_CELL) -> None:
        self._rule, self._cell = rule, cell
        self._walls, self._touched = Walls.of_size(LEAST_ROWS), Touched.of_size(LEAST_ROWS)
        self._grid = Grid.of_size(4 * LEAST_ROWS)
        self._free: list[int] = []
        self._top = self._updates = 0

    def add(self, ends: Float, moments: Float, points: Int, place: tuple[float, float]) -> None:
        """Merge the walls of one scan with those of the map.

        Args:
            ends: (n, 4) segments around the laser [m].
            moments: (n, 6) their moments.
            points: (n,) their counts of points.
            place: Where the laser is [m].
        """
        self._touched.number[0] = 0
        if not len(ends):
            return
        self._updates += 1
        free = self._take(len(ends))
        try:
            waiting, turn = np.empty(len(free) + 1, np.int64), np.zeros(2, np.int64)
            waiting[:-1] = free
            new = Walls(ends, moments, points), place
            while not unite_walls(
                *(self._walls, self._touched, self._grid, new, waiting, turn),
                *(self._updates, self._rule, self._cell),
            ):
                self._regrid(2 * len(self._grid.rows))
        finally:
            # An update that is interrupted leaves free rows as well.
            rows = self.changed if len(self.changed) else free
            self._free += rows[self._walls.points[rows] == 0].tolist()

    def _take(self, count: int) -> Int:
        """Free rows (count,)."""
        reused = min(count, len(self._free))
        rows = self._free[len(self._free) - reused :]
        del self._free[len(self._free) - reused :]
        fresh = count - reused
        while self._top + fresh > len(self._walls.points):
            self._walls, self._touched = self._walls.doubled(), self._touched.doubled()
        rows.extend(range(self._top, self._top + fresh))
        self._top += fresh
        return np.array(rows)

    def _regrid(self, entries: int) -> None:
        """Put all walls into a new, larger grid."""
        rows, done = np.flatnonzero(self._walls.points[: self._top]), 0
        while done < len(rows):
            self._grid = Grid.of_size(entries)
            done = insert_rows(self._grid, rows, 0, self._walls.ends, self._cell)
            entries *= 2

    @property
    def walls(self) -> Walls:
        """The walls as they are now; rows without points are free."""
        return self._walls

    @property
    def grid(self) -> Grid:
        """Where the walls are, in cells of MERGE_CELL."""
        return self._grid

    @property
    def touched(self) -> Touched:
        """Which rows changes and searches met."""
        return self._touched

    @property
    def changed(self) -> Int:
        """The rows that the last update changed."""
        return self._touched.rows[: self._touched.number[0]]

    def drop(self, row: int) -> None:
        """Take a wall out."""
        remove(self._grid, row, self._walls.ends[row], self._cell)
        self._walls.points[row] = 0
        self._free.append(row)

    def table(self) -> SegmentTable:
        """The walls as they are now, each an object of its own."""
        walls = self._walls.take(np.flatnonzero(self._walls.points[: self._top]))
        return SegmentTable(*walls, np.arange(len(walls.points)))
