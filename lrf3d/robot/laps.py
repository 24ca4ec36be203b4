"""Laps: a drive along a route, there and back again, for as many scans as are asked for."""

from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.pose import Pose
from lrf3d.robot.following import follow_route
from lrf3d.robot.trajectory import Trajectory


def drive_laps(
    route: Float, *, start: Pose | None, speed: float, lookahead: float, dt: float, most: int
) -> tuple[Trajectory, ...]:
    """A first lap along a route, and a second one that ends as it begins, to be driven for ever.

    A route that does not end where it begins is driven back the way it came. What is not asked
    for is not driven: the first lap ends after that number of poses, and there is no second.

    Args:
        route: (m, 2) way-points [m].
        start: Pose at time 0; on the first way-point where not given.
        speed: Speed on straight parts [m/s].
        lookahead: Distance along the route to the point that is steered at [m].
        dt: Time between the poses [s].
        most: How many poses are asked for.

    Raises:
        InputError: The route has fewer than two different points, or the laps are too long.
    """
    closed = (route[0] == route[-1]).all()
    way = route if closed else np.concatenate([route, route[-2::-1]])
    how: dict[str, Any] = {"speed": speed, "lookahead": lookahead, "dt": dt}
    first = follow_route(way, start=start, most=most, **how)
    if len(first) >= most:
        return (first,)
    return first, follow_route(way, start=first.poses[-1], **how)


def chain_laps(laps: tuple[Trajectory, ...], scans: int) -> Trajectory:
    """The first of two laps and then the second again and again, cut after a number of scans.

    Raises:
        InputError: The lap takes no time.
    """
    if len(laps[0]) >= scans:
        return Trajectory(laps[0].times[:scans], laps[0].poses[:scans])
    first, lap = _waited_for(laps[0]), _waited_for(laps[-1])
    if len(lap) < 2:
        raise InputError("laps: a lap takes no time; give a route of some length")
    more = scans - len(first)
    number, row = np.divmod(np.arange(more), len(lap) - 1)
    poses = lap.poses[row + 1]
    # The heading goes on over full turns; the places are the very same in every lap.
    poses[:, 2] += number * (lap.poses[-1, 2] - lap.poses[0, 2])
    times = first.times[-1] + number * lap.duration + lap.times[row + 1]
    return Trajectory(
        np.concatenate([first.times, times]),
        np.concatenate([first.poses, poses]),
    )


def _waited_for(lap: Trajectory) -> Trajectory:
    """The lap with its last pose a whole interval after the one before.

    The robot arrives between two scans, and waits for the next: they come evenly for ever.
    """
    if len(lap) < 3:
        return lap
    interval = lap.times[1] - lap.times[0]
    even = lap.times[-2] + interval
    if lap.times[-1] > even - 1e-6 * interval:
        return lap
    return Trajectory(np.append(lap.times[:-1], even), lap.poses)
