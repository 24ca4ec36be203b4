"""Neighbouring walls, compiled: clusters of connected walls, and parts without other walls near.

A cluster is a set of walls that are connected by shared ends; its width is that of the narrowest
strip between two parallel lines that contains all its ends. `lrf3d.casting.embree_walls` needs
both.
"""

import numpy as np

from lrf3d.casting.kernels.predicates import wall_at
from lrf3d.casting.kernels.tree import STACK, Tree
from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int

CORNERS = 256
"""Corners of a hull that are used; leaving out others makes the width smaller, never larger."""

WIDTH_ROUNDING = 1e-14
"""Bound on the error of a width, in parts of the points' extent."""

MOST_NEAR = 64
"""Largest number of walls near a wall that has a clear part: if a million walls pass through one
point, comparing all with all would take too long."""


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
    """The least point that point i is connected to; the path to it is compressed."""
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


@compiled
def clear_parts(tree: Tree, reach: float, parts: Float) -> Float:
    """The part (n, 2) of each wall, from 0 to 1, that has no other wall within reach [m].

    Where it is in pieces, the one is given that holds the part that was found for a larger reach,
    and if there was none about the longest. Where there is none, or more than MOST_NEAR walls are
    near, the first number is above. Within less reach no more of them are.
    """
    boxes, links, walls, _ = tree
    clear = np.empty((len(walls), 2))
    stack = np.empty(STACK, np.int64)
    for row in range(len(walls)):
        px, py, qx, qy = wall_at(walls, row)
        length = np.hypot(qx - px, qy - py)
        low, high = reach / length, 1.0 - reach / length
        held = parts[row, 0] <= parts[row, 1]
        middle = 0.5 * (parts[row, 0] + parts[row, 1])
        stack[0] = 0
        top = 1
        near = 0
        while top > 0 and low <= high:
            top -= 1
            node = stack[top]
            if (
                boxes[node, 0] - reach > max(px, qx) or boxes[node, 2] + reach < min(px, qx)
                or boxes[node, 1] - reach > max(py, qy) or boxes[node, 3] + reach < min(py, qy)
            ):  # fmt: skip
                continue
            first, count = links[node, 0], links[node, 1]
            if count < 0:
                for child in range(first, first - count):
                    stack[top] = child
                    top += 1
                continue
            for other in range(first, first + count):
                if other == row:
                    continue
                begin, end = _near_part(px, py, qx, qy, walls[other], reach)
                near += begin <= end
                if begin <= high and end >= low and begin <= end:
                    if begin > middle if held else begin - low > high - end:
                        high = begin
                    else:
                        low = end
            if near > MOST_NEAR:
                low, high = 1.0, 0.0
        clear[row, 0], clear[row, 1] = low, high
    return clear


@inner
def _near_part(
    px: float, py: float, qx: float, qy: float, wall: Float, reach: float
) -> tuple[float, float]:
    """Where on p…q, from 0 to 1, the rectangle begins and ends that is `reach` around a wall."""
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    length = np.hypot(ex, ey)
    ex, ey = ex / length, ey / length
    begin, end = 0.0, 1.0
    for axis in range(2):
        nx, ny = (ex, ey) if axis == 0 else (-ey, ex)
        low = -reach
        high = reach + (length if axis == 0 else 0.0)
        at_p = (px - wall[0]) * nx + (py - wall[1]) * ny - low
        change = (qx - px) * nx + (qy - py) * ny
        if abs(change) <= 1e-9 * reach:
            if at_p < -1e-6 * reach or at_p > (high - low) + 1e-6 * reach:
                return 1.0, 0.0
            continue
        one, two = -at_p / change, (high - low - at_p) / change
        begin = max(begin, min(one, two))
        end = min(end, max(one, two))
    return begin, end
