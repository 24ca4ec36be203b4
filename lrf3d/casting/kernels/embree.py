"""Scans with Embree, compiled: the rays for it, and what is known of what it found.

`wall_scene` has the argument.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.buffer import ROOM
from lrf3d.casting.kernels.predicates import FILTER
from lrf3d.casting.kernels.scans import (
    ALL_UNSURE,
    PADDING,
    UNSURE,
    Laser,
    PlainLaser,
    aim,
    turn,
)
from lrf3d.casting.kernels.tree import STACK, PlainTree, Tree
from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int, Single


class Frame(NamedTuple):
    """Where Embree has the walls, and how far it is trusted [m]."""

    x: float
    y: float
    radius: float  # The laser may stand so far from x and from y,
    margin: float  # but not so near to a wall.
    beyond: float  # What seems this much beyond the range is out of it.


PlainFrame = tuple[float, float, float, float, float]


@compiled
def rays_of(plain: PlainLaser, poses: Float, x: float, y: float) -> tuple[Single, Single]:
    """Origins and directions (k beams, 3) of the scans at poses (k, 3), seen from (x, y)."""
    fan = plain[0]
    beams = fan.shape[1]
    rays = np.zeros((2, len(poses) * beams, 3), np.float32)
    for k in range(len(poses)):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(beams):
            row = k * beams + i
            rays[0, row, 0], rays[0, row, 1] = poses[k, 0] - x, poses[k, 1] - y
            rays[1, row, 0], rays[1, row, 1] = turn(fan[0, i], fan[1, i], cos, sin)
    return rays[0], rays[1]


@compiled
def prove(
    plain_tree: PlainTree, clear: Float, plain_frame: PlainFrame, sines: tuple[float, float],
    found: NDArray[np.int32], plain_laser: PlainLaser, poses: Float, hits: Int,
) -> None:  # fmt: skip
    """From the faces (k beams,) that Embree found to the rows of the walls, −1, or doubt."""
    tree, frame, laser = Tree(*plain_tree), Frame(*plain_frame), Laser(*plain_laser)
    beams, walls, range_max = laser.fan.shape[1], tree.walls, laser.range_max
    dx, dy = np.zeros(beams + PADDING), np.zeros(beams + PADDING)
    for k in range(len(poses)):
        x, y, hit = poses[k, 0], poses[k, 1], hits[k]
        if near_a_wall(tree, frame, x, y):
            hit[0] = ALL_UNSURE
            continue
        aim(laser, x, y, poses[k, 2], dx, dy)
        stop = 0
        while stop < beams:
            # Neighbouring beams on one face share its numbers, and the loop over them is
            # vectorised.
            start, face = stop, found[k * beams + stop]
            while stop < beams and found[k * beams + stop] == face:
                stop += 1
            if face < 0 or face % 3 != 0:
                for i in range(start, stop):
                    hit[i] = -1 if face < 0 else UNSURE
                continue
            row = face // 3
            ax, ay = walls[row, 0] - x, walls[row, 1] - y
            ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
            left, right = ax * ey, ay * ex
            # Slopes are taken with the sign that the beam ahead of the wall gives them.
            sense, length = 1.0 if left > right else -1.0, math.sqrt(ex * ex + ey * ey)
            flat, steep = sines[0] * length, sines[1] * length
            begin, end, steep_begin, steep_end = clear[row]
            # How far away the beam meets the wall at least, times its slope.
            away = abs(left - right) - FILTER * (abs(left) + abs(right))
            for i in range(start, stop):
                slope = sense * (dx[i] * ey - dy[i] * ex)
                place = sense * (dy[i] * ax - dx[i] * ay)  # Where on the wall, times its slope.
                sure = (slope > flat) & (begin * slope < place) & (place < end * slope)
                sure |= (
                    (slope > steep) & (steep_begin * slope < place) & (place < steep_end * slope)
                )
                near, far = (
                    away <= range_max * ROOM * slope,
                    away > (range_max + frame.beyond) * slope,
                )
                hit[i] = (row if near else -1) if sure & (near | far) else UNSURE


@inner
def near_a_wall(tree: Tree, frame: Frame, x: float, y: float) -> bool:
    """Whether Embree is not to be trusted here: by a wall, or too far out; never too rarely."""
    boxes, links, walls, _ = tree
    stack, top = np.zeros(STACK, np.int64), 1
    while top > 0:
        top -= 1
        node = stack[top]
        side = max(boxes[node, 0] - x, x - boxes[node, 2])
        if max(side, boxes[node, 1] - y, y - boxes[node, 3]) > frame.margin:
            continue
        first, count = links[node, 0], links[node, 1]
        for child in range(first, first - count):
            stack[top] = child
            top += 1
        for row in range(first, first + count):
            ax, ay = x - walls[row, 0], y - walls[row, 1]
            ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
            square, along = ex * ex + ey * ey, ax * ex + ay * ey
            room = frame.margin * math.sqrt(square)
            if abs(ax * ey - ay * ex) <= room and -room <= along <= square + room:
                return True
    return max(abs(x - frame.x), abs(y - frame.y)) > frame.radius
