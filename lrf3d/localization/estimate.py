"""PoseEstimate: a pose with its covariance, and the two steps of the extended Kalman filter.

The prediction moves the pose by an odometry increment; the correction uses pairs of lines, as in
the localisation for which Teslić et al. build their map.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Value, read_only, sealed, wrap_angle
from lrf3d.localization.pairing import GATE, Innovation
from lrf3d.pose import Pose, as_pose

LEAST_FREE, ROUNDED = 1e-9, 64.0
"""A pair is tested if the other pairs determine at least this share of its noise: a constant, plus
a multiple of the rounding error of the share."""


@dataclass(frozen=True, eq=False, repr=False)
class PoseEstimate(Value):
    """An estimated pose, with the covariance (3, 3) of x, y [m] and theta [rad] in the world.

    Raises:
        InputError: The pose is invalid, or the covariance is not symmetric or has a negative
            variance.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> start = lrf3d.PoseEstimate(lrf3d.Pose(0, 0, 0), np.diag([0.01, 0.01, 0.001]))
        >>> start.pose.x
        0.0
    """

    pose: Pose
    covariance: Float

    def __post_init__(self) -> None:
        covariance = read_only(self.covariance, "covariance")
        if covariance.shape != (3, 3) or not np.isfinite(covariance).all():
            raise InputError(f"covariance of shape {covariance.shape}: expected finite (3, 3)")
        if not np.array_equal(covariance, covariance.T) or (np.diag(covariance) < 0.0).any():
            raise InputError("covariance: expected a symmetric matrix with variances of at least 0")
        object.__setattr__(self, "pose", as_pose(self.pose))
        object.__setattr__(self, "covariance", covariance)

    def moved(self, step: Float, noise: Float) -> "PoseEstimate":
        """The estimate after an odometry increment (3,) whose noise has a covariance (3, 3)."""
        x, y, theta = self.pose
        cos, sin = np.cos(theta), np.sin(theta)
        by_step = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        dx, dy, turn = (by_step @ step).tolist()
        by_pose = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        covariance = by_pose @ self.covariance @ by_pose.T + by_step @ noise @ by_step.T
        return PoseEstimate(
            Pose(x + dx, y + dy, float(wrap_angle(theta + turn))), _symmetric(covariance)
        )

    def corrected(self, pairs: Innovation) -> "tuple[PoseEstimate, Bool]":
        """The estimate after pairs of lines (k,), and which of them (k,) it uses.

        The worst pair is left out as long as it lies beyond the gate of pairing from the estimate
        by the prediction and all other pairs. So a wrong pair within the wide gate of the
        prediction does not make right ones look wrong, and many consistent lines outweigh a poor
        prediction. The innovations are those at this estimate's pose, in which they are linear.
        """
        measured = np.column_stack([pairs.angle, pairs.offset])
        gradient = np.zeros((len(measured), 2, 3))
        gradient[:, 0, 2] = -1.0
        gradient[:, 1, 0], gradient[:, 1, 1] = -pairs.normal_x, -pairs.normal_y
        noise = np.empty((len(measured), 2, 2))
        noise[:, 0, 0], noise[:, 1, 1] = pairs.variance_angle, pairs.variance_offset
        noise[:, 0, 1] = noise[:, 1, 0] = pairs.covariance
        used = np.ones(len(measured), dtype=np.bool_)
        while True:
            kept = gradient[used], noise[used]
            change, covariance = _correct(self.covariance, measured[used], *kept)
            residual = measured[used] - gradient[used] @ change
            squares = _misfits(residual, *kept, self.covariance, covariance)
            if squares.max(initial=0.0) <= GATE:
                break
            used[np.flatnonzero(used)[squares.argmax()]] = False
        x, y, theta = (np.array(self.pose) + change).tolist()
        return PoseEstimate(Pose(x, y, float(wrap_angle(theta))), covariance), sealed(used)


def _misfits(residual: Float, gradient: Float, noise: Float, before: Float, after: Float) -> Float:
    """Squared distance (k,) of each pair from the estimate of the prediction and all other pairs.

    The covariance of a residual (k, 2) is the noise (k, 2, 2) minus the share that the correction
    used; in these units the residual is as large as after a correction without the pair. Where a
    pair alone determines the pose, its residual does not vary and cannot contradict anything. The
    pose had the covariance before, and has that after the correction.
    """
    # In units of the noise the used share lies between 0 and 1.
    root = np.linalg.cholesky(noise)
    residual = np.linalg.solve(root, residual[:, :, None])[:, :, 0]
    gradient = np.linalg.solve(root, gradient)
    free, axes = np.linalg.eigh(np.eye(2) - gradient @ after @ gradient.transpose(0, 2, 1))
    rounded = np.finfo(np.float64).eps * np.einsum("kij,jl,kil->k", gradient, before, gradient)
    testable = free > LEAST_FREE + ROUNDED * rounded[:, None]
    parts = (residual[:, None, :] @ axes)[:, 0, :]
    squares = np.where(testable, parts**2 / np.where(testable, free, 1.0), 0.0)
    return np.asarray(squares.sum(axis=1), dtype=np.float64)


def _correct(
    covariance: Float, measured: Float, gradient: Float, noise: Float
) -> tuple[Float, Float]:
    """The change (3,) of a pose by measurements (k, 2), and its covariance (3, 3) afterwards."""
    size = 2 * len(measured)
    stacked, spread = gradient.reshape(size, 3), np.zeros((size, size))
    for row in range(len(noise)):
        spread[2 * row : 2 * row + 2, 2 * row : 2 * row + 2] = noise[row]
    projected = stacked @ covariance
    gain = np.linalg.solve(projected @ stacked.T + spread, projected).T
    keep = np.eye(3) - gain @ stacked
    # Joseph's form stays positive under rounding.
    corrected = keep @ covariance @ keep.T + gain @ spread @ gain.T
    return gain @ measured.reshape(size), _symmetric(corrected)


def _symmetric(matrix: Float) -> Float:
    """A covariance without asymmetry and negative variances from rounding."""
    symmetric = 0.5 * (matrix + matrix.T)
    np.fill_diagonal(symmetric, np.maximum(np.diag(symmetric), 0.0))
    return np.asarray(symmetric)
