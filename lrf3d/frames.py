"""Poses as rows x, y [m], theta [rad] of arrays, many at once: composed, inverted, compared."""

import numpy as np

from lrf3d.geometry import Float, Int, wrap_angle


def compose(first: Float, second: Float) -> Float:
    """Poses (…, 3): ``compose(world_from_robot, robot_from_laser)`` is ``world_from_laser``."""
    cos, sin = np.cos(first[..., 2]), np.sin(first[..., 2])
    x = first[..., 0] + cos * second[..., 0] - sin * second[..., 1]
    y = first[..., 1] + sin * second[..., 0] + cos * second[..., 1]
    return _poses(x, y, wrap_angle(first[..., 2] + second[..., 2]))


def between(first: Float, second: Float) -> Float:
    """The second of two poses (…, 3) as seen from the first."""
    cos, sin = np.cos(first[..., 2]), np.sin(first[..., 2])
    dx, dy = second[..., 0] - first[..., 0], second[..., 1] - first[..., 1]
    turn = wrap_angle(second[..., 2] - first[..., 2])
    return _poses(cos * dx + sin * dy, cos * dy - sin * dx, turn)


def _poses(x: Float, y: Float, turn: Float) -> Float:
    """Poses (…, 3). Most calls are for a single one, where ``np.stack`` takes half of the time."""
    poses = np.empty((*x.shape, 3))
    poses[..., 0] = x
    poses[..., 1] = y
    poses[..., 2] = turn
    return poses


def turned(matrix: Float, angle: float) -> Float:
    """A covariance or information (3, 3) along a robot's axes at an angle [rad], in the map's."""
    cos, sin = np.cos(angle), np.sin(angle)
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
