"""Walls that hang together by shared ends, and how wide such a cluster is, compiled.

The width is that of the narrowest strip between two parallel lines that holds all its ends.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int

CORNERS = 256
"""Corners of a hull that are looked at: fewer than there are give a width that is too small."""

WIDTH_ROUNDING = 1e-14
"""Bound on the error of a width, in parts of the points' extent."""


@compiled
def cluster_of(joined: Int, count: int) -> Int:
    """The cluster of each of count points, where walls (n, 2) join two of them each."""
    root = np.arange(count)
    for k in range(len(joined)):
        one, other = _root(root, joined[k, 0]), _root(root, joined[k, 1])
        root[max(one, other)] = min(one, other)
    for i in range(count):
        root[i] = root[root[i]]  # The root comes before, so its own is known.
    return root


@inner
def _root(root: Int, i: int) -> int:
    """The least point that point i hangs together with; the way there becomes shorter."""
    while root[i] != i:
        root[i] = root[root[i]]
        i = root[i]
    return i


@compiled
def least_width(points: Float, starts: Int) -> float:
    """The least width of groups of points (n, 2), or less; each begins at one of starts.

    In each group the points are in ascending order of x, and of y where x is equal.
    """
    least = np.inf
    for g in range(len(starts)):
        stop = starts[g + 1] if g + 1 < len(starts) else len(points)
        least = min(least, _width(points[starts[g] : stop]))
        if least <= 0.0:
            return 0.0
    return least


@inner
def _width(points: Float) -> float:
    """The width of points in ascending order."""
    hull = _hull(points)
    count = len(hull)
    if count < 3:
        return 0.0
    left, right, low, high = np.inf, -np.inf, np.inf, -np.inf
    for i in range(count):
        left, right = min(left, hull[i, 0]), max(right, hull[i, 0])
        low, high = min(low, hull[i, 1]), max(high, hull[i, 1])
    extent = np.hypot(right - left, high - low)
    least = np.inf
    for i in range(count):
        ex, ey = hull[i, 0] - hull[i - 1, 0], hull[i, 1] - hull[i - 1, 1]
        highest = 0.0
        for j in range(count):
            highest = max(highest, ex * (hull[j, 1] - hull[i, 1]) - ey * (hull[j, 0] - hull[i, 0]))
        least = min(least, highest / np.hypot(ex, ey))
    return float(least - WIDTH_ROUNDING * extent)


@inner
def _hull(points: Float) -> Float:
    """Corners of the hull, counter-clockwise; of many corners some (Andrew's monotone chain)."""
    count = len(points)
    chain = np.empty((2 * count + 1, 2))
    top = 0
    for way in range(2):
        bottom = top
        for k in range(count):
            place = k if way == 0 else count - 1 - k
            x, y = points[place, 0], points[place, 1]
            while top >= bottom + 2 and (
                (chain[top - 1, 0] - chain[top - 2, 0]) * (y - chain[top - 2, 1])
                <= (chain[top - 1, 1] - chain[top - 2, 1]) * (x - chain[top - 2, 0])
            ):
                top -= 1
            chain[top, 0], chain[top, 1] = x, y
            top += 1
        top -= 1  # The last point of one way is the first of the other.
    return chain[: top : 1 + (top - 1) // CORNERS]
