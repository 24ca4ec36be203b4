"""Sweep: scans whose beams were sent one after the other, without times in the log, are unrolled.

A laser whose mirror turns once for each scan shows bent walls while its robot turns. Two scans at
different turn rates agree better once both are unrolled, and worse if they are unrolled in the
opposite sense. At a constant rate all scans are bent alike; only those all around show it, as their
first and last beams do not meet.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int, usual_step
from lrf3d.geometry.pose import between
from lrf3d.laser import LaserScan
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.judging import LEAST_PAIRS, MOST_PAIRS, WIDEST, explained, is_clear
from lrf3d.recordings.repair.lag import fitted_again
from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.turns import MOST_DISTANCE

# Longest revolution of a mirror [s]: lasers that take longer are turned as a whole.
LONGEST = 0.25

# Number of scans from the first to the second of a pair, in which the turn rate can change.
APART = 4

# Least difference between the turn rates of the two scans of a pair [rad per scan]; at a constant
# rate, the least rate.
LEAST_CHANGE = 0.03

# Turn between the two scans of a pair at a constant rate [rad]: far enough from 0 and from a whole
# turn for the gap between their first and last beams to lie in different directions.
CLOSING = 2.0

# Least width of a fan that closes on itself [rad].
WHOLE_FAN = 6.0


class Sweep(NamedTuple):
    """Scans with the motion during each, in a sense: 1 for that of the beams in the log, −1, or 0.

    If the log ``declared`` how long a scan takes, the sense differs from the declared one, 1.
    """

    scans: list[LaserScan]
    sense: int
    declared: bool


def find(recording: Recording) -> Sweep | None:
    """The scans with the motion during each, if they agree clearly better with it."""
    scans = recording.scans
    interval = usual_step(np.array([scan.time for scan in scans]))
    declared = any(scan.motion is not None for scan in scans)
    if not recording.log.placed or recording.log.parts or not 0.0 < interval <= LONGEST:
        return None
    places = recording.moments
    poses = recording.path.at(places)
    pairs = _uneven_pairs(poses)
    if len(pairs) < LEAST_PAIRS and np.ptp(scans[0].angles) > WHOLE_FAN:
        pairs = _closing_pairs(poses)
    if len(pairs) < LEAST_PAIRS:
        return None
    rolled = partial(_rolled, recording, places, interval)
    measured = partial(explained, recording.converter, poses=poses, pairs=pairs)
    shares = {sense: measured(partial(rolled, sense)) for sense in (0, 1, -1)}
    sense = max(shares, key=lambda sense: float(shares[sense].mean()))
    # What is found must beat the sense that the log declares; without a declaration it must beat
    # scans that take no time, and the opposite sense must be clearly worse than these.
    gains = [shares[sense] - shares[declared]]
    if not declared:
        gains.append(shares[0] - shares[-sense])
    if not all(map(is_clear, gains)):
        return None
    return Sweep([rolled(sense, number) for number in range(len(scans))], sense, declared)


def _rolled(
    recording: Recording, places: Float, interval: float, sense: int, number: int
) -> LaserScan:
    """A scan with its motion in a sense, for as long as declared, or a turn in an interval [s]."""
    scan = recording.scans[number]
    declared = abs(scan.duration)
    if not sense:
        return replace(scan, motion=None, time_increment=0.0) if declared else scan
    if sense > 0 and scan.motion is not None:
        return scan
    share = declared / interval or float(abs(scan.angles[-1] - scan.angles[0])) / (2.0 * np.pi)
    lines = sense * share * usual_step(places)
    motion = between(*recording.path.at(places[number] + np.array([0.0, lines])))
    increment = share * interval / max(len(scan.ranges) - 1, 1)
    return replace(scan, motion=motion, time_increment=increment)


def _uneven_pairs(poses: Float) -> Int:
    """Pairs of scans at nearby poses (k, 3) whose turn rates differ, the most different first."""
    rates = np.gradient(poses[:, 2])
    x, y, turn = (poses[APART:] - poses[:-APART]).T
    change = np.abs(rates[APART:] - rates[:-APART])
    near = (np.hypot(x, y) < MOST_DISTANCE) & (np.abs(turn) < WIDEST) & (change > LEAST_CHANGE)
    first = np.flatnonzero(near)
    first = first[np.argsort(-change[first], kind="stable")[:MOST_PAIRS]]
    return np.column_stack([first, first + APART])


def _closing_pairs(poses: Float) -> Int:
    """Pairs of scans at nearby poses (k, 3) between which the robot kept turning at one rate."""
    rates = np.abs(np.gradient(poses[:, 2]))
    first = np.flatnonzero(rates > LEAST_CHANGE)
    second = first + np.rint(CLOSING / rates[first]).astype(np.int64)
    first, second = np.array([first, second])[:, second < len(poses)]
    x, y, turn = (poses[second] - poses[first]).T
    near = (np.hypot(x, y) < MOST_DISTANCE) & (np.abs(np.abs(turn) - CLOSING) < 0.5 * WIDEST)
    pairs: Int = np.column_stack([first, second])[near]
    return pairs[:: len(pairs) // MOST_PAIRS + 1]


def longest(sweep: Sweep | None) -> float:
    """The time [s] that the longest of the scans takes."""
    return max((scan.duration for scan in sweep.scans), default=0.0) if sweep else 0.0


def sentence(sweep: Sweep) -> str:
    """How long scans take, or what of a log is contradicted."""
    if not sweep.declared:
        return f"walls bend in turns, as a scan takes {longest(sweep):.3f} s: unrolled"
    found = "beams go out last first" if sweep.sense else "all beams are of one moment"
    return f"walls bend in turns by the declared times of beams: {found}"


SWEEP = Repair(
    "sweep",
    find,
    # Unrolled scans show other turns, so that the lag is fitted again.
    lambda recording, sweep: fitted_again(replace(recording, scans=sweep.scans)),
    sentence,
    lambda sweep: {"sweep": longest(sweep)},
)
