"""Object association: which walls are of one object, though what joins them was never seen.

Walls are of one object where a link, the shortest line from one to the other, exists that no beam
has crossed. What lies behind the faces of both walls is taken for solid until a beam crosses it. A
link that runs before one of them, to a corner that was not seen, must be short and lead to where
that wall may end: what stands before a wall that goes on behind it is no part of it, unless it was
seen to touch. A long link counts only where every line of sight from wall to wall is blocked, and
two objects of several walls are joined only by two such links: a single one may be a lane that no
beam happened to find.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import range_deviation
from lrf3d.mapping.robust.constants import (
    ABUTS,
    ABUTS_SIDE,
    BEHIND_SINE,
    CORNER_BEAMS,
    FACING,
    FACING_SINE,
    FREE_DEPTH,
    HIDDEN_LINK,
    HIDDEN_SINE,
    LINK_DEVIATIONS,
    LONGEST_LINK,
    NICHE_DEPTH,
    SECOND_LINK,
    SEVERAL_WALLS,
    SHORT_LINK,
    SIGHT_PLACES,
    STRAY_BEAMS,
    TOUCH,
)
from lrf3d.mapping.robust.evidence import is_crossed
from lrf3d.mapping.robust.evidence_grid import Cells
from lrf3d.mapping.robust.grid import order_of, pairs_within


@inner
def find_links(ends: Float, candidates: Int) -> tuple[Int, Float]:  # pragma: no cover
    """Pairs (k, 2) of walls that a link may join, and the links (k, 6).

    A link is x1 y1 x2 y2, its length [m], and 1 where it runs before a wall.
    """
    pairs, links = np.empty((len(candidates), 2), np.int64), np.empty((len(candidates), 6))
    kept = 0
    for k in range(len(candidates)):
        wall, other = candidates[k, 0], candidates[k, 1]
        link = _shortest_link(ends[wall], ends[other])
        length = np.hypot(link[2] - link[0], link[3] - link[1])
        one, another = reach_before(ends[wall], link), reach_before(ends[other], link)
        before, less = max(one, another), min(one, another)
        if (
            length > LONGEST_LINK
            or (length > FACING and less > FACING_SINE * length)
            or (
                (length > SHORT_LINK and before > BEHIND_SINE * length)
                and (length > HIDDEN_LINK or less > HIDDEN_SINE * length)
            )
        ):
            continue
        pairs[kept, 0], pairs[kept, 1] = wall, other
        for place in range(4):
            links[kept, place] = link[place]
        links[kept, 4] = length
        links[kept, 5] = before > BEHIND_SINE * length
        kept += 1
    return pairs[:kept], links[:kept]


@inner
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


@inner
def reach_before(wall: Float, link: Float) -> float:  # pragma: no cover
    """How far [m] a link gets before the face of a wall that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    first = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    last = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    before: float = max(first, last)
    return before


@inner
def neighbours(pairs: Int, count: int) -> tuple[Int, Int]:  # pragma: no cover
    """The partners of all walls in pairs (k, 2) in one row, and (count + 1,) where each's begin."""
    first = np.zeros(count + 2, np.int64)
    for k in range(len(pairs)):
        for turn in range(2):
            first[pairs[k, turn] + 2] += 1
    for wall in range(count):
        first[wall + 2] += first[wall + 1]
    near = np.empty(2 * len(pairs), np.int64)
    for k in range(len(pairs)):
        for turn in range(2):
            wall, other = pairs[k, turn], pairs[k, 1 - turn]
            near[first[wall + 1]] = other
            first[wall + 1] += 1
    return first[:-1], near


@inner
def goes_before(
    link: Float, ends: Float, one: int, other: int, others: Int, blur: float
) -> bool:  # pragma: no cover
    """Whether a link (6,) of two walls runs far before a face that goes on to both sides of it.

    Walls end somewhere within a blur [m], which the noise of the ranges leaves.
    """
    for k in range(len(others)):
        wall = others[k]
        if wall != other and _stands_off(link, ends[wall], blur):
            return True
    # A wall may go on, unseen, to the face of another.
    if _stands_off(link, ends[one], blur) and not _goes_along(link, ends[other]):
        return True
    return _stands_off(link, ends[other], blur) and not _goes_along(link, ends[one])


@inner
def _goes_along(link: Float, wall: Float) -> bool:  # pragma: no cover
    """Whether a link (6,) runs along the line of a wall (4,) that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    aside: float = abs(dx * (link[3] - link[1]) - dy * (link[2] - link[0]))
    return bool(aside <= BEHIND_SINE * link[4] * np.hypot(dx, dy))


@inner
def _stands_off(link: Float, wall: Float, blur: float) -> bool:  # pragma: no cover
    """Whether a link (6,) meets the inside of a wall (4,) and runs far before its face there."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    begin = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    end = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    most, least = max(begin, end), min(begin, end)
    rise = most - least
    if least > 1e-6 or rise < FACING_SINE * link[4] or most * link[4] < (ABUTS + blur) * rise:
        return False
    share = begin / (begin - end)
    x, y = link[0] + share * (link[2] - link[0]), link[1] + share * (link[3] - link[1])
    place: float = (dx * (x - wall[0]) + dy * (y - wall[1])) / size
    return bool(ABUTS_SIDE < place < size - ABUTS_SIDE)


class LinkCache(NamedTuple):
    """What the beams have shown of links: a hash table.

    Args:
        keys: (slots,) two serial numbers of segments; 0 where a slot is free.
        kinds: (slots,) what a link between them is.
        used: (1,) how many there are.
    """

    keys: Int
    kinds: NDArray[np.int8]
    used: Int

    @classmethod
    def of_size(cls, slots: int) -> "LinkCache":
        """No links, with some slots (a power of two)."""
        return cls(np.zeros(slots, np.int64), np.zeros(slots, np.int8), np.zeros(1, np.int64))


CROSSED, JOINS, BLOCKED, OPEN = 0, 1, 2, 3
"""What a link is: it joins nothing; it joins two walls; it is long, and either no line of sight is
open behind both of its walls, or one is."""


@compiled
def associate_objects(
    ends: Float, serials: Int, cells: Cells, noise: RangeNoise, cache: LinkCache
) -> Int:  # pragma: no cover
    """The object (m,) that each of some walls (m, 4) belongs to, named by one of its walls.

    Args:
        ends: (m, 4) walls [m], seen from their left.
        serials: (m,) their serial numbers.
        cells: The cells.
        noise: The noise of the ranges.
        cache: What is known of links already; is written.
    """
    parents = np.arange(len(ends))
    sizes = np.ones(len(ends), np.int64)
    candidates = pairs_within(ends, LONGEST_LINK)
    starts, near = neighbours(candidates, len(ends))
    pairs, links = find_links(ends, candidates)
    lengths = np.empty(len(links))
    for k in range(len(links)):
        lengths[k] = links[k, 4]
    order = order_of(lengths)
    waiting, strong = np.empty(len(order), np.int64), np.zeros(len(order), np.bool_)
    # The links that wait, in a list for each object that one of them leads from.
    heads, tails = np.full(len(ends), -1), np.full(len(ends), -1)
    following, counts = np.full(2 * len(order), -1), np.zeros(len(ends), np.int64)
    blur = LINK_DEVIATIONS * range_deviation(noise, LONGEST_LINK)
    count = 0
    # The shortest links come first; most others join what is one object by then.
    for turn in range(len(order)):
        place = order[turn]
        one, other = _root(parents, pairs[place, 0]), _root(parents, pairs[place, 1])
        if one == other:
            continue
        wall, across = pairs[place, 0], pairs[place, 1]
        first, second = serials[wall] + 1, serials[across] + 1
        key = (min(first, second) << 32) + max(first, second)
        mask = len(cache.keys) - 1
        mixed = key * 0x9E3779B97F4A7C1
        slot = (mixed ^ (mixed >> 29)) & mask
        while cache.keys[slot] != key and cache.keys[slot] != 0:
            slot = (slot + 1) & mask
        if cache.keys[slot] == key:
            kind = cache.kinds[slot]
        else:
            others = near[starts[wall] : starts[wall + 1]]
            kind = _kind(links[place], ends, wall, across, others, blur, cells)
            if 2 * cache.used[0] < len(cache.keys):
                cache.keys[slot], cache.kinds[slot] = key, kind
                cache.used[0] += 1
        if kind == CROSSED:
            continue
        if kind != JOINS:
            blocked = kind == BLOCKED
            if not blocked or min(sizes[one], sizes[other]) >= SEVERAL_WALLS:
                least = -np.inf if blocked else lengths[place] - SECOND_LINK
                few, many = (one, other) if counts[one] < counts[other] else (other, one)
                seconded = False
                entry = heads[few]
                while entry >= 0 and not seconded:
                    before = waiting[entry >> 1]
                    # All sight is blocked at one of the two; the other is about as long.
                    if blocked or (strong[entry >> 1] and lengths[before] >= least):
                        seconded = _root(parents, pairs[before, 1 - (entry & 1)]) == many
                    entry = following[entry]
                if not seconded:
                    waiting[count], strong[count] = place, blocked
                    for side in range(2):
                        root = _root(parents, pairs[place, side])
                        entry = 2 * count + side
                        following[entry] = heads[root]
                        heads[root] = entry
                        if tails[root] < 0:
                            tails[root] = entry
                        counts[root] += 1
                    count += 1
                    continue
        kept, gone = min(one, other), max(one, other)
        parents[gone] = kept
        sizes[kept] += sizes[gone]
        counts[kept] += counts[gone]
        if heads[gone] >= 0:
            if heads[kept] >= 0:
                following[tails[kept]] = heads[gone]
            else:
                heads[kept] = heads[gone]
            tails[kept] = tails[gone]
    for place in range(len(ends)):
        parents[place] = _root(parents, place)
    return parents


@inner
def _kind(
    link: Float, ends: Float, wall: int, across: int, others: Int, blur: float, cells: Cells
) -> int:  # pragma: no cover
    """What a link (6,) of two walls is."""
    if link[4] > ABUTS and goes_before(link, ends, wall, across, others, blur):
        return CROSSED
    if link[4] <= TOUCH:
        return JOINS
    if link[4] <= SHORT_LINK:
        return CROSSED if _is_separated(link, cells) else JOINS
    if is_crossed(link[:4], cells, FREE_DEPTH, 0):
        return CROSSED
    if link[5] > 0.0:
        return JOINS
    return BLOCKED if _is_blocked(ends[wall], ends[across], cells) else OPEN


@inner
def _root(parents: Int, wall: int) -> int:  # pragma: no cover
    while parents[wall] != wall:
        parents[wall] = parents[parents[wall]]
        wall = parents[wall]
    return wall


@inner
def _is_blocked(one: Float, other: Float, cells: Cells) -> bool:  # pragma: no cover
    """Whether no beam has crossed any line of sight that runs behind both of two walls."""
    line = np.empty(4)
    for own in SIGHT_PLACES:
        for across in SIGHT_PLACES:
            for k in range(2):
                line[k] = one[k] + own * (one[k + 2] - one[k])
                line[k + 2] = other[k] + across * (other[k + 2] - other[k])
            length = np.hypot(line[2] - line[0], line[3] - line[1])
            if max(reach_before(one, line), reach_before(other, line)) <= BEHIND_SINE * length:
                if is_crossed(line, cells, FREE_DEPTH, 0):
                    return False
    return True


@inner
def _is_separated(link: Float, cells: Cells) -> bool:  # pragma: no cover
    """Whether beams have crossed a short link (6,): many of them, or deeper than into a corner."""
    depth = max(FREE_DEPTH, NICHE_DEPTH * link[4]) if link[5] > 0.0 else FREE_DEPTH
    return is_crossed(link[:4], cells, depth, STRAY_BEAMS) or is_crossed(
        link[:4], cells, FREE_DEPTH, CORNER_BEAMS
    )
