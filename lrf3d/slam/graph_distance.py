"""Graph distances: how far key scans are from each other over driven ways and closures.

Links between key scans enter one by one; the shortest ways from one key scan to those around it
leave, at a cost that depends on how many are as near as those asked for, not on the whole graph.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Bool, Float, Int

LEAST_ROOM = 256
"""Links that a new graph has room for."""


class DistanceGraph:
    """Key scans and the links between them, in arrays that grow in place."""

    def __init__(self) -> None:
        self._count = 0
        self._links = 0
        # The newest link of each key scan; for each link the one before it, its end and length.
        self._newest = np.full(LEAST_ROOM, -1, np.int64)
        self._before = np.empty(2 * LEAST_ROOM, np.int64)
        self._ends = np.empty(2 * LEAST_ROOM, np.int64)
        self._lengths = np.empty(2 * LEAST_ROOM)

    def add(self) -> None:
        """Add a key scan."""
        if self._count == len(self._newest):
            self._newest = np.append(self._newest, np.full(self._count, -1))
        self._count += 1

    def link(self, first: int, second: int, length: float) -> None:
        """Link two key scans by a way of some length [m]."""
        if self._links + 2 > len(self._ends):
            self._before = np.append(self._before, np.empty_like(self._before))
            self._ends = np.append(self._ends, np.empty_like(self._ends))
            self._lengths = np.append(self._lengths, np.empty_like(self._lengths))
        for start, end in ((first, second), (second, first)):
            self._before[self._links] = self._newest[start]
            self._ends[self._links] = end
            self._lengths[self._links] = length
            self._newest[start] = self._links
            self._links += 1

    def distances(self, start: int, limit: float, wanted: Bool) -> Float:
        """The shortest ways (k,) [m] from a key scan to those of a mask (k,).

        It is +inf beyond a limit [m]; to others it may be longer than the shortest one.
        """
        newest = self._newest[: self._count]
        return shortest_distances(
            start, limit, wanted, newest, self._before, self._ends, self._lengths
        )


@compiled
def shortest_distances(
    start: int, limit: float, wanted: Bool, newest: Int, before: Int, ends: Int, lengths: Float
) -> Float:
    """Dijkstra's ways from a start, over linked lists of links, until no wanted one is left."""
    ways = np.full(len(newest), np.inf)
    left = 0
    for node in range(len(wanted)):
        left += wanted[node]
    # A heap of key scans by their ways; one that was found again, and nearer, stands in it twice.
    nodes = np.empty(64, np.int64)
    keys = np.empty(64)
    nodes[0], keys[0] = start, 0.0
    size = 1
    ways[start] = 0.0
    while size > 0:
        node, way = nodes[0], keys[0]
        size -= 1
        remove_least(nodes, keys, size)
        if way > ways[node]:
            continue
        # A robot that comes by again is near what it saw before over few links, however many
        # others there are within the limit.
        left -= wanted[node]
        if left == 0:
            break
        link = newest[node]
        while link >= 0:
            farther = way + lengths[link]
            end = ends[link]
            if farther < ways[end] and farther <= limit:
                ways[end] = farther
                if size == len(nodes):
                    more_nodes, more_keys = np.empty(2 * size, np.int64), np.empty(2 * size)
                    for k in range(size):
                        more_nodes[k], more_keys[k] = nodes[k], keys[k]
                    nodes, keys = more_nodes, more_keys
                insert(nodes, keys, size, end, farther)
                size += 1
            link = before[link]
    return ways


@borrower
def insert(nodes: Int, keys: Float, size: int, node: int, key: float) -> None:
    """Insert a node by its key into a heap of a size; there must be room for it."""
    place = size
    while place > 0 and keys[(place - 1) // 2] > key:
        nodes[place], keys[place] = nodes[(place - 1) // 2], keys[(place - 1) // 2]
        place = (place - 1) // 2
    nodes[place], keys[place] = node, key


@borrower
def remove_least(nodes: Int, keys: Float, size: int) -> None:
    """Remove the first, the least, of a heap of which a size is left."""
    last, key = nodes[size], keys[size]
    place = 0
    while 2 * place + 1 < size:
        child = 2 * place + 1
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        nodes[place], keys[place] = nodes[child], keys[child]
        place = child
    nodes[place], keys[place] = last, key
