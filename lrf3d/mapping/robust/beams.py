"""Beams: what a robust mapper makes of a scan before it enters the cells.

A scan enters; its pose in the map's own frame, the noise of its ranges, the free distance of each
beam, and the standard deviation of its end point leave.

The noise is learnt from the scans. On a flat wall the inverse of the range is a sine of the angle,
so that the ranges before and behind a beam predict its own; the difference is noise. At corners and
in clutter it is much larger, and the median leaves it out (Huber and Ronchetti 2009, section 5.1).
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import NORMAL_MEDIAN, Float, Int, Records
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserScan, RangeNoise

# [m] Side of a cell. Memory grows with its inverse square; at 0.2 the purity of the objects of a
# town falls by 0.05.
CELL = 0.1


# [m] Where the first scan was taken in the map's frame, which turns and moves with the world: off
# the edges of the cells, on which rounding would decide.
SHIFT = (0.37 * CELL, 0.41 * CELL)

# [m] Ranges above this are invalid: no laser of a robot measures farther.
MOST_RANGE = 10_000.0

# [m] Edges of the bins of range in which noise is measured, by factors of two. They matter little:
# the noise is fitted to all bins.
NOISE_RANGES = np.geomspace(0.1, 200.0, 13)

# [m] Resolution of the noise.
NOISE_UNIT = 1e-5

# [bins] Bins of the sizes of residuals: from the resolution on, eight decades.
RESIDUAL_BINS = 200

# [bins] Bins in a decade of sizes.
PER_DECADE = 24


def pose_in(frame: Pose, scan: LaserScan) -> tuple[tuple[float, float], float]:
    """Where a scan was taken [m] in the map's frame, and its heading [rad]."""
    dx = scan.pose.x - frame.x
    dy = scan.pose.y - frame.y
    cos = np.cos(frame.theta)
    sin = np.sin(frame.theta)
    x, y = np.add((cos * dx + sin * dy, cos * dy - sin * dx), SHIFT).tolist()
    return (x, y), float(scan.pose.theta - frame.theta)


def in_world(frame: Pose, segments: Float) -> Float:
    """Segments (n, 4) of the map's frame in the world."""
    return frame.apply(segments.reshape(-1, 2) - SHIFT).reshape(-1, 4)


class Beams(NamedTuple):
    """The beams of a scan in the map's frame.

    Unit vectors (n, 2); ranges (n,) [m], minus the free distance where nothing returned and 0 where
    nothing is known; and standard deviations (n,) [m] of the end points.
    """

    units: Float
    ranges: Float
    deviations: Float

    @classmethod
    def of(cls, scan: LaserScan, heading: float, noise: RangeNoise) -> "Beams":
        """The beams of a scan that was taken at a heading [rad]."""
        angles, measured = in_order(scan)
        headings = angles + heading
        count = len(headings)
        beams = cls(np.empty((count, 2)), np.empty(count), np.empty(count))
        np.cos(headings, out=beams.units[:, 0])
        np.sin(headings, out=beams.units[:, 1])
        measure_beams(plain(measured), float(scan.range_max), noise, pose_spread(scan), beams)
        return beams


def in_order(scan: LaserScan) -> tuple[Float, Float]:
    """Angles (n,) [rad] and ranges (n,) [m] of a scan by rising angle."""
    angles = scan.angles
    ranges = scan.ranges
    if (angles[1:] < angles[:-1]).any():
        order = np.argsort(angles, kind="stable")
        angles = angles[order]
        ranges = ranges[order]
    return angles, ranges


def plain(values: Float) -> Float:
    """The values as an array of the layout that kernels are compiled for."""
    if values.flags.c_contiguous and values.flags.writeable:
        return values
    return np.array(values)


@borrower
def is_return(reach: float, range_max: float) -> bool:
    """Whether a range [m] is that of a return."""
    return 0.0 < reach <= range_max and reach < np.inf


@inner
def longest_loss(ranges: Float, range_max: float) -> int:
    """Longest run of missing returns that is attributed to lost beams.

    The rate of losses is bounded by the rate of gaps in the scan: a scan without losses has few.
    """
    hits = gaps = 0
    returned = False
    for beam in range(len(ranges)):
        before = returned
        returned = is_return(ranges[beam], range_max)
        hits += returned
        gaps += before and not returned
    # [beams] Least bound on a run of missing returns that is attributed to lost beams: less takes
    # lost beams for gaps of walls.
    least_lost = 2
    # [beams] Largest bound on such a run: more ignores views through narrow gaps.
    most_lost = 8
    if gaps == 0 or gaps >= hits:
        return most_lost if gaps else least_lost
    # [odds] A gap in a scan is real if lost beams leave it with at most this chance.
    loss_odds = 0.01
    run = int(np.ceil(np.log(loss_odds) / np.log(gaps / hits)))
    return min(max(run, least_lost), most_lost)


@compiled
def measure_beams(
    measured: Float,
    range_max: float,
    noise: RangeNoise,
    spread: tuple[float, float],
    beams: Beams,
) -> None:
    """Fill in the free distances of beams and the standard deviations of their end points.

    Ranges (n,) [m] are measured by rising angle. A short run of missing returns between two returns
    is unknown, a longer one is free space; see `pose_spread` for the spread.
    """
    ranges = beams.ranges
    count = len(measured)
    missed = 0
    lost = longest_loss(measured, range_max)
    most_free = 1_000.0  # [m] Largest free distance of a beam without return.
    for beam in range(count + 1):
        if beam < count and measured[beam] > range_max:
            missed += 1
            continue
        if missed:
            # At the rim of the field of view there is no neighbour to lose it from.
            alone = missed <= lost and missed < beam < count
            for other in range(beam - missed, beam):
                ranges[other] = 0.0 if alone else -min(range_max, most_free)
            missed = 0
        if beam < count:
            # Nothing is known before what is too near, nor where any range may be measured.
            known = 0.0 < measured[beam] < MOST_RANGE
            ranges[beam] = measured[beam] if known else 0.0
    _measure_deviations(noise, spread, beams)


@inner
def _measure_deviations(noise: RangeNoise, spread: tuple[float, float], beams: Beams) -> None:
    """Fill in the standard deviations of the end points of beams."""
    for beam in range(len(beams.ranges)):
        reach = beams.ranges[beam]
        variance = noise.floor * noise.floor + (noise.growth * reach) * (noise.growth * reach)
        beams.deviations[beam] = np.sqrt(variance + (spread[0] + spread[1] * (reach * reach)))


def pose_spread(scan: LaserScan) -> tuple[float, float]:
    """Variances that the pose's error adds to end points: constant, and times the range squared."""
    covariance = scan.pose_covariance
    if covariance is None:
        return 0.0, 0.0
    return float(0.5 * (covariance[0, 0] + covariance[1, 1])), float(covariance[2, 2])


def widen(fits: Records, scan: LaserScan) -> None:
    """Reduce the weights of fits (n,) around the laser to what the error of the pose allows.

    All points of a scan share this error, so that it does not average out.
    """
    if scan.pose_covariance is None:
        return
    own, turn = pose_spread(scan)
    less = 1.0 + fits["weight"] * (own + turn * np.hypot(fits["x"], fits["y"]) ** 2)
    for name in ("weight", "xx", "xy", "yy"):
        fits[name] /= less


class NoiseEstimate:
    """The noise of ranges: the assumed one at first, then more and more the observed one."""

    def __init__(self, floor: float) -> None:
        self._floor = floor
        # How many differences there were, by range and by size.
        self._counts = np.zeros((len(NOISE_RANGES) - 1, RESIDUAL_BINS), np.int64)
        self._total = self._fitted = 0
        self.known: RangeNoise | None = None

    def update(self, scan: LaserScan, assumed: RangeNoise) -> RangeNoise:
        """Learn from a scan; returns the noise as it is known now, not that assumed at first."""
        known = assumed if self.known is None else self.known
        self._total += count_residuals(
            plain(scan.angles), plain(scan.ranges), known, NOISE_RANGES, self._counts
        )
        # [share] Growth of the data after which noise is fitted again. It changes speed, and the
        # error of the noise by a few per cent.
        noise_steps = 1.2
        # One more scan changes a noise that rests on many by little.
        if self.known is None or self._total > noise_steps * self._fitted:
            self.known = self._fit(assumed)
            self._fitted = self._total
        return self.known

    def _fit(self, assumed: RangeNoise) -> RangeNoise:
        """The floor and the growth that fit the scales at all ranges."""
        number = self._counts.sum(axis=1).astype(np.float64)
        ranges = np.sqrt(NOISE_RANGES[:-1] * NOISE_RANGES[1:])
        before = np.log(np.maximum(assumed.variance(ranges), self._floor**2))
        seen = number > 0.0
        median = (2 * self._counts.cumsum(axis=1) >= number[:, None]).argmax(axis=1)
        scale = NOISE_UNIT * 10.0 ** ((median + 0.5) / PER_DECADE) / NORMAL_MEDIAN
        found = np.where(seen, 2.0 * np.log(scale), before)
        # [ranges] Weight of the initial noise: a third of a scan. It matters for the first scans
        # only.
        noise_prior = 50.0
        # The initial noise loses weight as data come in; it has none at unseen ranges once others
        # are known.
        prior = noise_prior**2 / (noise_prior + number.sum())
        weights = number + prior
        variances = np.exp((number * found + prior * before) / weights)
        if number.sum() > noise_prior:
            weights[~seen] = 0.0
        least = self._floor**2
        floor = least
        growth = max(float(np.min(variances / ranges**2)), 0.0)
        for _ in range(20):
            # Weighted by the error of each variance, which is a share of the variance.
            share = weights / (floor + growth * ranges**2) ** 2
            growth = max(float((share * ranges**2) @ (variances - floor)), 0.0)
            growth /= float((share * ranges**2) @ ranges**2)
            floor = max(float(share @ (variances - growth * ranges**2)) / float(share.sum()), least)
        return RangeNoise(float(np.sqrt(floor)), float(np.sqrt(growth)))


@compiled
def count_residuals(
    angles: Float, ranges: Float, noise: RangeNoise, edges: Float, counts: Int
) -> int:
    """Histogram the deviations of ranges from those that their neighbours predict on a flat wall.

    Adds to the counts (bins, sizes) of deviations between edges (bins + 1,) [m] of the range;
    returns how many were added.
    """
    # [1/rad] Steepest relative change of the range along a wall: incidence above 10°. Steeper walls
    # magnify noise, and jumps between walls hide among them.
    noise_slope = 6.0
    noise_jump = 5.0  # [deviations] Tolerance that the present noise adds to the slope.
    # [share] Bound on that tolerance, relative to the range: with a far too large initial noise
    # corners would count as noise for good.
    noise_share = 0.05
    # [rad] Largest angle between consecutive beams: several lost beams of common range finders.
    # More includes ends of walls, less leaves few beams.
    noise_widest = np.radians(6.0)
    returned = 0
    turns = np.empty(len(ranges))
    reaches = np.empty(len(ranges))
    for beam in range(len(ranges)):
        if NOISE_UNIT < ranges[beam] < np.inf:
            turns[returned] = angles[beam]
            reaches[returned] = ranges[beam]
            returned += 1
    added = 0
    smooth = 0
    for last in range(1, returned):
        before = reaches[last - 1]
        after = reaches[last]
        step = abs(turns[last] - turns[last - 1])
        share = np.hypot(noise.floor / min(before, after), noise.growth)
        jump = noise_slope * step + noise_jump * min(share, noise_share)
        flat = abs(np.log(after / before)) < jump and 0.0 < step < noise_widest
        smooth = smooth + 1 if flat else 0
        if smooth < 4:
            continue
        # The middle one of five beams that follow each other without a jump.
        middle = last - 2
        row = -1
        while row + 1 < len(edges) and edges[row + 1] < reaches[middle]:
            row += 1
        if 0 <= row < len(counts):
            size = _off_flat(turns[middle - 1 : middle + 2], reaches[middle - 1 : middle + 2])
            column = int(PER_DECADE * np.log10(max(size, NOISE_UNIT) / NOISE_UNIT))
            counts[row, min(column, counts.shape[1] - 1)] += 1
            added += 1
    return added


@borrower
def _off_flat(turns: Float, reaches: Float) -> float:
    """The deviation [m] of the second of three ranges (3,) from a flat wall through the others.

    It is in units of its own noise: that of the others moves the wall.
    """
    left = abs(turns[1] - turns[0])
    right = abs(turns[2] - turns[1])
    # 1 / r = (sin(right) / one + sin(left) / other) / sin(left + right)
    a = np.sin(right) / np.sin(left + right)
    b = np.sin(left) / np.sin(left + right)
    flat = 1.0 / (a / reaches[0] + b / reaches[2])
    # By how much the noise of the neighbours moves that.
    a *= (flat / reaches[0]) ** 2
    b *= (flat / reaches[2]) ** 2
    return float(abs(reaches[1] - flat) / np.sqrt(1.0 + a * a + b * b))
