"""Local walls: from one scan to its fitted wall segments, as one compiled pass.

Enter a scan's beams and ranges; leave the walls in the world's directions around the laser, with
the moments of their points. Clusters are told by a gap that knows the beams' spacing, and are
divided into the likeliest walls; a full circle has no seam.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int
from lrf3d.mapping.returns import sorted_returns
from lrf3d.mapping.segmentation import LEAST_POINTS, fit_wall, segment_cluster

LEAST_INCIDENCE = 0.05
"""Smallest cosine of the incidence that a weight is computed with: along grazing beams other
errors than that of the range decide."""

WEAKEST_DIRECTION = 0.15
"""A segment whose direction is known to no better than this [rad] is not taken into the map."""

STRAIGHT = 0.2
"""Sine of the turn below which two neighbours are no corner: their lines cross just anywhere."""


@njit(cache=True, nogil=True)
def extract_walls(
    theta: float,
    angles: Float,
    ranges: Float,
    limits: tuple[float, float, float, float],
    ends: Float,
    moments: Float,
    labels: Int,
) -> int:  # pragma: no cover
    """Find the walls of a scan.

    Args:
        theta: Heading of the laser [rad].
        angles: (n,) angles of the beams from the heading [rad].
        ranges: (n,) measured ranges [m]; what is no number above 0 is no return.
        limits: Farthest range that counts, deviation of a range at no distance, its growth with
            the range, and the gap [m] that parts two clusters however far they are.
        ends: (≥ n // 3, 4) is filled with the segments, seen from their left.
        moments: (≥ n // 3, 6) is filled with the moments of their points.
        labels: (≥ n // 3, 2) is filled with the count of points and the cluster of each.

    Returns:
        How many there are.
    """
    range_max, floor, growth, gap = limits
    beams, reaches, deviations, joined = sorted_returns(
        theta, angles, ranges, range_max, floor, growth, gap
    )
    count = len(reaches)
    found = clusters = 0
    if count == 0:
        return 0
    # Begin behind a break, so that no cluster runs over the end of the list.
    begin = 0
    while begin < count and joined[begin]:
        begin += 1
    closed = begin == count
    begin = 0 if closed else begin + 1
    walls = np.empty((count // LEAST_POINTS + 1, 2), np.int64)
    first = 0
    run_beams = np.empty((count, 2))
    run_ranges = np.empty(count)
    run_deviations = np.empty(count)
    while first < count:
        size = 0
        while first + size < count:
            place = (begin + first + size) % count
            run_beams[size] = beams[place]
            run_ranges[size] = reaches[place]
            run_deviations[size] = deviations[place]
            size += 1
            if not joined[place] and not closed:
                break
        first += size
        if size < LEAST_POINTS:
            continue
        parts = segment_cluster(run_beams[:size], run_ranges[:size], run_deviations[:size], walls)
        if closed and parts > 1:
            # One object all round: begin anew at a corner, so that no wall is cut in two.
            turn = walls[1, 0]
            run_beams = np.concatenate((run_beams[turn:], run_beams[:turn]))
            run_ranges = np.concatenate((run_ranges[turn:], run_ranges[:turn]))
            run_deviations = np.concatenate((run_deviations[turn:], run_deviations[:turn]))
            parts = segment_cluster(run_beams, run_ranges, run_deviations, walls)
        size_found = _polyline(
            run_beams[:size],
            run_ranges[:size],
            run_deviations[:size],
            walls[:parts],
            floor,
            ends[found:],
            moments[found:],
            labels[found:],
        )
        for row in range(found, found + size_found):
            labels[row, 1] = clusters
        if size_found:
            clusters += 1
        found += size_found
    return found


@njit(cache=True, nogil=True)
def _polyline(
    beams: Float,
    ranges: Float,
    deviations: Float,
    walls: Int,
    floor: float,
    ends: Float,
    moments: Float,
    labels: Int,
) -> int:  # pragma: no cover
    """Segments of one cluster's walls (m, 2), joined at corners where two of them meet."""
    inverses = np.empty((len(walls), 2))
    spans = np.empty((len(walls), 2), np.int64)
    rows = 0
    for wall in range(len(walls)):
        first, last = walls[wall]
        x, y = fit_wall(
            beams[first : last + 1], ranges[first : last + 1], deviations[first : last + 1]
        )
        _measure(beams, ranges, deviations, first, last, x, y, moments[rows])
        size = np.sqrt(x * x + y * y)
        nx, ny = x / size, y / size
        spread = moments[rows, 3] * ny * ny + moments[rows, 5] * nx * nx
        spread -= 2.0 * moments[rows, 4] * nx * ny
        if not spread * WEAKEST_DIRECTION**2 > 1.0:
            continue
        inverses[rows, 0], inverses[rows, 1] = x, y
        spans[rows, 0], spans[rows, 1] = first, last
        labels[rows, 0] = last - first + 1
        for k in range(2):
            beam = spans[rows, k]
            # A noisy end goes along its beam onto the wall; near-parallel ones stay put.
            slope = beams[beam, 0] * x + beams[beam, 1] * y
            reach = ranges[beam]
            if slope > 0.0 and abs(1.0 / slope - reach) <= 5.0 * deviations[beam]:
                reach = 1.0 / slope
            ends[rows, 2 * k] = reach * beams[beam, 0]
            ends[rows, 2 * k + 1] = reach * beams[beam, 1]
        rows += 1
    for row in range(rows - 1):
        one, other = inverses[row], inverses[row + 1]
        turn = one[0] * other[1] - one[1] * other[0]
        lengths = np.sqrt((one[0] ** 2 + one[1] ** 2) * (other[0] ** 2 + other[1] ** 2))
        last, first = spans[row, 1], spans[row + 1, 0]
        if abs(turn) < STRAIGHT * lengths or first - last > 3:
            continue
        x, y = (other[1] - one[1]) / turn, (one[0] - other[0]) / turn
        ax, ay, bx, by = ends[row, 2], ends[row, 3], ends[row + 1, 0], ends[row + 1, 1]
        step = np.hypot(ax - bx, ay - by) + 4.0 * deviations[last]
        if max(np.hypot(x - ax, y - ay), np.hypot(x - bx, y - by)) <= 1.5 * step:
            ends[row, 2], ends[row, 3], ends[row + 1, 0], ends[row + 1, 1] = x, y, x, y
    return rows


@njit(cache=True, nogil=True)
def _measure(
    beams: Float,
    ranges: Float,
    deviations: Float,
    first: int,
    last: int,
    x: float,
    y: float,
    moments: Float,
) -> None:  # pragma: no cover
    """Fill in moments (6,) of the points of a wall n/c = (x, y), each with its own variance."""
    size = np.sqrt(x * x + y * y)
    total = mx = my = xx = xy = yy = 0.0
    for i in range(first, last + 1):
        incidence = max(abs(beams[i, 0] * x + beams[i, 1] * y) / size, LEAST_INCIDENCE)
        weight = 1.0 / (deviations[i] * incidence) ** 2
        px, py = ranges[i] * beams[i, 0], ranges[i] * beams[i, 1]
        # The running mean and the scatter about it, which no offset makes inexact.
        total += weight
        dx, dy = px - mx, py - my
        share = weight / total
        mx += share * dx
        my += share * dy
        spread = weight * (1.0 - share)
        xx += spread * dx * dx
        xy += spread * dx * dy
        yy += spread * dy * dy
    moments[0], moments[1], moments[2] = total, mx, my
    moments[3], moments[4], moments[5] = xx, xy, yy
