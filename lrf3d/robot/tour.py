"""Tours: the order in which to visit places so that the drive shows the most walls.

The input is a free space and what is visible in it; the output is the paths of the tour, as cells.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.robot.free_space import FreeSpace
from lrf3d.robot.viewpoints import Views

LEAST_WORTH = 0.02
"""Least length of wall [m] that each additional metre of driving must show."""

STARTS = 3
"""Number of places from which tours are grown."""

POSITIONS = 3
"""Number of positions in the tour, those with the cheapest detours, that are tried for a place."""


@dataclass(frozen=True)
class Network:
    """The cheapest paths between places, and what they show.

    Args:
        space: The free space.
        views: What is visible in it.
        places: (k,) the cells of the places.
        costs: (k, k) cost of the path between any two.
        before: (k, cells) the cell before each on the path from each place.
    """

    space: FreeSpace
    views: Views
    places: Int
    costs: Float
    before: Any
    paths: dict[tuple[int, int], Int] = field(default_factory=dict)
    shown: dict[tuple[int, int], Bool] = field(default_factory=dict)

    @classmethod
    def between(cls, space: FreeSpace, views: Views, places: Int) -> "Network":
        """The network of the cheapest paths between cells (k,)."""
        from scipy.sparse.csgraph import dijkstra

        costs, before = dijkstra(space.graph, indices=places, return_predecessors=True)
        return cls(space, views, places, costs[:, places], before)

    def path(self, start: int, end: int) -> Int:
        """The cells from one place to another."""
        if (start, end) not in self.paths:
            cells = [int(self.places[end])]
            while cells[-1] != self.places[start]:
                cells.append(int(self.before[start, cells[-1]]))
            self.paths[start, end] = np.array(cells[::-1])
            self.paths[end, start] = np.array(cells)
        return self.paths[start, end]

    def length(self, start: int, end: int) -> float:
        """Length [m] of the path from one place to another."""
        return self.space.length(self.path(start, end))

    def seen(self, start: int, end: int) -> Bool:
        """Which pieces of wall are seen along the path from one place to another."""
        if (start, end) not in self.shown:
            self.shown[start, end] = self.views.along(self.space.cells, self.path(start, end))
        return self.shown[start, end]

    def tour_length(self, order: list[int]) -> float:
        """Length [m] of the path through places in an order."""
        return sum(self.length(*leg) for leg in pairwise(order))


def best_tour(network: Network, *, longest: float, from_first: bool = False) -> list[int]:
    """An order of places whose path shows much and is not longer than allowed.

    Tours are grown from each of the places that show the most, and the best is kept.

    Args:
        network: The places, one or more.
        longest: Longest tour [m].
        from_first: Whether the tour begins at the first of the places.

    Raises:
        InputError: No place shows a wall.
    """
    if not len(network.places):
        raise InputError(
            "no wall can be seen from where the robot has room to drive; give a larger"
            " laser.range_max, or a route"
        )
    if from_first:
        return _grown(network, 0, longest, kept=1)
    count = min(STARTS, len(network.places))
    tours = [_grown(network, start, longest) for start in range(count)]
    # What is visible along a path depends on the direction of the drive.
    directed = [order for tour in tours for order in (tour, tour[::-1])]
    return max(directed, key=lambda order: _worth(network, order))


def _grown(network: Network, start: int, longest: float, kept: int = 0) -> list[int]:
    """A tour from a first place, to which one place after the other is added.

    It is always the one that shows the most additional wall for each additional metre. The first
    ``kept`` places stay at the beginning.
    """
    order = [start]
    while len(order) < len(network.places):
        found = max(_insertions(network, order, longest, kept), default=None)
        if found is None:
            break
        _, place, position = found
        order.insert(-position, place)
        order = _two_opt(network, order, kept)
    return order


def _insertions(
    network: Network, order: list[int], longest: float, kept: int
) -> Iterator[tuple[float, int, int]]:
    """Worth for each metre, place and negated position of each place that may be inserted."""
    views = network.views
    legs = [network.seen(*leg) for leg in pairwise(order)]
    times_seen = np.sum(legs, axis=0, dtype=np.int32) if legs else np.zeros(len(views.weights), int)
    worth, length = views.worth(np.asarray(times_seen > 0)), network.tour_length(order)
    for place in range(len(network.places)):
        if place in order:
            continue
        detours = [
            _detour(network.costs, order, position, place)
            for position in range(kept, len(order) + 1)
        ]
        for position in (kept + np.argsort(detours, kind="stable")[:POSITIONS]).tolist():
            before, after = order[max(position - 1, 0) : position], order[position : position + 1]
            others, new_length = times_seen, length
            if before and after:
                others = times_seen - legs[position - 1]
                new_length -= network.length(*before, *after)
            new_legs = list(pairwise([*before, place, *after]))
            seen = (others > 0) | np.any([network.seen(*leg) for leg in new_legs], axis=0)
            new_length += sum(network.length(*leg) for leg in new_legs)
            gain = views.worth(np.asarray(seen)) - worth
            if new_length <= longest and gain > LEAST_WORTH * (new_length - length):
                yield gain / max(new_length - length, 1.0), place, -position


def _detour(costs: Float, order: list[int], position: int, place: int) -> float:
    """Cost of inserting a place into a tour at a position."""
    detour = 0.0
    if position > 0:
        detour += costs[order[position - 1], place]
    if position < len(order):
        detour += costs[place, order[position]]
    if 0 < position < len(order):
        detour -= costs[order[position - 1], order[position]]
    return float(detour)


def _worth(network: Network, order: list[int]) -> float:
    """Weight of the walls that are visible along a tour."""
    legs = [network.seen(*leg) for leg in pairwise(order)]
    return network.views.worth(np.any(legs, axis=0)) if legs else 0.0


def _two_opt(network: Network, order: list[int], kept: int) -> list[int]:
    """Reverse pieces of an open tour, after the kept places, as long as that is cheaper."""
    costs, tour, count = network.costs, list(order), len(order)
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
