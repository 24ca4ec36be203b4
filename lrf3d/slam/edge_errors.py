"""Edge errors: of what the errors of a drive's pose graph are made.

The scans as the front end placed them, the key scans and the closures enter; what
`lrf3d.slam.uncertainty` needs to find covariances leaves.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float
from lrf3d.slam.closures import CLOSURE_SHARE, FLOOR, Closure, Key
from lrf3d.slam.drift import correlated_points, stretches
from lrf3d.slam.front_end import Tracked
from lrf3d.slam.map_shares import MapShares
from lrf3d.slam.resolution import DENSE, Resolution
from lrf3d.slam.uncertainty import EdgeErrors, rotations


def deviation_of(tracked: Sequence[Tracked], sigma: float) -> float:
    """How far matched points lie off their walls, over the deviation [m] that one counts with."""
    matched = [scan.deviation for scan in tracked if scan.matched]
    return float(np.median(matched)) / sigma if matched else 1.0


class ErrorModel:
    """Finds the errors of a pose graph's edges; of key scans that it knows nothing is done again.

    Args:
        resolution: That of the laser.
    """

    def __init__(self, resolution: Resolution = DENSE) -> None:
        self._resolution = resolution
        self._shares = MapShares(resolution)
        # For each key scan the share that one of its points has in the points around it.
        self._alone: list[float] = []

    def edge_errors(
        self, tracked: Sequence[Tracked], keys: Sequence[Key], closures: Sequence[Closure]
    ) -> EdgeErrors:
        """The errors of the edges between the key scans, to the last scan, and of closures.

        Args:
            tracked: The scans, at least one.
            keys: The key scans; the last scan is one more pose of the graph if it is none of them.
            closures: The closures, in the order of their edges.
        """
        nodes = np.array([key.scan for key in keys], dtype=np.int64)
        shares = self._shares.of_keys(keys)
        if nodes[-1] < len(tracked) - 1:
            nodes = np.append(nodes, len(tracked) - 1)
            # Its map is one key scan newer, with the shares of that one's map.
            last = shares[-1:] if len(keys) > 1 else np.eye(3) * (shares[-1:] + 1.0)
            shares = np.concatenate([shares, last])
        noise = self._noise(tracked, keys)
        back, new = stretches(tracked, nodes, noise)
        olds, old_shares = self._shares.of_closures(keys, closures)
        return EdgeErrors(back, shares, new, olds, old_shares, self._closing(closures, noise))

    def _noise(self, tracked: Sequence[Tracked], keys: Sequence[Key]) -> float:
        """What the inverse of matching's information is to be multiplied with.

        Matching counts with a large deviation of each point, because there are things that move.
        """
        deviation = deviation_of(tracked, self._resolution.sigma)
        if self._resolution.sparse:
            return deviation**2
        self._alone += [1.0 / correlated_points(key.surface) for key in keys[len(self._alone) :]]
        return deviation**2 / float(np.mean(self._alone))

    @staticmethod
    def _closing(closures: Sequence[Closure], noise: float) -> Float:
        """Covariances (c, 3, 3) of the noise in closures, along the axes of the new key scans."""
        if not closures:
            return np.empty((0, 3, 3))
        turn = rotations(np.array([closure.relative[2] for closure in closures]))
        information = np.array([closure.information for closure in closures]) - FLOOR
        information = turn.transpose(0, 2, 1) @ (information / CLOSURE_SHARE) @ turn
        inverse = np.linalg.inv(information + FLOOR)
        return np.asarray(inverse @ (noise * information + FLOOR) @ inverse)
