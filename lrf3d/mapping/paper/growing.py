"""GrowingMap: the map of section 3.1 while it grows, G_new = S ∪ G_old.

The segments of scans enter; those that Eq. 9 merges become one, until no two are left that it
merges. A grid finds the few that a segment can merge with, so that a scan costs what it touches,
however large the map is.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Protocol

import numpy as np

from lrf3d.geometry import Float, Int, lengths
from lrf3d.mapping.grid import Grid, Search, find, insert, insert_rows, remove
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.live_map import LEAST_ROWS, LiveMap, Placement
from lrf3d.mapping.segment_table import SegmentTable

CELL = 4.0
"""Size of a cell of the grid [m]. It changes speed only."""

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

    Rows keep their order; those that were merged into another have no points, and are taken out
    when they are the most. A union is numbered below the first row that came after it.

    Args:
        merging: Eq. 9.
        least: Segments with fewer points than this are not shown.
    """

    def __init__(self, merging: Merging, least: int) -> None:
        self._merging, self._least = merging, least
        self._live, self._longest = LiveMap(), 0.0
        self._top = self._dead = 0
        self._origin: Float | None = None
        self._lay_out(SegmentTable.empty(), 0)

    def add(self, local: SegmentTable, place: Float) -> None:
        """Unite the map with the segments of a scan.

        Args:
            local: The segments around the robot.
            place: (2,) where the robot is [m] in the world.
        """
        if self._origin is None:
            # Whole metres, so that taking the origin off and adding it again loses nothing.
            self._origin = np.round(place)
        self._make_room(len(local))
        fresh = range(self._top, self._top + len(local))
        unions = self._top + np.unique(local.unions, return_inverse=True)[1]
        self._append(replace(local.shifted(place - self._origin), unions=unions))
        for row in fresh:
            self._place(row)
        # Only fresh and merged segments are compared: the others were compared before.
        waiting = deque(fresh)
        # The loop ends, since each merge takes one segment away.
        while waiting:
            row = waiting.popleft()
            if not self._table.points[row]:
                continue
            other = self._merging.partner(self._table, row, self._candidates(row))
            if other >= 0:
                self._merge(row, other)
                waiting.append(row)
        self._publish()

    def _append(self, table: SegmentTable) -> None:
        """Take the rows of a table in behind those that are there."""
        begin, self._top = self._top, self._top + len(table)
        for name in COLUMNS:
            getattr(self._table, name)[begin : self._top] = getattr(table, name)
        for row, union in enumerate(table.unions.tolist(), begin):
            self._members.setdefault(union, set()).add(row)

    def _merge(self, row: int, other: int) -> None:
        table = self._table
        # Before anything is written: what fails changes nothing.
        ends, moments = self._merging.merge(table, row, other)
        for gone in (row, other):
            remove(self._grid, gone, table.ends[gone], CELL)
        table.ends[row], table.moments[row] = ends, moments
        table.points[row] += table.points[other]
        self._unite(int(table.unions[row]), int(table.unions[other]))
        self._members[int(table.unions[other])].remove(other)
        table.points[other] = 0
        self._changed.add(other)
        self._dead += 1
        self._place(row)

    def _unite(self, union: int, other: int) -> None:
        """Make two unions one, which keeps the number of the larger."""
        if union == other:
            return
        gone, kept = sorted((union, other), key=lambda each: (len(self._members[each]), -each))
        rows = self._members[gone]
        self._members[kept] |= rows
        self._table.unions[list(rows)] = kept
        self._changed |= rows
        del self._members[gone]

    def _place(self, row: int) -> None:
        """Put a row that is new or has changed into the grid."""
        self._changed.add(row)
        ends = self._table.ends[row]
        self._longest = max(self._longest, float(np.hypot(ends[2] - ends[0], ends[3] - ends[1])))
        while not insert(self._grid, row, ends, CELL):
            self._regrid(2 * len(self._grid.rows))

    def _candidates(self, row: int) -> Int:
        """The rows, rising, of all segments near enough to be merged with one."""
        search, reach = self._search, self._merging.reach(self._longest)
        search.number[0] += 1
        count = find(
            *(self._grid, self._table.ends[row], reach, CELL),
            *(search.stamps, int(search.number[0]), search.found),
        )
        found = search.found[:count]
        return np.sort(found[(self._table.points[found] > 0) & (found != row)])

    def _publish(self) -> None:
        """Show what has changed."""
        rows = np.array(sorted(self._changed), np.int64)
        points = self._table.points[rows]
        self._shown[rows] = np.where(points < self._least, 0, points)
        self._live.update(rows, *self._seen())
        self._changed.clear()

    def _seen(self) -> tuple[Float, Int, Int, Placement]:
        x, y = (0.0, 0.0) if self._origin is None else self._origin.tolist()
        return self._table.ends, self._shown, self._table.unions, Placement(x, y, 0.0)

    def _make_room(self, count: int) -> None:
        if 2 * self._dead > max(self._top, LEAST_ROWS) or self._top + count > len(self._shown):
            self.restore(self.state(), count)

    def _lay_out(self, table: SegmentTable, more: int) -> None:
        """Begin with the rows of a table, and room for more."""
        room = max(LEAST_ROWS, 2 * (len(table) + more))
        self._table, self._search = SegmentTable.empty(room), Search.of_size(room)
        self._members: dict[int, set[int]] = {}
        self._changed: set[int] = set()
        self._top = self._dead = 0
        self._append(table)
        self._shown = np.where(self._table.points < self._least, 0, self._table.points)
        self._longest = float(lengths(table.ends).max(initial=0.0))
        self._regrid(4 * LEAST_ROWS)

    def _regrid(self, entries: int) -> None:
        """Put all segments into a new grid that is large enough."""
        rows = np.flatnonzero(self._table.points)
        self._grid = Grid.of_size(entries)
        while insert_rows(self._grid, rows, 0, self._table.ends, CELL) < len(rows):
            entries *= 2
            self._grid = Grid.of_size(entries)

    def table(self) -> SegmentTable:
        """The segments as they are now."""
        return self._table.take(np.flatnonzero(self._table.points))

    @property
    def map(self) -> LineMap:
        """The segments that are shown, in the world."""
        return self._live.value()

    def state(self) -> dict[str, Any]:
        """All that the map is, as plain arrays; `restore` takes them back."""
        # An update that was interrupted has left changes that are not shown.
        if self._changed:
            self._publish()
        table, live = self.table(), self._live.state()
        known, unions = np.unique(table.unions, return_inverse=True)
        table = replace(table, unions=unions)
        rows = np.flatnonzero(self._table.points)
        return {
            **{f"table_{name}": getattr(table, name) for name in COLUMNS},
            "map_rows": np.searchsorted(rows, live["map_rows"]),
            "map_labels": np.searchsorted(known, live["map_labels"]),
            "origin": np.full(2, np.nan) if self._origin is None else self._origin.copy(),
        }

    def restore(self, state: Mapping[str, Any], more: int = 0) -> None:
        """Go on from a state, with room for more segments."""
        origin = state["origin"]
        self._origin = None if np.isnan(origin).any() else origin.copy()
        self._lay_out(SegmentTable(*(state[f"table_{name}"] for name in COLUMNS)), more)
        self._live.restore(state, *self._seen())
