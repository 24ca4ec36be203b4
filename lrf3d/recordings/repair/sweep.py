"""Sweep: how long a scan takes, from its first beam to its last, as turns of the robot show it.

A laser whose mirror turns once for each scan shows bent walls while its robot turns. Two scans at
different turn rates agree best once each is unrolled by the time that it took; that tests the time
that a log declares, and finds one that it does not. At a constant rate all scans are bent alike;
only those all around show it, as their first and last beams do not meet.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from math import copysign
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int, usual_step
from lrf3d.geometry.pose import between
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import TOO_LONG
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.lag import fitted_again
from lrf3d.recordings.repair.pairs import LEAST_COMPARED, MOST_DISTANCE, WIDEST, explained, is_clear
from lrf3d.recordings.repair.recording import Recording

# Longest revolution of a mirror [s] that is not declared: lasers that take longer are turned as a
# whole.
LONGEST = 0.25

# Number of pairs that are compared, those whose turn rates differ most. Eleven show a tenth of the
# interval between scans at ten standard errors.
MOST_PAIRS = 40

# Numbers of scans from the first to the second of a pair, in which the turn rate can change; the
# first of them with enough pairs is used, as slow lasers move too far in four scans.
APART = (4, 2, 1)

# Least difference between the turn rates of the two scans of a pair [rad per scan]; at a constant
# rate, the least rate.
LEAST_CHANGE = 0.03

# Turn between the two scans of a pair at a constant rate [rad]: far enough from 0 and from a whole
# turn for the gap between their first and last beams to lie in different directions.
CLOSING = 2.0

# Least width of a fan that closes on itself [rad].
WHOLE_FAN = 6.0

# Durations that are tried, from -1 to 1 in units of the interval between scans, then half that
# step and a quarter around the best.
STEP = 0.25


class Sweep(NamedTuple):
    """Scans with the motion during each, which take a duration [s], negative for last beams first.

    ``declared`` is the duration in the log [s], which the scans contradict; 0 if it names none.
    """

    scans: list[LaserScan]
    duration: float
    declared: float


def find(recording: Recording) -> Sweep | None:
    """The scans with the motion during each, if they agree clearly better with it."""
    scans = recording.scans
    interval = usual_step(np.array([scan.time for scan in scans]))
    declared = float(np.median([scan.duration for scan in scans]))
    # No scan takes longer than the time to the next one.
    possible = 0.0 if abs(declared) > TOO_LONG * interval > 0.0 else declared
    duration = _shown(recording, interval, possible)
    if duration == declared:
        return None
    rolled = partial(_rolled, recording, interval, duration)
    return Sweep([rolled(number) for number in range(len(scans))], duration, declared)


def _shown(recording: Recording, interval: float, declared: float) -> float:
    """The duration [s] that scans at an interval [s] show, or else the declared one."""
    log = recording.log
    if not (log.placed and interval) or log.parts or (interval > LONGEST and not declared):
        return declared
    wide = float(np.ptp(log.scans[0].angles))
    poses = recording.path.at(recording.taken_at)
    pairs = _pairs(poses, is_whole=wide > WHOLE_FAN)
    if pairs is None:
        return declared

    @cache
    def shares(duration: float) -> Float:
        scan_of = partial(_rolled, recording, interval, duration)
        return explained(recording.converter, scan_of, poses, pairs)

    # One turn of a mirror for each scan, what is declared, and no time are preferred to what is
    # hardly better.
    usual = interval * wide / (2.0 * np.pi), abs(declared), 0.0
    best = _best(shares, min(interval, LONGEST), declared, usual)
    # What is found must beat the declared duration; without a declaration it must beat scans that
    # take no time, and the opposite order of beams must be clearly worse than these.
    is_one_way = declared or is_clear(shares(0.0) - shares(-best))
    return best if is_one_way and is_clear(shares(best) - shares(declared)) else declared


def _pairs(poses: Float, *, is_whole: bool) -> Int | None:
    """Pairs of scans at poses (k, 3) that show a sweep; None if there are too few."""
    kinds: list[Callable[[Float], Int]] = [partial(_uneven_pairs, apart) for apart in APART]
    kinds += [_closing_pairs] * is_whole
    found = (pairs_of(poses) for pairs_of in kinds)
    return next((pairs for pairs in found if len(pairs) >= LEAST_COMPARED), None)


def _best(
    shares: Callable[[float], Float], unit: float, declared: float, usual: Sequence[float]
) -> float:
    """The duration [s], from minus to plus a unit, at which scans agree best; else a usual one."""

    def best_of(*durations: float) -> float:
        return max(durations, key=lambda duration: float(shares(duration).mean()))

    best = best_of(declared, *(unit * np.arange(-1.0, 1.0 + STEP, STEP)).tolist())
    for step in (STEP * unit / 2, STEP * unit / 4) if best != declared else ():
        best = best_of(best, best - step, best + step)
    for claim in (copysign(each, best) for each in usual):
        best = best if is_clear(shares(best) - shares(claim)) else claim
    return best


def _rolled(recording: Recording, interval: float, duration: float, number: int) -> LaserScan:
    """A scan with its motion in a duration [s], by the path between scans at an interval [s]."""
    scan = recording.scans[number]
    if duration == scan.duration and (not duration or scan.motion is not None):
        return scan
    if not duration:
        return replace(scan, motion=None, time_increment=0.0)
    at = recording.taken_at
    lines = duration / interval * usual_step(at)
    motion = between(*recording.path.at(at[number] + np.array([0.0, lines])))
    increment = abs(duration) / max(len(scan.ranges) - 1, 1)
    return replace(scan, motion=motion, time_increment=increment)


def _uneven_pairs(apart: int, poses: Float) -> Int:
    """Pairs of scans at nearby poses (k, 3) whose turn rates differ, the most different first."""
    rates = np.gradient(poses[:, 2])
    x, y, turn = (poses[apart:] - poses[:-apart]).T
    change = np.abs(rates[apart:] - rates[:-apart])
    near = (np.hypot(x, y) < MOST_DISTANCE) & (np.abs(turn) < WIDEST) & (change > LEAST_CHANGE)
    first = np.flatnonzero(near)
    first = first[np.argsort(-change[first], kind="stable")[:MOST_PAIRS]]
    return np.column_stack([first, first + apart])


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


def sentence(sweep: Sweep) -> str:
    """How long scans take, or what of a log is contradicted."""
    order = ", last beams first" * (sweep.duration < 0.0)
    taken = f"a scan takes {abs(sweep.duration):.3f} s{order}"
    if not sweep.declared:
        return f"walls bend in turns, as {taken}: unrolled"
    if not sweep.duration:
        contradicted = f"turns or stamps contradict the declared {sweep.declared:.3f} s of a scan"
        return f"{contradicted}: beams are taken to be of one moment"
    return f"by turns and stamps, {taken}, unlike the declared {sweep.declared:.3f} s: corrected"


SWEEP = Repair(
    "sweep",
    find,
    # Unrolled scans show other turns, so that the lag is fitted again.
    lambda recording, sweep: fitted_again(replace(recording, scans=sweep.scans)),
    sentence,
    lambda sweep: {"sweep": abs(sweep.duration) if sweep else 0.0},
)
