"""Which part of each wall has no other wall near, compiled: see `lrf3d.casting.embree_walls`."""

import numpy as np

from lrf3d.casting.kernels.predicates import wall_at
from lrf3d.casting.kernels.tree import STACK, Tree
from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float

MOST_NEAR = 64
"""Walls that may stand near a wall until its clear part is given up: where a million go through
one point, to look at them all would take each of them a million steps."""


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
