"""Uncertainty: covariances of the poses of key scans, and of one as seen from another.

The pose graph enters, and of which independent errors those of its edges are made; covariances
leave. A pose graph that is solved with weights Ω moves by δ = H⁻¹ Jᵀ Ω ε where its edges are off by
ε. The inverse of its normal equations, H⁻¹, would be the covariance if edges were independent and
as good as their weights say. They are not: edges between following key scans are matched with one
local map, and closures of one stretch with another. So ε is traced to what is independent: the
noise of each scan, and of the wheels between two.

Errors of poses are twists about the origin: of how a rigid body that the pose belongs to has moved.
Those of several key scans can be averaged wherever these stand.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.slam.pose_graph import Edges, edge_equations, factor

PRIOR_RESIDUALS = 30.0
"""How many residuals the deviation of matched points counts as, beside those of closures."""

POINT_DEVIATIONS = 2.4
"""Matched points count as if they lay this many times farther off than they do, for adjacent ones
share their errors: see `lrf3d.slam.drift`."""

CORRELATED = 1.3
"""By how much closures' squared errors exceed those of independent edges."""

TOGETHER = 16
"""Covariances that are computed at once."""


@dataclass(frozen=True, eq=False)
class EdgeErrors:
    """Of what the errors of a pose graph's edges are made; matrices are along the robot's axes.

    Args:
        back: (k, 3, 3) for each pose which share of the error of the one before goes on in the
            front end without the map.
        shares: (k, m, 3, 3) which share of the rest comes of each of the m key scans before, or
            as many as there are, from the oldest on.
        new: (k, 3, 3) covariances of what comes new.
        begins: (k,) for each the first pose of its stretch: what the front end placed without a
            known place between. The first one follows a scan in a known place.
        opening: (k, 3, 3) covariances of where that scan stood, for the first of a stretch.
        olds: (c, s) for each closure the key scans of the map that it was matched with.
        old_shares: (c, s, 3, 3) their shares.
        closing: (c, 3, 3) covariances of what comes new in it, along the axes of its new key scan.
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
        poses: (k, 3) that fit the edges best.
        edges: The edges.
        deviation: RMS distance of matched points to their walls, over what one counts with.
    """
    residuals = 3.0 * float(edges.robust.sum())
    squares = float((edges.weights(poses) * edges.squares(poses)).sum())
    before = PRIOR_RESIDUALS * (POINT_DEVIATIONS * deviation) ** 2
    return CORRELATED * (squares + before) / (residuals + PRIOR_RESIDUALS)


def joint_covariance(poses: Float, edges: Edges, errors: EdgeErrors, numbers: list[int]) -> Float:
    """Covariance (3m, 3m) of some poses together; the first pose of all is held, and certain."""
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
    # A stretch begins anew: the one before it has nothing to do with its errors.
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
    """Covariances (m, 3, 3) of poses (m,) by their numbers, each by itself."""
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
    """How far (k, 3, m) the new error of each pose of the front end enters m numbers.

    From the newest pose to the oldest: what the error of a pose enters, those that it follows
    enter too.

    Args:
        pull: (k, 3, m) how far the twist of each pose enters; it is added to.
        frames: (k, 3, 3) what makes twists of errors along the robot's axes.
        inverses: (k, 3, 3) their inverses.
        back: (k, 3, 3) the share of the pose before.
        shares: (k, w, 3, 3) those of the local map's key scans.
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
            # The error of the pose before, seen from this one; the map has what is left.
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
    """Matrices (k, 3, 3) that make twists of errors of poses (k, 3)."""
    levers = np.tile(np.eye(3), (len(poses), 1, 1))
    levers[:, 0, 2], levers[:, 1, 2] = poses[:, 1], -poses[:, 0]
    return levers


def rotations(angles: Float) -> Float:
    """Matrices (k, 3, 3) that turn a pose's place by angles (k,)."""
    turned = np.tile(np.eye(3), (len(angles), 1, 1))
    turned[:, 0, 0] = turned[:, 1, 1] = np.cos(angles)
    turned[:, 1, 0] = np.sin(angles)
    turned[:, 0, 1] = -turned[:, 1, 0]
    return turned


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
