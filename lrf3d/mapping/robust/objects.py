"""Objects: which walls are of one object, though what joins them was never seen.

Walls are of one object where a link, the shortest line from one to the other, exists that no beam
has crossed. What lies behind the faces of both walls is taken for solid until a beam crosses it. A
link that runs before one of them, to a corner that was not seen, must be short. A long link counts
only where every line of sight from wall to wall behind both is blocked: it may cross a lane that no
beam happened to pass.

Ends of walls of one object that all but meet are moved to where their lines cross.

One table holds the links of each wall to those around it. The beams are asked about them when the
wall is new, and again in turn; objects are worked out of the table when a map is read.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, near
from lrf3d.mapping.robust.cells import FREE_DEPTH, Cells
from lrf3d.mapping.robust.crossing import (
    LINK_SINE,
    along_of,
    end_of,
    is_crossed,
    length_of,
    put_line,
    vector_of,
)
from lrf3d.mapping.robust.walls import Walls, copy_columns, put_row

TOUCH = 0.1
"""[m] Walls that come nearer than this touch: no beam between them need be trusted."""

SHORT_LINK = 3.0
"""[m] Longest link that may run before a wall: less than a lane between buildings. More joins
buildings across lanes, less leaves corners of a building apart."""

LONGEST_LINK = 15.0
"""[m] Longest link behind two walls: as deep as most buildings are."""

MOST_LINKS = 24
"""[links] Others that a new wall is linked with, the nearest ones."""

BEHIND_SINE = 0.3
"""[sine] Angle by which a link may run before a wall and still count as behind it."""

STRAY_BEAMS = 1
"""[beams] How many may cross a short link: noise rarely lets one through, but links are many."""

CORNER_BEAMS = 8
"""[beams] How many may reach into the corner behind a short link: by more the corner was seen."""

NICHE_DEPTH = 0.5
"""[share] How deep such a corner may be, as a part of the link's length."""

SIGHT_PLACES = (0.1, 0.5, 0.9)
"""[share] Where along two walls the lines of sight between them begin and end."""

LINKS_A_TURN = 16
"""[links] How many an update asks the beams about again: so objects come apart that are two."""

CORNER_REACH = 0.3
"""[m] Two walls meet where their lines cross no farther than this from an end of each."""

CORNER_TRIM = 0.1
"""[m] An end is taken back to a corner by no more than this: beams hit the wall beyond it."""

CORNER_SINE = 0.25
"""[sine] Turn below which two walls have no corner: their lines cross at an arbitrary place."""


class Links(NamedTuple):
    """The links of each wall, a row of them for each.

    The wall at the other end of each (rows, MOST_LINKS) and its version when they were linked: of
    another version, the link is void; how many links each wall (rows,) has, and its own version;
    and the wall whose links are asked about next.
    """

    others: NDArray[np.int32]
    versions: NDArray[np.int32]
    counts: Int
    own: NDArray[np.int32]
    turn: Int

    @classmethod
    def of_size(cls, rows: int) -> "Links":
        """No links."""
        shape = (rows, MOST_LINKS)
        return cls(
            np.zeros(shape, np.int32), np.zeros(shape, np.int32), np.zeros(rows, np.int64),
            np.zeros(rows, np.int32), np.zeros(1, np.int64),
        )  # fmt: skip

    def with_rows(self, rows: int) -> "Links":
        """The links with room for those of this number of walls."""
        if rows <= len(self.own):
            return self
        grown = Links.of_size(rows)
        copy_columns(self, grown)
        return grown


@compiled
def link_walls(links: Links, walls: Walls, grid: Grid, cells: Cells, rows: Int) -> None:
    """Link some walls (n,) with those around them, and ask again about a few links of others."""
    lines, lengths = np.empty((MOST_LINKS + 1, 5)), np.empty(MOST_LINKS)
    others = np.empty(MOST_LINKS, np.int64)
    places = np.full(len(walls.rows), -1)
    for k in range(len(rows)):
        places[rows[k]] = k
        links.own[rows[k]] += 1
    for k in range(len(rows)):
        wall, reach, found, farthest = rows[k], LONGEST_LINK, 0, 0
        own = walls.ends[wall]
        for i in range(near(grid, own, LONGEST_LINK)):
            other = grid.found[i]
            # A link of two of them is added once, by the later one.
            if places[other] >= k or not walls.rows[other].shown:
                continue
            line, its = lines[MOST_LINKS], walls.ends[other]
            if _parted(own, its, reach) or not measure_link(own, its, line):
                continue
            length = length_of(line)
            if length > reach:
                continue
            place = found if found < MOST_LINKS else farthest
            others[place], lengths[place] = other, length
            put_row(lines, place, line)
            found = min(found + 1, MOST_LINKS)
            if found == MOST_LINKS:
                # A search of numpy's takes half a second to compile.
                farthest = 0
                for link in range(1, MOST_LINKS):
                    farthest = link if lengths[link] > lengths[farthest] else farthest
                reach = lengths[farthest]
        count = 0
        for place in range(found):
            other = others[place]
            if _joins(lines[place], own, walls.ends[other], cells):
                links.others[wall, count], links.versions[wall, count] = other, links.own[other]
                count += 1
        links.counts[wall] = count
    asked = 0
    taken = walls.counters[0].taken
    for _ in range(taken):
        wall = links.turn[0] = (links.turn[0] + 1) % taken
        for place in range(links.counts[wall]):
            if is_link(links, walls, wall, place):
                one, other = walls.ends[wall], walls.ends[links.others[wall, place]]
                asked += 1
                if measure_link(one, other, lines[0]) and not _joins(lines[0], one, other, cells):
                    links.versions[wall, place] = -1
        if asked >= LINKS_A_TURN:
            break


@borrower
def is_link(links: Links, walls: Walls, wall: int, place: int) -> bool:
    """Whether a link still stands."""
    other = links.others[wall, place]
    stands = links.versions[wall, place] == links.own[other]
    return bool(stands and walls.rows[wall].shown and walls.rows[other].shown)


@borrower
def measure_link(one: Float, other: Float, link: Float) -> bool:
    """Fill in the link x1 y1 x2 y2 of two walls, 1 if it runs before one; whether it may join."""
    _shortest_link(one, other, link)
    length = length_of(link)
    if length > LONGEST_LINK:
        return False
    before = max(_reach_before(one, link), _reach_before(other, link)) > BEHIND_SINE * length
    link[4] = before
    return bool(length <= SHORT_LINK or not before)


@borrower
def _parted(one: Float, other: Float, reach: float) -> bool:
    """Whether two segments are farther apart than a reach [m] along an axis."""
    for k in range(2):
        if min(other[k], other[k + 2]) - max(one[k], one[k + 2]) > reach:
            return True
        if min(one[k], one[k + 2]) - max(other[k], other[k + 2]) > reach:
            return True
    return False


@borrower
def _shortest_link(one: Float, other: Float, link: Float) -> None:
    """Fill in the shortest line from one of two segments to the other."""
    (dx, dy), (u, v) = vector_of(one), vector_of(other)
    crossing = dx * v - dy * u
    if crossing != 0.0:
        (x, y), (its_x, its_y) = end_of(one, 0), end_of(other, 0)
        ahead = ((its_x - x) * v - (its_y - y) * u) / crossing
        along = ((its_x - x) * dy - (its_y - y) * dx) / crossing
        if 0.0 <= ahead <= 1.0 and 0.0 <= along <= 1.0:
            # They cross: one was united through the other.
            x, y = x + ahead * dx, y + ahead * dy
            put_line(link, x, y, x, y)
            return
    least = np.inf
    for turn in range(4):
        own, across = (one, other) if turn < 2 else (other, one)
        x, y = end_of(own, turn % 2)
        (u, v), (dx, dy) = end_of(across, 0), vector_of(across)
        place = ((x - u) * dx + (y - v) * dy) / (dx * dx + dy * dy)
        place = min(max(place, 0.0), 1.0)
        u, v = u + place * dx, v + place * dy
        away = (x - u) ** 2 + (y - v) ** 2
        if away < least:
            least = away
            put_line(link, x, y, u, v)


@borrower
def _reach_before(wall: Float, link: Float) -> float:
    """How far [m] a link gets before the face of a wall that it begins or ends at."""
    (x, y), (dx, dy) = end_of(wall, 0), vector_of(wall)
    first, last = along_of(link, x, y, -dy, dx)
    size = np.hypot(dx, dy)
    before: float = max(first / size, last / size)
    return before


@inner
def _joins(link: Float, one: Float, other: Float, cells: Cells) -> bool:
    """Whether no beam has crossed a link (5,) of two walls (4,), so that it joins them."""
    length, before = length_of(link), link[4] > 0.0
    line = link[:4]
    if length <= TOUCH:
        return True
    if length > SHORT_LINK:
        crossed = is_crossed(line, cells, FREE_DEPTH, 0, LINK_SINE)
        return not crossed and _is_blocked(one, other, cells)
    # A short one may be crossed by many beams, but not by any that go deeper than a corner.
    depth = max(FREE_DEPTH, NICHE_DEPTH * length) if before else FREE_DEPTH
    if is_crossed(line, cells, depth, STRAY_BEAMS, LINK_SINE):
        return False
    return not (before and is_crossed(line, cells, FREE_DEPTH, CORNER_BEAMS, LINK_SINE))


@inner
def _is_blocked(one: Float, other: Float, cells: Cells) -> bool:
    """Whether no beam has crossed any line of sight that runs behind both of two walls."""
    line = np.empty(4)
    for own in SIGHT_PLACES:
        for across in SIGHT_PLACES:
            for k in range(2):
                line[k] = one[k] + own * (one[k + 2] - one[k])
                line[k + 2] = other[k] + across * (other[k + 2] - other[k])
            length = length_of(line)
            if max(_reach_before(one, line), _reach_before(other, line)) <= BEHIND_SINE * length:
                if is_crossed(line, cells, FREE_DEPTH, 0, LINK_SINE):
                    return False
    return True


@borrower
def _root(parents: Int, wall: int) -> int:
    while parents[wall] != wall:
        parents[wall] = parents[parents[wall]]
        wall = parents[wall]
    return wall


@compiled
def find_objects(links: Links, walls: Walls, rows: Int) -> Int:
    """The object (n,) of each of the real walls (n,), named by one of them."""
    parents, labels = np.arange(len(walls.rows)), np.empty(len(rows), np.int64)
    for k in range(len(rows)):
        wall = rows[k]
        for place in range(links.counts[wall]):
            if is_link(links, walls, wall, place):
                one, other = _root(parents, wall), _root(parents, links.others[wall, place])
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
    closed, places = ends.copy(), ends.copy().reshape(-1, 2)
    count, partners, corner = len(places), np.full(len(places), -1), np.empty(2)
    # Ends that are farther apart meet nowhere near to both.
    farthest = 2.01 * CORNER_REACH
    least = np.full(count, farthest * farthest)
    for k in range(count):
        end = order[k]
        after = k + 1
        # An end is named by twice its wall, and one more for the second one.
        while after < count and places[order[after], 0] - places[end, 0] <= farthest:
            other = order[after]
            after += 1
            dx, dy = places[other, 0] - places[end, 0], places[other, 1] - places[end, 1]
            away = dx * dx + dy * dy
            if away > max(least[end], least[other]) or objects[end >> 1] != objects[other >> 1]:
                continue
            if end >> 1 == other >> 1 or not _crossing(ends, end, other, corner):
                continue
            # Of equally near ones the order of the rows decides.
            for one, two in ((end, other), (other, end)):
                if away < least[one] or (away == least[one] and two < partners[one]):
                    partners[one], least[one] = two, away
    for end in range(count):
        other = partners[end]
        if other >= 0 and partners[other] == end and _crossing(ends, end, other, corner):
            closed[end >> 1, 2 * (end & 1)] = corner[0]
            closed[end >> 1, 2 * (end & 1) + 1] = corner[1]
    return closed


@borrower
def _crossing(ends: Float, end: int, other: int, corner: Float) -> bool:
    """Fill in the corner (2,) where the walls of two ends cross; whether it is near to both."""
    one, side, two, turned = end >> 1, end & 1, other >> 1, other & 1
    (ux, uy), (vx, vy) = vector_of(ends[one]), vector_of(ends[two])
    own, across = np.hypot(ux, uy), np.hypot(vx, vy)
    turn = ux * vy - uy * vx
    if abs(turn) < CORNER_SINE * own * across:
        return False
    x, y = end_of(ends[one], side)
    its_x, its_y = end_of(ends[two], turned)
    dx, dy = its_x - x, its_y - y
    ahead, back = (dx * vy - dy * vx) / turn, (dx * uy - dy * ux) / turn
    if abs(ahead) * own > CORNER_REACH or abs(back) * across > CORNER_REACH:
        return False
    # The first end (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(CORNER_TRIM, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(CORNER_TRIM, 0.5 * across):
        return False
    corner[0], corner[1] = x + ahead * ux, y + ahead * uy
    return True
