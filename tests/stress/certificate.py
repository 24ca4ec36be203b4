"""The certificate: what each beam of a batch truly gives, and how far a caster's claim is off.

Float64 with error bounds decides most beams (`stress.certify`); rationals decide
the others, and as many more outright as are asked for. Both are independent of the casters.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lrf3d.casting.exact import ExactWorld
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserRangeFinder
from stress.certify import UNDECIDED, certify

LEAST, MOST = 1e-44, 1e44
"""Between these the size of a number [m] is one that the error bounds hold for."""


@dataclass(frozen=True, slots=True)
class Certificate:
    """The truth about beams (k, beams), known for certain.

    Args:
        walls: The wall that each beam hits, of equally near ones the first; −1 for no range.
        ranges: The exact range rounded to a float64 [m]; +inf and −inf as in a scan.
        rest: What is missing from the rounded to the exact range [m].
        slack: Bound on the error of ranges + rest [m]; 0 for what rationals gave.
        rational: Which beams rationals decided.
        contradictions: Beams on which bounds and rationals do not agree: the proof is broken.
        limits: Nearest and farthest range that a scan may hold [m].
    """

    walls: Int
    ranges: Float
    rest: Float
    slack: Float
    rational: Bool
    contradictions: int
    limits: tuple[float, float]

    def judge(self, ranges: Float, walls: Int) -> "Verdict":
        """Compare the ranges and walls (k, beams) that a caster claims."""
        hits = self.walls >= 0
        low, high = self.limits
        inside = (ranges >= low) & (ranges <= high) & np.isfinite(ranges)
        right = (walls == self.walls) & np.where(hits, inside, ranges == self.ranges)
        errors, units = np.zeros(ranges.shape), np.full(ranges.shape, np.inf)
        both = hits & right
        gap = np.abs((ranges[both] - self.ranges[both]) - self.rest[both])
        errors[both] = gap + self.slack[both]
        units[both] = np.spacing(self.ranges[both])
        return Verdict(~right, errors, units)


@dataclass(frozen=True, slots=True)
class Verdict:
    """How claims (k, beams) compare with the truth.

    Args:
        wrong: Which beams have the wrong wall, a return for a miss, or a miss for a return.
        errors: Bound on the error of each range [m]; 0 where there is none.
        units: The unit in the last place of each exact range [m]; inf where there is none.
    """

    wrong: Bool
    errors: Float
    units: Float

    @property
    def ulps(self) -> Float:
        """The errors (k, beams) in units in the last place of the exact range."""
        with np.errstate(over="ignore"):
            return self.errors / self.units


def certified(
    segments: Float, lrf: LaserRangeFinder, poses: Float, outright: Bool | None = None
) -> Certificate:
    """Certify the beams of a range finder at poses (k, 3) among segments (n, 4).

    Args:
        segments: The walls, all as tall as the beams are high.
        lrf: The range finder.
        poses: The poses.
        outright: (k, beams) beams that rationals shall decide whatever the bounds say.
    """
    segments = np.ascontiguousarray(segments, dtype=np.float64)
    poses = np.ascontiguousarray(poses, dtype=np.float64)
    beams = directions(lrf, poses)
    shape = beams.shape[:2]
    walls = np.empty(shape, dtype=np.int64)
    ranges, rest, slack = np.empty(shape), np.empty(shape), np.empty(shape)
    limits = float(lrf.range_min), float(lrf.range_max)
    certify(segments, poses[:, :2], beams, limits, walls, ranges, rest, slack)
    known = (walls != UNDECIDED) & _bounds_hold(segments, lrf, poses)
    rational = ~known if outright is None else ~known | outright
    contradictions = 0
    reference = ExactWorld(segments, poses[:, :2].tolist())
    for k, i in np.argwhere(rational).tolist():
        wall, high, low = _exact(reference, k, beams[k, i].tolist(), lrf)
        if known[k, i]:
            off = abs((ranges[k, i] - high) + (rest[k, i] - low)) if wall >= 0 else 0.0
            same = wall == walls[k, i] and (wall >= 0 or high == ranges[k, i])
            contradictions += not (same and off <= 2.0 * slack[k, i])
        walls[k, i], ranges[k, i], rest[k, i], slack[k, i] = wall, high, low, 0.0
    return Certificate(walls, ranges, rest, slack, rational, contradictions, limits)


def _bounds_hold(segments: Float, lrf: LaserRangeFinder, poses: Float) -> Bool:
    """For which poses (k, 1) no product of the bounds under- or overflows."""
    shared = np.concatenate([segments.ravel(), lrf.fan.ravel(), [lrf.range_min]])
    own = np.column_stack([poses[:, :2], np.sin(poses[:, 2])])
    hold = np.asarray(_ordinary(shared).all() & _ordinary(own).all(axis=1), dtype=np.bool_)
    return hold[:, None]


def _ordinary(values: Float) -> Bool:
    """Which numbers are 0, or neither tiny nor enormous."""
    size = np.abs(values)
    return np.asarray((size == 0.0) | ((size > LEAST) & (size < MOST)), dtype=np.bool_)


def directions(lrf: LaserRangeFinder, poses: Float) -> Float:
    """Directions (k, beams, 2) at poses (k, 3): those of `LaserRangeFinder.directions`, at once."""
    cos = np.array([math.cos(theta) for theta in poses[:, 2].tolist()])[:, None]
    sin = np.array([math.sin(theta) for theta in poses[:, 2].tolist()])[:, None]
    ahead, left = lrf.fan
    return np.stack([cos * ahead - sin * left, sin * ahead + cos * left], axis=2)


def _exact(
    reference: ExactWorld, origin: int, direction: list[float], lrf: LaserRangeFinder
) -> tuple[int, float, float]:
    """The wall, the rounded range and its rest by rationals, with the range finder's limits."""
    wall, t = reference.cast(origin, direction)
    if t is None or t > Fraction(lrf.range_max):
        return -1, math.inf, 0.0
    if t < Fraction(lrf.range_min):
        return -1, -math.inf, 0.0
    high = float(t)
    return wall, high, float(t - Fraction(high))
