"""NoiseEstimate: the noise of ranges as the scans themselves show it.

On a flat wall the inverse of the range is a sine of the angle, so that the ranges before and behind
a beam give its own; by how much it differs is noise. What differs at corners and in clutter differs
by much more, and the median leaves it out (Huber and Ronchetti 2009, section 5.1). Scans enter;
a :class:`~lrf3d.laser.RangeNoise` leaves.
"""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan, RangeNoise

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
    returned = np.flatnonzero(np.isfinite(ranges) & (ranges > 0.0))
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
