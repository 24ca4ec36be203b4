"""What a robust mapper makes of a scan before it judges its beams.

A scan enters; leave where it was taken in the map's own frame, how far each of its beams was free,
and how far off the places may be where they ended.
"""

from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from lrf3d.compiling import inner
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.robust.constants import CELL, LEAST_LOST, LOSS_ODDS, MOST_LOST
from lrf3d.mapping.segment_table import SegmentTable

SHIFT = (0.37 * CELL, 0.41 * CELL)
"""[m] Where the first scan was taken in the map's frame: off the edges of the cells, on which
rounding would decide."""


@inner
def range_deviation(noise: RangeNoise, reach: float) -> float:  # pragma: no cover
    """Standard deviation [m] of a range [m]."""
    deviation: float = np.sqrt(noise.floor * noise.floor + (noise.growth * reach) ** 2)
    return deviation


class Frame(NamedTuple):
    """The map's own frame: that of the first scan, so that the map turns and moves with the world.

    Attributes:
        x: Where the first scan was taken [m].
        y: Where it was taken [m].
        theta: Its heading [rad].
    """

    x: float
    y: float
    theta: float

    @classmethod
    def of(cls, scan: LaserScan) -> "Frame":
        """The frame of a scan."""
        return cls(*(float(value) for value in scan.pose))

    def pose_of(self, scan: LaserScan) -> tuple[tuple[float, float], float]:
        """Where a scan was taken [m], and its heading [rad]."""
        dx, dy = scan.pose.x - self.x, scan.pose.y - self.y
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        place = float(cos * dx + sin * dy + SHIFT[0]), float(cos * dy - sin * dx + SHIFT[1])
        return place, float(scan.pose.theta - self.theta)

    def map_of(self, table: SegmentTable) -> LineMap:
        """The map in the world of a table in this frame."""
        turned = SegmentTable(self._turned(table.ends), table.moments, table.points, table.unions)
        return turned.as_map(np.array([self.x, self.y]))

    def in_world(self, segments: Float) -> Float:
        """Segments (n, 4) of this frame in the world."""
        turned: Float = self._turned(segments) + np.tile([self.x, self.y], 2)
        return turned

    def _turned(self, segments: Float) -> Float:
        """Segments (n, 4) of this frame in the world's directions, around its origin."""
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        turn = np.array([[cos, sin], [-sin, cos]])
        turned: Float = (segments.reshape(-1, 2) - SHIFT) @ turn
        return turned.reshape(-1, 4)


class Beams(NamedTuple):
    """The beams of a scan in the map's frame.

    Args:
        units: (n, 2) their unit vectors.
        ranges: (n,) ranges [m]; where nothing returned, minus the range that is free; 0 where
            nothing is known.
        deviations: (n,) standard deviations [m] of the places where they end.
    """

    units: Float
    ranges: Float
    deviations: Float

    @classmethod
    def of(cls, scan: LaserScan, heading: float, noise: RangeNoise) -> "Beams":
        """The beams of a scan that was taken at a heading [rad]."""
        angles, measured = in_order(scan)
        headings = angles + heading
        units = np.empty((len(headings), 2))
        np.cos(headings, out=units[:, 0])
        np.sin(headings, out=units[:, 1])
        ranges = free_ranges(measured, scan.range_max)
        variances = noise.variance(ranges) + pose_variance(scan, ranges)
        return cls(units, ranges, np.sqrt(variances))

    def limited(self, limits: Float) -> "Beams":
        """The beams, free no farther than limits (n,) [m], at which those went on elsewhere."""
        turned = np.isfinite(limits)
        return self._replace(ranges=np.where(turned, -limits, self.ranges))


def in_order(scan: LaserScan) -> tuple[Float, Float]:
    """Angles (n,) [rad] and ranges (n,) [m] of a scan by rising angle."""
    angles, ranges = scan.angles, scan.ranges
    if (angles[1:] < angles[:-1]).any():
        order = np.argsort(angles, kind="stable")
        angles, ranges = angles[order], ranges[order]
    return angles, ranges


def longest_loss(ranges: Float, range_max: float) -> int:
    """How many beams beside each other that return nothing are put down to beams that are lost.

    Each gap in a scan is taken for a lost beam to learn how often one is lost, at worst: of a scan
    without losses the gaps are few.
    """
    returned = (ranges > 0.0) & (ranges <= range_max) & (ranges < np.inf)
    hits = np.count_nonzero(returned)
    gaps = np.count_nonzero(returned[:-1] & ~returned[1:])
    if gaps == 0 or gaps >= hits:
        return MOST_LOST if gaps else LEAST_LOST
    run = int(np.ceil(np.log(LOSS_ODDS) / np.log(gaps / hits)))
    return min(max(run, LEAST_LOST), MOST_LOST)


def free_ranges(measured: Float, range_max: float) -> Float:
    """Ranges (beams,) [m] of those measured, by rising angle, as `Beams` has them.

    A beam that is lost between two that returned says nothing: only where more beside each other
    return nothing, nothing is there.
    """
    ranges: Float = measured.copy()
    # Nothing is known before what is too near.
    ranges[~(ranges > 0.0)] = 0.0
    missed = ranges > range_max
    if np.isinf(range_max):
        ranges[np.isinf(ranges)] = 0.0
    elif missed.any():
        lost = longest_loss(measured, range_max)
        edges = np.flatnonzero(np.diff(missed, prepend=False, append=False))
        free = missed.copy()
        for first, last in edges.reshape(-1, 2).tolist():
            # At the rim of the field of view there is no neighbour to lose it from.
            if last - first <= lost and first > 0 and last < len(ranges):
                free[first:last] = False
        ranges[missed] = 0.0
        ranges[free] = -range_max
    return ranges


def pose_variance(scan: LaserScan, ranges: Float) -> Float | float:
    """Variance [m²] that the pose's error leaves of places so far [m] from the laser."""
    covariance = scan.pose_covariance
    if covariance is None:
        return 0.0
    spread: Float = 0.5 * (covariance[0, 0] + covariance[1, 1]) + covariance[2, 2] * ranges**2
    return spread


def widen(moments: Float, scan: LaserScan) -> None:
    """Let moments (n, 6) around the laser weigh no more than the error of the pose leaves them.

    All points of a scan share it, so that it does not average out.
    """
    reach = np.hypot(moments[:, 1], moments[:, 2])
    moments[:, [0, 3, 4, 5]] /= (1.0 + moments[:, 0] * pose_variance(scan, reach))[:, None]


def fingerprint(scan: LaserScan) -> int:
    """A number of 64 bits that no other scan has."""
    digest = blake2b(scan.ranges.tobytes(), digest_size=8)
    digest.update(scan.angles.tobytes())
    digest.update(np.array(scan.pose).tobytes())
    return int.from_bytes(digest.digest(), "little", signed=True)
