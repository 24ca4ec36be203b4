"""Segmentation: the best division of a cluster into straight walls, by dynamic programming.

Along a wall with the normal n at the distance c, the inverse range is linear in the direction of
the beam: 1/r = (n_x·cos φ + n_y·sin φ)/c. With the variance s²/r⁴ of 1/r, the maximum-likelihood
line of any run of beams is a linear least-squares fit of two numbers, which running sums give in
a few operations; so every division of a cluster can be weighed, and the cheapest one be taken.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int

WALL_COST = 20.0
"""What a further wall costs, in units of χ²: noise on one wall of some hundred points, divided
at its best place, gains less than this but once in thousands of times."""

POINT_COST = 12.0
"""What a point on no wall costs, in units of χ²: as much as one 3.5 standard deviations off."""

LEAST_POINTS = 3
"""Fewest points of a wall: two fit any line."""


@njit(cache=True)
def segment_cluster(angles: Float, ranges: Float, deviations: Float) -> Int:  # pragma: no cover
    """Divide a cluster into walls.

    Args:
        angles: (n,) directions of the beams [rad], rising.
        ranges: (n,) measured ranges [m].
        deviations: (n,) standard deviations of the ranges [m].

    Returns:
        (m, 2) the first and the last point of each wall; points between are on none.
    """
    count = len(ranges)
    sums = np.zeros((count + 1, 6))
    for i in range(count):
        cos, sin = np.cos(angles[i]), np.sin(angles[i])
        inverse = 1.0 / ranges[i]
        weight = ranges[i] ** 4 / deviations[i] ** 2
        sums[i + 1, 0] = sums[i, 0] + weight * cos * cos
        sums[i + 1, 1] = sums[i, 1] + weight * cos * sin
        sums[i + 1, 2] = sums[i, 2] + weight * sin * sin
        sums[i + 1, 3] = sums[i, 3] + weight * cos * inverse
        sums[i + 1, 4] = sums[i, 4] + weight * sin * inverse
        sums[i + 1, 5] = sums[i, 5] + weight * inverse * inverse
    best = np.zeros(count + 1)
    origin = np.zeros(count + 1, np.int64)
    for last in range(1, count + 1):
        # The last point lies on no wall …
        best[last] = best[last - 1] + POINT_COST
        origin[last] = -1
        # … or it ends a wall that begins behind the point `first`.
        for first in range(last - LEAST_POINTS, -1, -1):
            cc = sums[last, 0] - sums[first, 0]
            cs = sums[last, 1] - sums[first, 1]
            ss = sums[last, 2] - sums[first, 2]
            ci = sums[last, 3] - sums[first, 3]
            si = sums[last, 4] - sums[first, 4]
            ii = sums[last, 5] - sums[first, 5]
            determinant = cc * ss - cs * cs
            if determinant <= 1e-14 * cc * ss:
                continue
            explained = (ss * ci * ci - 2.0 * cs * ci * si + cc * si * si) / determinant
            misfit = max(ii - explained, 0.0)
            cost = best[first] + misfit + WALL_COST
            if cost < best[last]:
                best[last] = cost
                origin[last] = first
    walls = np.empty((count // LEAST_POINTS + 1, 2), np.int64)
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
    return walls[:found][::-1]


def fit_wall(angles: Float, ranges: Float, deviations: Float) -> Float:
    """The wall (2,) n/c [1/m] that fits ranges (n,) best: along it 1/r = (n/c)·(cos φ, sin φ)."""
    beams = np.column_stack([np.cos(angles), np.sin(angles)])
    scale = ranges**2 / deviations
    solution, *_ = np.linalg.lstsq(beams * scale[:, None], scale / ranges, rcond=None)
    return np.asarray(solution)
