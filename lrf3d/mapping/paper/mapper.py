"""PaperMapper: section 3 of Teslić et al. to the letter.

A scan enters and is united with the map: Eq. 9 decides which two segments are one, and the loop
of comparison around it (section 3.1) ends when no two are left.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, fit_line, lengths
from lrf3d.laser import LaserScan
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.paper.split_merge import SplitMergeExtractor
from lrf3d.mapping.segment_table import SegmentTable, add_moments


@dataclass(frozen=True, slots=True)
class EndPointMerging:
    """Eq. 9 to the letter, and total least squares over the four end points.

    Args:
        length: The threshold T [m] of the conditions c1 to c4.
        distance: The threshold R [m] of the conditions c5 to c8.
    """

    length: float
    distance: float

    def partner(self, table: SegmentTable, row: int, candidates: Int) -> int:
        """The first candidate that Eq. 9 merges with a row, or −1."""
        allowed = self.conditions(table.ends[row], table.ends[candidates])
        return int(candidates[np.argmax(allowed)]) if allowed.any() else -1

    def conditions(self, segment: Float, others: Float) -> Bool:
        """Whether Eq. 9 merges a segment L1 (4,) with each of others L2 (m, 4)."""
        a_end, b_end = segment[:2], segment[2:]
        c_ends, d_ends = others[:, :2], others[:, 2:]
        a, b = _distance(c_ends, a_end), _distance(c_ends, b_end)
        c, d = _distance(d_ends, a_end), _distance(d_ends, b_end)
        own, other = np.hypot(*(b_end - a_end)), lengths(others)
        c1, c2 = a + b < own + self.length, c + d < own + self.length
        c3, c4 = a + c < other + self.length, b + d < other + self.length
        unit = (b_end - a_end) / own
        r1, r2 = _aside(c_ends - a_end, unit), _aside(d_ends - a_end, unit)
        units = directions(others)
        r3, r4 = _aside(a_end - c_ends, units), _aside(b_end - c_ends, units)
        beside = np.maximum.reduce([r1, r2, r3, r4]) < self.distance
        two = c1.astype(int) + c2 + c3 + c4 >= 2
        return np.asarray((two & beside) | (c1 & c2) | (c3 & c4))

    def merge(self, table: SegmentTable, row: int, other: int) -> tuple[Float, Float]:
        """The line through the four end points, the ends projected on it."""
        ends = table.ends[[row, other]]
        mean, unit = fit_line(ends.reshape(-1, 2))
        if unit @ directions(ends)[0] < 0.0:
            unit = -unit
        along = (ends.reshape(-1, 2) - mean) @ unit
        merged = np.concatenate([mean + along.min() * unit, mean + along.max() * unit])
        return merged, add_moments(table.moments[row], table.moments[other])


def _distance(points: Float, point: Float) -> Float:
    return np.asarray(np.hypot(points[:, 0] - point[0], points[:, 1] - point[1]))


def _aside(offsets: Float, units: Float) -> Float:
    return np.asarray(np.abs(units[..., 0] * offsets[:, 1] - units[..., 1] * offsets[:, 0]))


def unite(table: SegmentTable, fresh: range, merging: EndPointMerging) -> SegmentTable:
    """Merge segments of a table until no two are left that the rule merges.

    Only fresh and merged segments are compared anew: the others were compared before. The loop
    ends, since each merge takes one segment away.

    Args:
        table: Segments.
        fresh: Rows that were not compared yet.
        merging: The rule.
    """
    ends, moments = table.ends.copy(), table.moments.copy()
    points, unions = table.points.copy(), table.unions.copy()
    current = SegmentTable(ends, moments, points, unions)
    alive = np.ones(len(table), dtype=bool)
    waiting = deque(fresh)
    while waiting:
        row = waiting.popleft()
        if not alive[row]:
            continue
        others = np.flatnonzero(alive)
        other = merging.partner(current, row, others[others != row])
        if other < 0:
            continue
        ends[row], moments[row] = merging.merge(current, row, other)
        points[row] += points[other]
        kept, gone = sorted((unions[row], unions[other]))
        unions[unions == gone] = kept
        alive[other] = False
        waiting.append(row)
    return current.take(np.flatnonzero(alive))


COLUMNS = tuple(column.name for column in fields(SegmentTable))


class PaperMapper:
    """Polylines by split-and-merge, Eq. 9, and lines through four end points.

    Args:
        extract: Finds the polylines of a scan.
        merging: Eq. 9.
        least: Segments with fewer points than this are kept back until more of them are seen.
    """

    def __init__(self, extract: SplitMergeExtractor, merging: EndPointMerging, least: int) -> None:
        self._extract, self._merging, self._least = extract, merging, least
        self._table = SegmentTable.empty()
        self._origin: Float | None = None
        self._unions = 0

    def update(self, scan: LaserScan) -> None:
        """Unite the map with the local map of a scan: G_new = S ∪ G_old."""
        place = np.array(scan.pose[:2])
        if self._origin is None:
            # Whole metres, so that taking the origin off and adding it again loses nothing.
            self._origin = np.round(place)
        local = self._extract(scan).shifted(place - self._origin)
        local = replace(local, unions=local.unions + self._unions)
        self._unions = int(local.unions.max(initial=self._unions - 1)) + 1
        known = len(self._table)
        fresh = range(known, known + len(local))
        self._table = unite(self._table.join(local), fresh, self._merging)

    def state(self) -> dict[str, Any]:
        """All that the mapper has learnt, as plain arrays; `restore` takes them back."""
        table = {f"table_{name}": getattr(self._table, name) for name in COLUMNS}
        origin = np.full(2, np.nan) if self._origin is None else self._origin
        return {**table, "origin": origin, "unions": np.array(self._unions)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what a mapper of the same settings had learnt."""
        self._table = SegmentTable(*(state[f"table_{name}"].copy() for name in COLUMNS))
        self._origin = None if np.isnan(state["origin"]).any() else state["origin"].copy()
        self._unions = int(state["unions"])

    @property
    def map(self) -> LineMap:
        """The global map."""
        table = self._table.take(np.flatnonzero(self._table.points >= self._least))
        return table.as_map(np.zeros(2) if self._origin is None else self._origin)
