"""Routes that are repeated forever: laps of the robot, and patrols of people and carts."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Value, as_rows, number
from lrf3d.pose import Pose
from lrf3d.robot.following import distinct, follow_route
from lrf3d.robot.trajectory import Trajectory


def drive_laps(
    route: Float, *, start: Pose | None, speed: float, lookahead: float, dt: float, most: int
) -> tuple[Trajectory, ...]:
    """A first lap along a route, and a second one that ends where it begins, to be repeated.

    A route (m, 2) that does not end where it begins is driven back the way it came. There is no
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
    first, lap = _evenly_spaced(laps[0]), _evenly_spaced(laps[-1])
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
    if lap.times[-1] > even - 1e-6 * interval:
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
