"""Uncertainty: covariances of the poses of key scans, and of one as seen from another.

Poses and edges of a pose graph enter; covariances leave, by the inverse of the normal equations and
by the variance factor. The equations know how edges compare with each other, but not how good all
of them are: that is what closures show, by how well they fit.
"""

from dataclasses import replace

import numpy as np

from lrf3d.geometry import Float
from lrf3d.slam.pose_graph import Edges, edge_equations, factor

KNOWN_BEFORE = 30.0
"""How many residuals the deviation of matched points counts as, beside those of closures."""

DEVIATIONS = 2.4
"""Matched points count as if they lay this many times farther off than they do: along a corridor
without closures, where nothing else tells, one such deviation was too little by half."""

CORRELATED = 1.3
"""By how much errors exceed those of independent edges: edges between following key scans share
the errors of one local map. Measured by `benchmarks/slam_consistency.py` with known truth: with 3
covariances are three times too large where loops are many."""

CANCELLING = 0.3
"""Share of the closures' residuals that edges between following key scans count with. The noise of
a scan enters two of them, and cancels: along a way much less adds up than each edge is off by."""

SHARED = 2.5
"""And that closures count with: those of one stretch are matched with the same map, share its
errors, and so fit each other better than the truth."""

BLUNT = 6.0
"""By how much closures are less sure of a direction that few points fix: in simulated drives they
are off by five times their variance along it, and by twice across it, for these points are of one
jamb or corner, and share its errors."""


def variance_factor(poses: Float, edges: Edges, deviation: float, share: float = 1.0) -> float:
    """What the covariances that matching gives are to be multiplied with.

    Those of the odometry are not: how far wheels slip does not depend on how sharp scans are.

    Args:
        poses: (k, 3) that fit the edges best.
        edges: The edges.
        deviation: RMS distance of matched points to their walls, over what one counts with.
        share: What the squared residuals of closures count with.
    """
    residuals = 3.0 * float(edges.robust.sum())
    squares = share * float((edges.weights(poses) * edges.squares(poses)).sum())
    before = KNOWN_BEFORE * (DEVIATIONS * deviation) ** 2
    return CORRELATED * (squares + before) / (residuals + KNOWN_BEFORE)


def honest(poses: Float, edges: Edges, deviation: float) -> Edges:
    """Edges with covariances as large as errors are; arguments are those of `variance_factor`."""
    following = variance_factor(poses, edges, deviation, CANCELLING)
    closing = variance_factor(poses, edges, deviation, SHARED)
    matched = edges.information - edges.prior
    matched[edges.robust] = blunted(matched[edges.robust])
    variances = np.where(edges.robust, closing, following)[:, None, None]
    return replace(edges, information=edges.prior + matched / variances)


def blunted(information: Float) -> Float:
    """Information (e, 3, 3) with less about the direction that is fixed worst: see `BLUNT`.

    Where all directions are fixed alike nothing changes.
    """
    turn = np.maximum(information[:, 2, 2], 1e-9)[:, None, None]
    coupled = information[:, :2, 2, None] * information[:, None, :2, 2] / turn
    values, axes = np.linalg.eigh(information[:, :2, :2] - coupled)
    weak, strong = np.maximum(values, 1e-9).T
    values[:, 0] = weak / (1.0 + (BLUNT - 1.0) * (1.0 - np.sqrt(weak / strong)))
    less = information.copy()
    less[:, :2, :2] = coupled + (axes * values[:, None, :]) @ axes.transpose(0, 2, 1)
    return less


def joint_covariance(poses: Float, edges: Edges, numbers: list[int]) -> Float:
    """Covariance (3m, 3m) of some poses together; the first pose of all is held, and certain."""
    count = 3 * len(poses)
    free = edge_equations(poses, edges).matrix[3:, 3:].tocsc()
    rows = (3 * np.array(numbers)[:, None] + np.arange(3)).ravel()
    units = np.zeros((count, len(rows)))
    units[rows, np.arange(len(rows))] = 1.0
    solved = np.zeros((count, len(rows)))
    solved[3:] = factor(free).solve(units[3:])
    covariance: Float = solved[rows]
    return 0.5 * (covariance + covariance.T)


def relative_covariance(poses: Float, edges: Edges, first: int, second: int) -> Float:
    """Covariance (3, 3) of a pose as seen from another one, along the axes of that one."""
    joint = joint_covariance(poses, edges, [first, second])
    x, y = poses[second, :2] - poses[first, :2]
    cos, sin = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    lever = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    derivative = np.hstack([-back @ lever, back])
    return np.asarray(derivative @ joint @ derivative.T)
