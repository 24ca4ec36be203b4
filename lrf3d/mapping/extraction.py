"""Extraction: the local map of one scan, polylines of fitted line segments (section 3).

Both extractors take a scan and give a table of segments in the scan's own frame, so that no
digits are lost far from the world's origin; each polyline is a union.
"""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.mapping.clusters import clusters, near_each_other, ordered_returns
from lrf3d.mapping.local_walls import extract_walls
from lrf3d.mapping.segmentation import LEAST_POINTS
from lrf3d.mapping.split_merge import split_and_merge
from lrf3d.mapping.table import SegmentTable

USUAL_RANGE = 80.0
"""The range [m] that the noise is scaled by where a scan does not say how far it sees."""


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

    def growth(self, scan: LaserScan) -> float:
        """How the deviation of a scan's ranges grows with the range (Eq. 7)."""
        return self.sigma / (scan.range_max if scan.range_max < np.inf else USUAL_RANGE)

    def walls(self, scan: LaserScan) -> tuple[Float, Float, Int]:
        """Walls of a scan, in the world's directions around the laser's place.

        Returns:
            Segments (n, 4) [m], moments (n, 6), and (n, 2) counts of points and clusters.
        """
        most = len(scan.ranges) // LEAST_POINTS
        ends, moments = np.empty((most, 4)), np.empty((most, 6))
        labels = np.empty((most, 2), np.int64)
        limits = (float(scan.range_max), self.floor, self.growth(scan), self.gap)
        angles, ranges = _plain(scan.angles), _plain(scan.ranges)
        count = extract_walls(float(scan.pose.theta), angles, ranges, limits, ends, moments, labels)
        return ends[:count], moments[:count], labels[:count]

    def __call__(self, scan: LaserScan) -> SegmentTable:
        """The local map of a scan, in the world's directions around the laser's place."""
        ends, moments, labels = self.walls(scan)
        return SegmentTable(ends, moments, labels[:, 0], labels[:, 1])


def _plain(values: Float) -> Float:
    """The values as an array of the one kind that the compiled code is made for."""
    if values.flags.c_contiguous and values.flags.writeable:
        return values
    return np.array(values)


def _join(polylines: list[SegmentTable]) -> SegmentTable:
    table = SegmentTable.empty()
    for number, polyline in enumerate(polylines):
        table = table.join(replace(polyline, unions=np.full(len(polyline), number)))
    return table
