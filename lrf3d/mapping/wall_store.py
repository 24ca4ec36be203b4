"""WallStore: the walls of a growing map, in arrays that grow in place.

An update costs what it changes, however large the map is: a grid finds the partners of new walls,
and earlier states are kept as what has changed since, not as copies.
"""

from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, insert
from lrf3d.mapping.table import SegmentTable
from lrf3d.mapping.wall_merging import Rule, add_walls, unite_walls
from lrf3d.mapping.wall_rows import Changes, Walls, longer

CELL = 4.0
"""Size of a cell of the grid [m]: a few of the reach of merging and a fraction of a wall."""

LEAST_ROWS = 256
"""Rows that a new store has room for."""


class Version:
    """A state of a store: newer states say what they changed, so that it can be gone back to."""

    __slots__ = ("before", "bonds", "following", "rows")

    def __init__(self, bonds: int) -> None:
        self.bonds = bonds
        self.following: Version | None = None
        self.rows: Int = np.empty(0, np.int64)
        self.before: Walls | None = None


class WallStore:
    """The walls of a map, united as they come in."""

    def __init__(self, rule: Rule, *, cell: float = CELL) -> None:
        self._rule, self._reach, self._cell = rule, rule.reach, cell
        self._walls = Walls.of_size(LEAST_ROWS)
        self._changes = Changes.of_size(LEAST_ROWS)
        self._grid = Grid.of_size(4 * LEAST_ROWS)
        self._free: list[int] = []
        self._top = self._unions = self._updates = 0
        self.version = Version(0)

    def add(self, ends: Float, moments: Float, labels: Int, place: tuple[float, float]) -> None:
        """Unite the map with the walls of one scan.

        Args:
            ends: (n, 4) segments around the laser [m].
            moments: (n, 6) their moments.
            labels: (n, 2) their counts of points, and numbers of their unions from 0.
            place: Where the laser is [m].
        """
        self._updates += 1
        changes = self._changes
        changes.number[0] = 0
        count = len(ends)
        if count:
            free = self._take(count)
            changes = self._changes
            args = (ends, moments, labels, *place, self._unions, self._updates)
            add_walls(self._walls, changes, free, *args)
            self._unions += int(labels[-1, 1]) + 1
            waiting, turn = np.append(free, 0), np.array([0, count])
            while not unite_walls(
                self._walls,
                changes,
                self._grid,
                waiting,
                turn,
                self._updates,
                self._rule,
                self._reach,
                self._cell,
            ):
                self._regrid(2 * len(self._grid.rows))
        self._close()

    def _take(self, count: int) -> Int:
        """Free rows (count,), with room for all that uniting them may need."""
        reused = min(count, len(self._free))
        rows = self._free[len(self._free) - reused :]
        del self._free[len(self._free) - reused :]
        fresh = count - reused
        while self._top + fresh > len(self._walls.points):
            self._walls, self._changes = self._walls.doubled(), self._changes.doubled()
        # Each merge takes a wall away and makes at most one bond.
        while self._changes.number[1] + self._top + fresh > len(self._changes.bonds):
            self._changes = self._changes._replace(bonds=longer(self._changes.bonds))
        rows.extend(range(self._top, self._top + fresh))
        self._top += fresh
        return np.array(rows)

    def _regrid(self, entries: int) -> None:
        """Put all walls into a new, larger grid."""
        grid = Grid.of_size(entries)
        for row in np.flatnonzero(self._walls.points[: self._top]).tolist():
            if not insert(grid, row, self._walls.ends[row], self._cell):
                return self._regrid(2 * entries)
        self._grid = grid

    def _close(self) -> None:
        """End an update: keep what it changed for those who hold the state before."""
        changes, old = self._changes, self.version
        count = int(changes.number[0])
        rows = changes.rows[:count].copy()
        self.version = Version(int(changes.number[1]))
        old.following = self.version
        old.rows = rows
        old.before = changes.before.take(slice(count))
        self._free += rows[self._walls.points[rows] == 0].tolist()

    def table(self, version: Version) -> SegmentTable:
        """The walls as they were at a version, their unions numbered from 0."""
        walls = self._walls.take(slice(self._top))
        steps = []
        while version.following is not None:
            steps.append(version)
            version = version.following
        bonds = steps[0].bonds if steps else version.bonds
        for step in reversed(steps):
            assert step.before is not None
            walls.put(step.rows, step.before)
        walls = walls.take(np.flatnonzero(walls.points))
        labels = _labels(self._unions, self._changes.bonds[:bonds])[walls.unions]
        return SegmentTable(walls.ends, walls.moments, walls.points, labels)


def _labels(count: int, bonds: Int) -> Int:
    """A label for each of some unions, the same for those that bonds (k, 2) made one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if not count:
        return np.empty(0, np.int64)
    graph = coo_array((np.ones(len(bonds)), (bonds[:, 0], bonds[:, 1])), shape=(count, count))
    labels: Any = connected_components(graph, directed=False)[1]
    return np.asarray(labels, dtype=np.int64)
