"""Unicycle: the kinematic model of the robot (Eq. 2 of Teslić et al.) and its exact arcs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, is_finite, number
from lrf3d.pose import Pose, as_pose

RADIUS = 0.35
"""Radius of the robot's round body [m] if none is given."""


@dataclass(frozen=True, slots=True)
class Unicycle:
    """A robot that drives in the direction of its heading at v [m/s] and turns at ω [rad/s].

    Args:
        radius: Radius of the robot's round body [m].

    Examples:
        >>> import math
        >>> import lrf3d
        >>> end = lrf3d.Unicycle().move((0, 0, 0), v=math.pi / 2, omega=math.pi / 2, duration=1.0)
        >>> round(end.x, 6), round(end.y, 6), round(end.theta, 6)
        (1.0, 1.0, 1.570796)
    """

    radius: float = RADIUS

    def __post_init__(self) -> None:
        number(self.radius, "robot of radius", "metres")

    def derivative(self, state: Float, v: float, omega: float) -> Float:
        """Time derivative (3,) of the state x, y, theta (Eq. 2)."""
        return np.array([v * np.cos(state[2]), v * np.sin(state[2]), omega])

    def move(self, pose: Sequence[float], v: float, omega: float, duration: float) -> Pose:
        """Where the robot is after it held v and ω for a time [s]: the exact arc of Eq. 2."""
        if not is_finite(v, omega, duration):
            raise InputError(f"move {shown((v, omega, duration))}: expected finite numbers")
        x, y, theta = as_pose(pose)
        half_turn = 0.5 * omega * duration
        chord = v * duration * sinc(half_turn / np.pi)
        middle = theta + half_turn
        return Pose(
            x + chord * float(np.cos(middle)),
            y + chord * float(np.sin(middle)),
            theta + 2.0 * half_turn,
        )


def sinc(x: float) -> float:
    """The same number as `np.sinc`, which takes ten times as long for one."""
    angle = np.pi * (x or 1e-20)
    return float(np.sin(angle)) / angle


def arcs(poses: Float, v: Float, omega: Float, durations: Float) -> Float:
    """Poses (k, 3) after arcs with v (k,), ω (k,) held for durations (k,) [s] from poses (k, 3).

    The chord of an arc has the length v·t·sin(ωt/2)/(ωt/2) and the heading of the arc's middle;
    in this form a straight line is not a special case, and a small ω loses no digits.
    """
    half_turn = 0.5 * omega * durations
    chord = v * durations * np.sinc(half_turn / np.pi)
    middle = poses[:, 2] + half_turn
    step = np.column_stack([chord * np.cos(middle), chord * np.sin(middle), 2.0 * half_turn])
    return poses + step
