"""SegmentPool: segments that come and go, in arrays that grow in place, found by where they are."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.constants import MERGE_CELL, NEW_POINTS, UNCHANGED
from lrf3d.mapping.robust.grid import Grid, find, insert, remove
from lrf3d.mapping.robust.walls import Walls, longer

LEAST_ROWS = 256
"""Rows that a new pool has room for."""


class SegmentPool:
    """Segments, each of a wall that has a number.

    Attributes:
        walls: The segments; rows without points are free.
        parents: (rows,) the number of the wall that each is of.
        grid: Where they are, in cells of MERGE_CELL.
    """

    def __init__(self) -> None:
        self.walls = Walls.of_size(LEAST_ROWS)
        self.parents = np.zeros(LEAST_ROWS, np.int64)
        self._known = np.zeros(LEAST_ROWS, np.int64)
        self.grid = Grid.of_size(4 * LEAST_ROWS)
        self._stamps = np.zeros(LEAST_ROWS, np.int64)
        self._found = np.zeros(LEAST_ROWS, np.int64)
        self._rows_of: dict[int, list[int]] = {}
        self._free: list[int] = []
        self._top = self._searches = 0

    def rows_of(self, walls: Iterable[int]) -> list[int]:
        """The rows of the segments of some walls."""
        return [row for wall in walls for row in self._rows_of.get(wall, ())]

    def rows(self) -> Int:
        """The rows of all segments."""
        return np.flatnonzero(self.walls.points[: self._top])

    def add(self, ends: Float, moments: Float, points: Int, parents: Int) -> Int:
        """Add segments (n, 4); returns their rows (n,)."""
        rows = [self._take() for _ in range(len(ends))]
        for row, segment, parent in zip(rows, ends, parents.tolist(), strict=True):
            self._rows_of.setdefault(parent, []).append(row)
            self._insert(row, segment)
        added = np.array(rows, np.int64)
        self.walls.ends[added], self.walls.moments[added] = ends, moments
        self.walls.points[added], self.parents[added] = points, parents
        return added

    def drop(self, walls: Iterable[int]) -> Int:
        """Drop all segments of some walls; returns the rows that they had."""
        gone = sorted(row for wall in walls for row in self._rows_of.pop(wall, ()))
        for row in gone:
            remove(self.grid, row, self.walls.ends[row], MERGE_CELL)
            self.walls.points[row] = 0
        self._free += gone
        return np.array(gone, np.int64)

    def exchange(
        self, walls: Iterable[int], ends: Float, moments: Float, points: Int, parents: Int
    ) -> tuple[Int, Int]:
        """Put segments (n, 4) in the place of those of some walls.

        One that hardly differs from one before keeps its row, and is no new one until it has
        many more points.

        Returns:
            The rows whose segments are gone, and those that have new ones.
        """
        old = np.array(
            sorted(row for wall in walls for row in self._rows_of.pop(wall, ())), np.int64
        )
        rows = np.full(len(ends), -1)
        if len(old) and len(ends):
            apart = np.abs(ends[:, None] - self.walls.ends[old]).max(axis=2)
            for k, nearest in enumerate(apart.argmin(axis=1).tolist()):
                if apart[k, nearest] < UNCHANGED and old[nearest] not in rows:
                    rows[k] = old[nearest]
        gone = [row for row in old.tolist() if row not in rows]
        for row in old.tolist():
            remove(self.grid, row, self.walls.ends[row], MERGE_CELL)
        self.walls.points[gone] = 0
        self._free += gone
        same = rows >= 0
        grown = points[same] > NEW_POINTS * self._known[rows[same]]
        renewed = rows[same][grown]
        fresh = [self._take() for _ in range(len(ends) - np.count_nonzero(same))]
        rows[~same] = fresh
        self.walls.ends[rows], self.walls.moments[rows] = ends, moments
        self.walls.points[rows], self.parents[rows] = points, parents
        for row, segment, parent in zip(rows.tolist(), ends, parents.tolist(), strict=True):
            self._rows_of.setdefault(parent, []).append(row)
            self._insert(row, segment)
        new = np.concatenate([np.array(fresh, np.int64), renewed])
        self._known[new] = self.walls.points[new]
        return np.concatenate([np.array(gone, np.int64), renewed]), new

    def near(self, segment: Float, reach: float) -> Int:
        """The rows of segments near another (4,); some may be farther off than the reach [m]."""
        self._searches += 1
        count = find(
            self.grid, segment, reach, MERGE_CELL, self._stamps, self._searches, self._found
        )
        return self._found[:count].copy()

    def _take(self) -> int:
        if self._free:
            return self._free.pop()
        if self._top == len(self.parents):
            self.walls = self.walls.doubled()
            self.parents = longer(self.parents)
            self._known = longer(self._known)
            self._stamps, self._found = longer(self._stamps), longer(self._found)
        self._top += 1
        return self._top - 1

    def _insert(self, row: int, segment: Float) -> None:
        while not insert(self.grid, row, segment, MERGE_CELL):
            grid = Grid.of_size(2 * len(self.grid.rows))
            for other in self.rows().tolist():
                insert(grid, other, self.walls.ends[other], MERGE_CELL)
            self.grid = grid

    def state(self, name: str) -> dict[str, Any]:
        """All that the pool is, as plain arrays by their names; `restore` takes them back."""
        walls = self.walls.take(slice(self._top))
        return {
            **{f"{name}_{part}": column for part, column in walls._asdict().items()},
            **{f"{name}_grid_{part}": array.copy() for part, array in self.grid._asdict().items()},
            f"{name}_parents": self.parents[: self._top].copy(),
            f"{name}_known": self._known[: self._top].copy(),
            f"{name}_free": np.array(self._free, np.int64),
        }

    def restore(self, state: Mapping[str, Any], name: str) -> None:
        """Be the pool whose state is given."""
        self.__init__()  # type: ignore[misc]
        top = len(state[f"{name}_parents"])
        while len(self.parents) < top:
            self._top = len(self.parents)
            self._take()
        self._top = top
        for part, column in self.walls._asdict().items():
            column[:top] = state[f"{name}_{part}"]
        self.parents[:top] = state[f"{name}_parents"]
        self._known[:top] = state[f"{name}_known"]
        self.grid = Grid(*(state[f"{name}_grid_{part}"].copy() for part in Grid._fields))
        self._free = state[f"{name}_free"].tolist()
        for row in self.rows().tolist():
            self._rows_of.setdefault(int(self.parents[row]), []).append(row)
