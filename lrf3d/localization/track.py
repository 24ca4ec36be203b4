"""Track: where the robot was thought to be over a drive, and how that compares with the truth."""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, Int, Value, wrap_angle
from lrf3d.pose import as_poses


@dataclass(frozen=True, eq=False)
class Track(Value):
    """Where the robot was thought to be at each scan.

    Args:
        poses: (k, 3) x, y [m], theta [rad].
        covariances: (k, 3, 3) of them.
        lines: (k,) how many pairs of lines each correction took in.
        comparisons: (k,) how many comparisons finding them took.
    """

    poses: Float
    covariances: Float
    lines: Int
    comparisons: Int

    def __post_init__(self) -> None:
        self._hold("poses", "covariances")
        self._hold("lines", "comparisons", dtype=np.int64)

    def __len__(self) -> int:
        return len(self.poses)

    def errors(self, truth: Float) -> Float:
        """Differences (k, 3) from the true poses (k, 3): x, y [m], theta [rad]."""
        difference = self.poses - as_poses(truth)
        difference[:, 2] = wrap_angle(difference[:, 2])
        return difference

    def nees(self, truth: Float) -> Float:
        """Normalised estimation error squared (k,): of three degrees of freedom, 3 on average.

        What the covariance takes for certain is left out.
        """
        errors = self.errors(truth)
        information = np.linalg.pinv(self.covariances, hermitian=True)
        return np.asarray(np.einsum("ki,kij,kj->k", errors, information, errors))
