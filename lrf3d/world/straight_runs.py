"""The fewest straight runs of a chain of points.

A run is straight if all its points lie within a tolerance of one line, that is, if the narrowest
strip around its convex hull is narrow enough. Any part of a straight run is straight, so taking the
longest run each time gives the fewest. Points are integers, and all decisions are exact.
"""

import math

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Int


@compiled
def hull_of(points: Int) -> Int:
    """The corners (k, 2) of the convex hull of points (n, 2), counter-clockwise (Andrew 1979)."""
    order = np.argsort(points[:, 0] * np.int64(1 << 32) + points[:, 1])
    count = len(points)
    hull = np.empty((2 * count + 2, 2), np.int64)
    size = 0
    for turn in range(2):
        base = size
        for index in range(count):
            point = points[order[index if turn == 0 else count - 1 - index]]
            while size - base >= 2:
                ax = hull[size - 1, 0] - hull[size - 2, 0]
                ay = hull[size - 1, 1] - hull[size - 2, 1]
                bx, by = point[0] - hull[size - 2, 0], point[1] - hull[size - 2, 1]
                if ax * by - ay * bx > 0:
                    break
                size -= 1
            hull[size, 0], hull[size, 1] = point[0], point[1]
            size += 1
        # The last point of a half is the first of the other.
        size -= 1
    return hull[: max(size, 1)].copy()


@compiled
def narrowest(hull: Int) -> tuple[int, int]:
    """The narrowest strip around a hull: the first corner of an edge, and the corner across."""
    count = len(hull)
    best_edge, best_corner, best = 0, 0, np.inf
    for edge in range(count):
        after = (edge + 1) % count
        dx, dy = hull[after, 0] - hull[edge, 0], hull[after, 1] - hull[edge, 1]
        length = dx * dx + dy * dy
        if length == 0:
            continue
        far, corner = np.int64(-1), 0
        for other in range(count):
            cross = dx * (hull[other, 1] - hull[edge, 1]) - dy * (hull[other, 0] - hull[edge, 0])
            if abs(cross) > far:
                far, corner = abs(cross), other
        width = float(far) * float(far) / float(length)
        if width < best:
            best_edge, best_corner, best = edge, corner, width
    return best_edge, best_corner


@compiled
def is_straight(points: Int, width: int) -> bool:
    """Whether points (n, 2) lie in a strip of the given width, a whole number."""
    hull = hull_of(points)
    if len(hull) < 3:
        return True
    edge, corner = narrowest(hull)
    after = (edge + 1) % len(hull)
    dx, dy = hull[after, 0] - hull[edge, 0], hull[after, 1] - hull[edge, 1]
    cross = dx * (hull[corner, 1] - hull[edge, 1]) - dy * (hull[corner, 0] - hull[edge, 0])
    return bool(cross * cross <= width * width * (dx * dx + dy * dy))


@inner
def _end_of_run(points: Int, start: int, width: int) -> int:
    """The end, exclusive, of the longest straight run from a start on."""
    count = len(points)
    good, step = min(start + 2, count), 2
    while good < count:
        end = min(good + step, count)
        if not is_straight(points[start:end], width):
            bad = end
            while bad - good > 1:
                middle = (good + bad) // 2
                if is_straight(points[start:middle], width):
                    good = middle
                else:
                    bad = middle
            return good
        good, step = end, 2 * step
    return good


@inner
def _misfit(points: Int, start: int, end: int) -> float:
    """Sum of squared distances of a run of points to the line that fits it best."""
    count = end - start
    if count < 3:
        return 0.0
    x = y = xx = xy = yy = 0.0
    for row in range(start, end):
        dx, dy = float(points[row, 0] - points[start, 0]), float(points[row, 1] - points[start, 1])
        x, y, xx, xy, yy = x + dx, y + dy, xx + dx * dx, xy + dx * dy, yy + dy * dy
    xx, xy, yy = xx - x * x / count, xy - x * y / count, yy - y * y / count
    half = 0.5 * (xx - yy)
    return max(0.0, 0.5 * (xx + yy) - math.sqrt(half * half + xy * xy))


CUT_SHIFT = 6
"""Number of points by which a cut may be moved to either side to improve the fit of both runs."""


@compiled
def cut_into_runs(points: Int, width: int) -> Int:
    """The starts (k,) of the fewest straight runs of a chain of points (n, 2), the first at 0.

    Args:
        points: Points one after the other, whole numbers below 2³¹.
        width: Width of the strip that a run must fit into.
    """
    count = len(points)
    cuts = np.empty(count + 1, np.int64)
    cuts[0], runs = 0, 0
    while cuts[runs] < count:
        cuts[runs + 1] = _end_of_run(points, cuts[runs], width)
        runs += 1
    # A greedy run takes a few points beyond the corner; each cut is moved to the best fit.
    for _ in range(2):
        for cut in range(1, runs):
            before, here, after = cuts[cut - 1], cuts[cut], cuts[cut + 1]
            best, chosen = np.inf, here
            for place in range(max(before + 1, here - CUT_SHIFT), min(after, here + CUT_SHIFT + 1)):
                misfit = _misfit(points, before, place) + _misfit(points, place, after)
                if misfit < best - 1e-9 and (
                    place == here
                    or (
                        is_straight(points[before:place], width)
                        and is_straight(points[place:after], width)
                    )
                ):
                    best, chosen = misfit, place
            cuts[cut] = chosen
    return cuts[:runs].copy()
