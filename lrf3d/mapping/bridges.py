"""Bridges: stretches of one line between which no beam has passed are one wall, compiled.

A wall behind trees, cars or other buildings is seen in stretches. What lies between two of them
on the same line is taken for wall until a beam passes through it.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int
from lrf3d.mapping.evidence import PASSED
from lrf3d.mapping.grid import pairs_within
from lrf3d.mapping.links import passed
from lrf3d.mapping.scan_archive import Beams
from lrf3d.mapping.wall_merging import Rule, merge, misfit
from lrf3d.mapping.wall_rows import Walls

LONGEST = 3.0
"""Longest stretch [m] of a wall that no beam needs to have met."""


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
    links = np.empty((len(pairs), 4))
    gaps = np.full(len(pairs), np.inf)
    wide = Rule(LONGEST, rule.bend, rule.bend, rule.distance)
    for k in range(len(pairs)):
        one, other = pairs[k]
        if not misfit(
            walls.ends[one], walls.moments[one], walls.ends[other], walls.moments[other], wide
        ) < 1.0:
            continue
        ux, uy = walls.ends[one, 2] - walls.ends[one, 0], walls.ends[one, 3] - walls.ends[one, 1]
        size = np.hypot(ux, uy)
        ahead = walls.ends[other, 0] - walls.ends[one, 2], walls.ends[other, 1] - walls.ends[one, 3]
        back = walls.ends[one, 0] - walls.ends[other, 2], walls.ends[one, 1] - walls.ends[other, 3]
        first = (ahead[0] * ux + ahead[1] * uy) / size
        last = (back[0] * ux + back[1] * uy) / size
        gaps[k] = max(first, last, 0.0)
        if first > last:
            links[k, :2], links[k, 2:] = walls.ends[one, 2:], walls.ends[other, :2]
        else:
            links[k, :2], links[k, 2:] = walls.ends[other, 2:], walls.ends[one, :2]
    parents = np.arange(len(walls.ends))
    for k in np.argsort(gaps, kind="mergesort"):
        if gaps[k] == np.inf:
            break
        one, other = pairs[k]
        while parents[one] != one:
            one = parents[one]
        while parents[other] != other:
            other = parents[other]
        if one == other or not misfit(
            walls.ends[one], walls.moments[one], walls.ends[other], walls.moments[other], wide
        ) < 1.0:
            continue
        if gaps[k] > 0.0 and passed(links[k], beams, floor, growth, PASSED, 0):
            continue
        kept, gone = min(one, other), max(one, other)
        merge(walls, kept, gone)
        parents[gone] = kept
