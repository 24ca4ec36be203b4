"""The cases of the extended Kalman filter near singular matrices, against rational ones.

The prior's variances lie up to 1e18 apart, some of them 0; many pairs show parallel walls, or one
wall again and again. Errors are in deviations of the prior; a covariance that is not symmetric or
has a negative variance in any direction counts as infinitely wrong.
"""

from fractions import Fraction

import numpy as np

from lrf3d.geometry import Float
from lrf3d.localization import PoseEstimate
from lrf3d.localization.pairing import Innovation
from lrf3d.pose import as_pose
from stress import rational
from stress.cases import check

DEVIATIONS = "σ of the prior"

NEGATIVE = 1e-14
"""Share of the largest variance that rounding may leave negative in some direction."""


LEAST = 1e-12
"""Least deviation [m, rad] that errors are measured in."""


def priors(rng: np.random.Generator) -> PoseEstimate:
    """An estimate whose covariance is nearly singular, or is."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    spread = 10.0 ** rng.uniform(-8.0, 1.0, 3) * rng.choice([0.0, 1.0, 1.0, 1.0], 3)
    root = turn * spread
    covariance = root @ root.T
    pose = as_pose((*rng.uniform(-50.0, 50.0, 2), rng.uniform(-np.pi, np.pi)))
    return PoseEstimate(pose, 0.5 * (covariance + covariance.T))


def pairs(rng: np.random.Generator, prior: PoseEstimate, count: int) -> Innovation:
    """Pairs of lines as the prior leads one to expect, most of them all but parallel."""
    apart = rng.choice([0.0, 1e-12, 1e-6, 1.0])
    normal = rng.uniform(-np.pi, np.pi) + apart * rng.normal(size=count)
    x, y = np.cos(normal), np.sin(normal)
    deviation = 10.0 ** rng.uniform(-6.0, 0.0, (2, count))
    shared = rng.choice([0.0, 0.9, 0.999], count) * deviation[0] * deviation[1]
    values, vectors = np.linalg.eigh(prior.covariance)
    off = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=3))
    noise = deviation * rng.normal(size=(2, count))
    angle, offset = -off[2] + noise[0], -(x * off[0] + y * off[1]) + noise[1]
    squares = deviation**2
    return Innovation(angle, offset, x, y, squares[0], shared, squares[1], np.ones(count, bool))


def proper(covariance: Float, largest: float) -> bool:
    """Whether a covariance is finite, symmetric and nowhere negative but for rounding.

    It was made of rounded numbers: what they leave negative is a share of the largest variance
    that ever went in, and stays where nothing is added or measured.
    """
    if not (np.isfinite(covariance).all() and (covariance == covariance.T).all()):
        return False
    return bool(np.linalg.eigvalsh(covariance)[0] >= -NEGATIVE * max(largest, LEAST**2))


def corrections(rng: np.random.Generator) -> Float:
    """One correction by all pairs, against the same in rationals."""
    prior = priors(rng)
    seen = pairs(rng, prior, int(rng.integers(1, 5)))
    found = prior.corrected(seen, gate=np.inf).estimate
    if not proper(found.covariance, float(np.trace(prior.covariance))):
        return np.array([np.inf])
    change, covariance = _exact(prior, seen)
    # What is known exactly may move by rounding alone.
    deviation = np.sqrt(np.diag(prior.covariance))
    scale = np.maximum(deviation, LEAST)
    moved = np.array(found.pose) - np.array(prior.pose)
    # A pose is rounded to its coordinates, however well it is known.
    floor = 2.0 * np.spacing(np.maximum(np.abs(np.array(prior.pose)), np.abs(change)))
    gap = np.abs(moved - change)
    gap[2] -= 2.0 * np.pi * np.round(gap[2] / (2.0 * np.pi))
    steps = np.maximum(np.abs(gap) - floor, 0.0) / scale
    squares = np.abs(found.covariance - covariance) / np.outer(scale, scale)
    return np.array([max(steps.max(), squares.max())])


def _exact(prior: PoseEstimate, seen: Innovation) -> tuple[Float, Float]:
    """The change (3,) of the pose and its covariance (3, 3) after it, in rationals."""
    count = len(seen.angle)
    covariance = rational.matrix(prior.covariance)
    gradient = np.zeros((2 * count, 3))
    gradient[0::2, 2] = -1.0
    gradient[1::2, 0], gradient[1::2, 1] = -seen.normal_x, -seen.normal_y
    noise = np.zeros((2 * count, 2 * count))
    for k in range(count):
        block = [
            [seen.variance_angle[k], seen.covariance[k]],
            [seen.covariance[k], seen.variance_offset[k]],
        ]
        noise[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    h = rational.matrix(gradient)
    across = rational.times(h, covariance)
    total = rational.plus(rational.times(across, rational.transposed(h)), rational.matrix(noise))
    gain = rational.transposed(rational.solved(total, across))
    measured = np.column_stack([seen.angle, seen.offset]).reshape(-1, 1)
    change = rational.times(gain, rational.matrix(measured))
    after = rational.plus(covariance, rational.times(gain, across), -1)
    return _floats(change)[:, 0], _floats(after)


def _floats(values: list[list[Fraction]]) -> Float:
    return np.array([[float(value) for value in row] for row in values])


def long_drives(rng: np.random.Generator) -> Float:
    """Hundreds of predictions and corrections on one another, with pairs left out by the gate."""
    estimate = priors(rng)
    noise = np.diag(10.0 ** rng.uniform(-18.0, 0.0, 3) * rng.choice([0.0, 1.0], 3))
    largest = float(np.trace(estimate.covariance))
    for _ in range(100):
        estimate = estimate.moved(rng.normal(size=3), noise)
        largest = max(largest, float(np.trace(estimate.covariance)))
        seen = pairs(rng, estimate, int(rng.integers(1, 6)))
        if rng.random() < 0.3:
            # A wrong pair, which the gate is there for.
            seen.offset[0] += 10.0 ** rng.uniform(-3.0, 3.0)
        estimate = estimate.corrected(seen).estimate
        if not (proper(estimate.covariance, largest) and np.isfinite(estimate.pose).all()):
            return np.array([np.inf])
    return np.zeros(1)


ESTIMATES = (
    check("localising", "corrections near singular", corrections, bound=1e-4, unit=DEVIATIONS,
          tries=2_000, each=250),
    check("localising", "100 steps near singular, gated", long_drives, bound=0.0,
          unit="covariances that are none", tries=400, each=50),
)  # fmt: skip
"""The cases of the filter."""
