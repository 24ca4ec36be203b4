"""Tracking: which object of a map is which object of the map before.

A mapper numbers the objects of each map from the start. These numbers last: an object keeps its
number while it grows, merged objects take the number of the largest, and when an object splits, its
largest part keeps the number.
"""

import numpy as np
import shapely

from lrf3d.geometry.lines import Float, Int, lengths, sealed
from lrf3d.mapping.line_map import LineMap

# [m] Largest shift of a segment from one map to the next: more than noise moves it, less than the
# distance of walls that face each other.
_NEAR = 0.5

# [share] Places along a segment at which it is compared, off its ends, where others begin.
_PLACES = (np.arange(3) + 0.5) / 3


class ObjectTracker:
    """Assigns lasting numbers to the objects of successive maps; `count` is how many there are."""

    def __init__(self) -> None:
        self._map = LineMap.empty()
        self._numbers: Int = np.zeros(0, np.int64)
        self.count = 0

    def follow(self, line_map: LineMap) -> Int:
        """The lasting number (m,) of the object of each segment of the next map."""
        unions, union = np.unique(line_map.objects, return_inverse=True)
        votes = shared_lengths(line_map.segments, self._map.segments, _NEAR)
        number = _paired(union[votes[0]], self._numbers[votes[1]], votes[2], len(unions))
        new = np.flatnonzero(number < 0)
        number[new] = self.count + np.arange(len(new))
        self.count += len(new)
        self._map = line_map
        self._numbers = sealed(number[union])
        return self._numbers


def numbers_by_truth(numbers: Int, line_map: LineMap, walls: Float, objects: Int) -> dict[int, int]:
    """The true object, of those (n,) of true walls (n, 4), of each number (m,).

    A true object has one number at most.
    """
    segment, wall, shared = shared_lengths(line_map.segments, walls, 2.0 * _NEAR)
    known, index = np.unique(numbers, return_inverse=True)
    truth = _paired(index[segment], objects[wall], shared, len(known))
    return {int(n): int(t) for n, t in zip(known, truth, strict=True) if t >= 0}


def shared_lengths(segments: Float, others: Float, near: float) -> tuple[Int, Int, Float]:
    """Pairs of segments (v,) and others (v,) that overlap, and by how much (v,) [m]; some twice."""
    if not len(segments) or not len(others):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    # Most segments of a large map have not moved since the map before.
    order = np.argsort(others[:, 0], kind="stable")
    place = np.searchsorted(others[order, 0], segments[:, 0]).clip(max=len(others) - 1)
    still = np.flatnonzero((others[order[place]] == segments).all(axis=1))
    moved = np.setdiff1d(np.arange(len(segments)), still)
    start, end = segments[moved, None].reshape(-1, 2, 1, 2).swapaxes(0, 1)
    places = shapely.points((start + _PLACES[:, None] * (end - start)).reshape(-1, 2))
    tree = shapely.STRtree(shapely.linestrings(others.reshape(-1, 2, 2)))
    near_by, nearest = tree.query_nearest(places, max_distance=near, all_matches=False)
    segment = np.append(still, moved[near_by // len(_PLACES)])
    votes = np.repeat([1, len(_PLACES)], [len(still), len(nearest)])
    return segment, np.append(order[place[still]], nearest), lengths(segments)[segment] / votes


def _paired(first: Int, second: Int, shared: Float, count: int) -> Int:
    """For each of the first (count,) the second that it shares most with, or −1.

    Pairs are made in the order of what they share; each is in one pair.
    """
    result = np.full(count, -1, np.int64)
    if not len(first):
        return result
    pairs, pair = np.unique(np.column_stack([first, second]), axis=0, return_inverse=True)
    total = np.bincount(pair.reshape(-1), weights=shared)
    taken: set[int] = set()
    for one, other in pairs[np.argsort(-total, kind="stable")].tolist():
        if result[one] < 0 and other not in taken:
            result[one] = other
            taken.add(other)
    return result
