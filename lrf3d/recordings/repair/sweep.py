"""Sweep: scans whose beams were sent one after the other, without times in the log, are unrolled.

A laser whose mirror turns once for each scan shows bent walls while its robot turns. Two scans at
different turn rates agree better once both are unrolled, and worse if they are unrolled in the
opposite sense.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Float, usual_step
from lrf3d.geometry.pose import between
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import unrolled
from lrf3d.matching.search import Submap
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.lag import fitted_again
from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.turns import LEAST_PAIRS, MOST_DISTANCE, PAIR

# Longest revolution of a mirror [s]: lasers that take longer are turned as a whole.
LONGEST = 0.25

# Number of scans from the first to the second of a pair, in which the turn rate can change.
APART = 4

# Largest number of pairs that are compared: more take longer and prove no more.
MOST_PAIRS = 120

# Least difference between the turn rates of the two scans of a pair [rad per scan].
LEAST_CHANGE = 0.03

# Largest turn from the first to the second of a pair [rad], so that both see the same walls.
WIDEST = 1.0

# Information of the window in which the second scan of a pair is matched.
INFORMATION = np.asarray(np.linalg.inv(PAIR), dtype=np.float64)

# Number of standard errors that gain and loss must reach; lasers with a mirror reach 4 to 9 and
# 4 to 13.
SURE = 3.0


def find(recording: Recording) -> list[LaserScan] | None:
    """The scans with the motion during each, if they agree clearly better with it."""
    interval = _interval(recording)
    if not interval:
        return None
    places = recording.places - recording.lags
    pairs = _uneven_pairs(recording.path.at(places))
    if len(pairs) < LEAST_PAIRS:
        return None
    rolled = partial(_rolled, recording, places, interval, usual_step(places))
    agreement = partial(_agreement, recording, places, pairs)
    still = agreement(partial(rolled, 0))
    gains = {sense: agreement(partial(rolled, sense)) - still for sense in (1, -1)}
    sense = max(gains, key=lambda sense: float(gains[sense].mean()))
    sure = SURE / np.sqrt(len(pairs))
    for change in (gains[sense], -gains[-sense]):
        if change.mean() < sure * change.std():
            return None
    return [rolled(sense, number) for number in range(len(recording.scans))]


def _interval(recording: Recording) -> float:
    """The time between scans [s] if beams may be spread over it without times; else 0."""
    scans = recording.scans
    said = any(scan.time_increment or scan.motion is not None for scan in scans)
    interval = usual_step(np.array([scan.time for scan in scans]))
    followed = recording.log.placed and not recording.log.parts
    return interval if followed and not said and interval <= LONGEST else 0.0


def _rolled(
    recording: Recording, places: Float, interval: float, lines: float, sense: int, number: int
) -> LaserScan:
    """A scan with its motion, for a mirror that turns once in an interval [s], or in [lines]."""
    scan = recording.scans[number]
    if not sense:
        return scan
    share = float(abs(scan.angles[-1] - scan.angles[0])) / (2.0 * np.pi)
    motion = between(*recording.path.at(places[number] + np.array([0.0, sense * share * lines])))
    increment = share * interval / max(len(scan.ranges) - 1, 1)
    return replace(scan, motion=motion, time_increment=increment)


def _agreement(
    recording: Recording,
    places: Float,
    pairs: list[list[int]],
    rolled: Callable[[int], LaserScan],
) -> Float:
    """Share of the second scan of each pair (p,) that the first explains, with both unrolled."""
    explained = []
    for pair in pairs:
        check()
        before, after = (recording.converter.candidate(unrolled(rolled(k))) for k in pair)
        step = between(*recording.path.at(places[pair]))
        match = Submap([before], np.zeros((1, 3))).match(after, step, INFORMATION)
        explained.append(match.explained if match else 0.0)
    return np.array(explained)


def _uneven_pairs(poses: Float) -> list[list[int]]:
    """Pairs of scans at nearby poses (k, 3) whose turn rates differ, the most different first."""
    rates = np.gradient(poses[:, 2])
    x, y, turn = (poses[APART:] - poses[:-APART]).T
    change = np.abs(rates[APART:] - rates[:-APART])
    near = (np.hypot(x, y) < MOST_DISTANCE) & (np.abs(turn) < WIDEST) & (change > LEAST_CHANGE)
    first = np.flatnonzero(near)
    first = first[np.argsort(-change[first], kind="stable")[:MOST_PAIRS]]
    pairs: list[list[int]] = np.column_stack([first, first + APART]).tolist()
    return pairs


def longest(scans: list[LaserScan] | None) -> float:
    """The time [s] that the longest of the scans takes."""
    return max((scan.duration for scan in scans or ()), default=0.0)


SWEEP = Repair(
    "sweep",
    find,
    # Unrolled scans show other turns, so that the lag is fitted again.
    lambda recording, scans: fitted_again(replace(recording, scans=scans)),
    lambda scans: f"walls bend in turns, as a scan takes {longest(scans):.3f} s: unrolled",
    lambda scans: {"sweep": longest(scans)},
)
