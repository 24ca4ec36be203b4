"""Links: which walls belong to one object, although the wall that joins them was never seen.

Two walls belong to one object if no beam has crossed their link, the shortest line between them.
The space behind the faces of both walls counts as solid until a beam crosses it. A link that runs
in front of one of them, to an unseen corner, must be short. A long link also needs all lines of
sight behind both walls to be blocked: it may cross a lane that no beam happened to pass.

Walls that are new in their places enter; their links are tested, and those of other walls again in
turn. Objects are found from the links when a map is read, and the ends of two walls of one object
are moved to where their lines cross.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import Float, Int
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import FREE_DEPTH, Cells, is_crossed
from lrf3d.mapping.robust.walls import (
    MOST_LINKS,
    Walls,
    along_of,
    end_of,
    length_of,
    near,
    put_line,
    put_row,
    vector_of,
)

# [m] Longest link that may run in front of a wall: less than a lane between buildings. More joins
# buildings across lanes, less separates the corners of a building.
SHORT_LINK = 3.0

# [m] Longest link behind two walls: the depth of most buildings.
LONGEST_LINK = 15.0

# [sine] Least angle at which a beam crosses a link.
LINK_SINE = 0.35

# [m] Largest distance from an end to the corner.
CORNER_REACH = 0.3

# [sine] Least angle of a corner: lines that are almost parallel cross at an arbitrary place.
CORNER_SINE = 0.25


@compiled
def link_walls(walls: Walls, cells: Cells, rows: Int) -> None:
    """Link walls (n,) to those around them, and retest a few links of others."""
    lines = np.empty((MOST_LINKS + 1, 4))
    lengths = np.empty(MOST_LINKS)
    others = np.empty(MOST_LINKS, np.int64)
    places = np.full(walls.counters[0].taken, -1)
    for k in range(len(rows)):
        places[rows[k]] = k
        walls.rows[rows[k]].linked += 1
    for k in range(len(rows)):
        reach = LONGEST_LINK
        found = 0
        farthest = 0
        own = walls.ends[rows[k]]
        line = lines[MOST_LINKS]
        for i in range(near(walls, own, LONGEST_LINK)):
            other = walls.found[i]
            # A link between two of these walls is added once, by the later one.
            if places[other] >= k or not walls.fits[other].shown:
                continue
            if not _measure_link(own, walls.ends[other], line):
                continue
            length = length_of(line)
            if length > reach:
                continue
            place = found if found < MOST_LINKS else farthest
            others[place] = other
            lengths[place] = length
            put_row(lines, place, line)
            found = min(found + 1, MOST_LINKS)
            if found == MOST_LINKS:
                farthest = _largest(lengths)
                reach = lengths[farthest]
        _keep_links(walls, cells, rows[k], others[:found], lines)
    _retest_links(walls, cells, lines[0])


@borrower
def _largest(values: Float) -> int:
    """The index of the first of the largest values; a search of numpy's is slow to compile."""
    largest = 0
    for place in range(1, len(values)):
        largest = place if values[place] > values[largest] else largest
    return largest


@inner
def _keep_links(walls: Walls, cells: Cells, row: int, others: Int, lines: Float) -> None:
    """Make those of the links (n,) of a wall to others that no beam has crossed."""
    wall = walls.rows[row]
    wall.links = 0
    for place in range(len(others)):
        other = others[place]
        if _joins(lines[place], walls.ends[row], walls.ends[other], cells):
            link = walls.links[row, wall.links]
            link.wall = other
            link.linked = walls.rows[other].linked
            wall.links += 1


@inner
def _retest_links(walls: Walls, cells: Cells, line: Float) -> None:
    """Retest a few links in turn, and void those that beams have crossed since."""
    asked = 0
    counters = walls.counters[0]
    # [links] Links that an update retests, so that two objects that were joined come apart.
    links_a_turn = 16
    for _ in range(counters.taken):
        counters.asked = (counters.asked + 1) % counters.taken
        for place in range(walls.rows[counters.asked].links):
            if _stands(walls, counters.asked, place):
                link = walls.links[counters.asked, place]
                one = walls.ends[counters.asked]
                other = walls.ends[link.wall]
                asked += 1
                if _measure_link(one, other, line) and not _joins(line, one, other, cells):
                    link.linked = -1
        if asked >= links_a_turn:
            break


@borrower
def _stands(walls: Walls, wall: int, place: int) -> bool:
    """Whether a link is valid."""
    link = walls.links[wall, place]
    stands = link.linked == walls.rows[link.wall].linked
    return bool(stands and walls.fits[wall].shown and walls.fits[link.wall].shown)


@borrower
def _measure_link(one: Float, other: Float, link: Float) -> bool:
    """Fill in the link (4,) of two walls; whether it is short enough to join them."""
    _shortest_link(one, other, link)
    length = length_of(link)
    return bool(length <= SHORT_LINK or (length <= LONGEST_LINK and _is_behind(one, other, link)))


@borrower
def _is_behind(one: Float, other: Float, line: Float) -> bool:
    """Whether a line between two walls runs in front of neither."""
    before = max(_reach_before(one, line), _reach_before(other, line))
    # [sine] Largest angle at which a link that runs in front of a wall still counts as behind it.
    behind_sine = 0.3
    return before <= behind_sine * length_of(line)


@borrower
def _shortest_link(one: Float, other: Float, link: Float) -> None:
    """Fill in the shortest line from one of two segments to the other."""
    dx, dy = vector_of(one)
    u, v = vector_of(other)
    crossing = dx * v - dy * u
    if crossing != 0.0:
        x, y = end_of(one, 0)
        its_x, its_y = end_of(other, 0)
        ahead = ((its_x - x) * v - (its_y - y) * u) / crossing
        along = ((its_x - x) * dy - (its_y - y) * dx) / crossing
        if 0.0 <= ahead <= 1.0 and 0.0 <= along <= 1.0:
            # They cross: one was united through the other.
            x = x + ahead * dx
            y = y + ahead * dy
            put_line(link, x, y, x, y)
            return
    least = np.inf
    for turn in range(4):
        own, across = (one, other) if turn < 2 else (other, one)
        x, y = end_of(own, turn % 2)
        u, v = end_of(across, 0)
        dx, dy = vector_of(across)
        place = ((x - u) * dx + (y - v) * dy) / (dx * dx + dy * dy)
        place = min(max(place, 0.0), 1.0)
        u = u + place * dx
        v = v + place * dy
        away = (x - u) ** 2 + (y - v) ** 2
        if away < least:
            least = away
            put_line(link, x, y, u, v)


@borrower
def _reach_before(wall: Float, link: Float) -> float:
    """How far [m] a line gets in front of the face of a wall."""
    x, y = end_of(wall, 0)
    dx, dy = vector_of(wall)
    first, last = along_of(link, x, y, -dy, dx)
    size = np.hypot(dx, dy)
    before: float = max(first / size, last / size)
    return before


@inner
def _joins(link: Float, one: Float, other: Float, cells: Cells) -> bool:
    """Whether no beam has crossed a link (4,) of two walls (4,), so that it joins them."""
    length = length_of(link)
    if length <= CELL:
        # They touch: no beam between them need be trusted.
        return True
    if length > SHORT_LINK:
        crossed = is_crossed(link, cells, FREE_DEPTH, 0, LINK_SINE)
        return not crossed and _is_blocked(one, other, cells)
    # A short one may be crossed by many beams, but not by any that go deeper than a
    # corner, half as deep as it is long.
    before = not _is_behind(one, other, link)
    depth = max(FREE_DEPTH, 0.5 * length) if before else FREE_DEPTH
    # [beams] Beams that may cross a short link: noise rarely lets one through, but links are many.
    stray_beams = 1
    if is_crossed(link, cells, depth, stray_beams, LINK_SINE):
        return False
    # [beams] Beams that may reach into the corner behind a short link; more have seen that corner.
    corner_beams = 8
    return not (before and is_crossed(link, cells, FREE_DEPTH, corner_beams, LINK_SINE))


@inner
def _is_blocked(one: Float, other: Float, cells: Cells) -> bool:
    """Whether no beam has crossed a line of sight behind both of two walls."""
    line = np.empty(4)
    # [share] Lines of sight begin and end this far from the ends of two walls, and midway.
    inset = 0.1
    sight_places = (inset, 0.5, 1.0 - inset)
    for own in sight_places:
        for across in sight_places:
            for k in range(2):
                line[k] = one[k] + own * (one[k + 2] - one[k])
                line[k + 2] = other[k] + across * (other[k + 2] - other[k])
            if _is_behind(one, other, line) and is_crossed(line, cells, FREE_DEPTH, 0, LINK_SINE):
                return False
    return True


@borrower
def _root(parents: Int, wall: int) -> int:
    while parents[wall] != wall:
        parents[wall] = parents[parents[wall]]
        wall = parents[wall]
    return wall


@compiled
def find_objects(walls: Walls, rows: Int) -> Int:
    """The object (n,) of each of the shown walls (n,), named by one of them."""
    parents = np.arange(len(walls.rows))
    labels = np.empty(len(rows), np.int64)
    for k in range(len(rows)):
        wall = rows[k]
        for place in range(walls.rows[wall].links):
            if _stands(walls, wall, place):
                one = _root(parents, wall)
                other = _root(parents, walls.links[wall, place].wall)
                parents[max(one, other)] = min(one, other)
    for k in range(len(rows)):
        labels[k] = _root(parents, rows[k])
    return labels


def close_corners(ends: Float, objects: Int) -> Float:
    """The walls (m, 4), each of an object (m,), with closed corners."""
    return _close(ends, objects, np.argsort(ends.reshape(-1, 2)[:, 0], kind="stable"))


@compiled
def _close(ends: Float, objects: Int, order: Int) -> Float:
    """Walls with closed corners; the order is that of their ends (2 m,) by rising x."""
    closed = ends.copy()
    places = ends.copy().reshape(-1, 2)
    count = len(places)
    partners = np.full(len(places), -1)
    corner = np.empty(2)
    # No corner is near to both of two ends that are farther apart.
    farthest = 2.0 * CORNER_REACH
    least = np.full(count, farthest * farthest)
    for k in range(count):
        end = order[k]
        after = k + 1
        # An end is named by twice its wall, and one more for the second one.
        while after < count and places[order[after], 0] - places[end, 0] <= farthest:
            other = order[after]
            after += 1
            dx = places[other, 0] - places[end, 0]
            dy = places[other, 1] - places[end, 1]
            away = dx * dx + dy * dy
            if away > max(least[end], least[other]) or objects[end >> 1] != objects[other >> 1]:
                continue
            if end >> 1 == other >> 1 or not _crossing(ends, end, other, corner):
                continue
            # Of equally near ones the order of the rows decides.
            for one, two in ((end, other), (other, end)):
                if away < least[one] or (away == least[one] and two < partners[one]):
                    partners[one] = two
                    least[one] = away
    for end in range(count):
        other = partners[end]
        if other >= 0 and partners[other] == end and _crossing(ends, end, other, corner):
            closed[end >> 1, 2 * (end & 1)] = corner[0]
            closed[end >> 1, 2 * (end & 1) + 1] = corner[1]
    return closed


@borrower
def _crossing(ends: Float, end: int, other: int, corner: Float) -> bool:
    """Fill in the corner (2,) where the walls of two ends cross; whether both may end there."""
    one = end >> 1
    side = end & 1
    two = other >> 1
    turned = other & 1
    ux, uy = vector_of(ends[one])
    vx, vy = vector_of(ends[two])
    own = np.hypot(ux, uy)
    across = np.hypot(vx, vy)
    turn = ux * vy - uy * vx
    if abs(turn) < CORNER_SINE * own * across:
        return False
    x, y = end_of(ends[one], side)
    its_x, its_y = end_of(ends[two], turned)
    dx = its_x - x
    dy = its_y - y
    ahead = (dx * vy - dy * vx) / turn
    back = (dx * uy - dy * ux) / turn
    if abs(ahead) * own > CORNER_REACH or abs(back) * across > CORNER_REACH:
        return False
    # Beams hit a wall beyond its corner: it is shortened by no more than a cell. The first end
    # (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(CELL, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(CELL, 0.5 * across):
        return False
    corner[0] = x + ahead * ux
    corner[1] = y + ahead * uy
    return True
