"""Outlines of occupied cells: where a grid is occupied, as chains of points.

Cells enter; chains of points leave, in half cells, so that all coordinates are whole numbers. Where
a wall is one cell thick, its points are the middles of the cells; around what is thicker, they are
the middles of the edges between an occupied cell and one that is not. A straight wall, drawn cell
by cell at any angle, is so a chain of points that lie within half a cell of one line.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Int

BAND = 1 << 18
"""About how many cells are looked at together: a few megabytes of them, however large the grid."""


@dataclass(frozen=True, slots=True)
class Outline:
    """Points (k, 2) [half cells] one after the other; a closed chain goes back to its first."""

    points: Int
    closed: bool


def chains_of(occupied: Bool) -> tuple[list[Outline], Int]:
    """The chains of a grid, and the lone cells (k, 2) [half cells] that no chain goes through.

    Args:
        occupied: (rows, columns) whether a cell is, the first row at the bottom. What lies outside
            of the grid is as the cells at its border are: no outline runs along the border.
    """
    links, lone = _links(occupied)
    if not len(links):
        return [], lone
    height = 2 * occupied.shape[0] + 2
    keys, ends = np.unique(links, return_inverse=True)
    points = np.column_stack([keys // height, keys % height])
    return list(_walk(points, ends.reshape(-1, 2))), lone


def _links(occupied: Bool) -> tuple[Int, Int]:
    """Pairs (k, 2) of points that follow each other, as keys, and the lone cells."""
    # Cells around the grid are as those at its border; nothing goes through them.
    grid = np.pad(occupied, 1, mode="edge")
    height = 2 * occupied.shape[0] + 2
    rows, columns = grid.shape
    x, y = (2 * np.arange(columns) - 1) * height, 2 * np.arange(rows) - 1
    links, cells = [np.empty((0, 2), np.int64)], [np.empty(0, np.int64)]
    # Bands share a row, so that all that meets in a corner is in one of them.
    step = max(1, BAND // columns)
    for low in range(0, rows - 1, step):
        high, below = min(low + step + 1, rows), max(low - 1, 0)
        around = grid[below : high + 1]
        if around.all() or not around.any():
            continue
        band = grid[low:high]
        inside = np.zeros_like(band)
        inside[int(low == 0) : len(band) - int(high == rows), 1:-1] = True
        thin = band & ~_thick(around)[low - below : high - below] & inside
        middle = x + y[low:high, None]
        links += _thin_links(band, thin, middle)
        links += _edge_links(band, thin, inside, middle, height)
        cells.append(middle[thin])
    pairs = np.sort(np.concatenate(links), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    lone = np.setdiff1d(np.concatenate(cells), pairs)
    return pairs, np.column_stack([lone // height, lone % height])


Quarter = tuple[slice, slice]
_SW: Quarter = (slice(0, -1), slice(0, -1))
_SE: Quarter = (slice(0, -1), slice(1, None))
_NW: Quarter = (slice(1, None), slice(0, -1))
_NE: Quarter = (slice(1, None), slice(1, None))
"""The cells around each corner of the lattice."""


def _thick(grid: Bool) -> Bool:
    """Which cells are part of two by two that are occupied."""
    blocks = grid[_SW] & grid[_SE] & grid[_NW] & grid[_NE]
    thick = np.zeros_like(grid)
    for part in (_SW, _SE, _NW, _NE):
        thick[part] |= blocks
    return thick


def _thin_links(grid: Bool, thin: Bool, middle: Int) -> Iterator[Int]:
    """Links between thin cells side by side, and corner to corner where both others are empty."""
    every, first, rest = slice(None), slice(0, -1), slice(1, None)
    neighbours: list[tuple[Quarter, Quarter]] = [
        ((every, first), (every, rest)),
        ((first, every), (rest, every)),
    ]
    for here, there in neighbours:
        both = thin[here] & thin[there]
        yield np.column_stack([middle[here][both], middle[there][both]])
    for here, there, between, beyond in ((_SW, _NE, _SE, _NW), (_SE, _NW, _SW, _NE)):
        both = thin[here] & thin[there] & ~grid[between] & ~grid[beyond]
        yield np.column_stack([middle[here][both], middle[there][both]])


def _edge_links(grid: Bool, thin: Bool, inside: Bool, middle: Int, height: int) -> Iterator[Int]:
    """Links around thick parts: from edge to edge, past each corner of the lattice."""
    # Each of the edges that meet in a corner lies between two cells, half a cell on from the first.
    sides = {
        "s": (_SW, _SE, height),
        "n": (_NW, _NE, height),
        "w": (_SW, _NW, 1),
        "e": (_SE, _NE, 1),
    }
    met, point, owned = {}, {}, {}
    for side, (one, other, step) in sides.items():
        owner_is_thin = np.where(grid[one], thin[one], thin[other])
        owner = np.where(grid[one], middle[one], middle[other])
        met[side] = (grid[one] != grid[other]) & inside[one] & inside[other]
        point[side] = np.where(owner_is_thin, owner, middle[one] + step)
        owned[side] = owner_is_thin
    saddle = (grid[_SW] == grid[_NE]) & (grid[_SE] == grid[_NW]) & (grid[_SW] != grid[_SE])
    turns = [
        ("s", "n", None),
        ("w", "e", None),
        ("s", "w", _SW),
        ("s", "e", _SE),
        ("n", "w", _NW),
        ("n", "e", _NE),
    ]
    for first, second, corner in turns:
        # Thin cells are linked by themselves. At a saddle the edges of each empty cell turn.
        both = met[first] & met[second] & ~(owned[first] & owned[second])
        both &= ~saddle if corner is None else ~(saddle & grid[corner])
        yield np.column_stack([point[first][both], point[second][both]])


def _walk(points: Int, links: Int) -> Iterator[Outline]:
    """The chains along links (k, 2) between points; straight ways go on through forks."""
    count = len(points)
    either = np.concatenate([links, links[:, ::-1]])
    order = np.argsort(either[:, 0], kind="stable")
    neighbours = either[order, 1].tolist()
    first = np.searchsorted(either[order, 0], np.arange(count + 1)).tolist()
    degree = np.diff(first)
    used: set[tuple[int, int]] = set()

    def chain(start: int, following: int) -> list[int]:
        way = [start, following]
        used.update([(start, following), (following, start)])
        while degree[way[-1]] == 2:
            here, before = way[-1], way[-2]
            one, other = neighbours[first[here] : first[here + 1]]
            there = other if one == before else one
            if (here, there) in used:
                break
            used.update([(here, there), (there, here)])
            way.append(there)
        return way

    ways = []
    for start in np.flatnonzero(degree != 2).tolist():
        for following in neighbours[first[start] : first[start + 1]]:
            if (start, following) not in used:
                ways.append(chain(start, following))
    for way in _through(ways, points):
        closed = way[0] == way[-1]
        yield Outline(points[way[:-1] if closed else way], closed)
    for start in range(count):
        if degree[start] == 2:
            following = neighbours[first[start]]
            if (start, following) not in used:
                yield Outline(points[chain(start, following)[:-1]], True)


LOOK = 12
"""Points along a chain that give its direction."""

STRAIGHT_ON = -0.9
"""Largest cosine between the ways out of a fork that go on in each other: within 26°."""


def _through(ways: list[list[int]], points: Int) -> list[list[int]]:
    """The ways with those joined that go straight on through a fork, the straightest first."""
    at: dict[int, list[tuple[int, int]]] = {}
    heading = {}
    for number, way in enumerate(ways):
        if way[0] == way[-1]:
            continue
        for end in (0, -1):
            node = way[end]
            ahead = way[min(LOOK, len(way) - 1)] if end == 0 else way[max(-LOOK - 1, -len(way))]
            delta = (points[ahead] - points[node]).astype(np.float64)
            heading[number, end] = delta / np.hypot(*delta)
            at.setdefault(node, []).append((number, end))
    partner: dict[tuple[int, int], tuple[int, int]] = {}
    for ends in at.values():
        pairs = [
            (float(heading[one] @ heading[other]), one, other)
            for place, one in enumerate(ends)
            for other in ends[:place]
        ]
        for cosine, one, other in sorted(pairs):
            if cosine > STRAIGHT_ON:
                break
            if one not in partner and other not in partner:
                partner[one], partner[other] = other, one
    joined, left = [], set(range(len(ways)))
    # Open ways are begun at an end that nothing goes on from; rings of ways wherever they are.
    starts = [(n, end) for n in range(len(ways)) for end in (0, -1) if (n, end) not in partner]
    for number, end in starts + [(n, 0) for n in range(len(ways))]:
        if number not in left:
            continue
        line: list[int] = []
        while number in left:
            left.discard(number)
            part = ways[number] if end == 0 else ways[number][::-1]
            line += part if not line else part[1:]
            following = partner.get((number, -1 if end == 0 else 0))
            if following is None:
                break
            number, end = following
        joined.append(line)
    return joined
