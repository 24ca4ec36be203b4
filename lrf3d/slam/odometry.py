"""Odometry of a recording: put in order, without jumps, and by the laser's clock.

Scans and odometry lines as they were logged enter; both leave in the order in which they were
taken, each once. Then the turns between following scans, as scans show them, say how far the
laser's clock is behind, and whether the laser and the odometry count turns alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, wrap_angle
from lrf3d.laser import LaserScan
from lrf3d.pose import bent, between, compose
from lrf3d.slam.key_scans import Key
from lrf3d.slam.search import field_of, search
from lrf3d.slam.surface import grid_of
from lrf3d.text import counted

FASTEST, FASTEST_TURN = 3.0, 3.0
"""A robot that moves farther [m] or turns more [rad] between two lines of a log has jumped, or in a
second [m/s], [rad/s] where there is more time between them."""

FASTER, VEHICLE = 3.0, 15.0
"""Yet as many times the usual speed are no jump, up to that of a vehicle [m/s]."""

SHORTER = 0.5
"""The order of the stamps is taken where the path is shorter in it by this [m]."""

OUT, BACK = 0.25, 0.3
"""A line is out and back where the step to it is larger than the first [m], [rad], and what is left
of it at the next line is less than the second, as a share: it was corrupted on its way."""

MOST_JUMPS = 0.1
"""Share of lines that may jump: in other units than metres and radians they do so everywhere."""

STAMPED = 0.25
"""Share of lines that must have a stamp of their own, for stamps to be of any use."""

PAIRS, LEAST_PAIRS = 200, 20
"""Pairs of scans whose turns are found, those that turn most; with fewer than the second, what they
would show is not known."""

LEAST_TURN, MOST_DISTANCE = 0.01, 0.5
"""A pair counts where odometry turns by more than the first [rad] and moves by less than the second
[m], so that much of one scan shows in the other."""

PAIR = np.diag([0.1**2, 0.1**2, 0.2**2])
"""Covariance of the window that is searched for the turn of a pair."""

LEAST_EXPLAINED = 0.5
"""Share of a scan that the other one of its pair must explain."""

LAGS = -1.0, 2.0
"""The least and the largest lag that are believed, in lines."""

SURE = 1.3
"""A lag is believed if without it the cost is higher by this factor. In logs it is by 1.7 and more;
between two lines the noise of both cancels in part, which looks like a lag of 1.1."""

CLEARLY = 3.0
"""Factor by which turns must fit better in another sense or unit, for the odometry to be in it."""

HUGE = 0.5
"""Turn between two scans [rad] that is rarely seen, but where odometry is in degrees."""

STILL = 1e-3
"""Length [m] that is added to the motion at each line, so that no line has none."""

HUBER = 0.01
"""Residuals beyond this [rad] count linearly."""


@dataclass(frozen=True, slots=True)
class Repairs:
    """What was wrong with a recording.

    Lines out of order were sorted by their stamps, doubled ones read once, and jumps left out; a
    mirrored laser turns clockwise without saying so.
    """

    put_in_order: bool = False
    doubled_scans: int = 0
    doubled_odometry_lines: int = 0
    odometry_jumps: int = 0
    mirrored: bool = False

    def sentences(self) -> list[str]:
        """What was wrong and what was done, a sentence each; none where all was well."""
        said = []
        if self.mirrored:
            said.append("the laser turns clockwise, unlike the odometry: its beams were reversed")
        if self.put_in_order:
            said.append("the log is out of order: sorted by its stamps")
        copies = (self.doubled_scans, "scan"), (self.doubled_odometry_lines, "odometry line")
        if doubled := " and ".join(counted(count, name) for count, name in copies if count):
            said.append(f"{doubled} in the log more than once: read once")
        if self.odometry_jumps:
            jumps = counted(self.odometry_jumps, "jump")
            said.append(f"{jumps} of the odometry left out: the rest may be misplaced")
        return said


@dataclass(frozen=True, eq=False, slots=True)
class Recording:
    """A recording in order: its scans (k,), each once, and poses (n, 3) by odometry, without jumps.

    Places (k,) are for each scan the index of the last pose before it, and rows (lines,) for each
    line of the log its row of the poses.
    """

    scans: list[LaserScan]
    wheels: Float
    places: Int
    rows: Int
    repairs: Repairs


def in_order(scans: Sequence[LaserScan], wheels: Float, times: Float, places: Int) -> Recording:
    """A recording, given as to `solve_log`, in order; refused where its odometry jumps often."""
    # Without stamps of their own lines that are alike are no copies.
    stamped = len(np.unique(times)) >= STAMPED * len(times)
    table = np.column_stack([times, wheels]) if stamped else np.arange(len(wheels))[:, None]
    _, first, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
    lines = np.sort(first)
    by_stamp = lines[np.argsort(times[lines], kind="stable")]
    shorter = _length(wheels[by_stamp]) < _length(wheels[lines]) - SHORTER
    sort = bool(shorter or 2 * (np.diff(times[lines]) < 0.0).sum() > max(len(lines) - 1, 1))
    if sort:
        lines = by_stamp
    rank = np.empty(len(wheels), np.int64)
    rank[lines] = np.arange(len(lines))
    rows = rank[first[group.reshape(-1)]]
    # Of scans with the same stamp and ranges the first one counts.
    whole = {(scan.time, scan.ranges.tobytes()): -k for k, scan in enumerate(reversed(scans), 1)}
    chosen = len(scans) + np.sort(np.array(list(whole.values())))
    if sort:
        stamps = np.array([scan.time for scan in scans])
        chosen = chosen[np.lexsort([stamps[chosen], rows[places[chosen]]])]
    straightened, jumps = without_jumps(wheels[lines], times[lines])
    if len(jumps) > max(MOST_JUMPS * len(lines), 2):
        raise InputError(
            f"the odometry jumps at {len(jumps)} of {len(lines)} lines, first at line"
            f" {lines[jumps[0]]}; expected poses in metres and radians, line by line"
        )
    copies = len(scans) - len(chosen), len(wheels) - len(lines)
    repairs = Repairs(sort, *copies, len(jumps))
    kept = [scans[k] for k in chosen.tolist()]
    return Recording(kept, straightened, rows[places[chosen]], rows, repairs)


def _length(wheels: Float) -> float:
    """Length of the path through poses (n, 3) [m]."""
    return float(np.hypot(*np.diff(wheels[:, :2], axis=0).T).sum())


def without_jumps(wheels: Float, times: Float) -> tuple[Float, Int]:
    """Odometry poses (n, 3) without jumps, by motions as around them, and the lines of these."""
    times = times.copy()
    # A stamp outside of those around it is wrong, too.
    times[1:-1] = np.median([times[:-2], times[1:-1], times[2:]], axis=0)
    wheels, out = _without_outliers(wheels, times)
    steps = between(wheels[:-1], wheels[1:])
    time = np.maximum(np.diff(times), 1.0)
    speeds = np.hypot(steps[:, 0], steps[:, 1]) / time
    usual = float(np.quantile(speeds, 0.8)) if len(speeds) else 0.0
    jumped: Bool = speeds > min(max(FASTEST, FASTER * usual), VEHICLE)
    jumped |= np.abs(steps[:, 2]) > FASTEST_TURN * time
    if not jumped.any():
        return wheels, out
    good, number = np.flatnonzero(~jumped), np.arange(len(steps), dtype=np.float64)
    for axis in range(3):
        around = np.interp(number, good, steps[good, axis]) if len(good) else np.zeros(len(steps))
        steps[jumped, axis] = around[jumped]
    smooth = wheels.copy()
    for line in np.flatnonzero(jumped):
        after = compose(smooth[line], steps[line])
        smooth[line + 1 :] = compose(after, between(wheels[line + 1], wheels[line + 1 :]))
    smooth[:, 2] = wrap_angle(smooth[:, 2])
    return smooth, np.union1d(out, np.flatnonzero(jumped) + 1)


def _without_outliers(wheels: Float, times: Float) -> tuple[Float, Int]:
    """Odometry poses (n, 3) without lines that are out and back at once, and these lines."""
    usual = float(np.ptp(times)) / len(times) or 1.0
    gaps = np.maximum(np.diff(times), usual)
    into, over = between(wheels[:-2], wheels[1:-1]), between(wheels[:-2], wheels[2:])
    away, left = (
        np.array([np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])]) for step in (into, over)
    )
    least = np.maximum(np.array([[FASTEST], [FASTEST_TURN]]) * np.minimum(gaps[:-1], gaps[1:]), OUT)
    out: Bool = ((away > least) & (left < BACK * away)).any(axis=0)
    # The line after one that is out seems to be out, as seen from it.
    out[1:] &= ~out[:-1]
    lines, smooth = np.flatnonzero(out) + 1, wheels.copy()
    smooth[lines] = compose(wheels[lines - 1], 0.5 * over[lines - 1])
    return smooth, lines


class WheelPath:
    """The path of the wheels through poses (n, 3), straight between the lines of the log."""

    def __init__(self, poses: Float) -> None:
        self._whole = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])

    def __len__(self) -> int:
        return len(self._whole)

    def at(self, places: NDArray[np.floating[Any]]) -> Float:
        """Poses (k, 3) at fractional places (k,) between the lines; headings go on over π."""
        number = np.arange(len(self._whole), dtype=np.float64)
        return np.column_stack([np.interp(places, number, values) for values in self._whole.T])

    def increments(self, places: NDArray[np.floating[Any]]) -> Float:
        """How the robot moved (k, 3) to each of the places (k,) from the one before."""
        poses = self.at(places)
        return np.vstack([np.zeros(3), between(poses[:-1], poses[1:])])


def turns_between(seen: Callable[[int], Key], path: WheelPath, places: Int) -> Float:
    """Turn (k − 1,) from each scan to the next [rad] as the scans show it; NaN where unknown.

    All headings around are searched, not those near the odometry, which may count them the other
    way or in degrees. ``seen(number)`` is what a scan saw.
    """
    turns = np.full(max(len(places) - 1, 0), np.nan)
    steps = path.increments(places.astype(np.float64))[1:]
    distances, sizes = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    chosen = np.flatnonzero((sizes > LEAST_TURN) & (distances < MOST_DISTANCE))
    for number in chosen[np.argsort(-sizes[chosen], kind="stable")][:PAIRS].tolist():
        before = seen(number)
        if not len(before.walls):
            continue
        guess, field = np.array([*steps[number, :2], 0.0]), field_of([before], np.zeros((1, 3)))
        places_found = search(seen(number + 1), grid_of(before.walls), field, guess, PAIR)
        if places_found and places_found[0].explained > LEAST_EXPLAINED:
            turns[number] = places_found[0].pose[2]
    return turns


def is_mirrored(turns: Float, path: WheelPath, places: Int) -> bool:
    """Whether the laser turns clockwise, by the turns (k − 1,) [rad] between scans."""
    wheels = np.diff(path.at(places.astype(np.float64))[:, 2])
    known = np.isfinite(turns) & (np.abs(wheels) > LEAST_TURN)
    if known.sum() < LEAST_PAIRS:
        return False
    alike, mirrored, degrees = (
        float(np.median(np.abs(turns[known] - share * wheels[known])))
        for share in (1.0, -1.0, np.pi / 180.0)
    )
    # Scans that seem to stand still may show a bare corridor: in degrees most turns are huge.
    if CLEARLY * degrees < alike and np.quantile(np.abs(wheels), 0.9) > HUGE:
        raise InputError("the odometry turns in degrees, by its scans; expected radians")
    return CLEARLY * mirrored < alike


def fitted_lag(turns: Float, path: WheelPath, places: Int) -> float:
    """The lag [lines] at which odometry fits the turns (k − 1,) of scans; 0 if it is not known."""
    # Of scans without a line between them odometry says nothing, whatever the lag is.
    known = np.isfinite(turns) & (np.diff(places) > 0)
    distances = np.hypot(*np.diff(path.at(places.astype(np.float64))[:, :2], axis=0).T)[known]

    def left(free: Float) -> Float:
        lag, by_turn, by_distance = free
        turned = np.diff(path.at(places - lag)[:, 2])[known]
        return np.asarray(turns[known] - (1.0 + by_turn) * turned - by_distance * distances)

    moved = np.abs(left(np.array([LAGS[1], 0.0, 0.0])) - left(np.array([LAGS[0], 0.0, 0.0])))
    if (moved > LEAST_TURN * (LAGS[1] - LAGS[0])).sum() < LEAST_PAIRS:
        return 0.0
    # What is left once the systematic errors of the wheels are out, with the lag and without it.
    with_lag = least_squares(left, np.zeros(3), loss="huber", f_scale=HUBER)

    def left_at_once(biases: Float) -> Float:
        return left(np.append(0.0, biases))

    without = least_squares(left_at_once, np.zeros(2), loss="huber", f_scale=HUBER)
    lag = float(np.clip(with_lag.x[0], *LAGS))
    return lag if without.cost > SURE * with_lag.cost else 0.0


def line_poses(path: WheelPath, places: Int, lag: float, scan_poses: Float) -> Float:
    """Poses (n, 3) at all odometry lines, which follow the odometry between scans.

    The pose of a line that a scan follows is that of the scan: the poses are by the clock of the
    laser, for it is the laser's measurements that they are compared with.
    """
    wheels = path.at(np.arange(float(len(path))) - lag)
    known, last = np.unique(places[::-1], return_index=True)
    # What is left between odometry and scans is spread by how far the robot moved and turned.
    steps = np.abs(between(wheels[:-1], wheels[1:])).sum(axis=1) + STILL
    return bent(wheels, known, scan_poses[::-1][last], np.concatenate([[0.0], np.cumsum(steps)]))
