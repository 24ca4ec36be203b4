"""Facets: the parts of a wall that stand, and the straight facets that they are made of, compiled.

Enter what beams did at each piece of the walls; leave new walls. A part stands where the beams
that ended there outweigh those that passed through it or ended on a nearer wall; it is divided
where its points bend by more than a map can be trusted.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int
from lrf3d.mapping.segmentation import WALL_COST

PASS = 0.07
"""What a beam that passed weighs against one that ended: poses and edges are a little wrong, so a
wall that one beam in fifteen met is still more than nothing."""

OPEN = 0.5
"""What a beam that passed weighs where none ended."""

RIVAL = 0.2
"""What a beam weighs that ended nearer to another wall: a second copy of a wall is not kept."""

TOLL = 0.1
"""What each piece that stands costs where nothing was seen, so that walls end where beams do."""

CHANGE = 5.0
"""What it costs that a wall begins or ends, in beams: less would cut walls for stray beams."""

BLUR = 0.025
"""No piece of a map is known better than this [m], however many beams ended there: what they
share, the errors of poses, does not average out."""


@njit(cache=True, nogil=True)
def choose(counts: Int) -> Int:  # pragma: no cover
    """Which pieces (n,) of a wall stand, by the cheapest run of states along it.

    A piece that stands is charged for each beam that passed, one that does not for each beam that
    ended on it, and each change from one to the other costs something too.
    """
    count = len(counts)
    # Before the wall, on it, in a gap of it, behind it: where it begins and where it ends is free.
    costs = np.array([0.0, 0.0, np.inf, np.inf])
    following = np.empty(4)
    came = np.zeros((count, 4), np.int64)
    for i in range(count):
        following[:] = costs
        came[i] = (0, 1, 2, 3)
        if costs[0] < following[1]:
            following[1], came[i, 1] = costs[0], 0
        if costs[2] + CHANGE < following[1]:
            following[1], came[i, 1] = costs[2] + CHANGE, 2
        if costs[1] + CHANGE < following[2]:
            following[2], came[i, 2] = costs[1] + CHANGE, 1
        if costs[1] < following[3]:
            following[3], came[i, 3] = costs[1], 1
        ended, passed, rivals = counts[i]
        weight = PASS if ended else OPEN
        following += ended
        following[1] += weight * passed + RIVAL * rivals + TOLL - ended
        costs, following = following, costs
    states = np.zeros(count, np.int64)
    state = np.argmin(costs)
    for i in range(count - 1, -1, -1):
        states[i] = state == 1
        state = came[i, state]
    return states


@njit(cache=True, nogil=True)
def facets(sums: Float, breaks: Int) -> int:  # pragma: no cover
    """Divide pieces (n, 6) of a wall into straight facets: fills in where each ends."""
    count = len(sums)
    total = np.zeros((count + 1, 6))
    for i in range(count):
        w = sums[i, 0]
        # No piece of the map is known better than its blur, however many beams ended there.
        factor = 1.0 / (1.0 + w * BLUR * BLUR)
        for k in range(6):
            total[i + 1, k] = total[i, k] + factor * sums[i, k]
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    origin = np.zeros(count + 1, np.int64)
    for last in range(1, count + 1):
        for first in range(last):
            w = total[last, 0] - total[first, 0]
            cost = best[first] + WALL_COST
            if w > 0.0:
                s = (total[last, 1] - total[first, 1]) / w
                d = (total[last, 2] - total[first, 2]) / w
                ss = (total[last, 3] - total[first, 3]) - w * s * s
                sd = (total[last, 4] - total[first, 4]) - w * s * d
                dd = (total[last, 5] - total[first, 5]) - w * d * d
                if ss > 0.0:
                    dd -= sd * sd / ss
                cost += max(dd, 0.0)
            if cost < best[last]:
                best[last] = cost
                origin[last] = first
    found = 0
    last = count
    while last > 0:
        breaks[found] = last
        found += 1
        last = origin[last]
    for i in range(found // 2):
        breaks[i], breaks[found - 1 - i] = breaks[found - 1 - i], breaks[i]
    return found


@njit(cache=True, nogil=True)
def cut(
    ends: Float,
    first: Int,
    counts: Int,
    sums: Float,
) -> tuple[Float, Float, Int]:  # pragma: no cover
    """The parts of walls (m, 4) that stand: (k, 4) their ends, (k, 3) wall, ended and passed."""
    parts = np.empty((len(counts), 4))
    moments = np.empty((len(counts), 6))
    labels = np.empty((len(counts), 3), np.int64)
    breaks = np.empty(len(counts) + 1, np.int64)
    found = 0
    for wall in range(len(ends)):
        low, high = first[wall], first[wall + 1]
        states = choose(counts[low:high])
        pieces = high - low
        x1, y1, x2, y2 = ends[wall]
        length = np.hypot(x2 - x1, y2 - y1)
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        i = 0
        while i < pieces:
            if not states[i]:
                i += 1
                continue
            begin = i
            while i < pieces and states[i]:
                i += 1
            number = facets(sums[low + begin : low + i], breaks)
            start = begin
            for part in range(number):
                stop = begin + breaks[part]
                met = passed = 0
                total = np.zeros(6)
                for k in range(low + start, low + stop):
                    met += counts[k, 0]
                    passed += counts[k, 1]
                    total += sums[k]
                a, b = start / pieces * length, stop / pieces * length
                start = stop
                w = total[0]
                if w <= 0.0:
                    continue
                s, d = total[1] / w, total[2] / w
                ss = max(total[3] - w * s * s, 1e-12)
                sd = total[4] - w * s * d
                dd = max(total[5] - w * d * d, 0.0)
                slope = 0.0
                if ss > w * 0.01:
                    slope = sd / ss
                da, db = d + slope * (a - s), d + slope * (b - s)
                parts[found, 0], parts[found, 1] = x1 + a * ux - da * uy, y1 + a * uy + da * ux
                parts[found, 2], parts[found, 3] = x1 + b * ux - db * uy, y1 + b * uy + db * ux
                moments[found, 0] = w
                moments[found, 1] = x1 + s * ux - d * uy
                moments[found, 2] = y1 + s * uy + d * ux
                moments[found, 3] = ss * ux * ux - 2 * sd * ux * uy + dd * uy * uy
                moments[found, 4] = (ss - dd) * ux * uy + sd * (ux * ux - uy * uy)
                moments[found, 5] = ss * uy * uy + 2 * sd * ux * uy + dd * ux * ux
                labels[found, 0], labels[found, 1], labels[found, 2] = wall, met, passed
                found += 1
    return parts[:found], moments[:found], labels[:found]
