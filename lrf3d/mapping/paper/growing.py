"""GrowingMap: the map of section 3.1 while it grows, G_new = S ∪ G_old.

The segments of scans enter; those that Eq. 9 merges become one, until no two are left that it
merges. A grid finds the few that a segment can merge with, so that a scan costs what it touches,
however large the map is.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Protocol

import numpy as np

from lrf3d.geometry import Float, Int, lengths
from lrf3d.mapping.grid import Grid, find, insert, remove
from lrf3d.mapping.segment_table import SegmentTable

CELL = 4.0
"""Size of a cell of the grid [m]. It changes speed only."""

LEAST_ROWS = 256
"""Rows that a new map has room for."""

COLUMNS = tuple(column.name for column in fields(SegmentTable))


class Merging(Protocol):
    """A rule by which two segments are one, such as Eq. 9."""

    def reach(self, longest: float) -> float:
        """Farthest [m] that two segments may lie apart and be merged, at most so long [m]."""

    def partner(self, table: SegmentTable, row: int, candidates: Int) -> int:
        """The first candidate that the rule merges with a row, or −1."""

    def merge(self, table: SegmentTable, row: int, other: int) -> tuple[Float, Float]:
        """The merged segment (4,) and its moments (6,)."""


class GrowingMap:
    """Segments that are merged as they come in.

    Rows keep their order; those that were merged into another are dead, and are taken out when
    they are the most.
    """

    def __init__(self, merging: Merging) -> None:
        self._merging = merging
        self._unions = self._top = self._dead = self._searches = 0
        self._longest = 0.0
        self._lay_out(SegmentTable.empty(), LEAST_ROWS)

    def add(self, local: SegmentTable) -> None:
        """Unite the map with the segments of a scan; their unions are numbered from 0."""
        self._make_room(len(local))
        fresh = range(self._top, self._top + len(local))
        self._top = fresh.stop
        # Only fresh and merged segments are compared: the others were compared before.
        for row, own in zip(fresh, range(len(local)), strict=True):
            self._table.ends[row], self._table.moments[row] = local.ends[own], local.moments[own]
            self._table.points[row] = local.points[own]
            self._table.unions[row] = self._unions + local.unions[own]
            self._alive[row] = True
            self._place(row)
        self._unions += int(local.unions.max(initial=-1)) + 1
        waiting = deque(fresh)
        # The loop ends, since each merge takes one segment away.
        while waiting:
            row = waiting.popleft()
            if not self._alive[row]:
                continue
            other = self._merging.partner(self._table, row, self._candidates(row))
            if other >= 0:
                self._merge(row, other)
                waiting.append(row)

    def _merge(self, row: int, other: int) -> None:
        table = self._table
        # Before anything is written: what fails changes nothing.
        ends, moments = self._merging.merge(table, row, other)
        for gone in (row, other):
            remove(self._grid, gone, table.ends[gone], CELL)
        table.ends[row], table.moments[row] = ends, moments
        table.points[row] += table.points[other]
        kept, gone = sorted(
            (self._root(int(table.unions[row])), self._root(int(table.unions[other])))
        )
        if kept != gone:
            self._parents[gone] = kept
        self._alive[other] = False
        self._dead += 1
        self._place(row)

    def _place(self, row: int) -> None:
        """Put a row into the grid."""
        ends = self._table.ends[row]
        self._longest = max(self._longest, float(np.hypot(ends[2] - ends[0], ends[3] - ends[1])))
        while not insert(self._grid, row, ends, CELL):
            self._regrid(2 * len(self._grid.rows))

    def _candidates(self, row: int) -> Int:
        """The rows, rising, of all segments near enough to be merged with one."""
        self._searches += 1
        reach = self._merging.reach(self._longest)
        count = find(
            self._grid, self._table.ends[row], reach, CELL, self._met, self._searches, self._found
        )
        found = self._found[:count]
        return np.sort(found[self._alive[found] & (found != row)])

    def _root(self, union: int) -> int:
        """The union that a union is part of by now."""
        root = union
        while (parent := self._parents.get(root, root)) != root:
            root = parent
        while union != root:
            self._parents[union], union = root, self._parents[union]
        return root

    def _make_room(self, count: int) -> None:
        if 2 * self._dead > max(self._top, LEAST_ROWS) or self._top + count > len(self._alive):
            table = self.table()
            self._lay_out(table, max(LEAST_ROWS, 2 * (len(table) + count)))

    def _lay_out(self, table: SegmentTable, room: int) -> None:
        """Begin with the rows of a table, and room for more."""
        count = len(table)
        self._table = SegmentTable(
            np.zeros((room, 4)),
            np.zeros((room, 6)),
            np.zeros(room, np.int64),
            np.zeros(room, np.int64),
        )
        for name in COLUMNS:
            getattr(self._table, name)[:count] = getattr(table, name)
        self._alive = np.arange(room) < count
        self._top, self._dead = count, 0
        self._parents: dict[int, int] = {}
        self._met, self._found, self._searches = (
            np.zeros(room, np.int64),
            np.empty(room, np.int64),
            0,
        )
        self._longest = float(lengths(table.ends).max(initial=0.0))
        self._regrid(4 * LEAST_ROWS)

    def _regrid(self, entries: int) -> None:
        """Put all segments into a new grid that is large enough."""
        grid = Grid.of_size(entries)
        for row in np.flatnonzero(self._alive).tolist():
            if not insert(grid, row, self._table.ends[row], CELL):
                return self._regrid(2 * entries)
        self._grid = grid

    def table(self) -> SegmentTable:
        """The segments as they are now."""
        table = self._table.take(np.flatnonzero(self._alive))
        if self._parents:
            joined = np.array(sorted(self._parents), dtype=np.int64)
            roots = np.array([self._root(union) for union in joined.tolist()], dtype=np.int64)
            place = np.searchsorted(joined, table.unions).clip(max=len(joined) - 1)
            part = joined[place] == table.unions
            table.unions[part] = roots[place[part]]
        return table

    def state(self) -> dict[str, Any]:
        """All that the map is, as plain arrays; `restore` takes them back."""
        table = self.table()
        return {
            **{f"table_{name}": getattr(table, name) for name in COLUMNS},
            "unions": np.array(self._unions),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state."""
        table = SegmentTable(*(state[f"table_{name}"].copy() for name in COLUMNS))
        self._unions = int(state["unions"])
        self._lay_out(table, max(LEAST_ROWS, 2 * len(table)))
