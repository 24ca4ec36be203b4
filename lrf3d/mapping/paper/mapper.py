"""PaperMapper: section 3 of Teslić et al. to the letter.

A scan enters and is united with the map: Eq. 9 decides which two segments are one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, fit_line, lengths
from lrf3d.laser import LaserScan
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.paper.growing import GrowingMap
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

    def reach(self, longest: float) -> float:
        """Farthest [m] that two segments may lie apart and be merged, at most so long [m].

        One of c1 to c4 holds of those: an end lies in the ellipse around the other segment's ends
        that is half so wide.
        """
        return 0.5 * float(np.sqrt(self.length * (2.0 * longest + self.length)))

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


class PaperMapper:
    """Polylines by split-and-merge, Eq. 9, and lines through four end points.

    Args:
        extract: Finds the polylines of a scan.
        merging: Eq. 9.
        least: Segments with fewer points than this are kept back until more of them are seen.
    """

    def __init__(self, extract: SplitMergeExtractor, merging: EndPointMerging, least: int) -> None:
        self._extract = extract
        self._segments = GrowingMap(merging, least)
        self._map: LineMap | None = None

    def update(self, scan: LaserScan) -> None:
        """Unite the map with the local map of a scan: G_new = S ∪ G_old."""
        self._map = None
        self._segments.add(self._extract(scan), np.array(scan.pose[:2]))

    def state(self) -> dict[str, Any]:
        """All that the mapper has learnt, as plain arrays; `restore` takes them back."""
        return self._segments.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what a mapper of the same settings had learnt."""
        self._map = None
        self._segments.restore(state)

    @property
    def map(self) -> LineMap:
        """The global map."""
        if self._map is None:
            self._map = self._segments.map
        return self._map
