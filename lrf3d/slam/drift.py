"""Drift: how the errors of scans and wheels become those of the front end's poses.

Scans as the front end placed them enter. For each stretch between two nodes of the pose graph,
which shares of the error at its end come from its beginning and from the local map, and which
covariance is new, leave. A scan's pose is a mean, weighted by information, of the pose by the walls
of the map and the pose by the wheels:

    T = P (Ω T_map + Ω₀ T_wheels),    P = (Ω + Ω₀)⁻¹

so that a share K = P Ω₀ of the wheels' error enters it, and a share 1 − K of the map's. Matrices
are along the axes of the robot where they apply.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.slam.frames import between
from lrf3d.slam.front_end import Tracked
from lrf3d.slam.surface import BASELINE, MOST_NEIGHBOURS
from lrf3d.slam.wheels import EXPECTED

PRIOR_INCREMENTS = 2.0
"""Increments that the expected noise of the wheels counts as, beside those that scans measure."""

LARGEST_SLIP = 10.0
"""Deviations that an increment counts as off by, at most."""

SEEN = 0.5
"""An increment shows the noise of the wheels in directions in which scans have at least this share
of the pose."""


def correlated_points(surface: Float) -> float:
    """How many adjacent points of a surface (m, 4) share one error, in the harmonic mean.

    The normal and the offset of a point are those of the points around it: see
    `lrf3d.slam.surface`.
    """
    steps = np.hypot(*np.diff(surface[:, :2], axis=0).T)
    if not len(steps):
        return 1.0
    together = np.clip(2.0 + 2.0 * BASELINE / np.maximum(steps, 1e-3), 3, 2 * MOST_NEIGHBOURS + 1)
    return float(1.0 / np.mean(1.0 / together))


def wheel_factors(found: Float, motions: Float, variances: Float, gains: Float) -> Float:
    """Factors (3,) for the wheels' variances, from how far wheels and scans differ.

    Args:
        found: (n, 3) increments as the front end found them: ahead, to the left [m], turn [rad].
        motions: (n, 3) those of the wheels.
        variances: (n, 3) expected variances of their random errors [m²], [rad²]; +inf where an
            increment is not to be used.
        gains: (n, 3) which share of the wheels' error the found increment still has.
    """
    off = found - motions
    off[:, 2] = wrap_angle(off[:, 2])
    shown = (gains < 1.0 - SEEN) & np.isfinite(variances)
    variances = np.where(shown, variances, 0.0)
    squares = np.where(shown, off / np.where(shown, 1.0 - gains, 1.0), 0.0) ** 2
    squares = np.minimum(squares, LARGEST_SLIP**2 * variances)
    # Sums are compared, not increments: the error that accumulates is what has to be right.
    before = PRIOR_INCREMENTS * variances.sum(axis=0) / np.maximum(shown.sum(axis=0), 1)
    total, expected = squares.sum(axis=0) + before, variances.sum(axis=0) + before
    known = expected > 0.0
    factors = np.where(known, total / np.where(known, expected, 1.0), 1.0)
    place = total[:2].sum() / expected[:2].sum() if known[:2].any() else 1.0
    return np.array([place, place, factors[2]])


def stretches(tracked: Sequence[Tracked], nodes: Int, noise: float) -> tuple[Float, Float]:
    """How errors propagate from node to node, and which are added.

    Args:
        tracked: The scans.
        nodes: (k,) rising numbers of the scans that are nodes, the first of them 0.
        noise: The factor from the inverse of matching's information to a covariance.

    Returns:
        For each node the share (k, 3, 3) of the error of the node before that it keeps by the
        wheels; the rest comes from the local map. And the covariance (k, 3, 3) that is added.
    """
    motions = np.array([scan.motion for scan in tracked])
    information = np.array([scan.information for scan in tracked])
    random = np.array([scan.covariance.diagonal() for scan in tracked])
    unlearned = np.array([scan.unlearned for scan in tracked])
    prior = random + unlearned[:, None] * np.array([0.0, 0.0, 1.0])
    both = np.linalg.inv(information + _diagonal(1.0 / prior))
    gains = both / prior[:, None, :]
    poses = np.array([scan.pose for scan in tracked])
    usable = np.where([[scan.matched] for scan in tracked], random, np.inf)
    # While the systematic errors are still unknown, turns differ by these instead of by noise.
    usable[unlearned > random[:, 2], 2] = np.inf
    shares = np.diagonal(gains, axis1=1, axis2=2)
    factors = wheel_factors(between(poses[:-1], poses[1:]), motions[1:], usable[1:], shares[1:])
    wheels = random * factors
    # Where the wheels' noise is smaller than expected, the systematic errors are known better.
    before = ((EXPECTED[:2] * motions[:, [2, 0]]) ** 2).sum(axis=1)
    known = np.maximum(1.0 / np.maximum(unlearned, 1e-12) - 1.0 / np.maximum(before, 1e-12), 0.0)
    left = 1.0 / (1.0 / np.maximum(before, 1e-12) + known / factors[2])
    wheels[:, 2] += np.where(unlearned > 0.0, left, 0.0)
    return chained(motions, gains, wheels, noise * both @ information @ both, nodes)


def _diagonal(values: Float) -> Float:
    """Diagonal matrices (n, 3, 3) of values (n, 3)."""
    return np.asarray(values[:, :, None] * np.eye(3))


@compiled
def chained(
    motions: Float, gains: Float, wheels: Float, scans: Float, nodes: Int
) -> tuple[Float, Float]:
    """What `stretches` returns, scan by scan.

    Args:
        motions: (n, 3) increments to each scan.
        gains: (n, 3, 3) which share of the wheels' error each scan keeps.
        wheels: (n, 3) variances of the increments.
        scans: (n, 3, 3) covariances of the poses by the noise of each scan.
        nodes: (k,) the scans that are nodes.
    """
    back = np.zeros((len(nodes), 3, 3))
    new = np.zeros((len(nodes), 3, 3))
    step, share, noise = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    left, moved = np.zeros((3, 3)), np.zeros((3, 3))
    step[2, 2] = 1.0
    for node in range(1, len(nodes)):
        for a in range(3):
            for b in range(3):
                share[a, b], noise[a, b] = 1.0 if a == b else 0.0, 0.0
        for scan in range(nodes[node - 1] + 1, nodes[node] + 1):
            x, y = motions[scan, 0], motions[scan, 1]
            cos, sin = np.cos(motions[scan, 2]), np.sin(motions[scan, 2])
            # An error of the pose before, along the axes of this one.
            step[0, 0], step[0, 1], step[0, 2] = cos, sin, sin * x - cos * y
            step[1, 0], step[1, 1], step[1, 2] = -sin, cos, cos * x + sin * y
            _product(step, share, moved)
            _product(gains[scan], moved, share)
            _spread(step, noise, left, moved)
            for a in range(3):
                moved[a, a] += wheels[scan, a]
            _spread(gains[scan], moved, left, noise)
            for a in range(3):
                for b in range(3):
                    noise[a, b] += scans[scan, a, b]
        for a in range(3):
            for b in range(3):
                back[node, a, b], new[node, a, b] = share[a, b], noise[a, b]
    return back, new


@inner
def _product(first: Float, second: Float, product: Float) -> None:
    """The product of two matrices (3, 3)."""
    for a in range(3):
        for b in range(3):
            product[a, b] = (
                first[a, 0] * second[0, b] + first[a, 1] * second[1, b] + first[a, 2] * second[2, b]
            )


@inner
def _spread(matrix: Float, covariance: Float, left: Float, found: Float) -> None:
    """The covariance A C Aᵀ (3, 3) of errors after a matrix A; left is room for A C."""
    _product(matrix, covariance, left)
    for a in range(3):
        for b in range(3):
            found[a, b] = (
                left[a, 0] * matrix[b, 0] + left[a, 1] * matrix[b, 1] + left[a, 2] * matrix[b, 2]
            )
