"""Edge errors: of what the errors of a drive's pose graph are made.

The scans as the front end placed them, the key scans and the closures enter; what
`lrf3d.slam.uncertainty` needs to find covariances leaves.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.slam.closures import CLOSURE_SHARE, FLOOR, Closure
from lrf3d.slam.drift import correlated_points, stretches
from lrf3d.slam.front_end import LOCAL_KEYS, Tracked
from lrf3d.slam.known_places import GUESS
from lrf3d.slam.map_shares import MapShares
from lrf3d.slam.resolution import DENSE, Resolution
from lrf3d.slam.uncertainty import EdgeErrors, rotations
from lrf3d.slam.violation import Key


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
        self,
        tracked: Sequence[Tracked],
        anchored: Int,
        keys: Sequence[Key],
        closures: Sequence[Closure],
    ) -> EdgeErrors:
        """The errors of the edges between the key scans, to the last scan, and of closures.

        Args:
            tracked: The scans, at least one.
            anchored: (a,) numbers of the key scans and of scans in known places among them.
            keys: The key scans; the last scan is one more pose of the graph if it is none of them.
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
            # Its map is one key scan newer, with the shares of that one's map.
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
        """Covariances (k, 3, 3) of where scans in known places stood, before each pose.

        Such a scan is matched with key scans around it. What they do not fix goes on.
        """
        key, found = np.zeros(len(anchored) + 1, np.bool_), np.zeros((len(anchored) + 1, 3, 3))
        key[places] = True
        for place in np.flatnonzero(~key).tolist():
            information = tracked[anchored[place]].information if place < len(anchored) else GUESS
            inverse = np.linalg.inv(information + GUESS)
            before = GUESS @ (found[place - 1] + new[place]) @ GUESS
            found[place] = inverse @ (noise * information + before) @ inverse
        return np.asarray(found[np.maximum(places - 1, 0)])

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
