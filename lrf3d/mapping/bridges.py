"""Bridges: stretches of one line between which no beam has passed are one wall, compiled.

A wall behind trees, cars or other buildings is seen in stretches. What lies between two of them
on the same line is taken for wall until a beam passes through it.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float
from lrf3d.mapping.evidence import PASSED
from lrf3d.mapping.grid import pairs_within
from lrf3d.mapping.passing import passed
from lrf3d.mapping.scan_archive import Beams
from lrf3d.mapping.wall_merging import Rule, merge, misfit
from lrf3d.mapping.wall_rows import Walls

LONGEST = 3.0
"""Longest stretch [m] of a wall that no beam needs to have met: behind what is longer there may
as well be a recess that beams could not look into."""


@njit(cache=True, nogil=True)
def bridge_walls(
    walls: Walls, rule: Rule, beams: Beams, floor: float, growth: float
) -> None:  # pragma: no cover
    """Merge walls on one line between which no beam has passed; those gone have no points.

    Args:
        walls: The walls; are written.
        rule: What one wall is.
        beams: The beams.
        floor: Deviation of a range at no distance [m].
        growth: What a deviation grows by with the range.
    """
    pairs = pairs_within(walls.ends, LONGEST)
    # As straight as a wall is continued, and no farther off than two views of it: stretches are
    # short, and nothing overlaps that could tell where they lead.
    straight = Rule(LONGEST, rule.bend, rule.bend, rule.distance)
    links = np.empty((len(pairs), 4))
    gaps = np.full(len(pairs), np.inf)
    for k in range(len(pairs)):
        one, other = pairs[k]
        if _fits(walls, one, other, straight):
            gaps[k] = _span(walls.ends[one], walls.ends[other], links[k])
    parents = np.arange(len(walls.ends))
    for k in np.argsort(gaps, kind="mergesort"):
        if gaps[k] == np.inf:
            break
        one, other = pairs[k]
        while parents[one] != one:
            one = parents[one]
        while parents[other] != other:
            other = parents[other]
        if one == other or not _fits(walls, one, other, straight):
            continue
        if gaps[k] > 0.0 and passed(links[k], beams, floor, growth, PASSED, 0):
            continue
        kept, gone = min(one, other), max(one, other)
        merge(walls, kept, gone)
        parents[gone] = kept


@njit(cache=True, nogil=True)
def _fits(walls: Walls, one: int, other: int, rule: Rule) -> bool:  # pragma: no cover
    ends, moments = walls.ends, walls.moments
    misses: float = misfit(ends[one], moments[one], ends[other], moments[other], rule)
    return misses < 1.0


@njit(cache=True, nogil=True)
def _span(one: Float, other: Float, link: Float) -> float:  # pragma: no cover
    """Fill in the link (4,) from the end of one wall to where the next begins: its length [m]."""
    ux, uy = one[2] - one[0], one[3] - one[1]
    size = np.hypot(ux, uy)
    ahead = ((other[0] - one[2]) * ux + (other[1] - one[3]) * uy) / size
    back = ((one[0] - other[2]) * ux + (one[1] - other[3]) * uy) / size
    if ahead > back:
        link[:2], link[2:] = one[2:], other[:2]
    else:
        link[:2], link[2:] = other[2:], one[:2]
    gap: float = max(ahead, back, 0.0)
    return gap
