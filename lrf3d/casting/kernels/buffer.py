"""Draw walls into a depth buffer over a fan of evenly spaced beams, compiled; exact.

A wall covers a run of neighbouring beams. Bearings are taken with a short polynomial that is off
by less than BEARING_SLACK: beams deeper inside the wall's bearings meet it for sure, beams that
lie outside by more miss it, and the few at the borders are decided by exact predicates.

The buffer holds 1 / t, which along a wall is linear in the beam's direction, as an interval from
`low` to `high` that holds the true value. A wall whose interval lies wholly above takes the beam,
one wholly below leaves it, and where intervals overlap the exact comparison decides. Of walls met
at equal t the one with the lowest index stays.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.predicates import (
    FILTER,
    Beam,
    area_sign,
    between,
    compare,
    length,
    meets_in_line,
    meets_seen,
    precise_area,
    wall_at,
)
from lrf3d.casting.kernels.tree import Tree
from lrf3d.compiling import inner
from lrf3d.geometry import Float, Int

BEARING_SLACK = 4e-6
"""Bound on the error of a bearing [rad]: 1.7e-6 of the polynomial, and ample room for rounding."""

DEPTH_SLACK = 16.0 * 2.0**-53
"""Bound on the rounding of 1 / t in parts of the sum of its terms: at most eight for each."""

CLEAR_AREA = 1e-7
"""Cancellation in a wall's area from which on plain float64 is too coarse for the depths."""

ROOM = 1.0 + 1e-9
"""Room for rounding and for directions that are not quite of unit length."""

TURN = 2.0 * np.pi

NARROW = 1e-9
"""Fans not wider than this [rad] are decided beam by beam."""

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


class Fan(NamedTuple):
    """Evenly spaced beams from one place [m], turned to the laser's heading."""

    x: float
    y: float
    dx: Float  # Directions, with room for as many numbers behind as kernels take at once.
    dy: Float
    ahead_x: float  # The direction in the middle of the fan.
    ahead_y: float
    half: float  # The angle from there to the last beam [rad].
    per_step: float  # One over the angle from beam to beam [1/rad], or 0 where all are but one.


class Buffer(NamedTuple):
    """The depth buffer over the beams (beams,) of a fan."""

    low: Float  # 1 / t is not below this [1/m],
    high: Float  # nor above this.
    hit: Int  # The row of the wall that each beam has met first so far, or −1.
    contested: Int  # Room for the beams that `draw` leaves to `settle`.


@inner
def per_step_of(beams: int, half: float) -> float:
    """What a fan has as `per_step`."""
    return 0.0 if half <= NARROW else 0.5 * (beams - 1) / half


@inner
def bearing(x: float, y: float) -> float:
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
def span(start: float, stop: float) -> float:
    """The angle from 0 to π from one bearing on to another, counter-clockwise.

    What comes out a hair below 0 is a point, or a whole half turn.
    """
    width = stop - start
    width = width + TURN if width < -0.5 * np.pi else width
    return width if width > 0.0 else 0.0


@inner
def turns_to_meet(start: float, width: float, half: float) -> tuple[int, int]:
    """By which whole turns bearings have to be shifted to meet the fan: the first and the last."""
    turns = 1 + int(half / TURN)
    before = -turns if start + width + BEARING_SLACK >= TURN - half else 0
    after = turns if start - BEARING_SLACK <= half - TURN else 0
    return before, after


@inner
def reached(place: float, beams: int) -> int:
    """How many of the beams 0, 1, 2 … lie at or before a place counted in beams."""
    return int(min(max(place + 1.0, 0.0), float(beams)))


@inner
def outline(walls: Float, first: int, count: int, fan: Fan, sketch: Float) -> None:
    """Bearings and depths of `count` walls from row `first` on, in one loop without branches.

    Where float64 cannot tell on which side a wall is seen, its slack is infinite.
    """
    ox, oy, ahead_x, ahead_y = fan.x, fan.y, fan.ahead_x, fan.ahead_y
    for k in range(index_of(count)):
        row = index_of(first) + k
        px, py, qx, qy = wall_at(walls, row)
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
def draw(row: int, k: int, sketch: Float, fan: Fan, buffer: Buffer) -> int:
    """Draw wall k of a sketch where that is sure, and leave the beams that are not in `contested`.

    Returns:
        How many beams are left to `settle`, those at the borders as −1 − beam; or UNCLEAR, where
        all of them are and none was drawn.
    """
    place = index_of(k)
    low, high, hit, contested = buffer
    dx, dy, half, per_step, beams = fan.dx, fan.dy, fan.half, fan.per_step, len(hit)
    start, width = sketch[START + place], sketch[WIDTH + place]
    u, v, slack = sketch[U + place], sketch[V + place], sketch[SLACK + place]
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
def depth_line(area: float, size: float, ex: float, ey: float) -> tuple[float, float, float]:
    """The u, v for which 1 / t = dx · u − dy · v along a wall, and a bound on its error.

    1 / t is d × e / area, where the area may be off by FILTER · size.
    """
    scale = 1.0 / area
    u, v = ey * scale, ex * scale
    slack = DEPTH_SLACK + (FILTER * ROOM) * size * abs(scale)
    return u, v, slack * (abs(u) + abs(v))


@inner
def settle(left_open: int, row: int, tree: Tree, fan: Fan, buffer: Buffer) -> None:
    """Decide the beams that `draw` left open, exactly."""
    low, high, hit, contested = buffer
    wall = wall_at(tree.walls, row)
    sense = area_sign(fan.x, fan.y, wall)
    if sense == 0:
        _settle_in_line(row, tree, fan, buffer)
        return
    area = precise_area(fan.x, fan.y, wall)
    u, v, slack = depth_line(area, abs(area), wall.qx - wall.px, wall.qy - wall.py)
    for k in range(len(hit) if left_open == UNCLEAR else left_open):
        beam = -1 - k if left_open == UNCLEAR else contested[k]
        i = beam if beam >= 0 else -1 - beam
        depth = fan.dx[i] * u - fan.dy[i] * v
        if depth + slack < low[i]:
            continue
        if beam < 0 and not meets_seen(sense, _beam_of(fan, i), wall):
            continue
        if depth - slack > high[i] or _nearer(row, i, tree, fan, hit):
            low[i], high[i], hit[i] = depth - slack, depth + slack, row


@inner
def _settle_in_line(row: int, tree: Tree, fan: Fan, buffer: Buffer) -> None:
    """Decide all beams for a wall whose line goes through the laser."""
    low, high, hit, _ = buffer
    wall = wall_at(tree.walls, row)
    inside = between(fan.x, fan.y, wall)
    for i in range(len(hit)):
        if not inside and not meets_in_line(_beam_of(fan, i), wall):
            continue
        if _nearer(row, i, tree, fan, hit):
            t = length(_beam_of(fan, i), wall)
            low[i], high[i], hit[i] = (1.0 / ROOM) / t, ROOM / t, row


@inner
def _nearer(row: int, i: int, tree: Tree, fan: Fan, hit: Int) -> bool:
    """Whether beam i meets the wall of this row before the one that it holds, exactly."""
    other = hit[i]
    if other < 0:
        return True
    order = compare(_beam_of(fan, i), wall_at(tree.walls, row), wall_at(tree.walls, other))
    return order < 0 or (order == 0 and tree.rows[row] < tree.rows[other])


@inner
def _beam_of(fan: Fan, i: int) -> Beam:
    """A beam of a fan."""
    return Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
