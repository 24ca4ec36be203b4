"""What a robust mapper makes of a scan before it judges its beams.

A scan enters; leave where it was taken in the map's own frame, the noise of its ranges, how far
each of its beams was free, and how far off the places may be where they ended.

The noise is that which the scans themselves show. On a flat wall the inverse of the range is a sine
of the angle, so that the ranges before and behind a beam give its own; by how much it differs is
noise. What differs at corners and in clutter differs by much more, and the median leaves it out
(Huber and Ronchetti 2009, section 5.1).
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int, Records
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.pose import Pose

CELL = 0.1
"""[m] Size of a cell. What is kept of the ground grows with its square; at 0.2 the purity of the
objects of a town falls by 0.05."""

LOSS_ODDS = 0.01
"""[odds] A gap in a scan that lost beams leave by no more than such a chance is a real one."""

LEAST_LOST, MOST_LOST = 2, 8
"""[beams] How many beams beside each other may be lost at least, also where hardly any are, and at
most. More forgets what is seen through narrow gaps, less takes lost beams for gaps of walls."""


SHIFT = (0.37 * CELL, 0.41 * CELL)
"""[m] Where the first scan was taken in the map's frame, which turns and moves with the world: off
the edges of the cells, on which rounding would decide."""

MOST_FREE = 1_000.0
"""[m] How far a beam without return is taken to be free at most, however far its laser reaches."""

MOST_RANGE = 10_000.0
"""[m] No laser of a robot measures farther than this: such a range is not known."""

NOISE_RANGES = np.geomspace(0.1, 200.0, 13)
"""[m] The ranges between which noise is measured together: steps of a factor of two. It changes
little: noise is fitted to all of them."""

NOISE_UNIT = 1e-5
"""[m] The smallest noise that is distinguished from none."""

NOISE_WIDEST = np.radians(6.0)
"""[rad] Farthest apart of two beams that follow each other on a wall: several lost beams of common
range finders. Wider, walls end in between more often; narrower, few beams show nothing."""

NOISE_SLOPE = 6.0
"""Steepest change of the range along a wall, as a share for each radian: walls met at 10° or more.
Steeper ones magnify noise, and jumps from wall to wall hide among them."""

NOISE_JUMP = 5.0
"""[deviations] How much noise may add to that, by what is known of it so far."""

NOISE_SHARE = 0.05
"""Largest noise, as a share of the range, that may add to that: were it more, a noise that is given
far too large would take corners for noise and never be put right."""

NOISE_PRIOR = 50.0
"""How many ranges the noise that is given counts as: a third of a scan. It matters for the first
scans only."""

NOISE_STEPS = 1.2
"""By which factor more must be known before noise is fitted again. It changes speed, and the error
of the noise by a few per cent."""


RANGE_BINS, RESIDUAL_BINS, PER_DECADE = len(NOISE_RANGES) - 1, 200, 24

MEDIAN_SIZE = 0.6745
"""[deviations] The median of the sizes of normal deviates."""


@inner
def range_deviation(noise: RangeNoise, reach: float) -> float:
    """Standard deviation [m] of a range [m]."""
    deviation: float = np.sqrt(noise.floor * noise.floor + (noise.growth * reach) ** 2)
    return deviation


def pose_in(frame: Pose, scan: LaserScan) -> tuple[tuple[float, float], float]:
    """Where a scan was taken [m] in the map's frame, and its heading [rad]."""
    dx, dy = scan.pose.x - frame.x, scan.pose.y - frame.y
    cos, sin = np.cos(frame.theta), np.sin(frame.theta)
    x, y = np.add((cos * dx + sin * dy, cos * dy - sin * dx), SHIFT).tolist()
    return (x, y), float(scan.pose.theta - frame.theta)


def in_world(frame: Pose, segments: Float) -> Float:
    """Segments (n, 4) of the map's frame in the world."""
    return frame.apply(segments.reshape(-1, 2) - SHIFT).reshape(-1, 4)


class Beams(NamedTuple):
    """The beams of a scan in the map's frame.

    Their unit vectors (n, 2); ranges (n,) [m], where nothing returned minus the range that is free,
    and 0 where nothing is known; and standard deviations (n,) [m] of the places where they end.
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
    angles, ranges = scan.angles, scan.ranges
    if (angles[1:] < angles[:-1]).any():
        order = np.argsort(angles, kind="stable")
        angles, ranges = angles[order], ranges[order]
    return angles, ranges


def plain(values: Float) -> Float:
    """The values as an array of the one kind that the compiled code is made for."""
    if values.flags.c_contiguous and values.flags.writeable:
        return values
    return np.array(values)


@inner
def longest_loss(ranges: Float, range_max: float) -> int:
    """How many beams beside each other that return nothing are put down to beams that are lost.

    Each gap in a scan is taken for a lost beam to learn how often one is lost, at worst: of a scan
    without losses the gaps are few.
    """
    hits = gaps = 0
    returned = False
    for beam in range(len(ranges)):
        before, reach = returned, ranges[beam]
        returned = reach > 0.0 and reach <= range_max and reach < np.inf
        hits += returned
        gaps += before and not returned
    if gaps == 0 or gaps >= hits:
        return MOST_LOST if gaps else LEAST_LOST
    run = int(np.ceil(np.log(LOSS_ODDS) / np.log(gaps / hits)))
    return min(max(run, LEAST_LOST), MOST_LOST)


@compiled
def measure_beams(
    measured: Float,
    range_max: float,
    noise: RangeNoise,
    spread: tuple[float, float],
    beams: Beams,
) -> None:
    """Find how far beams were free, and how far off the places may be where they ended.

    A beam that is lost between two that returned says nothing: only where more beside each other
    return nothing, nothing is there. Ranges and deviations of the beams are filled in from measured
    ranges (n,) [m] by rising angle; see `pose_spread` for the spread.
    """
    ranges = beams.ranges
    count, missed, lost = len(measured), 0, longest_loss(measured, range_max)
    for beam in range(count + 1):
        if beam < count and measured[beam] > range_max:
            missed += 1
            continue
        if missed:
            # At the rim of the field of view there is no neighbour to lose it from.
            alone = missed <= lost and missed < beam < count
            for other in range(beam - missed, beam):
                ranges[other] = 0.0 if alone else -min(range_max, MOST_FREE)
            missed = 0
        if beam < count:
            # Nothing is known before what is too near, nor where any range may be measured.
            known = 0.0 < measured[beam] < MOST_RANGE
            ranges[beam] = measured[beam] if known else 0.0
    for beam in range(count):
        reach = ranges[beam]
        variance = noise.floor * noise.floor + (noise.growth * reach) * (noise.growth * reach)
        beams.deviations[beam] = np.sqrt(variance + (spread[0] + spread[1] * (reach * reach)))


def pose_spread(scan: LaserScan) -> tuple[float, float]:
    """What the pose's error adds to the variance of places: at no distance, and by its square."""
    covariance = scan.pose_covariance
    if covariance is None:
        return 0.0, 0.0
    return float(0.5 * (covariance[0, 0] + covariance[1, 1])), float(covariance[2, 2])


def widen(fits: Records, scan: LaserScan) -> None:
    """Let fits (n,) around the laser weigh no more than the error of the pose leaves them.

    All points of a scan share it, so that it does not average out.
    """
    if scan.pose_covariance is None:
        return
    own, turn = pose_spread(scan)
    less = 1.0 + fits["weight"] * (own + turn * np.hypot(fits["x"], fits["y"]) ** 2)
    for name in ("weight", "xx", "xy", "yy"):
        fits[name] /= less


class NoiseEstimate:
    """The noise of ranges as it is `known`: what was assumed, and more and more what scans show."""

    def __init__(self, floor: float) -> None:
        self._floor = floor
        # How many differences there were, by range and by size.
        self._counts = np.zeros((RANGE_BINS, RESIDUAL_BINS), np.int64)
        self._total = self._fitted = 0
        self.known: RangeNoise | None = None

    def update(self, scan: LaserScan, assumed: RangeNoise) -> RangeNoise:
        """Learn from a scan; returns the noise as it is known now, not that assumed at first."""
        known = assumed if self.known is None else self.known
        self._total += count_residuals(scan.angles, scan.ranges, known, NOISE_RANGES, self._counts)
        # The more is known, the less another scan changes it.
        if self.known is None or self._total > NOISE_STEPS * self._fitted:
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
        scale = NOISE_UNIT * 10.0 ** ((median + 0.5) / PER_DECADE) / MEDIAN_SIZE
        found = np.where(seen, 2.0 * np.log(scale), before)
        # What was assumed counts the less the more is known, and nothing at ranges that were not
        # seen where others were.
        prior = NOISE_PRIOR**2 / (NOISE_PRIOR + number.sum())
        weights = number + prior
        variances = np.exp((number * found + prior * before) / weights)
        if number.sum() > NOISE_PRIOR:
            weights[~seen] = 0.0
        least = self._floor**2
        floor, growth = least, max(float(np.min(variances / ranges**2)), 0.0)
        for _ in range(20):
            # Weighted by the error of each variance, which is a share of the variance.
            share = weights / (floor + growth * ranges**2) ** 2
            growth = max(float((share * ranges**2) @ (variances - floor)), 0.0)
            growth /= float((share * ranges**2) @ ranges**2)
            floor = max(float(share @ (variances - growth * ranges**2)) / float(share.sum()), least)
        return RangeNoise(float(np.sqrt(floor)), float(np.sqrt(growth)))


def count_residuals(
    angles: Float, ranges: Float, noise: RangeNoise, edges: Float, counts: Int
) -> int:
    """Count by how much ranges differ from those that their neighbours give on a flat wall.

    Counts (bins, sizes) of those between two edges (bins + 1,) [m] are added to; returns how many.
    """
    returned = np.flatnonzero(np.isfinite(ranges) & (ranges > NOISE_UNIT))
    steps, ranges = np.abs(np.diff(angles[returned])), ranges[returned]
    before, after = ranges[:-1], ranges[1:]
    share = np.hypot(noise.floor / np.fmax(np.minimum(before, after), NOISE_UNIT), noise.growth)
    jumps = NOISE_SLOPE * steps + NOISE_JUMP * np.minimum(share, NOISE_SHARE)
    smooth = (np.abs(np.log(after / before)) < jumps) & (steps < NOISE_WIDEST) & (steps > 0.0)
    # The middle ones of five beams that follow each other without a jump.
    beams = 2 + np.flatnonzero(smooth[:-3] & smooth[1:-2] & smooth[2:-1] & smooth[3:])
    left, right, middle = steps[beams - 1], steps[beams], ranges[beams]
    # 1 / r = (sin(right) / one + sin(left) / other) / sin(left + right)
    a, b = np.sin([right, left]) / np.sin(left + right)
    one, other = ranges[beams - 1], ranges[beams + 1]
    flat = 1.0 / (a / one + b / other)
    # By how much the noise of the neighbours moves that.
    a, b = a * (flat / one) ** 2, b * (flat / other) ** 2
    sizes = np.abs(middle - flat) / np.sqrt(1.0 + a * a + b * b)
    rows = np.searchsorted(edges, middle) - 1
    columns = PER_DECADE * np.log10(np.maximum(sizes, NOISE_UNIT) / NOISE_UNIT)
    inside = (rows >= 0) & (rows < len(counts))
    places = rows[inside], np.minimum(columns[inside], counts.shape[1] - 1).astype(np.int64)
    np.add.at(counts, places, 1)
    return int(inside.sum())
