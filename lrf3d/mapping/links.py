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
from lrf3d.mapping.evidence import PASSED, SIGMAS
from lrf3d.mapping.grid import pairs_within
from lrf3d.mapping.link_lines import (
    ABUTS,
    BEHIND,
    FAR,
    SHORT,
    find_links,
    goes_before,
    neighbours,
    reach_before,
)
from lrf3d.mapping.passing import passed
from lrf3d.mapping.scan_archive import Beams

TOUCH = 0.1
"""Walls that come nearer than this [m] touch: no beam that passes between them need be trusted."""

SPREAD = (0.1, 0.5, 0.9)
"""Where on two walls the lines of sight between them begin and end, as parts of their lengths."""

SEVERAL = 3
"""Walls from which on an object is joined to another such by two long links and not by one."""

ALIKE = 1.0
"""How much longer [m] the second of them may be: what is much longer leads past more walls."""

BLUR = 2.0 * SIGMAS
"""How many deviations of a range the end of a wall and the face before it may be off together."""

STRAY = 1
"""Beams that may pass a short link: noise that lets one pass is rare, but links are many."""

FEW = 8
"""Beams that may reach into the corner behind a short link: by more the corner was seen, and what
joins there was seen too."""

NICHE = 0.5
"""How deep such a corner may be, as a part of the link's length."""


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
    starts, near = neighbours(candidates, len(ends))
    pairs, links = find_links(ends, candidates)
    order = np.argsort(links[:, 4], kind="mergesort")
    waiting, strong = np.empty(len(order), np.int64), np.zeros(len(order), np.bool_)
    blur = BLUR * np.sqrt(floor * floor + (growth * FAR) ** 2)
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
            if goes_before(links[place], ends, wall, across, others, blur):
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
        elif length > TOUCH and _parted(links[place], beams, floor, growth):
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
            if max(reach_before(one, line), reach_before(other, line)) <= BEHIND * length:
                if passed(line, beams, floor, growth, PASSED, 0):
                    return False
    return True


@njit(cache=True, nogil=True)
def _parted(link: Float, beams: Beams, floor: float, growth: float) -> bool:  # pragma: no cover
    """Whether beams have passed a short link (6,): many of them, or deeper than into a corner."""
    depth = max(PASSED, NICHE * link[4]) if link[5] > 0.0 else PASSED
    return passed(link[:4], beams, floor, growth, depth, STRAY) or passed(
        link[:4], beams, floor, growth, PASSED, FEW
    )
