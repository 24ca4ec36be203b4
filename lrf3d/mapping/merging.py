"""Merging: which segments stand for one wall, and the segment that they become (section 3.1).

A merging rule has two verbs: ``partner`` finds the row of a table, among candidates, that a
segment is to be merged with; ``merge`` makes one segment of two.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, fit_line, lengths
from lrf3d.mapping.table import SegmentTable, add_moments, fit_ends


class Merging(Protocol):
    """A rule of merging."""

    def partner(self, table: SegmentTable, row: int, candidates: Int) -> int:
        """The row among candidates (k,) to merge a row with, or −1."""
        ...

    def merge(self, table: SegmentTable, row: int, other: int) -> tuple[Float, Float]:
        """Ends (4,) and moments (6,) of the segment that two rows become."""
        ...


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


@dataclass(frozen=True, slots=True)
class MomentMerging:
    """One wall is what lies on one line within its uncertainty, overlaps and faces one way.

    Args:
        length: Largest gap [m] along the line between two segments of one wall.
        distance: How far [m] a true wall may bend from a line, beside what noise explains.
        parted: Largest uncertainty [m] that noise may explain.
    """

    length: float
    distance: float
    parted: float = 1.0

    def partner(self, table: SegmentTable, row: int, candidates: Int) -> int:
        """The candidate that fits a row best, or −1."""
        ends, moments = table.ends, table.moments
        rows = candidates[self._boxes_meet(ends[row], ends[candidates])]
        if not len(rows):
            return -1
        own, units = directions(ends[[row]])[0], directions(ends[rows])
        # Ends run so that the laser stood on the left: opposite ways are two faces of a wall.
        rows, units = rows[units @ own > 0.5], units[units @ own > 0.5]
        if not len(rows):
            return -1
        misfits = np.array(
            [
                self._misfit(ends[row], own, moments[row], ends[k], unit, moments[k])
                for k, unit in zip(rows, units, strict=True)
            ]
        )
        best = int(np.argmin(misfits))
        return int(rows[best]) if misfits[best] < 1.0 else -1

    def merge(self, table: SegmentTable, row: int, other: int) -> tuple[Float, Float]:
        """The exact fit to all points of both, as long as both reach."""
        moments = add_moments(table.moments[row], table.moments[other])
        return fit_ends(moments, table.ends[[row, other]]), moments

    def _boxes_meet(self, segment: Float, others: Float) -> Bool:
        """Whether the box around a segment (4,) comes near that of each of others (m, 4)."""
        reach = self.length + self.distance + self.parted
        low = np.minimum(segment[:2], segment[2:]) - reach
        high = np.maximum(segment[:2], segment[2:]) + reach
        return np.asarray(
            (np.minimum(others[:, :2], others[:, 2:]) <= high).all(axis=1)
            & (np.maximum(others[:, :2], others[:, 2:]) >= low).all(axis=1)
        )

    def _misfit(
        self,
        ends: Float,
        unit: Float,
        moments: Float,
        other_ends: Float,
        other_unit: Float,
        other: Float,
    ) -> float:
        """How far the shorter segment lies off the longer one's line; 1 is the most allowed."""
        if np.hypot(*(ends[2:] - ends[:2])) > np.hypot(*(other_ends[2:] - other_ends[:2])):
            ends, other_ends = other_ends, ends
            moments, other = other, moments
            unit, other_unit = other_unit, unit
        line, mean = other_unit, other[1:3]
        points = ends.reshape(2, 2)
        along = (points - mean) @ line
        reach = (other_ends.reshape(2, 2) - mean) @ line
        gap = max(along.min() - reach.max(), reach.min() - along.max())
        if gap > self.length:
            return np.inf
        aside = line[0] * (points - mean)[:, 1] - line[1] * (points - mean)[:, 0]
        own = (points - moments[1:3]) @ unit
        variance = _variance(moments, unit, own) + _variance(other, line, along)
        allowed = self.distance + np.minimum(3.0 * np.sqrt(variance), self.parted)
        return float((np.abs(aside) / allowed).max())


def _variance(moments: Float, unit: Float, along: Float) -> Float:
    """Variance (k,) [m²] of a line's offset at places (k,) [m] along it from its mean."""
    spread = (
        moments[3] * unit[0] ** 2 + 2.0 * moments[4] * unit[0] * unit[1] + moments[5] * unit[1] ** 2
    )
    return np.asarray(1.0 / moments[0] + along**2 / spread)
