"""Shortest paths over the graph of key scans: their lengths, and how uncertain they leave a pose.

The links of the graph enter, each with the error that a step over it adds; the shortest paths from
one key scan to all others leave, and the covariances of its pose as seen from them. Those of one
path alone are an upper bound of the graph's own, at a hundredth of the time.
"""

from heapq import heappop, heappush

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int

LEAST_ROOM = 256
"""Links that there is room for at first."""


class GraphPaths:
    """The links between key scans."""

    def __init__(self) -> None:
        self.count = 0
        self._links = 0
        self._ends = np.empty((LEAST_ROOM, 2), np.int64)
        self._lengths = np.empty(LEAST_ROOM)
        self._covariances = np.empty((LEAST_ROOM, 3, 3))

    def link(self, first: int, second: int, length: float, covariance: Float) -> None:
        """Join two key scans by a link of a length [m].

        The covariance (3, 3) is that of the second as seen from the first, along its axes.
        """
        if self._links == len(self._lengths):
            for name in ("_ends", "_lengths", "_covariances"):
                old = getattr(self, name)
                setattr(self, name, np.concatenate([old, np.empty_like(old)]))
        row = self._links
        self._ends[row], self._lengths[row] = (first, second), length
        self._covariances[row] = covariance
        self._links += 1
        self.count = max(self.count, first + 1, second + 1)

    def lengths(self, source: int, limit: float) -> Float:
        """Lengths (k,) [m] of the paths from a key scan to all, +inf beyond a limit [m]."""
        return self._shortest(source, limit)[0]

    def _shortest(self, source: int, limit: float) -> tuple[Float, Int, Int]:
        count, links = max(self.count, source + 1), self._links
        return _shortest(source, limit, count, self._ends[:links], self._lengths[:links])

    def spreads(self, source: int, poses: Float, limit: float) -> tuple[Float, Float]:
        """Lengths (k,) of paths [m], and covariances (k, 3, 3) of a pose with each other one held.

        The poses (k, 3) are those of all key scans; lengths are +inf beyond the limit [m], and
        covariances along the axes of the map.
        """
        lengths, last, order = self._shortest(source, limit)
        links = last[order[1:]]
        ends = self._ends[links]
        # Errors as twists about the origin: those of the links of a path add up.
        twist = np.zeros((len(links), 3, 3))
        cos, sin = np.cos(poses[ends[:, 0], 2]), np.sin(poses[ends[:, 0], 2])
        twist[:, 0, 0], twist[:, 0, 1], twist[:, 0, 2] = cos, -sin, poses[ends[:, 1], 1]
        twist[:, 1, 0], twist[:, 1, 1], twist[:, 1, 2] = sin, cos, -poses[ends[:, 1], 0]
        twist[:, 2, 2] = 1.0
        own = twist @ self._covariances[links] @ twist.transpose(0, 2, 1)
        before = np.where(ends[:, 0] == order[1:], ends[:, 1], ends[:, 0])
        sums = _sums_along(order[1:], before, own, len(lengths))
        lever = np.array([[1.0, 0.0, -poses[source, 1]], [0.0, 1.0, poses[source, 0]], [0, 0, 1.0]])
        return lengths, np.asarray(lever @ sums @ lever.T)


@compiled
def _shortest(
    source: int, limit: float, count: int, ends: Int, lengths: Float
) -> tuple[Float, Int, Int]:
    """Lengths (k,) of the paths from a key scan, their last links (k,), and their order (r,).

    By Dijkstra: the order is that of the lengths, of those within the limit.
    """
    heads, following = np.full(count, -1), np.empty(ends.shape, np.int64)
    for link in range(len(ends)):
        for side in range(2):
            following[link, side] = heads[ends[link, side]]
            heads[ends[link, side]] = 2 * link + side
    found, last, order = np.full(count, np.inf), np.full(count, -1), np.empty(count, np.int64)
    found[source], settled = 0.0, 0
    heap = [(0.0, source)]
    while heap:
        length, k = heappop(heap)
        if length > found[k]:
            continue
        order[settled] = k
        settled += 1
        place = heads[k]
        while place >= 0:
            link, side = place // 2, place % 2
            other, through = ends[link, 1 - side], length + lengths[link]
            if through < found[other] and through <= limit:
                found[other], last[other] = through, link
                heappush(heap, (through, other))
            place = following[link, side]
    return found, last, order[:settled]


@compiled
def _sums_along(order: Int, before: Int, own: Float, count: int) -> Float:
    """The sums (k, 3, 3) of what the links of each path bring, from the nearest to the farthest."""
    sums = np.zeros((count, 3, 3))
    for row, k in enumerate(order):
        for a in range(3):
            for b in range(3):
                sums[k, a, b] = sums[before[row], a, b] + own[row, a, b]
    return sums
