"""SegmentPool: segments that come and go, in arrays that grow in place, found by where they are."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, Search, insert_rows, remove_rows
from lrf3d.mapping.robust.constants import MERGE_CELL, NEW_POINTS, UNCHANGED
from lrf3d.mapping.robust.walls import Walls, longer

LEAST_ROWS = 256
"""Rows that a new pool has room for."""


class SegmentPool:
    """Segments, each of a wall that has a number.

    Attributes:
        walls: The segments; rows without points are free.
        parents: (rows,) the number of the wall that each is of.
        grid: Where they are, in cells of MERGE_CELL.
        search: Is written by searches of the grid.
    """

    def __init__(self) -> None:
        self.walls = Walls.of_size(LEAST_ROWS)
        self.parents = np.zeros(LEAST_ROWS, np.int64)
        # The points that each had when it was new, or renewed, and where it was when it was new.
        self._known, self._placed = np.zeros(LEAST_ROWS, np.int64), np.zeros((LEAST_ROWS, 4))
        self.grid = Grid.of_size(4 * LEAST_ROWS)
        self.search = Search.of_size(LEAST_ROWS)
        self._rows_of: dict[int, list[int]] = {}
        self._free: list[int] = []
        self._top = 0

    def rows_of(self, walls: Iterable[int]) -> list[int]:
        """The rows of the segments of some walls."""
        return [row for wall in walls for row in self._rows_of.get(wall, ())]

    def rows(self) -> Int:
        """The rows of all segments."""
        return np.flatnonzero(self.walls.points[: self._top])

    def add(self, ends: Float, moments: Float, points: Int, parents: Int) -> Int:
        """Add segments (n, 4); returns their rows (n,)."""
        rows = np.array([self._take() for _ in range(len(ends))], np.int64)
        self._put(rows, ends, moments, points, parents)
        return rows

    def _put(self, rows: Int, ends: Float, moments: Float, points: Int, parents: Int) -> None:
        self.walls.ends[rows], self.walls.moments[rows] = ends, moments
        self.walls.points[rows], self.parents[rows] = points, parents
        for row, parent in zip(rows.tolist(), parents.tolist(), strict=True):
            self._rows_of.setdefault(parent, []).append(row)
        done = insert_rows(self.grid, rows, 0, self.walls.ends, MERGE_CELL)
        while done < len(rows):
            self.grid = Grid.of_size(2 * len(self.grid.rows))
            rows = self.rows()
            done = insert_rows(self.grid, rows, 0, self.walls.ends, MERGE_CELL)

    def _pop(self, walls: Iterable[int]) -> Int:
        """Take all segments of some walls out of the grid; returns their rows."""
        rows = sorted(row for wall in walls for row in self._rows_of.pop(wall, ()))
        gone = np.array(rows, np.int64)
        remove_rows(self.grid, gone, self.walls.ends, MERGE_CELL)
        return gone

    def drop(self, walls: Iterable[int]) -> None:
        """Drop all segments of some walls."""
        gone = self._pop(walls)
        self.walls.points[gone] = 0
        self._free += gone.tolist()

    def exchange(
        self, walls: Iterable[int], ends: Float, moments: Float, points: Int, parents: Int
    ) -> tuple[Int, Int, Int]:
        """Put segments (n, 4) in the place of those of some walls.

        One that hardly differs from where another was when it was new keeps its row. When it has
        many more points it is renewed.

        Returns:
            The rows whose segments are gone, those that have new ones, and those that are renewed.
        """
        old = self._pop(walls)
        places = match(self._placed, old, ends)
        same = places >= 0
        kept = np.zeros(len(old), np.bool_)
        kept[places[same]] = True
        gone = old[~kept]
        self.walls.points[gone] = 0
        self._free += gone.tolist()
        rows = np.full(len(ends), -1)
        rows[same] = old[places[same]]
        fresh = np.array([self._take() for _ in range(np.count_nonzero(~same))], np.int64)
        rows[~same] = fresh
        grown = points[same] > NEW_POINTS * self._known[rows[same]]
        renewed = rows[same][grown]
        self._put(rows, ends, moments, points, parents)
        self._placed[fresh] = ends[~same]
        for new in (fresh, renewed):
            self._known[new] = self.walls.points[new]
        return gone, fresh, renewed

    def _take(self) -> int:
        if self._free:
            return self._free.pop()
        if self._top == len(self.parents):
            self.walls = self.walls.doubled()
            self.parents = longer(self.parents)
            self._known, self._placed = longer(self._known), longer(self._placed)
            self.search = Search.of_size(len(self.parents))
        self._top += 1
        return self._top - 1

    def state(self, name: str) -> dict[str, Any]:
        """All that the pool is, as plain arrays by their names; `restore` takes them back."""
        walls = self.walls.take(slice(self._top))
        return {
            **{f"{name}_{part}": column for part, column in walls._asdict().items()},
            **{f"{name}_grid_{part}": array.copy() for part, array in self.grid._asdict().items()},
            f"{name}_parents": self.parents[: self._top].copy(),
            f"{name}_known": self._known[: self._top].copy(),
            f"{name}_placed": self._placed[: self._top].copy(),
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
        self._placed[:top] = state[f"{name}_placed"]
        self.grid = Grid(*(state[f"{name}_grid_{part}"].copy() for part in Grid._fields))
        self._free = state[f"{name}_free"].tolist()
        for row in self.rows().tolist():
            self._rows_of.setdefault(int(self.parents[row]), []).append(row)


@compiled
def match(before: Float, old: Int, ends: Float) -> Int:  # pragma: no cover
    """For each of some segments (n, 4) the place of the old row that it hardly differs from.

    Args:
        before: (rows, 4) where all segments were [m].
        old: (m,) rows of them.
        ends: (n, 4) the segments [m].

    Returns:
        (n,) places among the old rows, each once; −1 where there is none.
    """
    places, taken = np.full(len(ends), -1), np.zeros(len(old), np.bool_)
    for k in range(len(ends)):
        best, least = -1, UNCHANGED
        for place in range(len(old)):
            apart = 0.0
            for side in range(4):
                apart = max(apart, abs(ends[k, side] - before[old[place], side]))
            if apart < least:
                best, least = place, apart
        if best >= 0 and not taken[best]:
            places[k], taken[best] = best, True
    return places
