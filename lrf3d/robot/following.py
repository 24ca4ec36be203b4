"""Following a route: pure pursuit of way-points with a unicycle."""

import math
from bisect import bisect
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError
from lrf3d.geometry import Float, as_rows, number, whole_number, wrap_angle
from lrf3d.pose import Pose, as_pose
from lrf3d.robot.trajectory import Trajectory
from lrf3d.robot.unicycle import Unicycle, sinc

CONTROL_STEP = 0.05
"""Time that each command of the follower is held [s]: 20 Hz, as on a real robot."""

SPEED = 3.0
"""Speed of a drive [m/s] if none is given."""

LOOKAHEAD = 1.0
"""Default look-ahead along the route [m]: about three radii of the robot, so that it cuts corners
by no more than the clearance of planned routes."""

SCAN_INTERVAL = 0.25
"""Time between two scans [s] if none is given."""

MAX_TURN_RATE = 1.5
"""Fastest turn that the follower commands [rad/s]."""

SAMPLES = np.arange(33.0)
"""Samples of the route between which the nearest one to the robot is looked for."""

ARRIVED = 1e-3
"""Distance to a way-point at which the robot has arrived [m]."""


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
    number(dt, "dt", "seconds", positive=True, most=1e5)
    pose = as_pose(path.start if start is None else start)
    robot = Unicycle()
    per_sample = max(1, round(dt / CONTROL_STEP))
    step = dt / per_sample
    reach, poses, times = 0.0, [pose], [0.0]
    stops = path.stops()
    stop = path.at(stops[0])
    # After ten times the duration at full speed and a minute for turns, it will never arrive.
    limit = int((10.0 * path.length / speed + 60.0) / step)
    straight = path.length / speed / step
    needed = straight if most is None else min(straight, float(most - 1) * per_sample)
    for count in range(1, limit + 1):
        if len(poses) == most:
            return Trajectory(np.array(times), np.array(poses))
        # More than a day at 20 Hz takes minutes of computing.
        if max(needed, count) > 2_000_000:
            raise InputError(
                f"drive of {path.length:.4g} m at {speed:g} m/s: more than 2,000,000 steps of"
                f" {step:g} s; drive faster, scan less often, or ask for fewer scans"
            )
        reach = path.progress(pose, reach, min(reach + lookahead, stops[0]))
        goal = path.at(min(reach + lookahead, stops[0]))
        v, omega = _command(pose, goal, speed, step)
        pose = robot.move(pose, v, omega, step)
        if len(stops) > 1 and math.dist(stop, pose[:2]) < ARRIVED:
            reach, stop = stops.pop(0), path.at(stops[0])
        arrived = len(stops) == 1 and math.dist(path.end, pose[:2]) < ARRIVED
        if count % per_sample == 0 or arrived:
            poses.append(pose)
            times.append(count * step)
        if arrived:
            return Trajectory(np.array(times), np.array(poses))
    x, y = path.points[-1]
    raise InputError(f"route: the robot does not reach ({x:g}, {y:g}); lower the speed")


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
        self._known, self._rows = self.stations.tolist(), self.points.tolist()
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
        long, off = self._known[begin + 1] - self._known[begin], station - self._known[begin]
        return (x2 - x) / long * off + x, (y2 - y) / long * off + y

    def stops(self) -> list[float]:
        """Stations of the way-points that the robot must reach: sharp turns and the end.

        Where it turns farther, the point to steer at would be behind it, or at its own position.
        """
        headings = np.arctan2(*np.diff(self.points, axis=0).T[::-1])
        sharp = np.abs(wrap_angle(np.diff(headings))) > np.radians(100.0)
        return [*self.stations[1:-1][sharp].tolist(), self.length]

    def progress(self, pose: Pose, reach: float, limit: float) -> float:
        """The station nearest to the pose, from the last one up to a limit."""
        # With a look-ahead of 1 m the samples are 3 cm apart.
        stations = SAMPLES * ((limit - reach) / SAMPLES[-1]) + reach
        stations[-1] = limit
        x = np.interp(stations, self.stations, self.x) - pose.x
        y = np.interp(stations, self.stations, self.y) - pose.y
        return float(stations[np.hypot(x, y).argmin()])


def _command(
    pose: Pose, goal: tuple[float, float], speed: float, step: float
) -> tuple[float, float]:
    """Speed and turn rate of the arc to a goal [m]."""
    dx, dy = goal[0] - pose.x, goal[1] - pose.y
    distance = float(np.hypot(dx, dy))
    if distance == 0.0:
        return 0.0, 0.0
    bearing = float(wrap_angle(np.arctan2(dy, dx) - pose.theta))
    # It turns in place instead of circling the goal.
    if abs(bearing) > np.radians(75.0):
        return 0.0, float(np.clip(bearing / step, -MAX_TURN_RATE, MAX_TURN_RATE))
    curvature = 2.0 * np.sin(bearing) / distance
    # The arc to the goal has this length; near the end it is driven in one last step.
    arc = distance / sinc(bearing / np.pi)
    v = min(speed, arc / step, MAX_TURN_RATE / max(abs(curvature), 1e-300))
    return float(v), float(v * curvature)
