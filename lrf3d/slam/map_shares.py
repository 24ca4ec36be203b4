"""Map shares: how far the pose of a matched scan follows each key scan of the map.

The surface of a scan, its pose, and the key scans of the map that it was matched with enter. For
each of these key scans a matrix (3, 3) leaves, which takes an error of its pose to the error of the
scan's pose. The matrices add up to the identity: if the whole map moves, the scan moves with it.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int
from lrf3d.slam.closures import FLOOR, Closure
from lrf3d.slam.frames import between, compose
from lrf3d.slam.front_end import LOCAL_KEYS, REACH
from lrf3d.slam.resolution import DENSE, Resolution
from lrf3d.slam.scan_matching import ALIGNED, LAST_SCALE
from lrf3d.slam.surface import moved
from lrf3d.slam.violation import Key


class MapShares:
    """The shares in the maps of all key scans and of all closures, each computed once.

    Args:
        resolution: The resolution of the laser. Key scans of a sparse laser, whose points take
            their normals from many scans together, have equal shares.
    """

    def __init__(self, resolution: Resolution = DENSE) -> None:
        self._resolution = resolution
        self._of_keys = [np.zeros((LOCAL_KEYS, 3, 3))]
        self._olds: list[Int] = []
        self._of_closures: list[Float] = []

    def of_keys(self, keys: Sequence[Key], begins: Int) -> Float:
        """Shares (k, 8, 3, 3) of the key scans before each key scan, from the oldest on.

        Args:
            keys: The key scans.
            begins: (k,) for each the first one of its stretch.
        """
        for new in range(len(self._of_keys), len(keys)):
            begin = int(begins[new])
            olds = range(max(new - LOCAL_KEYS, begin), new)
            shares = np.zeros((LOCAL_KEYS, 3, 3))
            if len(olds):
                shares[: len(olds)] = self._shares(keys, olds, new, keys[new].pose)
            if begin:
                # Scans in known places before the stretch are in its local map, too.
                shares *= len(olds) / LOCAL_KEYS
            self._of_keys.append(shares)
        return np.array(self._of_keys[: len(keys)])

    def of_closures(
        self, keys: Sequence[Key], begins: Int, closures: Sequence[Closure]
    ) -> tuple[Int, Float]:
        """For each closure the key scans (c, m) of its map, and their shares (c, m, 3, 3).

        Where there are fewer than m of them the last number is repeated, with shares of zero.

        Args:
            keys: The key scans (k,).
            begins: (k,) for each the first one of its stretch.
            closures: The closures (c,), in the order in which they were accepted.
        """
        most = 2 * self._resolution.submap + 1
        for closure in closures[len(self._olds) :]:
            around = self._resolution.submap_of(closure.old, closure.new)
            olds = [k for k in around if begins[k] == begins[closure.old]]
            pose = compose(keys[closure.old].pose, closure.relative)
            shares = np.zeros((most, 3, 3))
            shares[: len(olds)] = self._shares(keys, olds, closure.new, pose)
            self._of_closures.append(shares)
            self._olds.append(np.array(olds + olds[-1:] * (most - len(olds))))
        if not len(closures):
            return np.empty((0, most), np.int64), np.empty((0, most, 3, 3))
        return np.array(self._olds[: len(closures)]), np.array(self._of_closures[: len(closures)])

    def _shares(self, keys: Sequence[Key], olds: Sequence[int], new: int, pose: Float) -> Float:
        """The shares (m, 3, 3) of old key scans in the match of a new one, along its axes."""
        count = len(olds)
        information = np.zeros((count, 3, 3))
        if not self._resolution.sparse:
            seen = [moved(keys[old].walls, between(pose, keys[old].pose)) for old in olds]
            owners = np.repeat(np.arange(count), [len(walls) for walls in seen])
            sigma, along = self._resolution.sigma, self._resolution.along
            information = shared_information(
                keys[new].surface, np.concatenate(seen), owners, count, along, sigma
            )
        # In a direction that the walls do not fix all have the same share.
        even = information + FLOOR / count
        return np.asarray(np.linalg.solve(even.sum(axis=0), even))


@compiled
def shared_information(
    surface: Float, cloud: Float, owners: Int, count: int, along: float, sigma: float
) -> Float:
    """Information (m, 3, 3) of a scan's pose by the points of each key scan of a map.

    The weights are those of `lrf3d.slam.scan_matching`.

    Args:
        surface: (n, 4) what the scan saw, in its own frame.
        cloud: (p, 4) the points of the map in the same frame.
        owners: (p,) for each point the key scan that saw it, from 0 to m - 1.
        count: How many key scans these are.
        along: How far along a wall a point of it speaks for the wall [m].
        sigma: Standard deviation [m] that a point's distance to its line counts with.
    """
    information = np.zeros((count, 3, 3))
    weights = np.empty(count)
    row = np.empty(3)
    farthest, reach = along * along, REACH * REACH
    for i in range(len(surface)):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        total = sum_x = sum_y = sum_off = 0.0
        for j in range(count):
            weights[j] = 0.0
        for k in range(len(cloud)):
            dx, dy = x - cloud[k, 0], y - cloud[k, 1]
            square = dx * dx + dy * dy
            if square > reach + farthest:
                continue
            mx, my = cloud[k, 2], cloud[k, 3]
            off = mx * dx + my * dy
            beside = 1.0 - (square - off * off) / farthest
            across = 1.0 - off * off / reach
            if mx * nx + my * ny < ALIGNED or beside <= 0.0 or across < 0.0:
                continue
            weight = beside * beside * across * across
            weights[owners[k]] += weight
            total += weight
            sum_x += weight * mx
            sum_y += weight * my
            sum_off += weight * off
        if total < 1e-3:
            continue
        length = np.sqrt(sum_x * sum_x + sum_y * sum_y)
        bounded = 1.0 + (sum_off / total / LAST_SCALE) ** 2
        strength = min(1.0, total) / (bounded * bounded * sigma * sigma * total)
        row[0], row[1] = sum_x / length, sum_y / length
        row[2] = row[1] * x - row[0] * y
        for j in range(count):
            for a in range(3):
                for b in range(3):
                    information[j, a, b] += strength * weights[j] * row[a] * row[b]
    return information
