"""Poses: position and heading in the plane, the group SE(2) (Eq. 1 of Teslić et al.).

A single one is a `Pose`, or a plain ``(x, y, theta)``; many are rows x, y [m], theta [rad].
"""

import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning, shown
from lrf3d.geometry.lines import LARGEST_COORDINATE as LARGEST
from lrf3d.geometry.lines import TINY, Float, Int, as_rows, numbers, wrap_angle

# Multiples of half of this heading, from this one on, are probably degrees.
_LEAST_DEGREES = 30.0


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

    def __repr__(self) -> str:
        # NumPy's numbers would show their types.
        return f"Pose(x={float(self.x)!r}, y={float(self.y)!r}, theta={float(self.theta)!r})"

    def __matmul__(self, other: "Pose") -> "Pose":
        """Compose: ``world_from_robot @ robot_from_laser`` is ``world_from_laser``."""
        other = as_pose(other)
        x, y = self.apply(np.array([[other.x, other.y]]))[0]
        return Pose(float(x), float(y), float(wrap_angle(self.theta + other.theta)))

    def inverse(self) -> "Pose":
        """The inverse: ``pose @ pose.inverse()`` is the identity."""
        return Pose(*between(np.array(self), np.zeros(3)).tolist())

    def apply(self, points: Float) -> Float:
        """Transform points (n, 2) from the frame of this pose to the frame that it is given in."""
        points = numbers(points, "points")
        if points.ndim < 1 or points.shape[-1] != 2:
            raise InputError(f"points of shape {points.shape}: expected (n, 2)")
        cos = np.cos(self.theta)
        sin = np.sin(self.theta)
        return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + np.array([self.x, self.y]))


def as_pose(pose: Sequence[float] | Float) -> Pose:
    """Check and convert a pose that comes from outside."""
    try:
        # Numbers of an array take thrice as long to read one by one, and this runs for every scan.
        x, y, theta = map(float, pose.tolist() if isinstance(pose, np.ndarray) else pose)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"pose {shown(pose)}: expected three numbers x, y, theta") from None
    if LARGEST >= abs(x) >= TINY <= abs(y) <= LARGEST and TINY <= abs(theta) < _LEAST_DEGREES:
        # Nearly all poses; making one as below takes twice as long.
        return tuple.__new__(Pose, (x, y, theta))
    if not (abs(x) <= LARGEST and abs(y) <= LARGEST and abs(theta) <= LARGEST):
        raise InputError(f"pose {(x, y, theta)}: expected finite numbers of at most {LARGEST:g}")
    if abs(theta) >= _LEAST_DEGREES and theta % (0.5 * _LEAST_DEGREES) == 0.0:
        _warn_of_degrees(theta)
    return Pose(
        x if abs(x) >= TINY else 0.0,
        y if abs(y) >= TINY else 0.0,
        theta if abs(theta) >= TINY else 0.0,
    )


def _warn_of_degrees(theta: float) -> None:
    warnings.warn(
        f"pose: theta {theta:g} is read as radians; for degrees write math.radians({theta:g})",
        Lrf3dWarning,
        stacklevel=3,
    )


def as_poses(poses: object) -> Float:
    """Check and convert poses (k, 3) that come from outside."""
    array = as_rows(poses, "poses", 3, row="pose")
    size = np.abs(array)
    if size[:, 2].max(initial=0.0) >= _LEAST_DEGREES:
        large = array[size[:, 2] >= _LEAST_DEGREES, 2]
        if (doubtful := large[large % (0.5 * _LEAST_DEGREES) == 0.0]).size:
            _warn_of_degrees(doubtful[0])
    if size.min(initial=TINY) >= TINY:
        return array
    tiny = (size < TINY) & (array != 0.0)
    return np.where(tiny, 0.0, array) if tiny.any() else array


def compose(first: Float, second: Float) -> Float:
    """Poses (…, 3): ``compose(world_from_robot, robot_from_laser)`` is ``world_from_laser``."""
    if first.ndim == second.ndim == 1:
        return _composed_two(first.tolist(), second.tolist())
    cos = np.cos(first[..., 2])
    sin = np.sin(first[..., 2])
    x = first[..., 0] + cos * second[..., 0] - sin * second[..., 1]
    y = first[..., 1] + sin * second[..., 0] + cos * second[..., 1]
    return _poses(x, y, wrap_angle(first[..., 2] + second[..., 2]))


def between(first: Float, second: Float) -> Float:
    """The second of two poses (…, 3) as seen from the first."""
    if first.ndim == second.ndim == 1:
        return _between_two(first.tolist(), second.tolist())
    cos = np.cos(first[..., 2])
    sin = np.sin(first[..., 2])
    dx = second[..., 0] - first[..., 0]
    dy = second[..., 1] - first[..., 1]
    turn = wrap_angle(second[..., 2] - first[..., 2])
    return _poses(cos * dx + sin * dy, cos * dy - sin * dx, turn)


def _between_two(first: list[float], second: list[float]) -> Float:
    """`between` for single poses, as plain numbers: most calls, and arrays take thrice as long."""
    x, y, heading = first
    other_x, other_y, other_heading = second
    cos = float(np.cos(heading))
    sin = float(np.sin(heading))
    dx = other_x - x
    dy = other_y - y
    return np.array([cos * dx + sin * dy, cos * dy - sin * dx, wrap_angle(other_heading - heading)])


def _composed_two(first: list[float], second: list[float]) -> Float:
    """`compose` for single poses, as plain numbers."""
    x, y, heading = first
    ahead, left, turn = second
    cos = float(np.cos(heading))
    sin = float(np.sin(heading))
    there = x + cos * ahead - sin * left, y + sin * ahead + cos * left
    return np.array([*there, wrap_angle(heading + turn)])


def _poses(x: Float, y: Float, turn: Float) -> Float:
    """Poses (…, 3); ``np.stack`` takes twice as long."""
    poses = np.empty((*x.shape, 3))
    poses[..., 0] = x
    poses[..., 1] = y
    poses[..., 2] = turn
    return poses


def heading_of(x: Float, y: Float, z: Float, w: Float) -> Float:
    """Headings [rad] of quaternions."""
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def turned(matrix: Float, angle: float) -> Float:
    """A covariance or information (3, 3) along a robot's axes at an angle [rad], in the map's."""
    cos = np.cos(angle)
    sin = np.sin(angle)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(rotation @ matrix @ rotation.T)


def bent(path: Float, known: Int, poses: Float, at: Float | None = None) -> Float:
    """A path (n, 3) that is right from step to step, bent to meet poses (m, 3) of known numbers.

    These rise; ``at`` (n,) is how far along the path each pose is, its number if not given.
    """
    count = np.arange(len(path))
    along = count.astype(np.float64) if at is None else at
    before = np.clip(np.searchsorted(known, count, side="right") - 1, 0, len(known) - 1)
    after = np.minimum(before + 1, len(known) - 1)
    from_before = compose(poses[before], between(path[known[before]], path))
    from_after = compose(poses[after], between(path[known[after]], path))
    length = along[known[after]] - along[known[before]]
    share = np.where(length > 0.0, (along - along[known[before]]) / np.where(length, length, 1), 0)
    share = np.clip(share, 0.0, 1.0)
    met = compose(from_before, between(from_before, from_after) * share[:, None])
    met[:, 2] = wrap_angle(met[:, 2])
    return met
