"""Patrol: there and back along a route, as people and carts go."""

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError
from lrf3d.geometry import Float, is_finite, numbers
from lrf3d.robot.trajectory import Trajectory

TURN = 0.5
"""Time that a turn on the spot takes [s]."""


def patrol(route: ArrayLike, *, speed: float, until: float) -> Trajectory:
    """Go straight from way-point to way-point, turn on the spot, and come back the same way.

    Args:
        route: (m, 2) way-points x, y [m], at least two.
        speed: Speed between them [m/s].
        until: Time up to which it goes on [s].

    Raises:
        InputError: The route has no length, or the speed is not positive.
    """
    points = np.asarray(numbers(route, "route"), dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InputError(f"patrol along points {points.shape}: expected finite points (m, 2)")
    if not (is_finite(speed) and speed > 0.0):
        raise InputError(f"patrol at {speed} m/s: expected a positive speed")
    points = points[np.append(True, (np.diff(points, axis=0) != 0.0).any(axis=1))]
    if len(points) < 2:
        raise InputError("patrol: expected a route of at least two different way-points")
    legs = np.diff(np.vstack([points, points[-2::-1]]), axis=0)
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    durations = np.hypot(legs[:, 0], legs[:, 1]) / speed
    time, place = 0.0, points[0]
    times: list[float] = []
    poses: list[Float] = []
    leg = 0
    # One pose where a leg begins and one where it ends; between legs it turns.
    while time <= until or not times:
        times += [time, time + durations[leg]]
        poses += [np.append(place, headings[leg]), np.append(place + legs[leg], headings[leg])]
        time, place = time + durations[leg] + TURN, place + legs[leg]
        leg = (leg + 1) % len(legs)
    return Trajectory(times, poses)
