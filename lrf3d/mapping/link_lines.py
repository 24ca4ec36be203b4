"""Link lines: where a link between two walls runs, and what it must not run before, compiled.

Enter walls; leave the pairs of them that a link may join, and the links: the shortest lines from
one to the other.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int

SHORT = 3.0
"""Longest link [m] that may run before a wall: less than a lane between buildings."""

HIDDEN = 4.0
"""Longest link [m] along which a wall may go on, unseen, to the face of another: a corner that
something hid."""

ALONG = 0.1
"""Sine of the angle by which such a link may stray before the wall that it continues."""

FACING = 1.0
"""Longest link [m] between the faces of two walls, across a niche: where such walls are farther
apart, a bottom that joins them is wide enough to be seen."""

ACROSS = 0.5
"""Sine of the angle by which a link runs before a wall that it leads to the face of."""

ABUTS = 0.5
"""Longest link [m] that may run before a wall which goes on to both sides of it: what abuts on it
is seen up to almost there, and what is seen no nearer merely stands before it."""

SIDE = 0.3
"""How far [m] a wall reaches beside a link if it goes on there."""

FAR = 15.0
"""Longest link [m] behind two walls: as deep as most buildings are."""

BEHIND = 0.3
"""Sine of the angle by which a link may run before a wall and still count as behind it."""


@njit(cache=True, nogil=True)
def find_links(ends: Float, candidates: Int) -> tuple[Int, Float]:  # pragma: no cover
    """Pairs (k, 2) of walls that a link may join, and the links (k, 6).

    A link is x1 y1 x2 y2, its length [m], and 1 where it runs before a wall.
    """
    pairs, links = np.empty((64, 2), np.int64), np.empty((64, 6))
    kept = 0
    for wall, other in candidates:
        link = _shortest_link(ends[wall], ends[other])
        length = np.hypot(link[2] - link[0], link[3] - link[1])
        one, another = reach_before(ends[wall], link), reach_before(ends[other], link)
        before, less = max(one, another), min(one, another)
        if (
            length > FAR
            or (length > FACING and less > ACROSS * length)
            or (
                (length > SHORT and before > BEHIND * length)
                and (length > HIDDEN or less > ALONG * length)
            )
        ):
            continue
        if kept == len(pairs):
            pairs = np.concatenate((pairs, np.empty_like(pairs)))
            links = np.concatenate((links, np.empty_like(links)))
        pairs[kept, 0], pairs[kept, 1] = wall, other
        links[kept, :4] = link
        links[kept, 4] = length
        links[kept, 5] = before > BEHIND * length
        kept += 1
    return pairs[:kept], links[:kept]


@njit(cache=True, nogil=True)
def _shortest_link(one: Float, other: Float) -> Float:  # pragma: no cover
    """The shortest line (4,) from one of two segments to the other."""
    link = np.zeros(4)
    dx, dy = one[2] - one[0], one[3] - one[1]
    u, v = other[2] - other[0], other[3] - other[1]
    crossing = dx * v - dy * u
    if crossing != 0.0:
        ahead = ((other[0] - one[0]) * v - (other[1] - one[1]) * u) / crossing
        along = ((other[0] - one[0]) * dy - (other[1] - one[1]) * dx) / crossing
        if 0.0 <= ahead <= 1.0 and 0.0 <= along <= 1.0:
            # They cross: one was united through the other.
            link[0] = link[2] = one[0] + ahead * dx
            link[1] = link[3] = one[1] + ahead * dy
            return link
    least = np.inf
    for turn in range(4):
        own, across = (one, other) if turn < 2 else (other, one)
        x, y = own[2 * (turn % 2)], own[2 * (turn % 2) + 1]
        dx, dy = across[2] - across[0], across[3] - across[1]
        place = ((x - across[0]) * dx + (y - across[1]) * dy) / (dx * dx + dy * dy)
        place = min(max(place, 0.0), 1.0)
        u, v = across[0] + place * dx, across[1] + place * dy
        away = (x - u) ** 2 + (y - v) ** 2
        if away < least:
            least = away
            link[0], link[1], link[2], link[3] = x, y, u, v
    return link


@njit(cache=True, nogil=True)
def reach_before(wall: Float, link: Float) -> float:  # pragma: no cover
    """How far [m] a link gets before the face of a wall that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    first = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    last = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    before: float = max(first, last)
    return before


@njit(cache=True, nogil=True)
def neighbours(pairs: Int, count: int) -> tuple[Int, Int]:  # pragma: no cover
    """The partners of all walls in pairs (k, 2) in one row, and (count + 1,) where each's begin."""
    first = np.zeros(count + 2, np.int64)
    for pair in pairs:
        first[pair[0] + 2] += 1
        first[pair[1] + 2] += 1
    first = np.cumsum(first)
    near = np.empty(2 * len(pairs), np.int64)
    for pair in pairs:
        for turn in range(2):
            wall, other = pair[turn], pair[1 - turn]
            near[first[wall + 1]] = other
            first[wall + 1] += 1
    return first[:-1], near


@njit(cache=True, nogil=True)
def goes_before(
    link: Float, ends: Float, one: int, other: int, others: Int, blur: float
) -> bool:  # pragma: no cover
    """Whether a link (6,) of two walls runs far before a face that goes on to both sides of it.

    Walls end somewhere within a blur [m], which the noise of the ranges leaves.
    """
    for wall in others:
        if wall != other and _stands_off(link, ends[wall], blur):
            return True
    # A wall may go on, unseen, to the face of another.
    if _stands_off(link, ends[one], blur) and not _goes_along(link, ends[other]):
        return True
    return _stands_off(link, ends[other], blur) and not _goes_along(link, ends[one])


@njit(cache=True, nogil=True)
def _goes_along(link: Float, wall: Float) -> bool:  # pragma: no cover
    """Whether a link (6,) runs along the line of a wall (4,) that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    aside: float = abs(dx * (link[3] - link[1]) - dy * (link[2] - link[0]))
    return bool(aside <= BEHIND * link[4] * np.hypot(dx, dy))


@njit(cache=True, nogil=True)
def _stands_off(link: Float, wall: Float, blur: float) -> bool:  # pragma: no cover
    """Whether a link (6,) meets the inside of a wall (4,) and runs far before its face there."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    begin = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    end = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    most, least = max(begin, end), min(begin, end)
    rise = most - least
    if least > 1e-6 or rise < ACROSS * link[4] or most * link[4] < (ABUTS + blur) * rise:
        return False
    share = begin / (begin - end)
    x, y = link[0] + share * (link[2] - link[0]), link[1] + share * (link[3] - link[1])
    place: float = (dx * (x - wall[0]) + dy * (y - wall[1])) / size
    return bool(SIDE < place < size - SIDE)
