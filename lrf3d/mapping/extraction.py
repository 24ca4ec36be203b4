"""Extraction: the local map of one scan, polylines of fitted line segments (section 3).

Both extractors take a scan and give a table of segments in the scan's own frame, so that no
digits are lost far from the world's origin; each polyline is a union.
"""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.mapping.clusters import clusters, near_each_other, on_one_surface, ordered_returns
from lrf3d.mapping.segmentation import fit_wall, segment_cluster
from lrf3d.mapping.split_merge import split_and_merge
from lrf3d.mapping.table import SegmentTable, measure_moments

LEAST_INCIDENCE = 0.05
"""Smallest cosine of the incidence that a weight is computed with: along grazing beams other
errors than that of the range decide."""

WEAKEST_DIRECTION = 0.15
"""A segment whose direction is known to no better than this [rad] is not taken into the map."""


@dataclass(frozen=True, slots=True)
class SplitMergeExtractor:
    """The paper's: clusters by a fixed gap, split-and-merge, plain total least squares.

    Args:
        gap: Two following points farther apart than this [m] are of two clusters.
        split: A polyline is split where a point is farther off than this [m].
    """

    gap: float
    split: float

    def __call__(self, scan: LaserScan) -> SegmentTable:
        """The local map of a scan, in the world's directions around the laser's place."""
        order, circle = ordered_returns(scan)
        ranges = np.where(scan.hits, scan.ranges, 0.0)
        points = ranges[:, None] * beam_directions(scan.pose.theta, scan.angles)
        joined = near_each_other(points[order], self.gap)
        polylines = [
            split_and_merge(points[beams], self.split)
            for beams in clusters(scan, joined, order, circle=circle)
        ]
        return _join(polylines)


@dataclass(frozen=True, slots=True)
class LikelihoodExtractor:
    """Clusters that know the beams' spacing, divided into the likeliest walls under the noise.

    Args:
        gap: A gap wider than this [m] always parts two clusters.
        sigma: Standard deviation of the range noise at range_max [m] (Eq. 7).
        floor: Standard deviation of a range at no distance [m].
    """

    gap: float
    sigma: float
    floor: float

    def __call__(self, scan: LaserScan) -> SegmentTable:
        """The local map of a scan, in the world's directions around the laser's place."""
        order, circle = ordered_returns(scan)
        ranges = np.where(scan.hits & (scan.ranges > 0.0), scan.ranges, 1.0)
        scale = scan.range_max if np.isfinite(scan.range_max) else 80.0
        deviations = np.hypot(self.floor, self.sigma * ranges / scale)
        angles = scan.pose.theta + scan.angles
        joined = on_one_surface(angles[order], ranges[order], deviations[order], self.gap)
        polylines = []
        for beams in clusters(scan, joined, order, circle=circle):
            if len(beams) >= 3:
                unwrapped = np.unwrap(angles[beams])
                polylines.append(_polyline(unwrapped, ranges[beams], deviations[beams]))
        return _join(polylines)


def _join(polylines: list[SegmentTable]) -> SegmentTable:
    table = SegmentTable.empty()
    for number, polyline in enumerate(polylines):
        table = table.join(replace(polyline, unions=np.full(len(polyline), number)))
    return table


def _polyline(angles: Float, ranges: Float, deviations: Float) -> SegmentTable:
    """Segments of one cluster, joined at corners where two walls meet."""
    beams = np.column_stack([np.cos(angles), np.sin(angles)])
    rows: list[tuple[int, int, Float, Float]] = []
    for first, last in segment_cluster(angles, ranges, deviations):
        part = slice(first, last + 1)
        inverse = fit_wall(angles[part], ranges[part], deviations[part])
        normal = inverse / np.hypot(*inverse)
        incidence = np.maximum(np.abs(beams[part] @ normal), LEAST_INCIDENCE)
        weights = 1.0 / (deviations[part] * incidence) ** 2
        moments = measure_moments(ranges[part, None] * beams[part], weights)
        spread = moments[3] * normal[1] ** 2 + moments[5] * normal[0] ** 2
        spread -= 2.0 * moments[4] * normal[0] * normal[1]
        if spread * WEAKEST_DIRECTION**2 > 1.0:
            rows.append((int(first), int(last), inverse, moments))
    if not rows:
        return SegmentTable.empty()
    ends = np.empty((len(rows), 4))
    for row, (first, last, inverse, _) in enumerate(rows):
        for place, beam in ((slice(0, 2), first), (slice(2, 4), last)):
            # A noisy end goes along its beam onto the wall; near-parallel ones stay put.
            slope = float(beams[beam] @ inverse)
            reach = 1.0 / slope if slope > 0.0 else np.inf
            if abs(reach - ranges[beam]) > 5.0 * deviations[beam]:
                reach = ranges[beam]
            ends[row, place] = reach * beams[beam]
    for row in range(len(rows) - 1):
        (_, last, inverse, _), (first, _, other, _) = rows[row], rows[row + 1]
        corner = _corner(inverse, other)
        if corner is None:
            continue
        step = np.hypot(*(ends[row, 2:] - ends[row + 1, :2])) + 4.0 * deviations[last]
        gaps = np.hypot(*(corner - ends[row, 2:])), np.hypot(*(corner - ends[row + 1, :2]))
        if first - last <= 3 and max(gaps) <= 1.5 * step:
            ends[row, 2:] = ends[row + 1, :2] = corner
    return SegmentTable(
        ends,
        np.array([moments for *_, moments in rows]),
        np.array([last - first + 1 for first, last, *_ in rows]),
        np.zeros(len(rows), np.int64),
    )


def _corner(one: Float, other: Float) -> Float | None:
    """Where the walls n/c of two neighbours meet, or nothing where they are nearly parallel."""
    determinant = one[0] * other[1] - one[1] * other[0]
    if abs(determinant) < 0.2 * np.hypot(*one) * np.hypot(*other):
        return None
    return np.asarray(np.array([other[1] - one[1], one[0] - other[0]]) / determinant)
