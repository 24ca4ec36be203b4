"""LineMapper: unites the local map of each scan with the global map (section 3.1)."""

from collections import deque
from dataclasses import replace

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapping.corners import connect, corner_pairs
from lrf3d.mapping.extraction import LikelihoodExtractor, SplitMergeExtractor
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.merging import EndPointMerging, Merging, MomentMerging
from lrf3d.mapping.table import SegmentTable

MODES = ("paper", "robust")

CORNER_REACH = 0.5
"""Robust mode: two walls belong to one object where their lines cross no farther than this [m]
from an end of each: less than half a door."""


class LineMapper:
    """Builds a global map of line segments in unions from scans at known poses.

    Args:
        mode: ``robust``, or ``paper`` for section 3 of the paper to the letter.
        gap: Two following points farther apart than this [m] are of two clusters.
        split: Paper mode: a polyline is split where a point is farther off than this [m];
            0.1 m and three deviations of the noise at half of range_max where not given.
        merge_length: T of Eq. 9 [m], 0.1 where not given; in robust mode the largest gap within
            a wall, 0.5.
        merge_distance: R of Eq. 9 [m]; 0.1 m and one deviation of the noise at half of
            range_max where not given. In robust mode how far a wall may bend from a line, 0.1.
        sigma: Standard deviation of the range noise at range_max [m] (Eq. 7).
        floor: Robust mode: standard deviation of a range at no distance [m].
        min_points: Segments of the map with fewer points than this are kept back until more
            points of them are seen.

    Raises:
        InputError: There is no such mode, or a threshold is not a positive number.
    """

    def __init__(
        self,
        mode: str = "robust",
        *,
        gap: float = 2.5,
        split: float | None = None,
        merge_length: float | None = None,
        merge_distance: float | None = None,
        sigma: float = 0.04,
        floor: float = 0.01,
        min_points: int | None = None,
    ) -> None:
        if mode not in MODES:
            raise InputError(f"mapper mode {mode!r}: expected one of {', '.join(MODES)}")
        paper = mode == "paper"
        if not (np.isfinite(sigma) and sigma >= 0.0):
            raise InputError(f"mapper: sigma is {sigma}, expected metres, at least 0")
        split = 0.1 + 1.5 * sigma if split is None else split
        length = (0.1 if paper else 0.5) if merge_length is None else merge_length
        usual = 0.1 + (0.5 * sigma if paper else 0.0)
        distance = usual if merge_distance is None else merge_distance
        for name, value in (
            ("gap", gap),
            ("split", split),
            ("merge_length", length),
            ("merge_distance", distance),
            ("floor", floor),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"mapper: {name} is {value}, expected a positive number of metres")
        self.mode = mode
        self._extract = (
            SplitMergeExtractor(gap, split) if paper else LikelihoodExtractor(gap, sigma, floor)
        )
        self._merging: Merging = (
            EndPointMerging(length, distance) if paper else MomentMerging(length, distance)
        )
        self._corner_reach = None if paper else CORNER_REACH
        self._least = min_points if min_points is not None else (2 if paper else 6)
        self._table = SegmentTable.empty()
        self._origin: Float | None = None
        self._unions = 0

    def update(self, scan: LaserScan) -> LineMap:
        """Unite the map with what a scan shows, and return it."""
        place = np.array(scan.pose[:2])
        if self._origin is None:
            # Whole metres, so that taking the origin off and adding it again loses nothing.
            self._origin = np.round(place)
        local = self._extract(scan).shifted(place - self._origin)
        local = replace(local, unions=local.unions + self._unions)
        self._unions = int(local.unions.max(initial=self._unions - 1)) + 1
        known = len(self._table)
        self._table = unite(
            self._table.join(local), range(known, known + len(local)), self._merging
        )
        return self.map

    def local_map(self, scan: LaserScan) -> LineMap:
        """The local map of one scan alone: its polylines as unions."""
        place = np.array(scan.pose[:2])
        return _as_map(self._extract(scan), place)

    @property
    def map(self) -> LineMap:
        """The global map."""
        table = self._table.take(np.flatnonzero(self._table.points >= self._least))
        origin = np.zeros(2) if self._origin is None else self._origin
        if self._corner_reach is not None:
            pairs = corner_pairs(table.ends, self._corner_reach)
            table = replace(table, unions=connect(table.unions, pairs))
        return _as_map(table, origin)


def _as_map(table: SegmentTable, origin: Float) -> LineMap:
    _, unions = np.unique(table.unions, return_inverse=True)
    return LineMap(table.ends + np.tile(origin, 2), unions, table.points)


def unite(table: SegmentTable, fresh: range, merging: Merging) -> SegmentTable:
    """Merge segments of a table until no two are left that the rule merges.

    Only fresh and merged segments are compared anew: the others were compared before. The loop
    ends, since each merge takes one segment away.
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
