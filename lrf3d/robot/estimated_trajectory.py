"""EstimatedTrajectory: the estimated poses of a drive, with covariances and loop closures."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import CONFIDENCE, Float, Int, Value, sealed
from lrf3d.geometry.pose import as_poses

# Half axes of the ellipse that holds a position with this probability, in standard deviations: χ²
# of two degrees of freedom is −2 ln(1 − p).
HALF_AXES = float(np.sqrt(-2.0 * np.log(1.0 - CONFIDENCE)))

NO_PAIRS = sealed(np.empty((0, 2), np.int64))
NO_POSES = sealed(np.empty((0, 3)))
NO_SCANS = sealed(np.empty(0, np.int64))
NO_COVARIANCES = sealed(np.empty((0, 3, 3)))


@dataclass(frozen=True, eq=False)
class EstimatedTrajectory(Value):
    """The estimated pose of a robot at each scan of a run, with covariances and loop closures.

    Args:
        poses: (k, 3) estimated poses x, y [m], theta [rad] in the world, one for each scan.
        known_scans: (m,) the scans, in ascending order, after which the covariance is known.
        covariances: (m, 3, 3) covariances of the poses at these scans along the world's axes.
        closures: (c, 2) pairs of scans, an older one and a newer one, that closed a loop.
        dropped_closures: (d, 2) pairs of scans whose loop closure was rejected.
        odometry: (k, 3) poses by odometry alone; (0, 3) if they are not known.

    Raises:
        InputError: The arrays do not fit together, or a scan does not exist.

    Examples:
        >>> import numpy as np
        >>> import lrf3d
        >>> poses = np.array([(0, 0, 0), (1, 0, 0), (2.0, 0, 0)])
        >>> covariances = np.array([0.0 * np.eye(3), 0.04 * np.eye(3)])
        >>> estimate = lrf3d.EstimatedTrajectory(poses, np.array([0, 2]), covariances)
        >>> estimate.ellipses.round(2).tolist()[1]
        [[0.49, 0.0], [0.0, 0.49]]
        >>> estimate.errors(np.array([(0, 0, 0), (1, 0.1, 0), (2, 0, 0)])).tolist()
        [0.0, 0.1, 0.0]
    """

    poses: Float
    known_scans: Int = field(default_factory=lambda: NO_SCANS)
    covariances: Float = field(default_factory=lambda: NO_COVARIANCES)
    closures: Int = field(default_factory=lambda: NO_PAIRS)
    dropped_closures: Int = field(default_factory=lambda: NO_PAIRS)
    odometry: Float = field(default_factory=lambda: NO_POSES)

    def __post_init__(self) -> None:
        self._hold("poses", "covariances", "odometry")
        self._hold("known_scans", "closures", "dropped_closures", dtype=np.int64)
        count = len(as_poses(self.poses))
        if len(as_poses(self.odometry)) not in (0, count):
            raise InputError(
                f"estimate: odometry of {len(self.odometry)} scans, poses of {count}; expected as"
                " many or none"
            )
        if self.known_scans.ndim != 1 or self.covariances.shape != (self.known_scans.size, 3, 3):
            raise InputError(
                f"estimate: covariances {self.covariances.shape} at scans"
                f" {self.known_scans.shape}; expected (m, 3, 3) at (m,)"
            )
        for name in ("closures", "dropped_closures"):
            if getattr(self, name).shape[1:] != (2,):
                raise InputError(f"estimate: {name} {getattr(self, name).shape}, expected (c, 2)")
        pairs = self.closures.ravel(), self.dropped_closures.ravel()
        named = np.concatenate([self.known_scans, *pairs])
        if (np.diff(self.known_scans) <= 0).any() or (named < 0).any() or (named >= count).any():
            raise InputError(
                f"estimate: expected ascending scans from 0 to {count - 1}, found {named.tolist()}"
            )

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        return (
            f"EstimatedTrajectory({len(self)} poses, {len(self.known_scans)} covariances,"
            f" {len(self.closures)} loop closures)"
        )

    @property
    def ellipses(self) -> Float:
        """Matrices (m, 2, 2) [m] that turn the unit circle into the ellipses of 95 % probability.

        They can be interpolated entry by entry, whereas axes of ellipses may change their order.
        """
        matrices = self.covariances[:, :2, :2]
        values, vectors = np.linalg.eigh(0.5 * (matrices + matrices.transpose(0, 2, 1)))
        # Rounding may have made a value slightly negative.
        roots = HALF_AXES * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(np.einsum("mij,mj,mkj->mik", vectors, roots, vectors))

    def errors(self, poses: ArrayLike) -> Float:
        """Distances (k,) [m] of the estimated positions from those of poses (k, 3)."""
        apart = self.poses[:, :2] - np.asarray(poses, dtype=np.float64)[:, :2]
        return np.hypot(apart[:, 0], apart[:, 1])

    def lines(self, pairs: Int) -> Float:
        """Lines (c, 4) x1 y1 x2 y2 [m] between the estimated positions of pairs of scans (c, 2)."""
        return self.poses[pairs, :2].reshape(-1, 4)

    def part(self, scans: Int) -> EstimatedTrajectory:
        """The estimate at some of the scans, in ascending order."""
        new_index = np.full(len(self), -1)
        new_index[scans] = np.arange(len(scans))
        known = new_index[self.known_scans] >= 0
        closures = new_index[self.closures]
        dropped = new_index[self.dropped_closures]
        return EstimatedTrajectory(
            self.poses[scans],
            new_index[self.known_scans[known]],
            self.covariances[known],
            closures[(closures >= 0).all(axis=1)],
            dropped[(dropped >= 0).all(axis=1)],
            self.odometry[scans] if len(self.odometry) else self.odometry,
        )
