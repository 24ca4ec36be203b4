"""Tours: the order in which to visit places so that the drive shows the most walls."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.planning.free_space import FreeSpace
from lrf3d.planning.lookouts import Views

LEAST_WORTH = 0.02
"""Least length of wall [m] that each additional metre of driving must show."""

POSITIONS = 3
"""Number of positions in the tour, those with the shortest detours, that are tried for a place."""


@dataclass(frozen=True)
class Network:
    """The cheapest paths between places, and what they show.

    Args:
        space: The free space.
        views: What is seen in it.
        places: (k,) the places.
        costs: (k, k) cost of the path between any two.
        before: (k, all places) the place before each on the path from each of the places.
    """

    space: FreeSpace
    views: Views
    places: Int
    costs: Float
    before: Any
    legs: dict[tuple[int, int], tuple[Int, float, Bool]] = field(default_factory=dict)

    @classmethod
    def between(cls, space: FreeSpace, views: Views, places: Int) -> "Network":
        """The network between places (k,) of a free space."""
        from scipy.sparse.csgraph import dijkstra

        costs, before = dijkstra(space.graph, indices=places, return_predecessors=True)
        return cls(space, views, places, costs[:, places], before)

    def leg(self, start: int, end: int) -> tuple[Int, float, Bool]:
        """The path from one place to another, its length [m], and the pieces seen along it."""
        if (start, end) not in self.legs:
            path = path_to(self.before[start], int(self.places[end]))
            seen = self.views.along(self.space.places, path)
            self.legs[start, end] = path, self.space.length(path), seen
        return self.legs[start, end]


def path_to(before: Any, end: int) -> Int:
    """The places of the path to an end, given the place before each."""
    path = [end]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])


def find_tour(network: Network, *, longest: float, from_first: bool) -> list[Int]:
    """The paths of a tour that shows much and is not longer than allowed [m].

    It grows by one place after the other, always the one that shows the most additional wall for
    each additional metre.

    Args:
        network: The places, one or more.
        longest: Longest tour [m].
        from_first: Whether the tour begins at the first of the places.
    """
    order, kept = [0], int(from_first)
    while True:
        found = max(_insertions(network, order, longest, kept), default=None)
        if found is None:
            break
        _, place, position = found
        order.insert(-position, place)
        order = _two_opt(network.costs, order, kept)
    tours = [order] if from_first else [order, order[::-1]]
    # What is seen depends on the direction of the drive.
    legs = [[network.leg(*ends) for ends in pairwise(tour)] for tour in tours]
    best = max(legs, key=lambda tour: network.views.worth(_seen(network, tour)))
    return [path for path, _, _ in best]


def _seen(network: Network, legs: list[tuple[Int, float, Bool]]) -> Bool:
    """The pieces seen along legs."""
    nothing = np.zeros(len(network.views.weights), dtype=np.bool_)
    return np.asarray(np.any([nothing, *(seen for _, _, seen in legs)], axis=0))


def _insertions(
    network: Network, order: list[int], longest: float, kept: int
) -> Iterator[tuple[float, int, int]]:
    """Worth for each metre, place and negated position of each place that may be inserted."""
    views, costs = network.views, network.costs
    legs = [network.leg(*ends) for ends in pairwise(order)]
    length = sum(leg[1] for leg in legs)
    times_seen = np.sum([leg[2] for leg in legs], axis=0, dtype=np.int32) if legs else 0
    worth = views.worth(np.asarray(times_seen > 0) & np.ones(len(views.weights), dtype=np.bool_))
    for place in sorted(set(range(len(network.places))) - set(order)):
        detours = [
            sum(costs[one, place] for one in _around(order, position))
            - sum(costs[ends] for ends in pairwise(_around(order, position)))
            for position in range(kept, len(order) + 1)
        ]
        for position in (kept + np.argsort(detours, kind="stable")[:POSITIONS]).tolist():
            around = _around(order, position)
            others, new_length = times_seen, length
            if len(around) == 2:
                others, new_length = (
                    times_seen - legs[position - 1][2],
                    length - legs[position - 1][1],
                )
            through = [
                *order[max(position - 1, 0) : position],
                place,
                *order[position : position + 1],
            ]
            new_legs = [network.leg(*ends) for ends in pairwise(through)]
            new_length += sum(leg[1] for leg in new_legs)
            seen = (others > 0) | np.any([leg[2] for leg in new_legs], axis=0)
            gain, metres = views.worth(seen) - worth, new_length - length
            if new_length <= longest and gain > LEAST_WORTH * metres:
                yield gain / max(metres, 1.0), place, -position


def _around(order: list[int], position: int) -> list[int]:
    """The one or two places of a tour next to a position between them."""
    return order[max(position - 1, 0) : position + 1]


def _two_opt(costs: Float, order: list[int], kept: int) -> list[int]:
    """Reverse pieces of an open tour, after the kept places, as long as that is cheaper."""
    tour, count = list(order), len(order)
    better = True
    while better:
        better = False
        for first in range(kept, count - 1):
            for last in range(first + 1, count):
                gain = 0.0
                if first > 0:
                    gain += costs[tour[first - 1], tour[first]] - costs[tour[first - 1], tour[last]]
                if last < count - 1:
                    gain += costs[tour[last], tour[last + 1]] - costs[tour[first], tour[last + 1]]
                # Rounding alone must not reverse a piece back and forth forever.
                if gain > 1e-9:
                    tour[first : last + 1] = tour[first : last + 1][::-1]
                    better = True
    return tour
