"""Tours: the order in which to visit places so that the drive shows the most walls."""

from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.planning.free_space import FreeSpace
from lrf3d.planning.lookouts import Views

LEAST_WORTH = 0.02
"""Least length of wall [m] that each additional metre of driving must show."""

POSITIONS = 3
"""Number of positions in the tour, those with the shortest detours, that are tried for a place."""

NOWHERE = -1
"""Stands before the first place of a tour and behind the last, where paths cost nothing."""


@dataclass(frozen=True)
class Network:
    """The cheapest paths between places (k,), what they cost, and what is seen along them.

    Costs (k + 1, k + 1) end with those to nowhere; ``before`` (k, all places) has the place before
    each on the path from each of the places.
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
        return cls(space, views, places, np.pad(costs[:, places], (0, 1)), before)

    def leg(self, start: int, end: int) -> tuple[Int, float, Bool]:
        """The path from one place to another, its length [m], and the pieces seen along it."""
        if (start, end) not in self.legs:
            path = path_to(self.before[start], int(self.places[end]))
            seen = self.views.along(self.space.places, path)
            self.legs[start, end] = path, self.space.length(path), seen
        return self.legs[start, end]

    def legs_of(self, order: list[int]) -> list[tuple[Int, float, Bool]]:
        """The legs of a tour."""
        return [self.leg(*ends) for ends in pairwise(order)]

    def worth(self, seen: Bool) -> float:
        """Total weight of seen pieces."""
        return float(self.views.weights @ seen)


def path_to(before: Any, end: int) -> Int:
    """The places of the path to an end, given the place before each."""
    path = [end]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])


def find_tour(network: Network, *, longest: float, from_first: bool) -> list[Int]:
    """The paths of a tour that shows much and is not longer than allowed [m].

    It grows by one place after the other, always the one that shows the most additional wall for
    each additional metre. It begins at the first of the places (one or more) if asked to.
    """
    order, kept = [0], int(from_first)
    while (longer := _longer(network, order, longest, kept)) is not None:
        order = _two_opt(network.costs, longer, kept)
    tours = [network.legs_of(order), network.legs_of(order[::-1])][: 2 - kept]
    # What is seen depends on the direction of the drive.
    best = max(tours, key=lambda legs: network.worth(_ahead(network, legs)[-1]))
    return [path for path, _, _ in best]


def _ahead(network: Network, legs: list[tuple[Int, float, Bool]]) -> Bool:
    """What is seen (legs + 1, pieces) on no leg, on the first, on the first two, and so on."""
    nothing = np.zeros(len(network.views.weights), dtype=np.bool_)
    return np.asarray(np.logical_or.accumulate([nothing, *(seen for _, _, seen in legs)]))


def _longer(network: Network, order: list[int], longest: float, kept: int) -> list[int] | None:
    """The tour with the one more place that shows the most for each metre of detour, or None."""
    costs, legs = network.costs, network.legs_of(order)
    before, after = _ahead(network, legs), _ahead(network, legs[::-1])[::-1]
    worth, length = network.worth(before[-1]), sum(leg[1] for leg in legs)
    best, most = None, 0.0
    ends = np.array([NOWHERE, *order, NOWHERE])
    for place in sorted(set(range(len(costs) - 1)) - set(order)):
        detours = costs[ends[:-1], place] + costs[place, ends[1:]] - costs[ends[:-1], ends[1:]]
        for at in kept + np.argsort(detours[kept:], kind="stable")[:POSITIONS]:
            new = network.legs_of([*order[max(at - 1, 0) : at], place, *order[at : at + 1]])
            old = legs[max(at - 1, 0) : at] if at < len(order) else []
            metres = sum(leg[1] for leg in new) - sum(leg[1] for leg in old)
            seen = before[max(at - 1, 0)] | after[min(at, len(legs))]
            gain = network.worth(seen | _ahead(network, new)[-1]) - worth
            if gain > max(LEAST_WORTH * metres, most * max(metres, 1.0)):
                if length + metres <= longest:
                    most = gain / max(metres, 1.0)
                    best = [*order[:at], place, *order[at:]]
    return best


def _two_opt(costs: Float, order: list[int], kept: int) -> list[int]:
    """Reverse pieces of an open tour, after the kept places, as long as that is cheaper."""
    tour = [NOWHERE, *order, NOWHERE]
    better = True
    while better:
        better = False
        for first, last in combinations(range(1 + kept, len(tour) - 1), 2):
            before, one, other, after = (tour[at] for at in (first - 1, first, last, last + 1))
            gain = costs[before, one] + costs[other, after]
            gain -= costs[before, other] + costs[one, after]
            # Rounding alone must not reverse a piece back and forth forever.
            if gain > 1e-9:
                tour[first : last + 1] = tour[first : last + 1][::-1]
                better = True
    return tour[1:-1]
