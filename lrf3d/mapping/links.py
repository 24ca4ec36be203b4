"""Links: which walls are of one object, though what joins them was never seen, compiled.

Walls are of one object where a link between them exists that no beam has passed. What lies behind
the faces of both walls is taken for solid until a beam passes through it. A link that runs before
one of them, to a corner that was not seen, must be short and lead to where that wall may end: what
stands before a wall that goes on behind it is no part of it, unless it was seen to touch. A long
one says something only where all sight from wall to wall is barred, and two objects of several
walls are one only by two such links: a single one may be a lane that no beam happened to find.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int
from lrf3d.mapping.evidence import PASSED, SIGMAS, beams_between
from lrf3d.mapping.grid import pairs_within
from lrf3d.mapping.scan_archive import Beams

TOUCH = 0.1
"""Walls that come nearer than this [m] touch: no beam that passes between them need be trusted."""

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
"""Longest link [m] that may run before a wall which goes on to both sides of it: what abuts on a
wall is seen up to almost there, and what is seen no nearer merely stands before it."""

SIDE = 0.3
"""How far [m] a wall reaches beside a link if it goes on there."""

FAR = 15.0
"""Longest link [m] behind two walls: as deep as most buildings are."""

BEHIND = 0.3
"""Sine of the angle by which a link may run before a wall and still count as behind it."""

SPREAD = (0.1, 0.5, 0.9)
"""Where on two walls the lines of sight between them begin and end, as parts of their lengths."""

SEVERAL = 3
"""Walls from which on an object is joined to another such by two long links and not by one."""

ALIKE = 1.0
"""How much longer [m] the second of them may be: what is much longer leads past more walls."""

STRAY = 1
"""Beams that may pass a short link: noise that lets one pass is rare, but links are many."""


@njit(cache=True, nogil=True)
def join_objects(ends: Float, beams: Beams, floor: float, growth: float) -> Int:  # pragma: no cover
    """The object (m,) that each of some walls (m, 4) belongs to, named by one of its walls.

    Args:
        ends: (m, 4) walls [m], seen from their left.
        beams: The beams.
        floor: Deviation of a range at no distance [m].
        growth: What a deviation grows by with the range.
    """
    parents = np.arange(len(ends))
    sizes = np.ones(len(ends), np.int64)
    candidates = pairs_within(ends, FAR)
    starts, near = _neighbours(candidates, len(ends))
    pairs, links = _find_links(ends, candidates)
    order = np.argsort(links[:, 4], kind="mergesort")
    waiting, strong = np.empty(len(order), np.int64), np.zeros(len(order), np.bool_)
    count = 0
    # The shortest links come first; most others join what is one object by then.
    for place in order:
        one, other = _root(parents, pairs[place, 0]), _root(parents, pairs[place, 1])
        if one == other:
            continue
        length = links[place, 4]
        if length > ABUTS:
            wall, across = pairs[place]
            others = near[starts[wall] : starts[wall + 1]]
            if _goes_before(links[place], ends, wall, across, others):
                continue
        if length > SHORT:
            if passed(links[place, :4], beams, floor, growth, PASSED, 0):
                continue
            corner = links[place, 5] > 0.0
            barred = corner or _barred(
                ends[pairs[place, 0]], ends[pairs[place, 1]], beams, floor, growth
            )
            if not corner and (not barred or min(sizes[one], sizes[other]) >= SEVERAL):
                seconded = False
                for k in range(count):
                    before = waiting[k]
                    # One of the two says that all sight is barred; the other is about as long.
                    if not (barred or (strong[k] and links[before, 4] >= length - ALIKE)):
                        continue
                    first, second = pairs[before]
                    first, second = _root(parents, first), _root(parents, second)
                    if (first, second) == (one, other) or (second, first) == (one, other):
                        seconded = True
                        break
                if not seconded:
                    waiting[count], strong[count] = place, barred
                    count += 1
                    continue
        elif length > TOUCH and passed(links[place, :4], beams, floor, growth, PASSED, STRAY):
            continue
        kept, gone = min(one, other), max(one, other)
        parents[gone] = kept
        sizes[kept] += sizes[gone]
    for place in range(len(ends)):
        parents[place] = _root(parents, place)
    return parents


@njit(cache=True, nogil=True)
def _root(parents: Int, wall: int) -> int:  # pragma: no cover
    while parents[wall] != wall:
        parents[wall] = parents[parents[wall]]
        wall = parents[wall]
    return wall


@njit(cache=True, nogil=True)
def _find_links(ends: Float, candidates: Int) -> tuple[Int, Float]:  # pragma: no cover
    """Pairs (k, 2) of walls that a link may join, and the links (k, 6).

    A link is x1 y1 x2 y2, its length [m], and 1 where it runs before a wall.
    """
    pairs, links = np.empty((64, 2), np.int64), np.empty((64, 6))
    kept = 0
    for wall, other in candidates:
        link = _shortest_link(ends[wall], ends[other])
        length = np.hypot(link[2] - link[0], link[3] - link[1])
        one, another = _before(ends[wall], link), _before(ends[other], link)
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
    turn = dx * v - dy * u
    if turn != 0.0:
        ahead = ((other[0] - one[0]) * v - (other[1] - one[1]) * u) / turn
        along = ((other[0] - one[0]) * dy - (other[1] - one[1]) * dx) / turn
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
def _before(wall: Float, link: Float) -> float:  # pragma: no cover
    """How far [m] a link gets before the face of a wall that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    first = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    last = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    before: float = max(first, last)
    return before


@njit(cache=True, nogil=True)
def _neighbours(pairs: Int, count: int) -> tuple[Int, Int]:  # pragma: no cover
    """The partners of each of some walls in pairs (k, 2), in one row, and where each wall's begin."""
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
def _goes_before(
    link: Float, ends: Float, one: int, other: int, others: Int
) -> bool:  # pragma: no cover
    """Whether a link (6,) of two walls runs far before a face that goes on to both sides of it."""
    for wall in others:
        if wall != other and _stands_off(link, ends[wall]):
            return True
    # A wall may go on, unseen, to the face of another.
    if _stands_off(link, ends[one]) and not _goes_along(link, ends[other]):
        return True
    return _stands_off(link, ends[other]) and not _goes_along(link, ends[one])


@njit(cache=True, nogil=True)
def _goes_along(link: Float, wall: Float) -> bool:  # pragma: no cover
    """Whether a link (6,) runs along the line of a wall (4,) that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    aside: float = abs(dx * (link[3] - link[1]) - dy * (link[2] - link[0]))
    return aside <= ALONG * link[4] * np.hypot(dx, dy)


@njit(cache=True, nogil=True)
def _stands_off(link: Float, wall: Float) -> bool:  # pragma: no cover
    """Whether a link (6,) meets the inside of a wall (4,) and runs far before its face there."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    begin = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    end = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    most, least = max(begin, end), min(begin, end)
    rise = most - least
    if least > 1e-6 or rise < ACROSS * link[4] or most * link[4] < ABUTS * rise:
        return False
    share = begin / (begin - end)
    x, y = link[0] + share * (link[2] - link[0]), link[1] + share * (link[3] - link[1])
    place: float = (dx * (x - wall[0]) + dy * (y - wall[1])) / size
    return SIDE < place < size - SIDE


@njit(cache=True, nogil=True)
def _barred(
    one: Float, other: Float, beams: Beams, floor: float, growth: float
) -> bool:  # pragma: no cover
    """Whether no beam has passed any line of sight that runs behind both of two walls."""
    line = np.empty(4)
    for own in SPREAD:
        line[:2] = one[:2] + own * (one[2:] - one[:2])
        for across in SPREAD:
            line[2:] = other[:2] + across * (other[2:] - other[:2])
            length = np.hypot(line[2] - line[0], line[3] - line[1])
            if max(_before(one, line), _before(other, line)) <= BEHIND * length:
                if passed(line, beams, floor, growth, PASSED, 0):
                    return False
    return True


@njit(cache=True, nogil=True)
def passed(
    link: Float, beams: Beams, floor: float, growth: float, depth: float, spare: int
) -> bool:  # pragma: no cover
    """Whether more beams than are to spare have passed a link (4,) and gone on by a depth [m]."""
    x1, y1, x2, y2 = link
    length = np.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return False
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    for scan in range(len(beams.places)):
        ox, oy = beams.places[scan]
        ax, ay, bx, by = x1 - ox, y1 - oy, x2 - ox, y2 - oy
        aside = ax * uy - ay * ux
        if abs(aside) < 1e-9 or ax * ax + ay * ay > (beams.reaches[scan] + length) ** 2:
            continue
        one = np.arctan2(ay, ax)
        turned = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        start = one if turned > 0.0 else one + turned
        for turn in range(2):
            low, high = beams_between(beams, scan, start, abs(turned), turn)
            for beam in range(low, high):
                incidence = beams.units[beam, 0] * uy - beams.units[beam, 1] * ux
                if incidence * aside <= 0.0:
                    continue
                reach = aside / incidence
                deviation = np.sqrt(floor * floor + (growth * reach) ** 2)
                if abs(beams.ranges[beam]) - reach > depth + SIGMAS * deviation:
                    spare -= 1
                    if spare < 0:
                        return True
    return False
