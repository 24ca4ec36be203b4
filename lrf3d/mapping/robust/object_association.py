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

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, Search, near, order_of
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import (
    ABUTS,
    ABUTS_SIDE,
    BEHIND_SINE,
    CORNER_BEAMS,
    FACING_SINE,
    FREE_DEPTH,
    LINK_SINE,
    LINKS_A_TURN,
    MERGE_CELL,
    NICHE_DEPTH,
    SECOND_LINK,
    SEVERAL_WALLS,
    SHORT_LINK,
    SIGHT_PLACES,
    SLOTS_A_TURN,
    STRAY_BEAMS,
    TOUCH,
)
from lrf3d.mapping.robust.crossing import is_crossed, is_crossed_aslant, is_crossed_at_all
from lrf3d.mapping.robust.links import UNASKED, Links, drop_link, reach_before

CROSSED, JOINS, BLOCKED, OPEN, BEFORE = 1, 2, 3, 4, 5
"""What a link is: beams have crossed it; it joins two walls; it is long, and either no line of
sight is open behind both of its walls, or one is; it runs before a wall that goes on behind it, and
joins nothing while that wall is there."""


class Sight(NamedTuple):
    """What decides on links: the walls, and what the beams have shown.

    Args:
        ends: (rows, 4) all walls [m], seen from their left.
        points: (rows,) 0 where there is no wall.
        grid: Where the walls are, in cells of MERGE_CELL.
        cells: The cells of the beams.
        blur: How far walls may be seen too short or too long [m].
        search: Is written by searches of the grid.
    """

    ends: Float
    points: Int
    grid: Grid
    cells: Cells
    blur: float
    search: Search


@compiled
def associate_objects(
    rows: Int, loose: int, objects: Int, links: Links, places: Int, sight: Sight
) -> Int:
    """The object (m,) that each of some walls belongs to, named by the place of one of them.

    Args:
        rows: (m,) the walls.
        loose: How many of them, the first, are of no object yet.
        objects: (m,) the object that each of the others is of, object by object; these stay whole.
        links: Their links; what the beams show of them is written, and those are dropped that
            they have crossed.
        places: (all rows,) −1; is written, and restored.
        sight: What decides on links.
    """
    parents = np.arange(len(rows))
    sizes = np.ones(len(rows), np.int64)
    for k in range(len(rows)):
        places[rows[k]] = k
        if k < loose:
            entry = links.heads[rows[k]]
            while entry >= 0:
                links.bearing[entry >> 1] = False
                entry = links.following[entry >> 1, entry & 1]
        if k > loose and objects[k] == objects[k - 1]:
            _unite(parents, sizes, k - 1, k)
    chosen = np.empty(links.used[0], np.int64)
    number = 0
    for k in range(loose):
        entry = links.heads[rows[k]]
        while entry >= 0:
            link, side = entry >> 1, entry & 1
            across = places[links.pairs[link, 1 - side]]
            # A link of two loose walls is met twice.
            if across >= loose or 0 <= across < k:
                # Short links that join walls do so in any order. They make no ring: the link that
                # would close it was not asked, because it led from an object to itself.
                if links.kinds[link] == JOINS and links.lines[link, 4] <= SHORT_LINK:
                    links.bearing[link] = True
                    _unite(parents, sizes, k, across)
                elif links.kinds[link] != BEFORE:
                    chosen[number] = link
                    number += 1
            entry = links.following[link, side]
    pairs, lengths = np.empty((number, 2), np.int64), np.empty(number)
    count = 0
    for k in range(number):
        link = chosen[k]
        one, other = places[links.pairs[link, 0]], places[links.pairs[link, 1]]
        if _root(parents, one) != _root(parents, other):
            chosen[count], lengths[count] = link, links.lines[link, 4]
            pairs[count, 0], pairs[count, 1] = one, other
            count += 1
    for k in range(len(rows)):
        places[rows[k]] = -1
    number = count
    order = order_of(lengths[:number])
    waiting, strong = np.empty(number, np.int64), np.zeros(number, np.bool_)
    # The links that wait, in a list for each object that one of them leads from.
    heads, tails = np.full(len(rows), -1), np.full(len(rows), -1)
    following, counts = np.full(2 * number, -1), np.zeros(len(rows), np.int64)
    count = 0
    # The shortest links come first; most others join what is one object by then.
    for turn in range(number):
        place = order[turn]
        one, other = _root(parents, pairs[place, 0]), _root(parents, pairs[place, 1])
        if one == other:
            continue
        link = chosen[place]
        kind = links.kinds[link]
        if kind == UNASKED:
            wall, across = links.pairs[link]
            line = links.lines[link]
            kind = _kind(line, wall, across, sight)
            links.kinds[link] = kind
            if kind == CROSSED:
                drop_link(links, link)
        if kind in (CROSSED, BEFORE):
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
                        if seconded:
                            links.bearing[chosen[before]] = True
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
        links.bearing[link] = True
        kept, gone = _unite(parents, sizes, one, other)
        counts[kept] += counts[gone]
        if heads[gone] >= 0:
            if heads[kept] >= 0:
                following[tails[kept]] = heads[gone]
            else:
                heads[kept] = heads[gone]
            tails[kept] = tails[gone]
    for place in range(len(rows)):
        parents[place] = _root(parents, place)
    return parents


@compiled
def recheck_links(links: Links, sight: Sight) -> Int:
    """Check some links that hold objects together again: evidence may have come since.

    Each call takes the next `LINKS_A_TURN` of them, so that all have their turn.

    Args:
        links: Is written.
        sight: What decides on links.

    Returns:
        (k,) one of the two walls of each link that is something else now.
    """
    found = np.empty(LINKS_A_TURN, np.int64)
    count, asked = 0, 0
    for _ in range(min(links.used[0], SLOTS_A_TURN)):
        link = links.used[2]
        links.used[2] = (link + 1) % links.used[0]
        if links.bearing[link] and links.lines[link, 4] > TOUCH:
            asked += 1
            one, other = links.pairs[link]
            kind = _kind(links.lines[link], one, other, sight)
            if kind != links.kinds[link]:
                links.kinds[link] = kind
                found[count] = one
                count += 1
                if kind == CROSSED:
                    drop_link(links, link)
            if asked == LINKS_A_TURN:
                break
    return found[:count]


@inner
def _kind(link: Float, wall: int, across: int, sight: Sight) -> int:
    """What a link (6,) of two walls is."""
    ends, cells = sight.ends, sight.cells
    if link[4] <= TOUCH:
        return JOINS
    # Most links are crossed, which is asked first.
    if _is_separated(link, cells):
        return CROSSED
    if link[4] > ABUTS and _goes_before(link, wall, across, sight):
        return BEFORE
    if link[4] <= SHORT_LINK or link[5] > 0.0:
        return JOINS
    return BLOCKED if _is_blocked(ends[wall], ends[across], cells) else OPEN


@inner
def _goes_before(link: Float, one: int, other: int, sight: Sight) -> bool:
    """Whether a link (6,) of two walls runs far before a face that goes on to both sides of it."""
    ends, blur, search = sight.ends, sight.blur, sight.search
    search.number[0] += 1
    stamp = search.number[0]
    count = near(sight.grid, link[:4], 0.0, MERGE_CELL, search.stamps, stamp, search.found)
    for k in range(count):
        wall = search.found[k]
        if wall not in (one, other) and sight.points[wall] > 0:
            if _stands_off(link, ends[wall], blur):
                return True
    # A wall may go on, unseen, to the face of another.
    if _stands_off(link, ends[one], blur) and not _goes_along(link, ends[other]):
        return True
    return _stands_off(link, ends[other], blur) and not _goes_along(link, ends[one])


@inner
def _goes_along(link: Float, wall: Float) -> bool:
    """Whether a link (6,) runs along the line of a wall (4,) that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    aside: float = abs(dx * (link[3] - link[1]) - dy * (link[2] - link[0]))
    return bool(aside <= BEHIND_SINE * link[4] * np.hypot(dx, dy))


@inner
def _stands_off(link: Float, wall: Float, blur: float) -> bool:
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


@inner
def _root(parents: Int, wall: int) -> int:
    while parents[wall] != wall:
        parents[wall] = parents[parents[wall]]
        wall = parents[wall]
    return wall


@inner
def _unite(parents: Int, sizes: Int, one: int, other: int) -> tuple[int, int]:
    """Make one of two objects, named by walls; returns the root that is kept, and the other."""
    one, other = _root(parents, one), _root(parents, other)
    kept, gone = min(one, other), max(one, other)
    parents[gone] = kept
    sizes[kept] += sizes[gone]
    return kept, gone


@inner
def _is_blocked(one: Float, other: Float, cells: Cells) -> bool:
    """Whether no beam has crossed any line of sight that runs behind both of two walls."""
    line = np.empty(4)
    for own in SIGHT_PLACES:
        for across in SIGHT_PLACES:
            for k in range(2):
                line[k] = one[k] + own * (one[k + 2] - one[k])
                line[k + 2] = other[k] + across * (other[k + 2] - other[k])
            length = np.hypot(line[2] - line[0], line[3] - line[1])
            if max(reach_before(one, line), reach_before(other, line)) <= BEHIND_SINE * length:
                if is_crossed_at_all(line, cells, LINK_SINE):
                    return False
    return True


@inner
def _is_separated(link: Float, cells: Cells) -> bool:
    """Whether beams have crossed a link (6,), a short one many of them or deeper than a corner."""
    if link[4] > SHORT_LINK:
        return is_crossed_at_all(link[:4], cells, LINK_SINE)
    depth = max(FREE_DEPTH, NICHE_DEPTH * link[4]) if link[5] > 0.0 else FREE_DEPTH
    return (
        is_crossed(link[:4], cells, depth, STRAY_BEAMS, LINK_SINE)
        or (depth > FREE_DEPTH and is_crossed(link[:4], cells, FREE_DEPTH, CORNER_BEAMS, LINK_SINE))
        or is_crossed_aslant(link[:4], cells, STRAY_BEAMS, LINK_SINE)
    )
