"""Segmentation: the best division of a cluster into straight walls, by dynamic programming.

Along a wall with the normal n at the distance c, the inverse range is linear in the direction of
the beam: 1/r = (n_x·cos φ + n_y·sin φ)/c. With the variance s²/r⁴ of 1/r, the maximum-likelihood
line of any run of beams is a linear least-squares fit of two numbers, which running sums give in
a few operations; so every division of a cluster can be weighed, and the cheapest one be taken.
"""

import numpy as np

from lrf3d.compiling import compiled, record
from lrf3d.geometry import Int
from lrf3d.mapping.robust.beams import Beams

WALL_COST = 20.0
"""[χ²] Cost of a further wall: noise on one wall of some hundred points, divided at its best place,
gains less than this but once in thousands of times. The refit of the map's walls uses it too."""

OUTLIER_COST = 12.0
"""[χ²] Cost of a point on no wall: as much as one 3.5 standard deviations off."""

LEAST_POINTS = 3
"""[points] Fewest points of a wall: two fit any line."""

PRUNED_COST = max(0.0, (LEAST_POINTS - 1) * OUTLIER_COST - WALL_COST)
"""[χ²] How much worse than the best a division may be and still lead to a better one later: what
the points behind it could cost that are too few for a wall of their own. Exact: no tuning."""

FIT = record(
    cc=float, cs=float, ss=float,  # of the cosine and the sine of the beam
    ci=float, si=float, ii=float,  # of these and the inverse range
)  # fmt: skip
"""Weighted sums of products, of which a line is fitted to the inverse ranges."""


@compiled
def segment_cluster(returns: Beams, walls: Int) -> int:
    """Divide a cluster of returns into walls; returns how many.

    ``walls`` (≥ n // LEAST_POINTS, 2) is filled with the first and the last point of each; points
    between are on none.
    """
    beams, ranges, deviations = returns
    count = len(ranges)
    sums = np.zeros(count + 1, FIT)
    for i in range(count):
        cos, sin = beams[i, 0], beams[i, 1]
        square = ranges[i] * ranges[i]
        # The inverse range and its fit are both scaled by r², which keeps the numbers near 1.
        weight = square * square / (deviations[i] * deviations[i])
        inverse = 1.0 / ranges[i]
        before, after = sums[i], sums[i + 1]
        after.cc = before.cc + weight * cos * cos
        after.cs = before.cs + weight * cos * sin
        after.ss = before.ss + weight * sin * sin
        after.ci = before.ci + weight * cos * inverse
        after.si = before.si + weight * sin * inverse
        after.ii = before.ii + weight * inverse * inverse
    best = np.zeros(count + 1)
    origin = np.zeros(count + 1, np.int64)
    # Where a wall may still begin; a beginning that has become too dear is struck off for good.
    open_first = np.empty(count + 1, np.int64)
    opened = 0
    for last in range(1, count + 1):
        # The last point lies on no wall …
        cheapest = best[last - 1] + OUTLIER_COST
        choice = -1
        # … or it ends a wall that begins behind the point `first`.
        if last >= LEAST_POINTS:
            open_first[opened] = last - LEAST_POINTS
            opened += 1
        total = sums[last]
        kept = 0
        for place in range(opened):
            first = open_first[place]
            start = sums[first]
            cc, cs, ss = total.cc - start.cc, total.cs - start.cs, total.ss - start.ss
            ci, si = total.ci - start.ci, total.si - start.si
            determinant = cc * ss - cs * cs
            misfit = 0.0
            if determinant > 1e-14 * cc * ss:
                explained = (ss * ci * ci - 2.0 * cs * ci * si + cc * si * si) / determinant
                misfit = max(total.ii - start.ii - explained, 0.0)
                cost = best[first] + misfit + WALL_COST
                if cost < cheapest:
                    cheapest = cost
                    choice = first
            # Points that are added only raise the misfit, so a beginning that costs more
            # without its wall than the best division does is never chosen later.
            if best[first] + misfit <= cheapest + PRUNED_COST:
                open_first[kept] = first
                kept += 1
        opened = kept
        best[last] = cheapest
        origin[last] = choice
    found = 0
    last = count
    while last > 0:
        if origin[last] < 0:
            last -= 1
        else:
            walls[found, 0] = origin[last]
            walls[found, 1] = last - 1
            found += 1
            last = origin[last]
    for i in range(found // 2):
        for k in range(2):
            walls[i, k], walls[found - 1 - i, k] = walls[found - 1 - i, k], walls[i, k]
    return found


@compiled
def fit_wall(returns: Beams) -> tuple[float, float]:
    """The wall n/c [1/m] that fits returns best: 1/r = (n/c)·beam."""
    beams, ranges, deviations = returns
    cc = cs = ss = ci = si = 0.0
    # In the frame of the middle beam the two unknowns are all but uncorrelated, so that a wall
    # seen under a tiny angle loses no digits.
    ahead = beams[len(ranges) // 2]
    for i in range(len(ranges)):
        cos = beams[i, 0] * ahead[0] + beams[i, 1] * ahead[1]
        sin = beams[i, 1] * ahead[0] - beams[i, 0] * ahead[1]
        square = ranges[i] * ranges[i]
        weight = square * square / (deviations[i] * deviations[i])
        cc += weight * cos * cos
        cs += weight * cos * sin
        ss += weight * sin * sin
        ci += weight * cos / ranges[i]
        si += weight * sin / ranges[i]
    determinant = cc * ss - cs * cs
    if determinant <= 0.0:
        return ahead[0] * ci / cc, ahead[1] * ci / cc
    along = (ss * ci - cs * si) / determinant
    aside = (cc * si - cs * ci) / determinant
    return along * ahead[0] - aside * ahead[1], along * ahead[1] + aside * ahead[0]
