"""WallStore: the walls of a growing map, in arrays that grow in place.

An update costs what it changes, however large the map is: a grid finds the partners of new walls,
and earlier states are kept as what has changed since, not as copies.
"""

from collections.abc import Mapping
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

MOST_BONDS = 1 << 16
"""Bonds after which unions are numbered anew: bonds come with every scan, and a store is not to
grow with time. It takes some milliseconds, once in thousands of scans."""


class Ledger:
    """The bonds between unions from one numbering of them to the next.

    Args:
        bonds: (k, 2) the bonds, once the ledger is closed; those of the store until then.
        unions: How many unions it numbers, once it is closed.
    """

    __slots__ = ("bonds", "unions")

    def __init__(self) -> None:
        self.bonds: Int | None = None
        self.unions = 0


class Version:
    """A state of a store: newer states say what they changed, so that it can be gone back to."""

    __slots__ = ("before", "bonds", "following", "ledger", "rows")

    def __init__(self, ledger: Ledger, bonds: int) -> None:
        self.ledger, self.bonds = ledger, bonds
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
        self._ledger = Ledger()
        self.version = Version(self._ledger, 0)

    def add(self, ends: Float, moments: Float, labels: Int, place: tuple[float, float]) -> None:
        """Unite the map with the walls of one scan.

        Args:
            ends: (n, 4) segments around the laser [m].
            moments: (n, 6) their moments.
            labels: (n, 2) their counts of points, and numbers of their unions from 0.
            place: Where the laser is [m].
        """
        self._updates += 1
        self._changes.number[0] = 0
        try:
            if len(ends):
                self._unite(ends, moments, labels, place)
        finally:
            # Maps of the states before are worked out later, so that an update that is
            # interrupted has to say as well what it changed.
            self._close()

    def _unite(self, ends: Float, moments: Float, labels: Int, place: tuple[float, float]) -> None:
        """Add walls, at least one, and unite them with those of the map."""
        count = len(ends)
        free = self._take(count)
        changes = self._changes
        args = (ends, moments, labels, *place, self._unions, self._updates)
        self._unions += int(labels[-1, 1]) + 1
        add_walls(self._walls, changes, free, *args)
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
        before, fresh = changes.before.take(slice(count)), Version(self._ledger, changes.number[1])
        old.rows, old.before = rows, before
        old.following = self.version = fresh
        self._free += rows[self._walls.points[rows] == 0].tolist()
        if changes.number[1] > MOST_BONDS:
            self._number_anew()

    def _number_anew(self) -> None:
        """Give unions that are one the same number, so that no bonds are left."""
        changes, old = self._changes, self.version
        bonds = changes.bonds[: changes.number[1]]
        labels = _labels(self._unions, bonds)[self._walls.unions[: self._top]]
        old.rows = np.arange(self._top)
        old.before = self._walls.take(slice(self._top))
        self._ledger.bonds, self._ledger.unions = bonds, self._unions
        self._ledger = Ledger()
        names, labels = np.unique(labels, return_inverse=True)
        self._walls.unions[: self._top] = labels
        self._unions = len(names)
        changes.number[1] = 0
        self._changes = changes._replace(bonds=np.empty((self._top + LEAST_ROWS, 2), np.int64))
        self.version = old.following = Version(self._ledger, 0)

    def state(self) -> dict[str, Any]:
        """All that the store is, as plain arrays by their names; `restore` takes them back."""
        number = self._changes.number
        counts = [self._top, self._unions, self._updates, *number[1:].tolist()]
        walls = self._walls.take(slice(self._top))
        return {
            **{f"wall_{name}": column for name, column in walls._asdict().items()},
            **{f"grid_{name}": column for name, column in self._grid._asdict().items()},
            "wall_bonds": self._changes.bonds[: number[1]].copy(),
            "wall_free": np.array(self._free, dtype=np.int64),
            "wall_counts": np.array(counts, dtype=np.int64),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Be the store whose state is given."""
        top, unions, updates, bonds, searches = state["wall_counts"].tolist()
        rows = LEAST_ROWS
        while rows < top:
            rows *= 2
        self._walls, self._changes = Walls.of_size(rows), Changes.of_size(rows)
        columns = Walls(*(state[f"wall_{name}"] for name in Walls._fields))
        self._walls.put(np.arange(top), columns)
        spare = np.empty((rows, 2), np.int64)
        self._changes = self._changes._replace(bonds=np.concatenate([state["wall_bonds"], spare]))
        self._changes.number[:] = 0, bonds, searches
        self._grid = Grid(*(state[f"grid_{name}"].copy() for name in Grid._fields))
        self._free = state["wall_free"].tolist()
        self._top, self._unions, self._updates = top, unions, updates
        self._ledger = Ledger()
        self.version = Version(self._ledger, bonds)

    def table(self, version: Version) -> SegmentTable:
        """The walls as they were at a version, their unions numbered from 0."""
        walls = self._walls.take(slice(self._top))
        steps = []
        while version.following is not None:
            steps.append(version)
            version = version.following
        first = steps[0] if steps else version
        ledger = first.ledger
        bonds = (self._changes.bonds if ledger.bonds is None else ledger.bonds)[: first.bonds]
        unions = self._unions if ledger.bonds is None else ledger.unions
        for step in reversed(steps):
            assert step.before is not None
            walls.put(step.rows, step.before)
        walls = walls.take(np.flatnonzero(walls.points))
        labels = _labels(unions, bonds)[walls.unions]
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
