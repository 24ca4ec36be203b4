"""Pose: position and heading in the plane, the group SE(2) (Eq. 1 of Teslić et al.).

A plain ``(x, y, theta)`` is accepted wherever a pose is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import LARGEST_COORDINATE as LARGEST
from lrf3d.geometry import TINY, Float, as_rows, wrap_angle


class Pose(NamedTuple):
    """Position x, y [m] and heading theta [rad], counter-clockwise from the x axis.

    Examples:
        >>> import math
        >>> from lrf3d import Pose
        >>> world_from_robot = Pose(2.0, 1.0, math.pi / 2)
        >>> robot_from_laser = Pose(0.5, 0.0, 0.0)
        >>> world_from_laser = world_from_robot @ robot_from_laser
        >>> round(world_from_laser.x, 3), round(world_from_laser.y, 3)
        (2.0, 1.5)
    """

    x: float
    y: float
    theta: float

    def __matmul__(self, other: "Pose") -> "Pose":
        """Compose: ``world_from_robot @ robot_from_laser`` is ``world_from_laser``."""
        x, y = self.apply(np.array([[other.x, other.y]]))[0]
        return Pose(float(x), float(y), float(wrap_angle(self.theta + other.theta)))

    def inverse(self) -> "Pose":
        """The inverse: ``pose @ pose.inverse()`` is the identity."""
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        return Pose(
            float(-cos * self.x - sin * self.y),
            float(sin * self.x - cos * self.y),
            float(wrap_angle(-self.theta)),
        )

    def apply(self, points: Float) -> Float:
        """Transform points (n, 2) from the frame of this pose to the frame that it is given in."""
        cos, sin = np.cos(self.theta), np.sin(self.theta)
        return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + np.array([self.x, self.y]))


def as_pose(pose: Sequence[float] | Float) -> Pose:
    """Check and convert a pose that comes from outside."""
    try:
        # Numbers of an array take thrice as long to read one by one, and this runs for every scan.
        x, y, theta = pose.tolist() if isinstance(pose, np.ndarray) else pose
        x, y, theta = float(x), float(y), float(theta)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"pose {shown(pose)}: expected three numbers x, y, theta") from None
    if TINY <= abs(x) <= LARGEST and TINY <= abs(y) <= LARGEST and TINY <= abs(theta) <= LARGEST:
        return Pose(x, y, theta)
    if not all(abs(value) <= LARGEST for value in (x, y, theta)):
        raise InputError(f"pose {(x, y, theta)}: expected finite numbers of at most {LARGEST:g}")
    return Pose(*(0.0 if abs(value) < TINY else value for value in (x, y, theta)))


def as_poses(poses: object) -> Float:
    """Check and convert poses (k, 3) that come from outside."""
    array = as_rows(poses, "poses", 3, row="pose")
    tiny = (np.abs(array) < TINY) & (array != 0.0)
    return np.where(tiny, 0.0, array) if tiny.any() else array
