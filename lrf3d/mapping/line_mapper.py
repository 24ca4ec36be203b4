"""LineMapper: unites the local map of each scan with the global map (section 3.1)."""

from collections import deque
from dataclasses import replace

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapping.extraction import LikelihoodExtractor, SplitMergeExtractor
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.merging import EndPointMerging, Merging, MomentMerging
from lrf3d.mapping.table import SegmentTable

MODES = ("paper", "robust")


class LineMapper:
    """Builds a global map of line segments in unions from scans at known poses.

    Args:
        mode: ``robust``, or ``paper`` for section 3 of the paper to the letter.
        gap: Two following points farther apart than this [m] are of two clusters.
        split: Paper mode: a polyline is split where a point is farther off than this [m].
        merge_length: T of Eq. 9 [m]; in robust mode the largest gap within a wall.
        merge_distance: R of Eq. 9 [m]; in robust mode how far a wall may bend from a line.
        sigma: Robust mode: standard deviation of the range noise at range_max [m] (Eq. 7).
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
        gap: float = 1.5,
        split: float = 0.1,
        merge_length: float | None = None,
        merge_distance: float = 0.1,
        sigma: float = 0.04,
        floor: float = 0.01,
        min_points: int | None = None,
    ) -> None:
        if mode not in MODES:
            raise InputError(f"mapper mode {mode!r}: expected one of {', '.join(MODES)}")
        paper = mode == "paper"
        length = (0.1 if paper else 0.5) if merge_length is None else merge_length
        for name, value in (
            ("gap", gap),
            ("split", split),
            ("merge_length", length),
            ("merge_distance", merge_distance),
            ("floor", floor),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"mapper: {name} is {value}, expected a positive number of metres")
        if not (np.isfinite(sigma) and sigma >= 0.0):
            raise InputError(f"mapper: sigma is {sigma}, expected metres, at least 0")
        self.mode = mode
        self._extract = (
            SplitMergeExtractor(gap, split) if paper else LikelihoodExtractor(gap, sigma, floor)
        )
        self._merging: Merging = (
            EndPointMerging(length, merge_distance)
            if paper
            else MomentMerging(length, merge_distance)
        )
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
        self._table = unite(self._table.join(local), range(known, known + len(local)), self._merging)
        return self.map

    def local_map(self, scan: LaserScan) -> LineMap:
        """The local map of one scan alone: its polylines as unions."""
        place = np.array(scan.pose[:2])
        return _as_map(self._extract(scan), place)

    @property
    def map(self) -> LineMap:
        """The global map."""
        rows = np.flatnonzero(self._table.points >= self._least)
        origin = np.zeros(2) if self._origin is None else self._origin
        return _as_map(self._table.take(rows), origin)


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
