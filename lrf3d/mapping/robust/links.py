"""Links: the shortest lines between walls that may be of one object, in a list for each wall."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, Search, near
from lrf3d.mapping.robust.constants import (
    BEHIND_SINE,
    FACING,
    FACING_SINE,
    HIDDEN_LINK,
    HIDDEN_SINE,
    LONGEST_LINK,
    MERGE_CELL,
    MOST_LINKS,
    SHORT_LINK,
)
from lrf3d.mapping.robust.walls import Walls

UNASKED = 0
"""The kind of a link that the beams were not asked about."""


class Links(NamedTuple):
    """The links that may join walls, a list of them for each wall.

    Args:
        pairs: (links, 2) the walls that each is between.
        lines: (links, 6) see `measure_link`.
        kinds: (links,) what each is, as far as it was asked. One that beams have crossed is
            dropped.
        bearing: (links,) whether each has joined two objects that no other link had joined before.
        following: (links, 2) the next entry of the list of either wall, −1 at the end; entry
            2·link + side stands for a link in the list of the wall on that side of its pair.
        preceding: (links, 2) the entry before, −1 at the beginning.
        heads: (walls,) the first entry of each wall's list.
        used: (3,) links that were taken, the first that was given back, and the next whose beams
            are looked at again.
    """

    pairs: Int
    lines: Float
    kinds: NDArray[np.int8]
    bearing: NDArray[np.bool_]
    following: Int
    preceding: Int
    heads: Int
    used: Int

    @classmethod
    def of_size(cls, links: int, walls: int) -> "Links":
        """No links, with room for some."""
        return cls(
            np.zeros((links, 2), np.int64), np.zeros((links, 6)), np.zeros(links, np.int8),
            np.zeros(links, np.bool_), np.full((links, 2), -1), np.full((links, 2), -1),
            np.full(walls, -1), np.array([0, -1, 0]),
        )  # fmt: skip


@inner
def measure_link(one: Float, other: Float, link: Float) -> bool:
    """Fill in the link (6,) of two walls (4,); returns whether it may join them.

    It is x1 y1 x2 y2, its length [m], and 1 where it runs before a wall.
    """
    shortest = _shortest_link(one, other)
    length = np.hypot(shortest[2] - shortest[0], shortest[3] - shortest[1])
    if length > LONGEST_LINK:
        return False
    near, far = reach_before(one, shortest), reach_before(other, shortest)
    before, less = max(near, far), min(near, far)
    if (length > FACING and less > FACING_SINE * length) or (
        (length > SHORT_LINK and before > BEHIND_SINE * length)
        and (length > HIDDEN_LINK or less > HIDDEN_SINE * length)
    ):
        return False
    for place in range(4):
        link[place] = shortest[place]
    link[4] = length
    link[5] = before > BEHIND_SINE * length
    return True


@inner
def _parted(one: Float, other: Float, reach: float) -> bool:
    """Whether two segments are farther apart than a reach [m] along an axis."""
    for k in range(2):
        if min(other[k], other[k + 2]) - max(one[k], one[k + 2]) > reach:
            return True
        if min(one[k], one[k + 2]) - max(other[k], other[k + 2]) > reach:
            return True
    return False


@inner
def _shortest_link(one: Float, other: Float) -> Float:
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
def reach_before(wall: Float, link: Float) -> float:
    """How far [m] a link gets before the face of a wall that it begins or ends at."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    size = np.hypot(dx, dy)
    first = (dx * (link[1] - wall[1]) - dy * (link[0] - wall[0])) / size
    last = (dx * (link[3] - wall[1]) - dy * (link[2] - wall[0])) / size
    before: float = max(first, last)
    return before


@inner
def add_links(
    links: Links, fresh: Int, places: Int, walls: Walls, grid: Grid, search: Search
) -> None:
    """Add the links of some walls to all others near them.

    Args:
        links: Is written; there is room for all that may come.
        fresh: (n,) the rows of the walls, which have no links.
        places: (rows,) at each of them its place among them; −1 at all other walls.
        walls: All walls.
        grid: Where they are, in cells of MERGE_CELL.
        search: Is written.
    """
    others, lines = np.empty(MOST_LINKS, np.int64), np.empty((MOST_LINKS + 1, 6))
    ends = walls.ends
    for k in range(len(fresh)):
        wall = fresh[k]
        search.number[0] += 1
        stamp = search.number[0]
        count = near(grid, ends[wall], LONGEST_LINK, MERGE_CELL, search.stamps, stamp, search.found)
        found, farthest, reach = 0, 0, LONGEST_LINK
        for i in range(count):
            other = search.found[i]
            # A link of two of them is added once, by the later one.
            if places[other] >= k or _parted(ends[wall], ends[other], reach):
                continue
            place = found if found < MOST_LINKS else farthest
            if not measure_link(ends[wall], ends[other], lines[MOST_LINKS]):
                continue
            if lines[MOST_LINKS, 4] > reach:
                continue
            others[place] = other
            for column in range(6):
                lines[place, column] = lines[MOST_LINKS, column]
            found = min(found + 1, MOST_LINKS)
            if found == MOST_LINKS:
                farthest = 0
                for place in range(1, MOST_LINKS):
                    if lines[place, 4] > lines[farthest, 4]:
                        farthest = place
                reach = lines[farthest, 4]
        for i in range(found):
            other, line = others[i], lines[i]
            link = links.used[1]
            if link >= 0:
                links.used[1] = links.following[link, 0]
            else:
                link = links.used[0]
                links.used[0] += 1
            links.kinds[link], links.bearing[link] = UNASKED, False
            for place in range(6):
                links.lines[link, place] = line[place]
            links.pairs[link, 0], links.pairs[link, 1] = wall, other
            for side in range(2):
                row = links.pairs[link, side]
                entry, head = 2 * link + side, links.heads[row]
                links.following[link, side], links.preceding[link, side] = head, -1
                if head >= 0:
                    links.preceding[head >> 1, head & 1] = entry
                links.heads[row] = entry


@inner
def drop_link(links: Links, link: int) -> None:
    """Take a link out of the lists of its two walls."""
    for side in range(2):
        before, after = links.preceding[link, side], links.following[link, side]
        if before < 0:
            links.heads[links.pairs[link, side]] = after
        else:
            links.following[before >> 1, before & 1] = after
        if after >= 0:
            links.preceding[after >> 1, after & 1] = before
    links.bearing[link] = False
    links.following[link, 0] = links.used[1]
    links.used[1] = link


@inner
def drop_links(links: Links, walls: Int) -> None:
    """Take all links of some walls (n,) out."""
    for k in range(len(walls)):
        while links.heads[walls[k]] >= 0:
            drop_link(links, links.heads[walls[k]] >> 1)


@inner
def renew_links(links: Links, walls: Int, ends: Float) -> None:
    """Measure the links of some walls (n,) anew, and have the beams asked about them again."""
    for k in range(len(walls)):
        entry = links.heads[walls[k]]
        while entry >= 0:
            link = entry >> 1
            entry = links.following[link, entry & 1]
            one, other = links.pairs[link]
            if measure_link(ends[one], ends[other], links.lines[link]):
                links.kinds[link] = UNASKED
            else:
                drop_link(links, link)
