"""Poses as rows x, y [m], theta [rad] of arrays, many at once: composed, inverted, compared."""

import numpy as np

from lrf3d.geometry import Float, wrap_angle


def compose(first: Float, second: Float) -> Float:
    """Poses (…, 3): ``compose(world_from_robot, robot_from_laser)`` is ``world_from_laser``."""
    cos, sin = np.cos(first[..., 2]), np.sin(first[..., 2])
    x = first[..., 0] + cos * second[..., 0] - sin * second[..., 1]
    y = first[..., 1] + sin * second[..., 0] + cos * second[..., 1]
    return np.stack([x, y, wrap_angle(first[..., 2] + second[..., 2])], axis=-1)


def between(first: Float, second: Float) -> Float:
    """The second of two poses (…, 3) as seen from the first."""
    cos, sin = np.cos(first[..., 2]), np.sin(first[..., 2])
    dx, dy = second[..., 0] - first[..., 0], second[..., 1] - first[..., 1]
    turn = wrap_angle(second[..., 2] - first[..., 2])
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx, turn], axis=-1)


def turned(matrix: Float, angle: float) -> Float:
    """A covariance or information matrix (3, 3) of a pose in axes turned back by an angle [rad].

    What is known along the axes of the robot is so known along those of the map, in which the
    robot stands at the angle.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(rotation @ matrix @ rotation.T)
