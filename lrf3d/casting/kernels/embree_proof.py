"""The proof of what Embree found, compiled.

`embree_walls` says when a wall that Embree names is the right one. Beams for which that does not
hold are cast again among the float64 walls.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.buffer import ROOM, Fan, index_of, per_step_of
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.predicates import FILTER
from lrf3d.casting.kernels.scans import Laser, turn
from lrf3d.casting.kernels.tree import STACK, PlainTree, Tree
from lrf3d.compiling import borrower, inner
from lrf3d.geometry import Float, Int

LEAST_SINE = 0.03
"""Beams that meet a wall under a smaller angle [rad] are cast again."""

STEEP_SINE = 0.25
"""From this angle [rad] on Embree is so much surer of the place that more of a wall is clear."""

UNSURE = -2
"""Marks a beam that is to be cast again, in place of its wall."""


class Local(NamedTuple):
    """The frame in which Embree has the walls, and how far it can be trusted there.

    Attributes:
        x: Its middle [m].
        y: The same.
        unit: Its units a metre.
        radius: How far from the middle, along x and y, the laser may stand [m].
        margin: How near to a wall it may not [m].
        beyond: How much farther than the range Embree has to look [m].
        width: Width of the narrowest cluster of walls, or less [m].
    """

    x: float
    y: float
    unit: float
    radius: float
    margin: float
    beyond: float
    width: float


class ProvedWalls(NamedTuple):
    """What the proof takes of the walls.

    Attributes:
        tree: The walls.
        clear: (n, 4) their clear parts, for flat and for steep beams.
        owners: (m,) the wall of each of Embree's triangles, as a row of the tree.
        local: Embree's frame.
    """

    tree: Tree
    clear: Float
    owners: NDArray[np.int32]
    local: Local


PlainKnown = tuple[PlainTree, Float, NDArray[np.int32], tuple[float, ...]]
"""The same as Python passes it; see `lrf3d.casting.kernels.scans.PlainLaser`."""


@inner
def known_of(plain: PlainKnown) -> ProvedWalls:
    """What the proof takes, with the names of its parts."""
    tree, clear, owners, local = plain
    return ProvedWalls(Tree(*tree), clear, owners, Local(*local))


@borrower
def prove(
    known: ProvedWalls,
    faces: NDArray[np.int32],
    x: float,
    y: float,
    dx: Float,
    dy: Float,
    range_max: float,
    hit: Int,
) -> int:
    """From the faces that Embree found to the rows of walls that the beams hit, exactly.

    Each face is owned by a wall. Beams that are not proved are marked as UNSURE; their
    number is returned.
    """
    beams = len(hit)
    walls, clear, owners = known.tree.walls, known.clear, known.owners
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
def cast_again(tree: Tree, laser: Laser, fan: Fan, theta: float, hit: Int) -> None:
    """Cast the unsure beams of a fan among the float64 walls; those side by side together."""
    beams = len(hit)
    cos, sin = math.cos(theta), math.sin(theta)
    step = 2.0 * laser.half / (beams - 1) if beams > 1 else 0.0
    stop = 0
    while stop < beams:
        start = stop
        stop += 1
        if hit[start] != UNSURE:
            continue
        while stop < beams and hit[stop] == UNSURE:
            stop += 1
        ahead_x, ahead_y = fan.dx[start], fan.dy[start]
        if stop - start > 1:
            angle = laser.middle + 0.5 * step * (start + stop - beams)
            ahead_x, ahead_y = turn(math.cos(angle), math.sin(angle), cos, sin)
        half = 0.5 * step * (stop - start - 1)
        part = Fan(
            fan.x, fan.y, fan.dx[start:stop], fan.dy[start:stop], ahead_x, ahead_y, half,
            per_step_of(stop - start, half),
        )  # fmt: skip
        trace(tree, part, laser.range_max, hit[start:stop])


@inner
def near_a_wall(tree: Tree, local: Local, x: float, y: float) -> bool:
    """Whether Embree is not to be trusted here: by a wall, or too far out; never too rarely."""
    boxes, links, walls, _ = tree
    if len(walls) == 0:
        return True
    radius, margin = local.radius, local.margin
    if not (abs(x - local.x) <= radius and abs(y - local.y) <= radius):
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
