"""Ways over the graph of key scans: how long they are, and how uncertain they leave a pose.

The links of the graph enter, each with the error that a step over it adds; the shortest ways from
one key scan to all others leave, and the covariances of its pose as seen from them. Those of one
way alone are an upper bound of the graph's own, at a hundredth of the time.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int

LEAST_ROOM = 256
"""Links that there is room for at first."""


class Ways:
    """The links between key scans."""

    def __init__(self) -> None:
        self.count = 0
        self._links = 0
        self._ends = np.empty((LEAST_ROOM, 2), np.int64)
        self._lengths = np.empty(LEAST_ROOM)
        self._covariances = np.empty((LEAST_ROOM, 3, 3))
        self._scales = np.empty((LEAST_ROOM, 3))

    def link(self, first: int, second: int, length: float, covariance: Float, scale: Float) -> None:
        """Join two key scans by a way of a length [m], with the covariance (3, 3) of the second.

        It is that of its pose as seen from the first, along its axes; ``scale`` (3,) is how that
        pose moves if wheels measure every distance too long by a share of one.
        """
        if self._links == len(self._lengths):
            for name in ("_ends", "_lengths", "_covariances", "_scales"):
                old = getattr(self, name)
                setattr(self, name, np.concatenate([old, np.empty_like(old)]))
        row = self._links
        self._ends[row], self._lengths[row] = (first, second), length
        self._covariances[row], self._scales[row] = covariance, scale
        self._links += 1
        self.count = max(self.count, first + 1, second + 1)

    def _shortest(self, source: int, limit: float) -> tuple[Float, Int]:
        """Lengths (k,) [m] of the ways from a key scan, and on each the key scan before its end."""
        ends, count = self._ends[: self._links], max(self.count, source + 1)
        # A length of 0 would be no link.
        lengths = np.maximum(self._lengths[: self._links], 1e-9)
        graph = csr_array((lengths, (ends[:, 0], ends[:, 1])), shape=(count, count))
        found, before = dijkstra(
            graph, directed=False, indices=[source], limit=limit, return_predecessors=True
        )
        return np.asarray(found[0]), np.asarray(before[0], dtype=np.int64)

    def lengths(self, source: int, limit: float) -> Float:
        """Lengths (k,) [m] of the ways from a key scan to all, +inf beyond a limit [m]."""
        return self._shortest(source, limit)[0]

    def spreads(self, source: int, poses: Float, limit: float, scale: float) -> tuple[Float, Float]:
        """Lengths (k,) of ways [m], and covariances (k, 3, 3) of a pose with each other one held.

        The poses (k, 3) are those of all key scans; lengths are +inf beyond the limit [m], and
        covariances along the axes of the map. The scale is that of the wheels, its deviation.
        """
        lengths, before = self._shortest(source, limit)
        ends = self._ends[: self._links]
        # Errors as twists about the origin: those of the links of a way add up.
        twist = np.zeros((self._links, 3, 3))
        cos, sin = np.cos(poses[ends[:, 0], 2]), np.sin(poses[ends[:, 0], 2])
        twist[:, 0, 0], twist[:, 0, 1], twist[:, 0, 2] = cos, -sin, poses[ends[:, 1], 1]
        twist[:, 1, 0], twist[:, 1, 1], twist[:, 1, 2] = sin, cos, -poses[ends[:, 1], 0]
        twist[:, 2, 2] = 1.0
        own = twist @ self._covariances[: self._links] @ twist.transpose(0, 2, 1)
        moves = np.einsum("eij,ej->ei", twist, self._scales[: self._links])
        order = np.argsort(lengths, kind="stable")[: np.isfinite(lengths).sum()]
        sums, moved = _along(order, before, ends, own, moves)
        lever = np.array([[1.0, 0.0, -poses[source, 1]], [0.0, 1.0, poses[source, 0]], [0, 0, 1.0]])
        together = sums + scale**2 * moved[:, :, None] * moved[:, None, :]
        return lengths, np.asarray(lever @ together @ lever.T)


@compiled
def _along(order: Int, before: Int, ends: Int, own: Float, moves: Float) -> tuple[Float, Float]:
    """Sums over the links of each way (k, 3, 3), (k, 3), from the nearest to the farthest."""
    sums, moved = np.zeros((len(before), 3, 3)), np.zeros((len(before), 3))
    # The links of each key scan, as lists through all of them.
    heads = np.full(len(before), -1, np.int64)
    following = np.full(2 * len(ends), -1, np.int64)
    for link in range(len(ends)):
        for side in range(2):
            following[2 * link + side] = heads[ends[link, side]]
            heads[ends[link, side]] = 2 * link + side
    for k in order:
        if before[k] < 0:
            continue
        entry = heads[k]
        while ends[entry // 2, 1 - entry % 2] != before[k]:
            entry = following[entry]
        link = entry // 2
        # Over a link against its sense the scale counts against its sense, too.
        sign = 1.0 if ends[link, 0] == k else -1.0
        for a in range(3):
            moved[k, a] = moved[before[k], a] + sign * moves[link, a]
            for b in range(3):
                sums[k, a, b] = sums[before[k], a, b] + own[link, a, b]
    return sums, moved
