"""Odometry: the increments between scans, as the wheels measure them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError
from lrf3d.geometry import Float, is_finite, wrap_angle
from lrf3d.pose import as_poses


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Gaussian noise of each odometry increment, independent of its length.

    Args:
        position: Standard deviation [m] ahead, and the same to the side.
        heading: Standard deviation [rad] of the turn.

    Raises:
        InputError: A number is negative or not finite.

    Examples:
        >>> import lrf3d
        >>> wheels = lrf3d.OdometryNoise(position=0.02, heading=0.01)
        >>> wheels.covariance.diagonal().round(6).tolist()
        [0.0004, 0.0004, 0.0001]
    """

    position: float = 0.1
    heading: float = float(np.radians(2.0))

    def __post_init__(self) -> None:
        values = (self.position, self.heading)
        if not (is_finite(*values) and min(values) >= 0.0):
            raise InputError(f"odometry noise {values}: expected finite numbers, at least 0")

    @property
    def covariance(self) -> Float:
        """Covariance (3, 3) of a step: ahead, to the left [m], turn [rad]."""
        return np.diag([self.position**2, self.position**2, self.heading**2])

    def __call__(self, steps: Float, rng: np.random.Generator) -> Float:
        """Return increments (k, 3) as the wheels would measure them."""
        deviations = [self.position, self.position, self.heading]
        return steps + rng.normal(size=steps.shape) * deviations


def odometry_increments(poses: ArrayLike) -> Float:
    """The increments (k − 1, 3) from pose to pose (k, 3): ahead, to the left [m], turn [rad].

    Raises:
        InputError: The poses are not rows of three finite numbers.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> poses = np.array([(0, 0, 0), (1, 0, 1.5), (1, 2, 1.5)])
        >>> lrf3d.odometry_increments(poses).round(2).tolist()
        [[1.0, 0.0, 1.5], [1.99, 0.14, 0.0]]
    """
    poses = as_poses(poses)
    (dx, dy, turn), theta = np.diff(poses, axis=0).T, poses[:-1, 2]
    cos, sin = np.cos(theta), np.sin(theta)
    return np.column_stack([cos * dx + sin * dy, cos * dy - sin * dx, wrap_angle(turn)])
