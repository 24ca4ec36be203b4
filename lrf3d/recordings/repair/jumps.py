"""Jumps: leaps of the odometry, and lines out and back, are replaced by the motion around them.

Odometry that never moves is treated as missing.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.geometry.pose import between, compose
from lrf3d.recordings.repair import Applied, Repair
from lrf3d.recordings.repair.recording import Recording

# Largest step of a robot between two odometry lines [m], [rad], or its largest speed [m/s], [rad/s]
# where they are more than a second apart; anything more is a jump.
FASTEST = 3.0

# Factor on the usual speed up to which a step is no jump.
FASTER = 3.0

# Speed of a vehicle [m/s]: the limit for jumps, which rises with the usual speed, stays below it.
VEHICLE = 15.0

# Least step to a corrupted line [m], [rad].
OUT = 0.25

# Largest share of that step that may remain at the next line, which is back.
BACK = 0.3

# Largest share of lines that may be jumps: in units other than metres and radians, all are.
MOST_JUMPS = 0.1


class Jumps(NamedTuple):
    """Poses (n, 3) without jumps, and how many jumps there were."""

    poses: Float
    number: int


def find(recording: Recording) -> Jumps | None:
    """Jumps of the odometry; raises InputError if there are too many."""
    poses, jumps = without_jumps(recording.poses, recording.times)
    if len(jumps) > max(MOST_JUMPS * len(poses), 2):
        first = int(np.flatnonzero(recording.rows == jumps[0])[0])
        raise InputError(
            f"the odometry jumps at {len(jumps)} of {len(poses)} lines, first at line {first};"
            " expected poses in metres and radians, line by line"
        )
    return Jumps(poses, len(jumps)) if len(jumps) else None


def without_jumps(wheels: Float, times: Float) -> tuple[Float, Int]:
    """Odometry poses (n, 3) with the usual motion in place of jumps, and the lines of the jumps."""
    times = times.copy()
    # A stamp that does not lie between its neighbours is wrong, too.
    times[1:-1] = np.median([times[:-2], times[1:-1], times[2:]], axis=0)
    wheels, out = _without_outliers(wheels, times)
    steps = between(wheels[:-1], wheels[1:])
    time = np.maximum(np.diff(times), 1.0)
    x, y, turns = steps.T
    speeds = np.hypot(x, y) / time
    usual = float(np.quantile(speeds, 0.8)) if len(speeds) else 0.0
    most = min(max(FASTEST, FASTER * usual), VEHICLE)
    jumped = np.asarray((speeds > most) | (np.abs(turns) > FASTEST * time))
    good = np.flatnonzero(~jumped)
    number = np.arange(len(steps), dtype=np.float64)
    smooth = wheels.copy()
    for line in np.flatnonzero(jumped):
        usual_step = [np.interp(number[line], good, each[good]) for each in steps.T if len(good)]
        after = compose(smooth[line], np.array(usual_step or np.zeros(3)))
        smooth[line + 1 :] = compose(after, between(wheels[line + 1], wheels[line + 1 :]))
    return smooth, np.union1d(out, np.flatnonzero(jumped) + 1)


def _without_outliers(wheels: Float, times: Float) -> tuple[Float, Int]:
    """Odometry poses (n, 3) with lines that leap out and back corrected, and these lines."""
    if len(wheels) < 3:
        return wheels, np.empty(0, np.int64)
    interval = float(np.ptp(times)) / len(times) or 1.0
    gaps = np.maximum(np.diff(times), interval)
    over = between(wheels[:-2], wheels[2:])
    steps, left = (
        np.array([np.hypot(x, y), np.abs(turn)])
        for x, y, turn in (between(wheels[:-1], wheels[1:]).T, over.T)
    )
    fastest = np.minimum(FASTER * np.quantile(steps / gaps, 0.9, axis=1), FASTEST)[:, None]
    away = steps[:, :-1]
    least = np.maximum(fastest * np.minimum(gaps[:-1], gaps[1:]), OUT)
    out: Bool = np.asarray(((away > least) & (left < BACK * away)).any(axis=0))
    # Between two lines that are out, a good line seems to go out and back, too.
    out[1:] &= ~out[:-1]
    lines = np.flatnonzero(out) + 1
    smooth = wheels.copy()
    smooth[lines] = compose(wheels[lines - 1], 0.5 * over[lines - 1])
    return smooth, lines


JUMPS = Repair(
    "jumps",
    find,
    lambda recording, jumps: replace(recording, poses=jumps.poses),
    lambda jumps: (
        f"{counted(jumps.number, 'jump')} of the odometry left out: the rest may be misplaced"
    ),
    lambda jumps: {"odometry_jumps": jumps.number if jumps else 0},
)


STANDING = Repair(
    "standing",
    lambda recording: recording.path.stands or None,
    lambda recording, _: replace(recording, log=replace(recording.log, placed=False)),
)


def with_more_jumps(recording: Recording, poses: Float, doubted: Sequence[int]) -> Recording:
    """The recording with the jumps before doubted scans, of all at poses (k, 3), added to its own.

    Such a step is a jump if it differs from that of the scans by as much as a corrupted line does.
    """
    increments = recording.path.increments(recording.taken_at)
    slips = [between(increments[k], between(poses[k - 1], poses[k])) for k in doubted]
    number = sum(bool(max(np.hypot(x, y), abs(turn)) > OUT) for x, y, turn in slips)
    number += recording.found[JUMPS.name].finding.number if JUMPS.name in recording.found else 0
    jumps = {JUMPS.name: Applied(JUMPS, Jumps(recording.poses, number))}
    return replace(recording, found={**recording.found, **jumps}) if number else recording
