"""Beams that need no ray, since beams on both sides of them end on one wall, compiled.

Say two beams end on one wall, with no other wall near the part of it between them. Nothing can
cross the triangle that they form with it; so what stands before the wall there stands wholly
inside, together with all that hangs together with it. What hangs together is `width` wide at
least, and a triangle is no wider than its narrowest height. Where that is less, the triangle is
empty, and all beams between the two end on the same wall.

So every few beams one is cast, and between those that differ the one in the middle, and so on.
"""

from lrf3d.casting.kernels.compiling import inner
from lrf3d.casting.kernels.embree_proof import prove
from lrf3d.casting.kernels.packets import find
from lrf3d.casting.kernels.predicates import FILTER

OPEN = -3
"""What stands for the wall of a beam of which nothing is known yet."""

STRIDES = (8, 4)
"""Beams from one that is cast to the next, powers of two. With 2 more time is lost than won: side
by side, beams go through Embree's tree together."""

USUAL_PART = 0.5
"""The stride suits hits at this part of the range; farther ones may need their middle cast."""

SPARE = 1.0 + 1e-6
"""Room for rounding, in slopes."""

LEAST_STEP, WIDEST_GAP = 1e-9, 0.5
"""Angles [rad] from beam to beam that rounding cannot turn round, and of a gap that is flat."""


@inner
def stride_for(beams, half, range_max, width):
    """How many beams to go from one that is cast to the next: 1, where no beam can be spared."""
    step = 2.0 * half / (beams - 1) if beams > 1 else 0.0
    for stride in STRIDES:
        gap = stride * step
        if step > LEAST_STEP and gap < WIDEST_GAP and USUAL_PART * range_max * gap < width:
            return stride
    return 1


@inner
def find_sparing(
    intersect, scene, packet, walls, clear, owners, width, stride, x, y, scene_x, scene_y, reach,
    half, range_max, dx, dy, room, faces, picked, found, hit,
):  # fmt: skip
    """Find the rows of walls that beams hit, or −1; tell how many are UNSURE.

    There is room (2, beams and more) for the directions of the beams that are cast; picked and
    found (beams,) are room for which they are and what they hit.
    """
    beams = len(hit)
    near_dx, near_dy = room[0], room[1]
    hit[:] = OPEN
    count = 0
    for i in range(0, beams - 1, stride):
        picked[count] = i
        count += 1
    picked[count] = beams - 1
    count += 1
    unsure = 0
    gap = stride
    while True:
        if count > 0:
            for k in range(count):
                near_dx[k], near_dy[k] = dx[picked[k]], dy[picked[k]]
            find(intersect, scene, packet, scene_x, scene_y, near_dx, near_dy, reach, count, faces)
            unsure += prove(
                walls, clear, owners, faces, x, y, range_max, near_dx, near_dy, found[:count]
            )
            for k in range(count):
                hit[picked[k]] = found[k]
        if gap == 1:
            return unsure
        count = 0
        for start in range(0, beams - 1, gap):
            stop = min(start + gap, beams - 1)
            if hit[start + 1] != OPEN:
                continue
            if _nothing_between(walls, width, x, y, dx, dy, half, start, stop, hit):
                hit[start + 1 : stop] = hit[start]
            elif start + gap // 2 < stop:
                picked[count] = start + gap // 2
                count += 1
        gap //= 2


@inner
def _nothing_between(walls, width, x, y, dx, dy, half, start, stop, hit):
    """Whether two beams end on one wall, and nothing fits between them and it."""
    row = hit[start]
    if row < 0 or hit[stop] != row:
        return False
    ax, ay = walls[row, 0] - x, walls[row, 1] - y
    ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
    left, right = ax * ey, ay * ex
    area = abs(left - right) + FILTER * (abs(left) + abs(right))
    slope = max(abs(dx[start] * ey - dy[start] * ex), abs(dx[stop] * ey - dy[stop] * ex))
    # The triangle's height over the longer of the two beams, times slope.
    angle = 2.0 * half / (len(hit) - 1) * (stop - start)
    return area * angle * SPARE < width * slope
