"""Outlines of the occupied cells of a grid, as chains of points.

Coordinates are in half cells, so that they are whole numbers. The points of a wall that is one cell
thick are the middles of its cells; those of a thicker one are the middles of the edges between
occupied cells and others. The points of a straight wall at any angle then lie within half a cell of
one line.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Int

BAND = 1 << 18
"""Approximate number of cells in a band that is processed at a time: some megabytes."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A chain of points (k, 2) [half cells]; a closed one ends at its first point."""

    points: Int
    closed: bool


def chains_of(occupied: Bool) -> tuple[list[Outline], Int]:
    """The outlines of a grid, and the single cells (k, 2) [half cells] that belong to none.

    Args:
        occupied: (rows, columns) whether each cell is occupied; the first row is at the bottom.
            Beyond the grid the cells at its border continue: no outline runs along the border.
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
    # The grid is extended by the cells at its border, which outlines do not enter.
    grid = np.pad(occupied, 1, mode="edge")
    height = 2 * occupied.shape[0] + 2
    rows, columns = grid.shape
    x, y = (2 * np.arange(columns) - 1) * height, 2 * np.arange(rows) - 1
    links, cells = [np.empty((0, 2), np.int64)], [np.empty(0, np.int64)]
    # Bands share a row, so that the four cells at each corner lie in one band.
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
        # Thin cells have links of their own. At a saddle the outline turns around each empty cell.
        both = met[first] & met[second] & ~(owned[first] & owned[second])
        both &= ~saddle if corner is None else ~(saddle & grid[corner])
        yield np.column_stack([point[first][both], point[second][both]])


def _walk(points: Int, links: Int) -> Iterator[Outline]:
    """The chains along links (k, 2) between points; straight ones continue through forks."""
    count = len(points)
    either = np.concatenate([links, links[:, ::-1]])
    order = np.argsort(either[:, 0], kind="stable")
    neighbours = either[order, 1].tolist()
    first = np.searchsorted(either[order, 0], np.arange(count + 1)).tolist()
    degree = np.diff(first)
    used: set[tuple[int, int]] = set()

    def chain(start: int, following: int) -> list[int]:
        path = [start, following]
        used.update([(start, following), (following, start)])
        while degree[path[-1]] == 2:
            here, before = path[-1], path[-2]
            one, other = neighbours[first[here] : first[here + 1]]
            there = other if one == before else one
            if (here, there) in used:
                break
            used.update([(here, there), (there, here)])
            path.append(there)
        return path

    paths = []
    for start in np.flatnonzero(degree != 2).tolist():
        for following in neighbours[first[start] : first[start + 1]]:
            if (start, following) not in used:
                paths.append(chain(start, following))
    for path in _join_at_forks(paths, points):
        closed = path[0] == path[-1]
        yield Outline(points[path[:-1] if closed else path], closed)
    for start in range(count):
        if degree[start] == 2:
            following = neighbours[first[start]]
            if (start, following) not in used:
                yield Outline(points[chain(start, following)[:-1]], True)


TAIL = 12
"""Number of points at the end of a chain that give its direction."""

STRAIGHT_ON = -0.9
"""Largest cosine between two chains that continue each other at a fork: within 26°."""


def _join_at_forks(paths: list[list[int]], points: Int) -> list[list[int]]:
    """The chains, joined where they continue each other at a fork, the straightest first."""
    at: dict[int, list[tuple[int, int]]] = {}
    heading = {}
    for number, path in enumerate(paths):
        if path[0] == path[-1]:
            continue
        for end in (0, -1):
            node = path[end]
            ahead = path[min(TAIL, len(path) - 1)] if end == 0 else path[max(-TAIL - 1, -len(path))]
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
    joined, left = [], set(range(len(paths)))
    # Open chains start at an end that has no continuation, rings of chains anywhere.
    starts = [(n, end) for n in range(len(paths)) for end in (0, -1) if (n, end) not in partner]
    for number, end in starts + [(n, 0) for n in range(len(paths))]:
        if number not in left:
            continue
        line: list[int] = []
        while number in left:
            left.discard(number)
            part = paths[number] if end == 0 else paths[number][::-1]
            line += part if not line else part[1:]
            following = partner.get((number, -1 if end == 0 else 0))
            if following is None:
                break
            number, end = following
        joined.append(line)
    return joined
