"""The proof of what Embree found, compiled.

`embree_walls` says when a wall that Embree names is the right one. Beams for which that does not
hold are cast again among the float64 walls.
"""

import math

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM, index_of
from lrf3d.casting.kernels.compiling import inner
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.predicates import FILTER
from lrf3d.casting.kernels.tree import STACK

LEAST_SINE = 0.03
"""Beams that meet a wall under a smaller angle [rad] are cast again."""

STEEP_SINE = 0.25
"""From this angle [rad] on Embree is so much surer of the place that more of a wall is clear."""

UNSURE = -2
"""What stands for the wall of a beam that is to be cast again."""


@inner
def prove(walls, clear, owners, faces, x, y, range_max, dx, dy, hit):
    """From the faces that Embree found to the rows of walls that the beams hit, exactly.

    Each face is owned by a wall. Beams that are not proved are marked as UNSURE; tells how many.
    """
    beams = len(hit)
    for i in range(index_of(beams)):
        face = faces[i]
        hit[i] = owners[face] if face >= 0 else -1
    limit = range_max * ROOM
    unsure = 0
    stop = 0
    while stop < beams:
        # Neighbouring beams on one wall share its numbers.
        start, row = stop, hit[stop]
        while stop < beams and hit[stop] == row:
            stop += 1
        if row < 0:
            continue
        ax, ay = walls[row, 0] - x, walls[row, 1] - y
        ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
        low, high = clear[row, 0], clear[row, 1]
        steep_low, steep_high = clear[row, 2], clear[row, 3]
        length = math.sqrt(ex * ex + ey * ey)
        left, right = ax * ey, ay * ex
        # How far away the wall is at least, times slope.
        away = abs(left - right) - FILTER * (abs(left) + abs(right))
        # Slopes are taken with the sign that the beam ahead of the wall gives them.
        sense = 1.0 if left > right else -1.0
        for i in range(index_of(start), index_of(stop)):
            slope = sense * (dx[i] * ey - dy[i] * ex)
            # Where on the wall the beam meets it, times slope.
            place = sense * (dy[i] * ax - dx[i] * ay)
            flat = (low * slope < place) & (place < high * slope) & (slope > LEAST_SINE * length)
            steep = (
                (steep_low * slope < place) & (place < steep_high * slope)
                & (slope > STEEP_SINE * length)
            )  # fmt: skip
            if not (flat | steep):
                hit[i] = UNSURE
                unsure += 1
            elif away > limit * slope:
                # Embree looks beyond the range. To compare these exactly would cost much more.
                hit[i] = -1
    return unsure


@inner
def cast_again(boxes, links, walls, index, x, y, theta, middle, half, range_max, dx, dy, hit):
    """Cast the unsure beams among the float64 walls; those side by side together."""
    beams = len(hit)
    cos, sin = math.cos(theta), math.sin(theta)
    step = 2.0 * half / (beams - 1) if beams > 1 else 0.0
    stop = 0
    while stop < beams:
        start = stop
        stop += 1
        if hit[start] != UNSURE:
            continue
        while stop < beams and hit[stop] == UNSURE:
            stop += 1
        ahead_x, ahead_y = dx[start], dy[start]
        if stop - start > 1:
            turn = middle + 0.5 * step * (start + stop - beams)
            turn_x, turn_y = math.cos(turn), math.sin(turn)
            ahead_x, ahead_y = cos * turn_x - sin * turn_y, sin * turn_x + cos * turn_y
        trace(
            boxes, links, walls, index, x, y, dx[start:stop], dy[start:stop], ahead_x, ahead_y,
            0.5 * step * (stop - start - 1), range_max, hit[start:stop],
        )  # fmt: skip


@inner
def near_a_wall(boxes, links, walls, local, x, y):
    """Whether Embree is not to be trusted here: by a wall, or too far out; never too rarely."""
    if len(walls) == 0:
        return True
    radius, margin = local[3], local[4]
    if not (abs(x - local[0]) <= radius and abs(y - local[1]) <= radius):
        return True
    stack = np.empty(STACK, np.int64)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        if (
            x < boxes[node, 0] - margin or x > boxes[node, 2] + margin
            or y < boxes[node, 1] - margin or y > boxes[node, 3] + margin
        ):  # fmt: skip
            continue
        first, count = links[node, 0], links[node, 1]
        for k in range(first, first - count):
            stack[top] = k
            top += 1
        for row in range(first, first + count):
            ax, ay = x - walls[row, 0], y - walls[row, 1]
            ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
            square = ex * ex + ey * ey
            along, across = ax * ex + ay * ey, abs(ax * ey - ay * ex)
            room = margin * math.sqrt(square)
            if across <= room and -room <= along <= square + room:
                return True
    return False
