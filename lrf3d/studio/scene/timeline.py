"""Timeline: where the robot stands and which scan is seen at each time of a film."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry.lines import Bool, Float, wrap_angle
from lrf3d.planning.planner import planned_way
from lrf3d.robot import Trajectory
from lrf3d.studio.scene.look import TINY
from lrf3d.studio.scene.shown import ScanPath, Shown
from lrf3d.studio.scene.stage.structures import Sight

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle

# Time for which a film shows the first scan [s of the film].
FIRST = 3.4

# Share of the time between two stops that the robot stands and scans.
_STANDING = 0.5

# Distance that takes as long as a turn by one radian [m].
_TURNING = 0.8

# Turn that takes as long as a robot stands before it goes on [rad].
_PAUSE = 0.05

# Time between scans from which on they are stops and not a drive [s].
_STOP_GAP = 1.0

# Speed above which a robot was set down elsewhere [m/s].
_FASTEST = 1000.0

# Half the time over which the speed is measured [s]: shorter shows the joints of the path.
_SPEED_STEP = 0.05

# Difference of times that are the same but for rounding [s], and part of a frame that it may lack.
_ROUNDING = 1e-6

# Largest error of a path with fewer keys [m].
_THINNED = 0.005


@dataclass(frozen=True, slots=True)
class Moment:
    """The state of a run at one time.

    Args:
        time: The time in the run [s].
        pose: (3,) the robot's pose in the world.
        scan: Number of the newest scan.
        speed: Speed of the robot [m/s].
        scanning: Whether the beams are on.
        now: The time asked for [s], also before the start and after the end, where nothing moves.
    """

    time: float
    pose: Float
    scan: int
    speed: float
    scanning: bool
    now: float

    @property
    def mapped(self) -> int:
        """The newest scan that the map may be of; −1 before the start."""
        return self.scan if self.now > self.time - _ROUNDING else -1


class Timeline:
    """The run as a function of time.

    A run of single stops, such as the paper's three poses, is played as stops: the robot stands
    with the beams on, then turns, drives to the next pose with the beams off, and turns again.
    Where a wall stands between it goes round, or is set down there if it cannot.

    Args:
        run: The run, or a drive that goes on.
        playback: Seconds of the run in a second of the film; the run's own if not given.

    Attributes:
        run: The run, or a drive that goes on.
        origin: (2,) where the origin of the film's frame lies in the world [m].
    """

    def __init__(self, run: Shown, *, playback: float | None = None) -> None:
        self.run = run
        self.playback = run.playback if playback is None else playback
        self.origin = Sight.of(run.world, run.trajectory.poses[:, :2]).origin
        times = run.trajectory.times
        gaps = np.diff(times)
        gap = float(np.median(gaps)) if len(gaps) else np.inf
        self.dwells = gap > _STOP_GAP
        self.start = float(times.min())
        self.end = float(times.max())
        # What the robot is shown to drive.
        self.drive: ScanPath = run.trajectory
        if self.dwells:
            # The last stop is shown as long as the others.
            self.end += _STANDING * (gap if len(gaps) else _STOP_GAP)
            self.drive = _drive_between_stops(run)

    def frame_times(self, fps: float, margin: float = 0.0) -> Float:
        """Times (frames,) of the run [s] that a film shows, first to last, at least one.

        Args:
            fps: Frames a second.
            margin: How long the film goes on after the run [s of the film]; there the run stands
                still, and only the camera moves.
        """
        step = self.playback / fps
        last = np.floor((self.end - self.start) / step + margin * fps + _ROUNDING)
        return self.start + step * np.arange(last + 1.0)

    def poses(self, times: Float) -> Float:
        """Poses (m, 3) of the robot at times (m,) [s]."""
        return self.drive.at(times)

    def moment(self, time: float) -> Moment:
        """What is to be seen at a time [s]; before the start it is the start, and so at the end."""
        times = self.run.trajectory.times
        now = time
        time = min(max(time, self.start), self.end)
        scan = max(int(np.searchsorted(times, time + _ROUNDING, side="right")) - 1, 0)
        before, pose, after = self.poses(time + _SPEED_STEP * np.array([-1.0, 0.0, 1.0]))
        until = times[scan + 1 : scan + 2] - times[scan]
        scanning = not (self.dwells and bool((time - times[scan] > _STANDING * until).any()))
        scanning &= now >= self.start - _ROUNDING
        step = 0.0 if self.dwells else float(np.hypot(*(after - before)[:2]))
        return Moment(float(time), pose, scan, step / (2.0 * _SPEED_STEP), scanning, float(now))


@lru_cache(1)
def _drive_between_stops(run: Shown) -> Trajectory:
    """A drive through the poses of a run, from each to the next as a unicycle drives."""
    stops = run.trajectory
    legs = shapely.linestrings(np.stack([stops.poses[:-1, :2], stops.poses[1:, :2]], axis=1))
    walls = shapely.STRtree(shapely.linestrings(run.world.segments.reshape(-1, 2, 2)))
    through, _ = walls.query(legs, predicate="intersects")
    times = [stops.times[:1]]
    poses = [stops.poses[:1]]
    for leg, (start, end) in enumerate(pairwise(stops.poses)):
        places = np.array([start[:2], end[:2]])
        planned = leg in through and run.knows_truth
        way = planned_way(run.world, start[:2], end[:2], run.radius) if planned else None
        if way is not None:
            far = np.hypot(*(way[:, None] - places).T).min(axis=0) > run.radius
            places = np.concatenate([places[:1], way[far], places[1:]])
        steps = np.diff(places, axis=0)
        headings = np.array([start[2], *np.arctan2(steps[:, 1], steps[:, 0]), end[2]])
        # It turns at each place, and goes from there to the next.
        costs = np.empty(2 * len(steps) + 1)
        costs[::2] = _TURNING * (_PAUSE + np.abs(wrap_angle(np.diff(headings))))
        costs[1::2] = np.hypot(*steps.T) * (TINY if leg in through and way is None else 1.0)
        shares = np.append(0.0, np.cumsum(costs) / costs.sum())
        begin, stop = stops.times[leg : leg + 2]
        times.append(begin + (stop - begin) * (_STANDING + (1.0 - _STANDING) * shares))
        poses.append(np.column_stack([places.repeat(2, axis=0), headings.repeat(2)[1:-1]]))
    every, first = np.unique(np.concatenate(times), return_index=True)
    return Trajectory(every, np.concatenate(poses)[first])


def lasting(seconds: float) -> str:
    """A time [s] in words; ten minutes and more are said in minutes."""
    return f"{seconds:.0f} s" if seconds < 600.0 else f"{seconds / 60.0:.0f} min"


def metres(length: float) -> str:
    """A length in words, in centimetres below a metre."""
    return f"{length:.1f} m" if round(length, 2) >= 1.0 else f"{100.0 * length:.0f} cm"


def smoothed(share: Any) -> Any:
    """Shares in 0…1 that leave 0 and reach 1 slowly: the cubic that is flat at both ends."""
    return share * share * (3.0 - 2.0 * share)


def interpolated(times: Float, knots: Float, values: Float) -> Float:
    """Values (k, c) at knots (k,), which rise, as rows (m, c) at times (m,) between them."""
    return np.column_stack([np.interp(times, knots, column) for column in values.T])


class DriveKeys(NamedTuple):
    """The robot's path in key poses, between which it goes straight and evenly."""

    # (k,) times from the start of the run on, which rise [s].
    times: Float
    # (k, 3) in the film's frame; headings go on past half a turn.
    poses: Float

    @property
    def driven(self) -> Bool:
        """Which legs (k − 1,) between keys the robot drove."""
        step = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        return np.asarray(step <= _FASTEST * np.diff(self.times))

    def thinned(self, error: float = _THINNED) -> "DriveKeys":
        """The keys without those that interpolation reproduces within an error [m].

        The path, and the distance over time, are simplified (Douglas and Peucker, 1973).
        """
        times = self.times
        places = self.poses[:, :2]
        if len(times) < 3:
            return self
        path = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
        pace = path.max() / np.ptp(times)
        lines = np.column_stack([places, times]), np.column_stack([path, pace * times, times])
        simple = shapely.simplify(shapely.linestrings(lines), error, preserve_topology=False)
        *_, left = shapely.get_coordinates(simple, include_z=True).T
        kept = np.isin(times, left)
        return DriveKeys(times[kept], self.poses[kept])


def drive_keys(timeline: Timeline) -> DriveKeys:
    """The key poses of a run's robot, as it is seen to move."""
    times = np.unique(np.append(timeline.drive.times, timeline.end))
    return _keys(timeline, times, timeline.poses(times))


def obstacle_keys(obstacle: "DynamicObstacle", timeline: Timeline) -> DriveKeys:
    """The key poses of a dynamic obstacle while a run lasts."""
    times = np.clip(obstacle.poses.times, timeline.start, timeline.end)
    times = np.unique([timeline.start, *times, timeline.end])
    return _keys(timeline, times, obstacle.path.at(times))


def _keys(timeline: Timeline, times: Float, poses: Float) -> DriveKeys:
    """Keys at times (k,) of the run with poses (k, 3) in the world."""
    x, y, theta = (poses - [*timeline.origin, 0.0]).T
    return DriveKeys(times - timeline.start, np.column_stack([x, y, np.unwrap(theta)]))


def scan_times(timeline: Timeline, every: int = 1) -> tuple[Float, Float]:
    """When each scan appears and disappears [s].

    A scan is seen half before and half after its moment: then the robot is never far from where
    it scanned. At a stop it is seen until the robot leaves.
    """
    times = timeline.run.trajectory.times[::every]
    if not timeline.dwells:
        middles = 0.5 * (times[:-1] + times[1:])
        return np.append(timeline.start, middles), np.append(middles, timeline.end)
    return times, np.append(times[:-1] + _STANDING * np.diff(times), timeline.end)
