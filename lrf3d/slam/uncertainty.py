"""Uncertainty: covariances of the poses of key scans, and of one as seen from another.

The pose graph and the independent errors that its edges' errors are made of enter; covariances
leave. A pose graph that is solved with weights Ω moves by δ = H⁻¹ Jᵀ Ω ε if its edges have the
errors ε. The inverse of its normal equations, H⁻¹, would be the covariance if edges were
independent and Ω their information. They are not: edges between adjacent key scans are matched with
one local map, and closures of one stretch with another. So ε is traced to independent errors: the
noise of each scan, and of the wheels between two scans.

Errors of poses are written as twists about the origin, the motion of a rigid body that the pose
belongs to, so that errors of key scans at different places can be averaged.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.slam.pose_graph import Edges, edge_equations, factor

PRIOR_RESIDUALS = 30.0
"""Residuals that the deviation of matched points counts as, beside those of closures."""

POINT_DEVIATIONS = 2.4
"""Factor on the distances of matched points to their walls: adjacent points share their errors, see
`lrf3d.slam.drift`."""

CORRELATED = 1.3
"""Factor by which closures' squared errors exceed those of independent edges."""

TOGETHER = 16
"""Covariances that are computed at once."""


@dataclass(frozen=True, eq=False)
class EdgeErrors:
    """What the errors of a pose graph's edges are made of.

    Covariances are of x, y [m], theta [rad]; all matrices are along the axes of the robot.

    Args:
        back: (k, 3, 3) for each pose the share of the error of the pose before that it keeps by
            the wheels.
        shares: (k, m, 3, 3) for each pose the shares, in the rest, of the m key scans before it,
            or of as many as there are, from the oldest on.
        new: (k, 3, 3) covariances of the errors that each pose adds.
        begins: (k,) for each pose the first one of its stretch. A stretch holds the poses that
            follow each other without a known place between; the first one follows a scan in one.
        opening: (k, 3, 3) covariances of that scan's pose, for the first pose of a stretch.
        olds: (c, s) for each closure the key scans of the map that it was matched with.
        old_shares: (c, s, 3, 3) their shares.
        closing: (c, 3, 3) covariances of each closure's own noise, along the axes of its new key
            scan.
    """

    back: Float
    shares: Float
    new: Float
    begins: Int
    opening: Float
    olds: Int
    old_shares: Float
    closing: Float


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
    return CORRELATED * (squares + before) / (residuals + PRIOR_RESIDUALS)


def joint_covariance(poses: Float, edges: Edges, errors: EdgeErrors, numbers: list[int]) -> Float:
    """Covariance (3m, 3m) of some poses together; the very first pose is fixed.

    Args:
        poses: (k, 3) all poses of the graph, x, y [m], theta [rad].
        edges: Its edges.
        errors: What the errors of the edges are made of.
        numbers: Numbers of the m poses; rows and columns are their x, y, theta, pose by pose.
    """
    count, columns = len(poses), 3 * len(numbers)
    free = edge_equations(poses, edges).matrix[3:, 3:].tocsc()
    rows = (3 * np.array(numbers)[:, None] + np.arange(3)).ravel()
    units = np.zeros((3 * count, columns))
    units[rows, np.arange(columns)] = 1.0
    solved = np.zeros((3 * count, columns))
    solved[3:] = factor(free).solve(units[3:])
    lever = _levers(poses)
    twists = lever @ solved.reshape(count, 3, columns)
    frames = lever @ rotations(poses[:, 2])
    inverses = np.asarray(np.linalg.inv(frames), dtype=np.float64)
    # An edge measures how the twists of its two poses differ.
    i, j = edges.first, edges.second
    seen = np.linalg.inv(lever[j] @ rotations(poses[i, 2]))
    weights = edges.information * edges.weights(poses)[:, None, None]
    pulls = seen.transpose(0, 2, 1) @ (weights @ (seen @ (twists[j] - twists[i])))
    pull = np.zeros((count, 3, columns))
    driven = ~edges.robust
    np.add.at(pull, j[driven], pulls[driven])
    # The first edge of a stretch has the errors of the scan in a known place, not of pose i.
    opens = driven & (errors.begins[j] == j)
    driven &= ~opens
    np.add.at(pull, i[driven], -pulls[driven])
    local = frames[j[opens]].transpose(0, 2, 1) @ pulls[opens]
    covariance = _summed(local, errors.opening[j[opens]])
    if edges.robust.any():
        closed = pulls[edges.robust]
        new, old = j[edges.robust], i[edges.robust]
        np.add.at(pull, old, -closed)
        local = frames[new].transpose(0, 2, 1) @ closed
        covariance += _summed(local, errors.closing)
        inverse = inverses[new].transpose(0, 2, 1)
        for number in range(errors.olds.shape[1]):
            share = errors.old_shares[:, number].transpose(0, 2, 1)
            np.add.at(pull, errors.olds[:, number], inverse @ (share @ local))
    local = traced(pull, frames, inverses, errors.back, errors.shares, errors.begins)
    return np.asarray(covariance + _summed(local, errors.new))


def pose_covariances(poses: Float, edges: Edges, errors: EdgeErrors, numbers: Int) -> Float:
    """Covariances (m, 3, 3) of the poses of some numbers (m,), each by itself."""
    found = np.zeros((len(numbers), 3, 3))
    moved = np.flatnonzero(numbers > 0)
    # Not all at once: of a long drive that would be a matrix of its length times theirs.
    for part in np.array_split(moved, -(-len(moved) // TOGETHER)) if len(moved) else []:
        joint = joint_covariance(poses, edges, errors, numbers[part].tolist())
        blocks = joint.reshape(len(part), 3, len(part), 3)
        found[part] = blocks[np.arange(len(part)), :, np.arange(len(part))]
    return found


def _summed(pulls: Float, covariances: Float) -> Float:
    """Sum of Lᵀ C L over pulls (n, 3, m) and covariances (n, 3, 3) of independent errors."""
    columns = pulls.shape[2]
    spread = covariances @ pulls
    return np.asarray(pulls.reshape(-1, columns).T @ spread.reshape(-1, columns))


@compiled
def traced(
    pull: Float, frames: Float, inverses: Float, back: Float, shares: Float, begins: Int
) -> Float:
    """Derivatives (k, 3, m) of m numbers by the error that each pose of the front end adds.

    From the newest pose to the oldest: what depends on the error of a pose also depends on the
    errors of the poses that it follows.

    Args:
        pull: (k, 3, m) derivatives by the twist of each pose; it is changed in place.
        frames: (k, 3, 3) matrices from errors along the robot's axes to twists.
        inverses: (k, 3, 3) their inverses.
        back: (k, 3, 3) the share of the pose before.
        shares: (k, w, 3, 3) the shares of the local map's key scans.
        begins: (k,) the first pose of each one's stretch.
    """
    count, columns, window = len(pull), pull.shape[2], shares.shape[1]
    entered = np.zeros(pull.shape)
    here, part, going, before, rest = (
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    for k in range(count - 1, 0, -1):
        first = max(begins[k], k - window)
        for column in range(columns):
            _pulled(frames[k], pull[k, :, column], here)
            for a in range(3):
                entered[k, a, column] = here[a]
            if begins[k] == k:
                continue
            _pulled(back[k], here, part)
            _pulled(inverses[k - 1], part, going)
            # The share of the pose before, along the axes of this one; the map has the rest.
            _pulled(frames[k], going, before)
            for a in range(3):
                pull[k - 1, a, column] += going[a]
                rest[a] = here[a] - before[a]
            for j in range(first, k):
                _pulled(shares[k, j - first], rest, part)
                _pulled(inverses[k], part, before)
                for a in range(3):
                    pull[j, a, column] += before[a]
    return entered


@inner
def _pulled(matrix: Float, vector: Float, product: Float) -> None:
    """The product of the transpose of a matrix (3, 3) with a vector (3,)."""
    for a in range(3):
        product[a] = matrix[0, a] * vector[0] + matrix[1, a] * vector[1] + matrix[2, a] * vector[2]


def _levers(poses: Float) -> Float:
    """Matrices (k, 3, 3) from errors of poses (k, 3), along the axes of the map, to twists."""
    levers = np.tile(np.eye(3), (len(poses), 1, 1))
    levers[:, 0, 2], levers[:, 1, 2] = poses[:, 1], -poses[:, 0]
    return levers


def rotations(angles: Float) -> Float:
    """Matrices (k, 3, 3) that rotate x, y of a pose's error by angles (k,) [rad]."""
    matrices = np.tile(np.eye(3), (len(angles), 1, 1))
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(angles)
    matrices[:, 1, 0] = np.sin(angles)
    matrices[:, 0, 1] = -matrices[:, 1, 0]
    return matrices


def relative_covariance(
    poses: Float, edges: Edges, errors: EdgeErrors, first: int, second: int
) -> Float:
    """Covariance (3, 3) of a pose as seen from another one, along the axes of that one."""
    joint = joint_covariance(poses, edges, errors, [first, second])
    x, y = poses[second, :2] - poses[first, :2]
    cos, sin = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    lever = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    derivative = np.hstack([-back @ lever, back])
    return np.asarray(derivative @ joint @ derivative.T)
