"""Routes: followed once by pure pursuit with a unicycle, in laps, or on a patrol."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import (
    LARGEST_TIME,
    ROUNDING,
    TINY,
    Float,
    Value,
    as_rows,
    number,
    whole_number,
    wrap_angle,
)
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.robot.kinematics import Unicycle, sinc
from lrf3d.robot.trajectory import Trajectory

# Time that each command of the follower is held [s]: 20 Hz, as on a real robot.
CONTROL_STEP = 0.05

# Speed of a drive [m/s] if none is given.
SPEED = 3.0

# Default look-ahead along the route [m]: about three radii of the robot, so that it cuts corners by
# no more than the clearance of planned routes.
LOOKAHEAD = 1.0

# Time between two scans [s] if none is given.
SCAN_INTERVAL = 0.25

# Fastest turn that the follower commands [rad/s].
MAX_TURN_RATE = 1.5

# Distance to a way-point at which the robot has arrived [m]: less than a laser resolves.
ARRIVAL = 1e-3

# Largest number of commands of a drive: a day at 20 Hz, which takes minutes of computing.
MOST_STEPS = 2_000_000

# Samples of the route between which the nearest one to the robot is looked for.
SAMPLES = np.arange(33.0)


def follow_route(
    route: ArrayLike,
    *,
    start: Sequence[float] | Float | None = None,
    speed: float = SPEED,
    lookahead: float = LOOKAHEAD,
    dt: float = SCAN_INTERVAL,
    most: int | None = None,
) -> Trajectory:
    """Drive along way-points by pure pursuit, each command held as an exact arc.

    Args:
        route: (m, 2) way-points [m], two or more.
        start: Initial pose; on the first way-point, facing the second, if not given.
        speed: Speed on straight parts [m/s]; tight turns are slower.
        lookahead: Distance along the route to the point that the robot steers at [m].
        dt: Time between the poses of the trajectory [s].
        most: Largest number of poses; the whole route if not given.

    Raises:
        InputError: The route has fewer than two different points, a number is invalid, or the
            drive needs more than two million commands.

    Examples:
        >>> import lrf3d
        >>> path = lrf3d.follow_route([[0, 0], [10, 0], [10, 5]], speed=2.0)
        >>> path.poses[0].tolist()
        [0.0, 0.0, 0.0]
        >>> bool(abs(path.poses[-1, :2] - [10, 5]).max() < 0.1)
        True
    """
    path = _Path(route)
    most = None if most is None else whole_number(most, "most")
    number(speed, "speed", positive=True)
    number(lookahead, "lookahead", positive=True)
    number(dt, "dt", "seconds", positive=True, most=LARGEST_TIME)
    follower = _Follower(path, as_pose(path.start if start is None else start), lookahead)
    per_sample = max(1, round(dt / CONTROL_STEP))
    step = dt / per_sample
    poses = [follower.pose]
    times = [0.0]
    # After ten times the duration at full speed and a minute for turns, it will never arrive.
    limit = int(min((10.0 * path.length / speed + 60.0) / step, MOST_STEPS + 1))
    straight = path.length / speed / step
    needed = straight if most is None else min(straight, float(most - 1) * per_sample)
    for count in range(1, limit + 1):
        if len(poses) == most:
            return Trajectory(np.array(times), np.array(poses))
        if max(needed, count) > MOST_STEPS:
            raise InputError(
                f"drive of {path.length:.4g} m at {speed:g} m/s: more than {MOST_STEPS:,} steps of"
                f" {step:g} s; drive faster, scan less often, or ask for fewer scans"
            )
        arrived = follower.advance(speed, step)
        if count % per_sample == 0 or arrived:
            poses.append(follower.pose)
            times.append(count * step)
        if arrived:
            return Trajectory(np.array(times), np.array(poses))
    raise InputError(
        "route: the robot does not reach ({:g}, {:g}); lower the speed".format(*path.end)
    )


def distinct(points: Float, name: str) -> Float:
    """Way-points (m, 2), at two places or more, without those where the one before is, too."""
    kept = (points[1:] != points[:-1]).any(axis=1)
    if not kept.any():
        raise InputError(f"{name}: expected at least two different way-points")
    return np.asarray(points[np.append(True, kept)])


class _Path:
    """The way-points as a curve, parametrised by length."""

    def __init__(self, route: ArrayLike) -> None:
        self.points = distinct(as_rows(route, "route", 2, row="point"), "route")
        self.stations = np.append(0.0, np.cumsum(np.hypot(*np.diff(self.points, axis=0).T)))
        self.length = float(self.stations[-1])
        self._known = self.stations.tolist()
        self._rows = self.points.tolist()
        self.x, self.y = (np.ascontiguousarray(column) for column in self.points.T)
        (x, y), (x2, y2) = self.points[:2].tolist()
        self.start = Pose(x, y, float(np.arctan2(y2 - y, x2 - x)))
        self.end = float(self.x[-1]), float(self.y[-1])

    def at(self, station: float) -> tuple[float, float]:
        # As np.interp does it, which takes five times as long for a single station.
        begin = bisect(self._known, station) - 1
        if begin >= len(self._rows) - 1:
            return self.end
        (x, y), (x2, y2) = self._rows[begin : begin + 2]
        long = self._known[begin + 1] - self._known[begin]
        off = station - self._known[begin]
        return (x2 - x) / long * off + x, (y2 - y) / long * off + y

    def stops(self) -> list[float]:
        """Stations of the way-points that the robot must reach: sharp turns and the end.

        Where it turns farther, the point to steer at would be behind it, or at its own position.
        """
        headings = np.arctan2(*np.diff(self.points, axis=0).T[::-1])
        sharp = np.abs(wrap_angle(np.diff(headings))) > np.radians(100)
        return [*self.stations[1:-1][sharp].tolist(), self.length]

    def progress(self, pose: Pose, reach: float, limit: float) -> float:
        """The station nearest to the pose, from the last one up to a limit."""
        # With a look-ahead of 1 m the samples are 3 cm apart.
        stations = SAMPLES * ((limit - reach) / SAMPLES[-1]) + reach
        stations[-1] = limit
        x = np.interp(stations, self.stations, self.x) - pose.x
        y = np.interp(stations, self.stations, self.y) - pose.y
        return float(stations[np.hypot(x, y).argmin()])


class _Follower:
    """A unicycle that steers at a point ahead of it on a path, from one stop to the next."""

    def __init__(self, path: _Path, pose: Pose, lookahead: float) -> None:
        self.pose = pose
        self._robot = Unicycle()
        self._path = path
        self._lookahead = lookahead
        self._stops = [(station, path.at(station)) for station in path.stops()]
        self._reach = 0.0
        self._starting = True

    def advance(self, speed: float, step: float) -> bool:
        """Hold one command for a time [s]; returns whether the robot has arrived at the end."""
        path = self._path
        station, stop = self._stops[0]
        limit = min(self._reach + self._lookahead, station)
        self._reach = path.progress(self.pose, self._reach, limit)
        goal = path.at(min(self._reach + self._lookahead, station))
        v, omega = _command(self.pose, goal, speed, step, self._starting)
        self._starting = self._starting and v == 0.0
        self.pose = self._robot.move(self.pose, v, omega, step)
        if len(self._stops) > 1 and math.dist(stop, self.pose[:2]) < ARRIVAL:
            self._reach = station
            del self._stops[0]
        return len(self._stops) == 1 and math.dist(path.end, self.pose[:2]) < ARRIVAL


def _command(
    pose: Pose, goal: tuple[float, float], speed: float, step: float, starting: bool
) -> tuple[float, float]:
    """Speed and turn rate of the arc to a goal [m], for a robot that may not have moved yet."""
    dx = goal[0] - pose.x
    dy = goal[1] - pose.y
    distance = float(np.hypot(dx, dy))
    if distance == 0.0:
        return 0.0, 0.0
    bearing = float(wrap_angle(np.arctan2(dy, dx) - pose.theta))
    # Bearings [rad] of the point to steer at beyond which a robot turns in place, en route and at
    # the start, where walls may be near: from 15° the arc to a point 1 m ahead keeps within 0.07 m
    # of the straight line.
    facing_away = math.radians(75)
    facing = math.radians(15)
    # It turns in place instead of circling the goal; at the start until it faces it.
    if abs(bearing) > (facing if starting else facing_away):
        return 0.0, float(np.clip(bearing / step, -MAX_TURN_RATE, MAX_TURN_RATE))
    curvature = 2.0 * np.sin(bearing) / distance
    # The arc to the goal has this length; near the end it is driven in one last step.
    arc = distance / sinc(bearing / np.pi)
    v = min(speed, arc / step, MAX_TURN_RATE / max(abs(curvature), TINY))
    return float(v), float(v * curvature)


def drive_laps(
    route: Float, *, start: Pose | None, speed: float, lookahead: float, dt: float, most: int
) -> tuple[Trajectory, ...]:
    """A first lap along a route, and a second one that ends where it begins, to be repeated.

    A route (m, 2) that does not end where it begins is driven back along itself. There is no
    second lap if the first one alone has as many poses as are needed at most.
    """
    closed = (route[0] == route[-1]).all()
    lap = route if closed else np.concatenate([route, route[-2::-1]])
    settings: dict[str, Any] = {"speed": speed, "lookahead": lookahead, "dt": dt}
    first = follow_route(lap, start=start, most=most, **settings)
    if len(first) >= most:
        return (first,)
    return first, follow_route(lap, start=first.poses[-1], **settings)


def chain_laps(laps: tuple[Trajectory, ...], scans: int) -> Trajectory:
    """The first of two laps and then the second again and again, cut after a number of scans."""
    if len(laps[0]) >= scans:
        return Trajectory(laps[0].times[:scans], laps[0].poses[:scans])
    first = _evenly_spaced(laps[0])
    lap = _evenly_spaced(laps[-1])
    if len(lap) < 2:
        raise InputError("laps: a lap takes no time; give a route of some length")
    number, row = np.divmod(np.arange(scans - len(first)), len(lap) - 1)
    poses = lap.poses[row + 1]
    # The heading is continuous over full turns; positions repeat to the last bit.
    poses[:, 2] += number * (lap.poses[-1, 2] - lap.poses[0, 2])
    times = first.times[-1] + number * lap.duration + lap.times[row + 1]
    return Trajectory(np.append(first.times, times), np.vstack([first.poses, poses]))


def _evenly_spaced(lap: Trajectory) -> Trajectory:
    """The lap with its last pose delayed to a whole interval after the one before.

    The robot arrives between two scans and waits for the next, so that scans stay evenly spaced.
    """
    if len(lap) < 3:
        return lap
    interval = lap.times[1] - lap.times[0]
    even = lap.times[-2] + interval
    if lap.times[-1] > even - ROUNDING * interval:
        return lap
    return Trajectory(np.append(lap.times[:-1], even), lap.poses)


@dataclass(frozen=True, eq=False)
class Patrol(Value):
    """A path along way-points (m, 2) [m] and back the same way at a speed [m/s], forever.

    It is straight, and turns on the spot at each way-point.
    """

    route: Float
    speed: float = 1.0

    def __post_init__(self) -> None:
        number(self.speed, "patrol: speed", "metres per second", positive=True)
        distinct(as_rows(self.route, "patrol: route", 2, row="point"), "patrol")
        self._hold("route")

    @cached_property
    def _lap(self) -> tuple[Float, Float, Float, Float]:
        """Corners of a lap, its legs, how long each takes [s], and when each begins [s]."""
        points = distinct(self.route, "patrol")
        corners = np.vstack([points, points[-2::-1]])
        legs = np.diff(corners, axis=0)
        durations = np.hypot(legs[:, 0], legs[:, 1]) / self.speed
        # A turn on the spot takes half a second.
        return corners, legs, durations, np.append(0.0, np.cumsum(durations + 0.5))

    @property
    def period(self) -> float:
        """Duration of a lap [s]."""
        return float(self._lap[3][-1])

    def until(self, time: float, *, since: float = 0.0) -> Trajectory:
        """The laps there and back that are driven from one time [s] to another, as whole ones."""
        corners, legs, durations, begins = self._lap
        laps = np.arange(int(since / begins[-1]), int(time / begins[-1]) + 1)
        # One pose where a leg begins and one where it ends; between legs it turns.
        times = np.column_stack([begins[:-1], begins[:-1] + durations]).ravel()
        headings = np.repeat(np.arctan2(legs[:, 1], legs[:, 0]), 2)
        poses = np.column_stack([np.repeat(corners, 2, axis=0)[1:-1], headings])
        starts = np.repeat(begins[-1] * laps, len(times))
        return Trajectory(starts + np.tile(times, len(laps)), np.tile(poses, (len(laps), 1)))

    def at(self, times: ArrayLike) -> Float:
        """Poses (m, 3) at times (m,) [s]; at rest before time 0."""
        last = float(np.max(times, initial=0.0))
        first = float(np.min(times, initial=last))
        return self.until(last, since=max(first, 0.0)).at(times)
