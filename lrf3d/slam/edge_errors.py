"""Edge errors: which independent errors those of a drive's pose graph are made of.

The scans as the front end placed them, the key scans and the closures enter; the `EdgeErrors` that
`lrf3d.slam.uncertainty` computes covariances from leave.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.slam.closures import CLOSURE_SHARE, FLOOR, Closure
from lrf3d.slam.drift import correlated_points, stretches
from lrf3d.slam.front_end import LOCAL_KEYS, Tracked
from lrf3d.slam.known_places import PLACE_INFORMATION
from lrf3d.slam.map_shares import MapShares
from lrf3d.slam.resolution import DENSE, Resolution
from lrf3d.slam.uncertainty import EdgeErrors, rotations
from lrf3d.slam.violation import Key


def deviation_of(tracked: Sequence[Tracked], sigma: float) -> float:
    """The usual distance of matched points to their walls, as a multiple of sigma [m]."""
    matched = [scan.deviation for scan in tracked if scan.matched]
    return float(np.median(matched)) / sigma if matched else 1.0


class ErrorModel:
    """Computes the errors of a pose graph's edges; what it has computed of key scans is kept.

    Args:
        resolution: The resolution of the laser.
    """

    def __init__(self, resolution: Resolution = DENSE) -> None:
        self._resolution = resolution
        self._shares = MapShares(resolution)
        # For each key scan the inverse of how many of its points share one error.
        self._alone: list[float] = []

    def edge_errors(
        self,
        tracked: Sequence[Tracked],
        anchored: Int,
        keys: Sequence[Key],
        closures: Sequence[Closure],
    ) -> EdgeErrors:
        """The errors of edges between key scans, of the edge to the last scan, and of closures.

        Args:
            tracked: The scans, at least one.
            anchored: (a,) numbers of the key scans and of scans in known places among all scans.
            keys: The key scans; if the last scan is not one of them it is a further pose.
            closures: The closures, in the order of their edges.
        """
        noise = self._noise(tracked, keys)
        nodes = np.append(anchored, len(tracked) - 1)
        back, new = stretches(tracked, nodes, noise)
        places = np.searchsorted(anchored, [key.scan for key in keys])
        begins = np.arange(len(keys))
        for number in range(1, len(keys)):
            if places[number] == places[number - 1] + 1:
                begins[number] = begins[number - 1]
        shares = self._shares.of_keys(keys, begins)
        if keys[-1].scan < len(tracked) - 1:
            hung = places[-1] < len(anchored) - 1
            begins = np.append(begins, len(keys) if hung else begins[-1])
            # The last scan's map has one key scan more than that key scan's; its shares serve.
            alone = begins[-1] == len(keys) - 1
            last = np.eye(3) * (np.arange(LOCAL_KEYS) == 0)[:, None, None] if alone else shares[-1]
            shares = np.concatenate([shares, last[None]])
            places = np.append(places, len(anchored))
        hanging = self._hanging(tracked, anchored, places, new, noise)
        olds, old_shares = self._shares.of_closures(keys, begins, closures)
        closing = self._closing(closures, noise)
        return EdgeErrors(
            back[places], shares, new[places], begins, hanging, olds, old_shares, closing
        )

    @staticmethod
    def _hanging(
        tracked: Sequence[Tracked], anchored: Int, places: Int, new: Float, noise: float
    ) -> Float:
        """Covariances (k, 3, 3) of the scans in known places that come just before each pose.

        Such a scan is matched with the key scans around it. In directions that these do not fix
        the error of the anchor before it persists.
        """
        guess, found = PLACE_INFORMATION, np.zeros((len(anchored), 3, 3))
        for place in np.setdiff1d(np.arange(len(anchored)), places).tolist():
            information = tracked[anchored[place]].information
            inverse = np.linalg.inv(information + guess)
            before = guess @ (found[place - 1] + new[place]) @ guess
            found[place] = inverse @ (noise * information + before) @ inverse
        return np.asarray(found[np.maximum(places - 1, 0)])

    def _noise(self, tracked: Sequence[Tracked], keys: Sequence[Key]) -> float:
        """The factor from the inverse of matching's information to a covariance.

        Matching assumes a large deviation of each point, because there are things that move.
        """
        deviation = deviation_of(tracked, self._resolution.sigma)
        if self._resolution.sparse:
            return deviation**2
        self._alone += [1.0 / correlated_points(key.surface) for key in keys[len(self._alone) :]]
        return deviation**2 / float(np.mean(self._alone))

    @staticmethod
    def _closing(closures: Sequence[Closure], noise: float) -> Float:
        """Covariances (c, 3, 3) of closures' own noise, along the axes of their new key scans."""
        if not closures:
            return np.empty((0, 3, 3))
        turn = rotations(np.array([closure.relative[2] for closure in closures]))
        information = np.array([closure.information for closure in closures]) - FLOOR
        information = turn.transpose(0, 2, 1) @ (information / CLOSURE_SHARE) @ turn
        inverse = np.linalg.inv(information + FLOOR)
        return np.asarray(inverse @ (noise * information + FLOOR) @ inverse)
