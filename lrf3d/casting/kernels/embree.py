"""What is known of the faces that Embree found, compiled; `wall_scene` has the argument."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.buffer import ROOM, Fan
from lrf3d.casting.kernels.predicates import FILTER, wall_at
from lrf3d.casting.kernels.tree import STACK, Tree
from lrf3d.compiling import inner, record
from lrf3d.geometry import Float, Int

UNSURE = -2
"""Marks a beam in doubt, in place of the row of its wall."""


NAMES = ("x", "y", "radius", "margin", "beyond", "level", "steep")
TRUST = record(**dict.fromkeys(NAMES, float))
"""How far Embree is trusted [m]: the middle of the walls; how far from x and from y the laser may
stand, but not so near to a wall; what seems this much beyond the range is out of it; and the least
sines of the angle between a beam and a wall whose first clear part counts, and its second one."""


@inner
def prove(
    tree: Tree, clear: Float, trust: Any, found: NDArray[np.int32], fan: Fan, range_max: float,
    hit: Int,
) -> None:  # fmt: skip
    """From the faces (beams,) that Embree found to the rows of the walls, −1, or doubt."""
    x, y, dx, dy, walls, beams = fan.x, fan.y, fan.dx, fan.dy, tree.walls, len(hit)
    stop = 0
    while stop < beams:
        # Neighbouring beams on one face share its numbers, and the loop over them is vectorised.
        start, face = stop, found[stop]
        while stop < beams and found[stop] == face:
            stop += 1
        if face < 0 or face % 3 != 0:
            for i in range(start, stop):
                hit[i] = -1 if face < 0 else UNSURE
            continue
        row = face // 3
        px, py, qx, qy = wall_at(walls, row)
        ax, ay, ex, ey = px - x, py - y, qx - px, qy - py
        left, right = ax * ey, ay * ex
        # Slopes are taken with the sign that the beam ahead of the wall gives them.
        sense, length = 1.0 if left > right else -1.0, math.sqrt(ex * ex + ey * ey)
        flat, steep = trust.level * length, trust.steep * length
        low, high, steep_low, steep_high = wall_at(clear, row)
        # How far away the beam meets the wall at least, times its slope.
        away = abs(left - right) - FILTER * (abs(left) + abs(right))
        for i in range(start, stop):
            slope = sense * (dx[i] * ey - dy[i] * ex)
            place = sense * (dy[i] * ax - dx[i] * ay)  # Where on the wall, times its slope.
            sure = (slope > flat) & (low * slope < place) & (place < high * slope)
            sure |= (slope > steep) & (steep_low * slope < place) & (place < steep_high * slope)
            near = away <= range_max * ROOM * slope
            far = away > (range_max + trust.beyond) * slope
            hit[i] = (row if near else -1) if sure & (near | far) else UNSURE


@inner
def near_a_wall(tree: Tree, trust: Any, x: float, y: float) -> bool:
    """Whether Embree is not to be trusted here: by a wall, or too far out; never too rarely."""
    boxes, links, walls, _ = tree
    stack, top = np.empty(STACK, np.int64), 1
    stack[0] = 0
    while top > 0:
        top -= 1
        node = stack[top]
        x0, y0, x1, y1 = wall_at(boxes, node)
        if max(x0 - x, x - x1, y0 - y, y - y1) > trust.margin:
            continue
        first, count = links[node, 0], links[node, 1]
        for child in range(first, first - count):
            stack[top] = child
            top += 1
        for row in range(first, first + count):
            px, py, qx, qy = wall_at(walls, row)
            ax, ay, ex, ey = x - px, y - py, qx - px, qy - py
            square, along = ex * ex + ey * ey, ax * ex + ay * ey
            room = trust.margin * math.sqrt(square)
            if abs(ax * ey - ay * ex) <= room and -room <= along <= square + room:
                return True
    return bool(max(abs(x - trust.x), abs(y - trust.y)) > trust.radius)
