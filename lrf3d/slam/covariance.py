"""Covariances of poses: those of the pose graph's own normal equations, scaled to what is seen.

Matching counts each point with one deviation, whatever the walls and the laser are. How far closed
loops are off, in units of what their edges claim, is the factor by which matching errs more or
less; what wheels say is left as it is.
"""

from dataclasses import replace

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.slam.pose_graph import Edges, edge_equations, factor

PRIOR_RESIDUALS = 30.0
"""Residuals that the deviation of matched points counts as, next to those of closures."""

POINT_DEVIATIONS = 2.4
"""Factor on the distances of matched points to their walls: adjacent points share their errors."""

TOGETHER = 16
"""Poses whose covariances are computed at once."""


def variance_factor(poses: Float, edges: Edges, deviation: float) -> float:
    """How large closures' squared errors are, in units of the variances that matching gives.

    Args:
        poses: (k, 3) the poses that fit the edges best.
        edges: The edges.
        deviation: RMS distance of matched points to their walls, over what one counts with.
    """
    residuals = 3.0 * float(edges.robust.sum())
    squares = float((edges.weights(poses) * edges.squares(poses)).sum())
    before = PRIOR_RESIDUALS * (POINT_DEVIATIONS * deviation) ** 2
    return (squares + before) / (residuals + PRIOR_RESIDUALS)


def scaled(edges: Edges, variance: float) -> Edges:
    """Edges whose information from matching is divided by a variance factor."""
    matching = (edges.information - edges.prior) / max(variance, 1e-6)
    return replace(edges, information=matching + edges.prior)


def joint_covariance(poses: Float, edges: Edges, numbers: Int) -> Float:
    """Covariance (3m, 3m) of m poses of the graph together; the very first pose is fixed."""
    columns = np.arange(3 * len(numbers))
    rows = (3 * numbers[:, None] + np.arange(3)).ravel()
    # The first pose is held: its rows are left out, and its covariance is 0.
    units = np.zeros((3 * len(poses), len(columns)))
    units[rows, columns] = 1.0
    free = edge_equations(poses, edges).matrix[3:, 3:].tocsc()
    solved = np.zeros_like(units)
    solved[3:] = factor(free).solve(units[3:])
    return np.asarray(solved[rows])


def pose_covariances(poses: Float, edges: Edges, numbers: Int) -> Float:
    """Covariances (m, 3, 3) of the poses of some numbers (m,), each by itself."""
    found = np.zeros((len(numbers), 3, 3))
    if len(poses) < 2:
        return found
    # Not all at once: of a long drive that would be a matrix of its length times theirs.
    for first in range(0, len(numbers), TOGETHER):
        part = numbers[first : first + TOGETHER]
        blocks = joint_covariance(poses, edges, part).reshape(len(part), 3, len(part), 3)
        each = np.arange(len(part))
        found[first : first + TOGETHER] = blocks[each, :, each]
    return found


def relative_covariance(poses: Float, edges: Edges, first: int, second: int) -> Float:
    """Covariance (3, 3) of a pose as seen from another one, along the axes of that one."""
    joint = joint_covariance(poses, edges, np.array([first, second]))
    x, y = poses[second, :2] - poses[first, :2]
    cos, sin = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    lever = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    derivative = np.hstack([-back @ lever, back])
    return np.asarray(derivative @ joint @ derivative.T)
