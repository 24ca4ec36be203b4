"""Beams that need no ray, since beams on both sides of them end on one wall, compiled.

Say two beams end on one wall, with no other wall near the part of it between them. Nothing can
cross the triangle that they form with it; so what stands before the wall there stands wholly
inside, together with all that hangs together with it. What hangs together is `width` wide at
least, and a triangle is no wider than its narrowest height. Where that is less, the triangle is
empty, and all beams between the two end on the same wall.

So every few beams one is cast, and between those that differ the one in the middle, and so on.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.buffer import Fan
from lrf3d.casting.kernels.embree_proof import ProvedWalls, prove
from lrf3d.casting.kernels.packets import WIDTH, Packets, find
from lrf3d.casting.kernels.predicates import FILTER, Beam, Wall, wall_at
from lrf3d.casting.kernels.scans import PADDING
from lrf3d.compiling import borrower, inner
from lrf3d.geometry import Float, Int

OPEN = -3
"""Marks a beam that is not cast yet, in place of its wall."""

STRIDES = (8, 4)
"""Beams from one that is cast to the next, powers of two. With 2 more time is lost than won: side
by side, beams go through Embree's tree together."""

USUAL_PART = 0.5
"""The stride suits hits at this part of the range; farther ones may need their middle cast."""

SPARE = 1.0 + 1e-6
"""Room for rounding, in slopes."""

LEAST_STEP, WIDEST_GAP = 1e-9, 0.5
"""Angles [rad] from beam to beam that rounding cannot turn round, and of a gap that is flat."""


BEHIND = max(PADDING, WIDTH - 1)
"""How many numbers beyond the last beam those may touch that work on several at once."""


class Room(NamedTuple):
    """Work space for a scan: its beams, and BEHIND more where whole packets are taken.

    Attributes:
        dx: Directions of all beams.
        dy: The same.
        cast_dx: Directions of those that are cast.
        cast_dy: The same.
        faces: Triangles that these meet.
        picked: (beams,) which beams they are.
        found: (beams,) the rows of walls that they hit.
    """

    dx: Float
    dy: Float
    cast_dx: Float
    cast_dy: Float
    faces: NDArray[np.int32]
    picked: Int
    found: Int


@inner
def room_for(beams: int) -> Room:
    """Work space for a scan of a number of beams."""
    wide = beams + BEHIND
    # Few arrays: making one takes as long as some beams.
    directions, rows = np.zeros((4, wide)), np.empty((2, beams), np.int64)
    return Room(
        directions[0],
        directions[1],
        directions[2],
        directions[3],
        np.empty(wide, np.int32),
        rows[0],
        rows[1],
    )


@inner
def stride_for(beams: int, half: float, range_max: float, width: float) -> int:
    """How many beams to go from one that is cast to the next: 1, where no beam can be spared."""
    step = 2.0 * half / (beams - 1) if beams > 1 else 0.0
    for stride in STRIDES:
        gap = stride * step
        if step > LEAST_STEP and gap < WIDEST_GAP and USUAL_PART * range_max * gap < width:
            return stride
    return 1


@borrower
def find_all(
    packets: Packets,
    known: ProvedWalls,
    fan: Fan,
    range_max: float,
    stride: int,
    room: Room,
    hit: Int,
) -> int:
    """Find the rows of walls that beams hit, or −1; how many are UNSURE.

    Where the stride is 1 all beams are cast.
    """
    local = known.local
    # Taken out of their tuples once: each time costs as much as some beams.
    x, y, dx, dy, walls = fan.x, fan.y, fan.dx, fan.dy, known.tree.walls
    scene_x, scene_y = (x - local.x) * local.unit, (y - local.y) * local.unit
    reach = (range_max + local.beyond) * local.unit
    beams = len(hit)
    faces, picked, found = room.faces, room.picked, room.found
    if stride == 1:
        find(packets, scene_x, scene_y, dx, dy, reach, beams, faces)
        return prove(known, faces, x, y, dx, dy, range_max, hit)
    cast_dx, cast_dy = room.cast_dx, room.cast_dy
    for i in range(beams):
        hit[i] = OPEN
    count = 0
    for i in range(0, beams - 1, stride):
        picked[count] = i
        count += 1
    picked[count] = beams - 1
    count += 1
    step = 2.0 * fan.half / (beams - 1)
    unsure = 0
    gap = stride
    while True:
        if count > 0:
            for k in range(count):
                cast_dx[k], cast_dy[k] = dx[picked[k]], dy[picked[k]]
            find(packets, scene_x, scene_y, cast_dx, cast_dy, reach, count, faces)
            unsure += prove(known, faces, x, y, cast_dx, cast_dy, range_max, found[:count])
            for k in range(count):
                hit[picked[k]] = found[k]
        if gap == 1:
            return unsure
        count = 0
        for start in range(0, beams - 1, gap):
            stop = min(start + gap, beams - 1)
            if hit[start + 1] != OPEN:
                continue
            row = hit[start]
            one, other = Beam(x, y, dx[start], dy[start]), Beam(x, y, dx[stop], dy[stop])
            if (
                row >= 0
                and hit[stop] == row
                and _nothing_between(
                    wall_at(walls, row), one, other, step * (stop - start), local.width
                )
            ):
                for i in range(start + 1, stop):
                    hit[i] = row
            elif start + gap // 2 < stop:
                picked[count] = start + gap // 2
                count += 1
        gap //= 2


@borrower
def _nothing_between(wall: Wall, one: Beam, other: Beam, angle: float, width: float) -> bool:
    """Whether nothing of a width fits between two beams, with an angle between, and their wall."""
    ax, ay = wall.px - one.ox, wall.py - one.oy
    ex, ey = wall.qx - wall.px, wall.qy - wall.py
    left, right = ax * ey, ay * ex
    area = abs(left - right) + FILTER * (abs(left) + abs(right))
    slope = max(abs(one.dx * ey - one.dy * ex), abs(other.dx * ey - other.dy * ex))
    # The triangle's height over the longer of the two beams, times slope.
    return area * angle * SPARE < width * slope
