"""Odometry of a recording: put in order, without jumps, and by the laser's clock.

Scans and odometry lines as they were logged enter; both leave in the order in which they were
taken, each once. Then the turns between following scans, as scans show them, say how late their
stamps are, and whether the laser and the odometry count turns alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Bool, Float, Int, usual_step
from lrf3d.geometry.pose import bent, between, compose
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import unrolled
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.matching.search import Submap

# Largest step of a robot between two lines of a log [m], [rad], and its largest speed [m/s],
# [rad/s] where there is more than a second between them; all else is a jump.
FASTEST = 3.0

# Factor on the usual speed up to which a step is no jump.
FASTER = 3.0

# Least step to a corrupted line [m], [rad], and largest share of it that remains at the next line.
OUT = 0.25
BACK = 0.3

# Share of lines that must have a stamp of their own, for stamps to be of any use.
STAMPED = 0.25

# Most and least pairs of scans whose turns are found, those that turn most.
PAIRS = 200
LEAST_PAIRS = 20

# Least turn [rad] and largest distance [m] of a pair by odometry, so that much of one scan shows in
# the other. Residuals beyond the turn count linearly.
LEAST_TURN = 0.01
MOST_DISTANCE = 0.5

# Covariance of the window that is searched for the turn of a pair.
PAIR = np.diag([0.1**2, 0.1**2, 0.2**2])

# Bounds of the lag, in lines and [s], whichever is wider.
LAGS = np.array([-1.0, 2.0])
LATEST = np.array([-0.5, 0.5])

# Accept the lag, or its drift, only if the cost without it is 1.3 times higher. In logs it is by
# 1.7 and more; between two lines the noise of both cancels in part, which looks like a lag of 1.1.
# Poses that are not found but believed move only if it is 3 times higher: odometry of a second's
# interval looks early by 1.8.
SURE = 1.3
SURE_OF_POSES = 3.0

# Lag of the scans [s] that is reported: by more than that maps of fast turns are blurred.
LATE = 0.03

# Factor by which turns must fit better in another sense or unit, for the odometry to be in it.
CLEARLY = 3.0


@dataclass(frozen=True, slots=True)
class Repairs:
    """What was wrong with a recording.

    Lines out of order were sorted by their stamps, doubled ones read once, and jumps left out; a
    mirrored laser turns clockwise without saying so. Scans are late against the odometry by these
    times [s] at the beginning and at the end, and their beams sweep for a time [s].
    """

    put_in_order: bool = False
    doubled_scans: int = 0
    doubled_odometry_lines: int = 0
    odometry_jumps: int = 0
    mirrored: bool = False
    late: tuple[float, float] = (0.0, 0.0)
    sweep: float = 0.0

    def sentences(self) -> list[str]:
        """What was wrong and what was done, a sentence each; none where all was well."""
        copies = (self.doubled_scans, "scan"), (self.doubled_odometry_lines, "odometry line")
        doubled = " and ".join(counted(count, name) for count, name in copies if count)
        jumps = counted(self.odometry_jumps, "jump")
        said = {
            "the laser turns clockwise, unlike the odometry: its beams were reversed":
                self.mirrored,
            "the log is out of order: sorted by its stamps": self.put_in_order,
            f"{doubled} in the log more than once: read once": doubled,
            f"{jumps} of the odometry left out: the rest may be misplaced": self.odometry_jumps,
            late_sentence(*self.late): max(map(abs, self.late)) >= LATE,
            f"walls bend in turns, as a scan takes {self.sweep:.3f} s: unrolled": self.sweep,
        }  # fmt: skip
        return [sentence for sentence, so in said.items() if so]


@dataclass(frozen=True, eq=False, slots=True)
class Recording:
    """A recording in order: its scans (k,), each once, and the path by odometry, without jumps.

    Places (k,) are for each scan the index of the last pose before it, and rows (lines,) for each
    line of the log its row of the poses.
    """

    scans: list[LaserScan]
    path: "WheelPath"
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
    # The order of the stamps is taken where the path is shorter in it by more than this [m].
    detour = 0.5
    shorter = _length(wheels[by_stamp]) < _length(wheels[lines]) - detour
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
    most_jumps = 0.1  # Share of the lines; in other units than metres and radians all jump.
    if len(jumps) > max(most_jumps * len(lines), 2):
        raise InputError(
            f"the odometry jumps at {len(jumps)} of {len(lines)} lines, first at line"
            f" {lines[jumps[0]]}; expected poses in metres and radians, line by line"
        )
    copies = len(scans) - len(chosen), len(wheels) - len(lines)
    repairs = Repairs(sort, *copies, len(jumps))
    kept = [scans[k] for k in chosen.tolist()]
    path = WheelPath(straightened, usual_step(times[lines]) if stamped else 0.0)
    return Recording(kept, path, rows[places[chosen]], rows, repairs)


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
    x, y, turns = steps.T
    speeds = np.hypot(x, y) / time
    usual = float(np.quantile(speeds, 0.8)) if len(speeds) else 0.0
    vehicle = 15.0  # Speed of a vehicle [m/s], up to which steps are no jumps if others are alike.
    most = min(max(FASTEST, FASTER * usual), vehicle)
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
    """Odometry poses (n, 3) without lines that are out and back at once, and these lines."""
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
    # The line after one that is out seems to be out, as seen from it.
    out[1:] &= ~out[:-1]
    lines = np.flatnonzero(out) + 1
    smooth = wheels.copy()
    smooth[lines] = compose(wheels[lines - 1], 0.5 * over[lines - 1])
    return smooth, lines


class WheelPath:
    """The path of the wheels through poses (n, 3), straight between the lines of the log.

    The interval is the usual time between two lines [s], 0 if it is not known.
    """

    def __init__(self, poses: Float, interval: float = 0.0) -> None:
        self.interval = interval
        self._whole = poses.copy()
        self._whole[:, 2] = np.unwrap(poses[:, 2])

    def __len__(self) -> int:
        return len(self._whole)

    def late(self, lags: Float) -> tuple[float, float]:
        """Lags [lines] at the beginning and at the end in seconds."""
        first, last = (self.interval * lags[[0, -1]]).tolist()
        return first, last

    @property
    def stands(self) -> bool:
        """Whether the odometry never moves."""
        return not np.ptp(self._whole, axis=0).any()

    def at(self, places: NDArray[Any]) -> Float:
        """Poses (k, 3) at fractional places (k,) between the lines; headings go on over π."""
        number = np.arange(len(self._whole), dtype=np.float64)
        last = max(len(self._whole) - 1, 0)
        poses = np.column_stack([np.interp(places, number, values) for values in self._whole.T])
        if last:
            # Before the first line and after the last the robot moved as beside them.
            beyond = np.array([np.minimum(places, 0.0), np.maximum(places - last, 0.0)])
            poses += beyond.T @ np.diff(self._whole, axis=0)[[0, -1]]
        return poses

    def increments(self, places: NDArray[Any]) -> Float:
        """How the robot moved (k, 3) to each of the places (k,) from the one before."""
        poses = self.at(places)
        return np.vstack([np.zeros(3), between(poses[:-1], poses[1:])])


def turns_between(
    converter: ScanConverter, scans: Sequence[LaserScan], path: WheelPath, places: Int
) -> Float:
    """Turn (k − 1,) from each of scans (k,) to the next [rad] as they show it; NaN where unknown.

    All headings around are searched, not those near the odometry, which may count them the other
    way or in degrees.
    """
    turns = np.full(max(len(places) - 1, 0), np.nan)
    x, y, turn = path.increments(places)[1:].T
    chosen = np.flatnonzero((np.abs(turn) > LEAST_TURN) & (np.hypot(x, y) < MOST_DISTANCE))
    for number in chosen[np.argsort(-np.abs(turn[chosen]), kind="stable")][:PAIRS].tolist():
        pair = scans[number : number + 2]
        first, following = (converter.candidate(unrolled(scan)) for scan in pair)
        before = Submap([first], np.zeros((1, 3)))
        guess = np.array([x[number], y[number], 0.0])
        for match, _ in before.places(following, guess, PAIR)[:1]:
            if match.explained > 0.5:  # Minimum inlier ratio of a pair.
                *_, turns[number] = match.pose
    return turns


def is_mirrored(turns: Float, path: WheelPath, places: Int) -> bool:
    """Whether the laser turns clockwise, by the turns (k − 1,) [rad] between scans."""
    wheels = np.diff(path.at(places)[:, 2])
    known = np.isfinite(turns) & (np.abs(wheels) > LEAST_TURN)
    if known.sum() < LEAST_PAIRS:
        return False
    alike, mirrored, degrees = (
        float(np.median(np.abs(turns[known] - share * wheels[known])))
        for share in (1.0, -1.0, np.pi / 180.0)
    )
    # Scans that seem to stand still may show a bare corridor: in degrees most turns are huge [rad].
    huge = 0.5
    if CLEARLY * degrees < alike and np.quantile(np.abs(wheels), 0.9) > huge:
        raise InputError("the odometry turns in degrees, by its scans; expected radians")
    return CLEARLY * mirrored < alike


def fitted_lag(turns: Float, path: WheelPath, places: Int, sure: float = SURE) -> Float:
    """The lags (k,) [lines] at which odometry fits the turns (k − 1,) of scans; 0 if not known.

    They are the same for all scans, or grow evenly where two clocks drift.
    """
    # Of scans without a line between them odometry says nothing, whatever the lag is.
    known = np.isfinite(turns) & (np.diff(places) > 0)
    distances = np.hypot(*np.diff(path.at(places)[:, :2], axis=0).T)[known]
    progress = np.linspace(-0.5, 0.5, len(places))

    def lags(lag: float = 0.0, drift: float = 0.0) -> Float:
        return np.clip(lag + drift * progress, least, most)

    def left(values: Float) -> Float:
        by_turn, by_distance, *late = values.tolist()
        turned = np.diff(path.at(places - lags(*late))[:, 2])[known]
        return np.asarray(turns[known] - (1.0 + by_turn) * turned - by_distance * distances)

    def fit(*start: float) -> Any:
        return least_squares(left, np.array(start), loss="huber", f_scale=LEAST_TURN)

    def at(lag: float) -> Float:
        return left(np.array([0.0, 0.0, lag]))

    bounds = LATEST / (path.interval or np.inf)
    least = min(LAGS[0], bounds[0])
    most = max(LAGS[1], bounds[1])
    moved = np.abs(at(most) - at(least))
    if (moved > LEAST_TURN * np.ptp(LAGS)).sum() < LEAST_PAIRS:
        return lags()
    # With a lag, and a drift of it, beside the systematic errors of the wheels. A turn is as long
    # as the widest lag, so that the best of some is where the search begins.
    tried = np.arange(least, most, 0.5)
    first = tried[np.argmin([np.abs(at(lag)).sum() for lag in tried])]
    best = fit(0.0, 0.0)
    for start in ((0.0, 0.0, first), (0.0, 0.0, first, 0.0)):
        found = fit(*start)
        best = found if best.cost > sure * found.cost else best
    return lags(*best.x[2:])


def late_sentence(first: float, last: float) -> str:
    """How late scans are [s] at the beginning and at the end of a recording."""
    when = f"{first:.2f} s late"
    if abs(last - first) >= LATE:
        when = f"late, by {first:.2f} s at the beginning and {last:.2f} s at the end"
    elif first < 0.0:
        when = f"{-first:.2f} s early"
    return f"by their turns, scans are stamped {when}: corrected"


def line_poses(path: WheelPath, places: Int, lags: Float, scan_poses: Float) -> Float:
    """Poses (n, 3) at all odometry lines, which follow the odometry between scans.

    The pose of a line that a scan follows is that of the scan: the poses are by the clock of the
    laser, for it is the laser's measurements that they are compared with.
    """
    lines = np.arange(len(path))
    wheels = path.at(lines - np.interp(lines, places, lags))
    known, last = np.unique(places[::-1], return_index=True)
    # The difference between odometry and scans is spread by the motion, and a little by lines.
    steps = np.abs(between(wheels[:-1], wheels[1:])).sum(axis=1) + 1e-3
    return bent(wheels, known, scan_poses[::-1][last], np.concatenate([[0.0], np.cumsum(steps)]))
