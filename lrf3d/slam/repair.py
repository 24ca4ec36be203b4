"""Recordings that are not as they should be: put in order before they are solved, and reported.

Scans and odometry lines as they were logged enter; both leave in the order in which they were
taken, each once, with what was wrong. Lines that stand twice are read once. Where the way is
shorter in the order of the stamps than in that of the log, the log is out of order. Where the robot
cannot have moved so fast the odometry has jumped, and goes on as it went before and after.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, wrap_angle
from lrf3d.laser import LaserScan
from lrf3d.slam.frames import between, compose
from lrf3d.text import counted

FASTEST, FASTEST_TURN = 3.0, 3.0
"""A robot that moves farther [m] or turns more [rad] between two lines of a log has jumped, or in a
second [m/s], [rad/s] where there is more time between them."""

FASTER, VEHICLE = 3.0, 15.0
"""Yet as many times the usual speed are no jump, up to that of a vehicle [m/s]."""

SHORTER = 0.5
"""The order of the stamps is taken where the way in it is shorter by this [m]."""

GAP = 2.0
"""Time [s] between two lines from which on something is missing, if the robot has moved."""

MOVED = 0.5
"""Way [m] or turn [rad] that counts as moved."""

FEW_SCANS = 10
"""More scans than this in a row without an odometry line between them are placed by scan matching
alone; fewer come where scans are more frequent than lines."""

MOST_JUMPS = 0.1
"""Share of lines that may jump: in other units than metres and radians they do so everywhere."""

NAMED = 5
"""Lines that a sentence names at most."""

STAMPED = 0.25
"""Share of lines that must have a stamp of their own, for stamps to be of any use."""


@dataclass(frozen=True, slots=True)
class Repairs:
    """What was wrong with a recording.

    Args:
        put_in_order: Whether the lines were out of order, and were sorted by their stamps.
        doubled_scans: How many scans stand in the log more than once, and were read once.
        doubled_lines: The same of odometry lines.
        jumps: Numbers of the lines to which the odometry jumped, which is not believed.
        gaps: Numbers of the lines before which some seconds are missing, in which the robot moved.
        scans_without_odometry: How many scans follow each other without a line of odometry.
        stamps_not_rising: How many scans have a stamp that is no later than the one before.
    """

    put_in_order: bool = False
    doubled_scans: int = 0
    doubled_lines: int = 0
    jumps: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    scans_without_odometry: int = 0
    stamps_not_rising: int = 0

    def sentences(self) -> list[str]:
        """What was wrong and what was done, a sentence each; none where all was well."""
        said = []
        if self.put_in_order:
            said.append("the log is out of order: sorted by its stamps")
        copies = [(self.doubled_scans, "scan"), (self.doubled_lines, "odometry line")]
        if doubled := " and ".join(counted(count, name) for count, name in copies if count):
            said.append(f"{doubled} in the log more than once: read once")
        if self.stamps_not_rising:
            said.append(f"{counted(self.stamps_not_rising, 'stamp')} went backwards: order kept")
        if self.jumps:
            jumps = f"{counted(len(self.jumps), 'jump')} of the odometry at {_lines(self.jumps)}"
            said.append(f"{jumps}: left out; if the robot was moved there, the rest is misplaced")
        if self.gaps:
            gaps = f"{counted(len(self.gaps), 'gap')} in the recording at {_lines(self.gaps)}"
            said.append(f"{gaps}: bridged by the odometry, the rest may be misplaced")
        if self.scans_without_odometry:
            scans = counted(self.scans_without_odometry, "scan")
            said.append(f"{scans} without odometry: placed by scan matching alone, may be wrong")
        return said


def _lines(numbers: tuple[int, ...]) -> str:
    """The first few of the numbers of lines, in words."""
    named = ", ".join(map(str, numbers[:NAMED]))
    return f"line{'s' if len(numbers) > 1 else ''} {named}{' …' if len(numbers) > NAMED else ''}"


@dataclass(frozen=True, eq=False, slots=True)
class Repaired:
    """A recording in order.

    Args:
        scans: The scans (k,), each once.
        wheels: (n, 3) poses by odometry, without jumps.
        places: (k,) for each scan the index of the last of these poses before it.
        rows: (lines,) for each line of the log its row of the poses.
        repairs: What was wrong.
    """

    scans: list[LaserScan]
    wheels: Float
    places: Int
    rows: Int
    repairs: Repairs


def repaired(scans: Sequence[LaserScan], wheels: Float, times: Float, places: Int) -> Repaired:
    """Put a recording in order.

    Args:
        scans: The scans as logged.
        wheels: (lines, 3) poses by odometry, line by line.
        times: (lines,) their stamps [s].
        places: For each scan the index of the last line before it.

    Raises:
        InputError: The odometry jumps so often that it is none.
    """
    lines, rows = _each_once(wheels, times)
    in_stamps_order = lines[np.argsort(times[lines], kind="stable")]
    backwards = np.diff(times[lines]) < 0.0
    shorter = _way(wheels[in_stamps_order]) < _way(wheels[lines]) - SHORTER
    put_in_order = bool(shorter or 2 * backwards.sum() > max(len(backwards), 1))
    if put_in_order:
        rank = np.empty(len(wheels), np.int64)
        rank[in_stamps_order] = np.arange(len(lines))
        rows, lines = rank[lines[rows]], in_stamps_order
    chosen, stamps = _scans_once(scans), np.array([scan.time for scan in scans])
    found = rows[places[chosen]]
    if put_in_order:
        order = np.lexsort([stamps[chosen], found])
        chosen, found = chosen[order], found[order]
    mended, jumps = without_jumps(wheels[lines], times[lines])
    if len(jumps) > max(MOST_JUMPS * len(lines), 2):
        raise InputError(
            f"slam: the odometry jumps at {len(jumps)} of {len(lines)} lines, first at line"
            f" {lines[jumps[0]]}; expected poses in metres and radians, line by line"
        )
    known = np.setdiff1d(_gaps(wheels[lines], times[lines]), jumps)
    repairs = Repairs(
        put_in_order,
        len(scans) - len(chosen),
        len(wheels) - len(lines),
        tuple(lines[list(jumps)].tolist()),
        tuple(lines[known].tolist()),
        _without_odometry(found),
        rising(stamps[chosen])[1],
    )
    return Repaired([scans[k] for k in chosen.tolist()], mended, found, rows, repairs)


def _each_once(wheels: Float, times: Float) -> tuple[Int, Int]:
    """The lines (n,) that are not copies of earlier ones, and for each line its row of them."""
    every = np.arange(len(wheels))
    if len(np.unique(times)) < STAMPED * len(times):
        return every, every
    table = np.column_stack([times, wheels])
    _, first, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
    lines = np.sort(first)
    return lines, np.asarray(np.searchsorted(lines, first[group.reshape(-1)]))


def _scans_once(scans: Sequence[LaserScan]) -> Int:
    """The numbers of the scans that are not copies of earlier ones: same stamp, same ranges."""
    seen: set[tuple[float, bytes]] = set()
    chosen = []
    for number, scan in enumerate(scans):
        key = scan.time, scan.ranges.tobytes()
        if key not in seen:
            seen.add(key)
            chosen.append(number)
    return np.array(chosen, dtype=np.int64)


def _way(wheels: Float) -> float:
    """Length of the way through poses (n, 3) [m]."""
    steps = np.diff(wheels[:, :2], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def without_jumps(wheels: Float, times: Float | None = None) -> tuple[Float, tuple[int, ...]]:
    """Odometry poses (n, 3) without jumps, and the numbers of the lines where they were.

    Where it jumped, the robot is taken to move as it did around that line.

    Args:
        wheels: (n, 3) the poses.
        times: (n,) their stamps [s]; if not given, no time passes between two lines.
    """
    steps = between(wheels[:-1], wheels[1:])
    time = np.maximum(np.diff(times), 1.0) if times is not None else np.ones(len(steps))
    speeds = np.hypot(steps[:, 0], steps[:, 1]) / time
    usual_speed = float(np.quantile(speeds, 0.8)) if len(speeds) else 0.0
    jumped: Bool = speeds > min(max(FASTEST, FASTER * usual_speed), VEHICLE)
    jumped |= np.abs(steps[:, 2]) > FASTEST_TURN * time
    if not jumped.any():
        return wheels, ()
    good = np.flatnonzero(~jumped)
    number = np.arange(len(steps), dtype=np.float64)
    for axis in range(3):
        usual = np.interp(number, good, steps[good, axis]) if len(good) else np.zeros(len(steps))
        steps[jumped, axis] = usual[jumped]
    mended = wheels.copy()
    for line in np.flatnonzero(jumped):
        next_pose = compose(mended[line], steps[line])
        mended[line + 1 :] = compose(next_pose, between(wheels[line + 1], wheels[line + 1 :]))
    mended[:, 2] = wrap_angle(mended[:, 2])
    return mended, tuple((np.flatnonzero(jumped) + 1).tolist())


def _gaps(wheels: Float, times: Float) -> Int:
    """The lines before which some time is missing in which the robot moved."""
    steps = between(wheels[:-1], wheels[1:])
    moved = np.maximum(np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])) > MOVED
    return np.flatnonzero(moved & (np.diff(times) > GAP)) + 1


def _without_odometry(places: Int) -> int:
    """How many scans stand in rows of many without a line of odometry between them."""
    _, counts = np.unique(places, return_counts=True)
    return int((counts[counts > FEW_SCANS] - 1).sum())


def rising(stamps: Float) -> tuple[Float, int]:
    """Stamps (k,) [s] as times that rise, and how many of them do not.

    A stamp that is no later than one before it is taken to lie evenly between those around it.
    """
    latest = np.maximum.accumulate(stamps)
    good = np.concatenate([[True], np.diff(latest) > 0.0])
    steps = np.diff(stamps)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    knots = np.flatnonzero(good)
    number = np.arange(len(stamps), dtype=np.float64)
    times = np.interp(number, knots, latest[knots])
    times[knots[-1] :] = latest[knots[-1]] + usual * (number[knots[-1] :] - knots[-1])
    return times, int((steps <= 0.0).sum())
