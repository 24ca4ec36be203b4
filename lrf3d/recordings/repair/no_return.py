"""No return: readings that a range finder writes for beams that met nothing.

The scans of one laser enter; they leave with ±inf for such readings. It is done as a log is read.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.laser import LaserScan
from lrf3d.recordings.repair import Repair

# The largest range stands out if it is read this many times as often as all ranges just below it. A
# wall at the end of a corridor does not: it is read at many ranges.
CROWDED = 5.0

# Width of the band just below the largest range with which it is compared [m].
BELOW = 0.5

# Readings that differ by less are the same [m]: logs are written in centimetres.
EQUAL = 0.011

# Share of all readings from which the largest range stands out in any case: so many beams end at
# the same range only where nothing is in reach.
OPEN = 0.1

# Least number of readings of the largest range that mean no return.
LEAST_READINGS = 50

# Least share of the largest range among all readings, for it to mean no return.
LEAST_SHARE = 0.001

# Least share of readings of the largest range with an adjacent beam that reads it, too: open space
# is seen by several adjacent beams; the far corner of a room, which a robot at rest reads again and
# again, by one.
ADJACENT = 0.3

# Depth [m] of a band below the largest range in which some range finders spread what met nothing.
SPREAD = 0.16

# Least mean difference of adjacent readings in that band, in its depth: those that met nothing have
# nothing to do with each other; a wall goes on from beam to beam.
UNRELATED = 0.2

# Share of the readings in that band that are walls.
RARE = 0.05

# Share of readings without a number from which these mean no return, so that no others do.
MARKED = 0.01

# Largest share of scans in which beams of the band read it: those of a robot at rest always do.
ALWAYS = 0.8


class NoReturn(NamedTuple):
    """Readings up to ``near`` [m] and from ``far`` [m] on mean no return; the user may give far."""

    near: float
    far: float
    given: bool


def find(scans: Sequence[LaserScan], limit: float | None = None) -> NoReturn | None:
    """Which readings of a laser mean no return: from a given one on, or those that stand out.

    Range finders write their largest range, such as 4, 8, 30 or 80 m, for beams that met nothing; a
    log does not name it. Taken for walls, such readings are an arc that moves with the robot.
    Others write their smallest range, which looks like a small arc around it.
    """
    ranges = [scan.ranges for scan in scans]
    far = limit or min(_outstanding(ranges, OPEN), _spread(ranges, scans[0].range_max))
    # Beams at a right angle to a near wall end at about the same range.
    near = -_outstanding([-each for each in ranges], np.inf)
    return None if max(near, -far) == -np.inf else NoReturn(near, far, limit is not None)


def apply(scans: Sequence[LaserScan], limits: NoReturn) -> list[LaserScan]:
    """The scans with −inf for readings that are too near, and +inf for those that are too far."""
    changed = [np.where(scan.ranges <= limits.near, -np.inf, scan.ranges) for scan in scans]
    return [
        replace(scan, ranges=np.where(ranges >= limits.far, np.inf, ranges))
        for scan, ranges in zip(scans, changed, strict=True)
    ]


def sentence(limits: NoReturn) -> str:
    """What was assumed; a limit that the user gave is not repeated."""
    far = f"readings from {limits.far:.4g} m on mean no return; --largest-range sets another limit"
    near = f"readings up to {limits.near:.4g} m mean no return"
    outstanding = limits.far < np.inf and not limits.given
    return ", ".join([far] * outstanding + [near] * (limits.near > -np.inf))


def _outstanding(scans: Sequence[Float], share: float) -> float:
    """The least reading [m] that means no return, if the largest one stands out; else +inf."""
    finite = [ranges[np.isfinite(ranges)] for ranges in scans]
    largest = max((float(ranges.max()) for ranges in finite if len(ranges)), default=0.0)
    near = np.concatenate([np.empty(0), *(r[r > largest - BELOW] for r in finite)])
    equal = near[near > largest - EQUAL]
    every = sum(map(len, finite))
    crowd = min(CROWDED * (len(near) - len(equal)), share * every)
    if len(equal) < max(LEAST_READINGS, LEAST_SHARE * every, crowd):
        return np.inf
    seen = [np.isfinite(ranges) & (ranges > largest - EQUAL) for ranges in scans]
    adjacent = sum(int((beams[1:] & beams[:-1]).sum()) for beams in seen)
    return np.inf if adjacent < ADJACENT * len(equal) else float(equal.min())


def _spread(scans: Sequence[Float], declared: float) -> float:
    """The least reading [m] of a band below the declared range that means no return; else +inf.

    Many readings lie in it, few just below, and neither adjacent beams nor successive scans agree.
    """
    if declared == np.inf or len({len(ranges) for ranges in scans}) != 1:
        return np.inf
    table = np.array(scans)
    finite = np.isfinite(table)
    largest = table[finite].max(initial=0.0)
    if (~finite).mean() > MARKED or abs(declared - largest) > SPREAD:
        return np.inf
    below = finite & (table > largest - BELOW)
    band = below & (table > largest - SPREAD)
    count = band.sum()
    least = max(LEAST_READINGS, OPEN * finite.sum(), CROWDED * (below.sum() - count))
    pairs = band[:, 1:] & band[:, :-1]
    shares = band.mean(axis=0)
    if count < least or pairs.sum() < ADJACENT * count or shares[shares > 0.0].max() > ALWAYS:
        return np.inf
    # Some walls lie in the band, too.
    depth = largest - np.quantile(table[band], RARE)
    apart = np.abs(table[:, 1:][pairs] - table[:, :-1][pairs]).mean()
    return float(largest - (1.0 + UNRELATED) * depth) if apart > UNRELATED * depth else np.inf


NO_RETURN = Repair("no_return", find, apply, sentence)
