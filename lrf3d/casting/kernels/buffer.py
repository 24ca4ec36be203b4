"""Draw walls into a depth buffer over a fan of evenly spaced beams, compiled; exact.

A wall covers a run of neighbouring beams. Bearings are taken with a short polynomial that is off
by less than BEARING_SLACK: beams deeper inside the wall's bearings meet it for sure, beams that
lie outside by more miss it, and the few at the borders are decided by exact predicates.

The buffer holds 1 / t, which along a wall is linear in the beam's direction, as an interval from
`low` to `high` that holds the true value. A wall whose interval lies wholly above takes the beam,
one wholly below leaves it, and where intervals overlap the exact comparison decides. Of walls met
at equal t the one with the lowest index stays.
"""

import numpy as np

from lrf3d.casting.kernels.compiling import inner
from lrf3d.casting.kernels.predicates import (
    FILTER,
    area_sign,
    between,
    compare,
    length,
    meets_in_line,
    meets_seen,
    precise_area,
)  # fmt: skip

BEARING_SLACK = 4e-6
"""Bound on the error of a bearing [rad]: 1.7e-6 of the polynomial, and ample room for rounding."""

DEPTH_SLACK = 16.0 * 2.0**-53
"""Bound on the rounding of 1 / t in parts of the sum of its terms: at most eight for each."""

CLEAR_AREA = 1e-7
"""Cancellation in a wall's area from which on plain float64 is too coarse for the depths."""

ROOM = 1.0 + 1e-9
"""Room for rounding and for directions that are not quite of unit length."""

TURN = 2.0 * np.pi

UNCLEAR = -1

index_of = np.uint64
"""Indices of this type are never negative, which spares each access in a hot loop the question
whether it counts from the end."""

BATCH = 32
"""Walls or boxes whose bearings are taken together."""

AX, AY, BX, BY, U, V, SLACK, START, WIDTH = (index_of(k * BATCH) for k in range(9))
"""Where the columns of a sketch begin: offsets from a, b to the laser [m], the line of depths and
its slack [1/m], bearings [rad]. One array with fixed places shows the compiler that no two of
them overlap, and it takes four walls at a time."""

SKETCH = 9 * BATCH


@inner
def bearing(x, y):
    """The angle of (x, y) in [−π, π], at most 1.7e-6 rad off."""
    across, along = abs(x), abs(y)
    q = min(across, along) / max(across, along)
    s = q * q
    fourth = s * s
    angle = q * (
        (0.9999772193 - s * 0.3326228321)
        + fourth * ((0.1935404001 - s * 0.1164265408)
        + fourth * (0.05264741553 - s * 0.01171916117))
    )  # fmt: skip
    angle = 0.5 * np.pi - angle if along > across else angle
    angle = np.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@inner
def span(start, stop):
    """The angle from 0 to π from one bearing on to another, counter-clockwise.

    What comes out a hair below 0 is a point, or a whole half turn.
    """
    width = stop - start
    width = width + TURN if width < -0.5 * np.pi else width
    return width if width > 0.0 else 0.0


@inner
def turns_to_meet(start, width, half):
    """By which whole turns bearings have to be shifted to meet the fan: the first and the last."""
    turns = 1 + int(half / TURN)
    before = -turns if start + width + BEARING_SLACK >= TURN - half else 0
    after = turns if start - BEARING_SLACK <= half - TURN else 0
    return before, after


@inner
def reached(place, beams):
    """How many of the beams 0, 1, 2 … lie at or before a place counted in beams."""
    return int(min(max(place + 1.0, 0.0), float(beams)))


@inner
def outline(walls, first, count, ox, oy, ahead_x, ahead_y, sketch):
    """Bearings and depths of `count` walls from row `first` on, in one loop without branches.

    Where float64 cannot tell on which side a wall is seen, its slack is infinite.
    """
    for k in range(index_of(count)):
        row = index_of(first) + k
        px, py, qx, qy = walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3]
        sketch[AX + k], sketch[AY + k] = px - ox, py - oy
        sketch[BX + k], sketch[BY + k] = qx - ox, qy - oy
        sketch[U + k], sketch[V + k] = qy - py, qx - px
    for k in range(index_of(count)):
        ax, ay, bx, by = sketch[AX + k], sketch[AY + k], sketch[BX + k], sketch[BY + k]
        ey, ex = sketch[U + k], sketch[V + k]
        left, right = ax * ey, ay * ex
        area = left - right
        size = abs(left) + abs(right)
        u, v, slack = depth_line(area, size, ex, ey)
        sketch[U + k] = u
        sketch[V + k] = v
        sketch[SLACK + k] = slack if abs(area) > CLEAR_AREA * size else np.inf
        a = bearing(ax * ahead_x + ay * ahead_y, ay * ahead_x - ax * ahead_y)
        b = bearing(bx * ahead_x + by * ahead_y, by * ahead_x - bx * ahead_y)
        start = a if area > 0.0 else b
        stop = b if area > 0.0 else a
        sketch[START + k] = start
        sketch[WIDTH + k] = span(start, stop)


@inner
def draw(row, k, sketch, dx, dy, beams, half, per_step, low, high, hit, contested):
    """Draw wall k of a sketch where that is sure, and leave the beams that are not in `contested`.

    Returns:
        How many beams are left to `settle`, those at the borders as −1 − beam; or UNCLEAR, where
        all of them are and none was drawn.
    """
    k = index_of(k)
    start, width = sketch[START + k], sketch[WIDTH + k]
    u, v, slack = sketch[U + k], sketch[V + k], sketch[SLACK + k]
    if not slack < np.inf:
        return UNCLEAR
    before, after = turns_to_meet(start, width, half)
    left_open = 0
    for turn in range(before, after + 1):
        a = start + turn * TURN + half
        b = a + width
        if per_step == 0.0:
            if a - BEARING_SLACK <= 2.0 * half and b + BEARING_SLACK >= 0.0:
                return UNCLEAR
            continue
        first = reached((a - BEARING_SLACK) * per_step, beams)
        stop = reached((b + BEARING_SLACK) * per_step, beams)
        sure = reached((a + BEARING_SLACK) * per_step, beams)
        sure_stop = max(sure, reached((b - BEARING_SLACK) * per_step, beams))
        for i in range(first, min(sure, stop)):
            contested[left_open] = -1 - i
            left_open += 1
        for i in range(sure_stop, stop):
            contested[left_open] = -1 - i
            left_open += 1
        for i in range(index_of(sure), index_of(sure_stop)):
            depth = dx[i] * u - dy[i] * v
            if depth + slack < low[i]:
                continue
            if depth - slack > high[i]:
                low[i], high[i], hit[i] = depth - slack, depth + slack, row
            else:
                contested[left_open] = i
                left_open += 1
    return left_open


@inner
def depth_line(area, size, ex, ey):
    """The u, v for which 1 / t = dx · u − dy · v along a wall, and a bound on its error.

    1 / t is d × e / area, where the area may be off by FILTER · size.
    """
    scale = 1.0 / area
    u, v = ey * scale, ex * scale
    slack = DEPTH_SLACK + (FILTER * ROOM) * size * abs(scale)
    return u, v, slack * (abs(u) + abs(v))


@inner
def settle(left_open, row, walls, index, ox, oy, dx, dy, beams, low, high, hit, contested):
    """Decide the beams that `draw` left open, exactly."""
    px, py, qx, qy = walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3]
    sense = area_sign(ox, oy, px, py, qx, qy)
    if sense == 0:
        _settle_in_line(row, walls, index, ox, oy, dx, dy, beams, low, high, hit)
        return
    area = precise_area(ox, oy, px, py, qx, qy)
    u, v, slack = depth_line(area, abs(area), qx - px, qy - py)
    for k in range(beams if left_open == UNCLEAR else left_open):
        beam = -1 - k if left_open == UNCLEAR else contested[k]
        i = beam if beam >= 0 else -1 - beam
        depth = dx[i] * u - dy[i] * v
        if depth + slack < low[i]:
            continue
        if beam < 0 and not meets_seen(sense, ox, oy, dx[i], dy[i], px, py, qx, qy):
            continue
        if depth - slack > high[i] or _nearer(row, i, walls, index, ox, oy, dx, dy, hit):
            low[i], high[i], hit[i] = depth - slack, depth + slack, row


@inner
def _settle_in_line(row, walls, index, ox, oy, dx, dy, beams, low, high, hit):
    """Decide all beams for a wall whose line goes through the laser."""
    px, py, qx, qy = walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3]
    inside = between(ox, oy, px, py, qx, qy)
    for i in range(beams):
        if not inside and not meets_in_line(ox, oy, dx[i], dy[i], px, py):
            continue
        if _nearer(row, i, walls, index, ox, oy, dx, dy, hit):
            t = length(ox, oy, dx[i], dy[i], px, py, qx, qy)
            low[i], high[i], hit[i] = (1.0 / ROOM) / t, ROOM / t, row


@inner
def _nearer(row, i, walls, index, ox, oy, dx, dy, hit):
    """Whether beam i meets the wall of this row before the one that it holds, exactly."""
    other = hit[i]
    if other < 0:
        return True
    order = compare(
        ox, oy, dx[i], dy[i], walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3],
        walls[other, 0], walls[other, 1], walls[other, 2], walls[other, 3],
    )  # fmt: skip
    return order < 0 or (order == 0 and index[row] < index[other])
