"""Cast a fan of evenly spaced beams into a tree of walls, compiled; every decision exact.

Walls are drawn into a depth buffer over the beams, near boxes first. A box is passed over when
no beam can meet it: it lies beyond the range or beside the fan, or each beam that could meet it
ends nearer than the box begins.

A wall covers a run of neighbouring beams. Bearings are taken with a short polynomial that is off
by less than BEARING_SLACK: beams deeper inside the wall's bearings meet it for sure, beams that
lie outside by more miss it, and the few at the borders are decided by exact predicates.

The buffer holds 1 / t, which along a wall is linear in the beam's direction, as an interval from
`low` to `high` that holds the true value. A wall whose interval lies wholly above takes the beam,
one wholly below leaves it, and where intervals overlap the exact comparison decides. Of walls met
at equal t the one with the lowest index stays.
"""

import math
from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.predicates import (
    FILTER,
    Beam,
    area_sign,
    between,
    compare,
    index_of,
    length,
    meets_in_line,
    meets_seen,
    precise_area,
    wall_at,
)
from lrf3d.casting.kernels.tree import ROOM, STACK, Tree, column_at, whole
from lrf3d.compiling import borrower, inner, record
from lrf3d.geometry.lines import Float, Int, Records

# Bound on the error of a bearing [rad]: 1.7e-6 of the polynomial, and ample room for rounding.
BEARING_SLACK = 4e-6

# Bound on the rounding of 1 / t in parts of the sum of its terms: at most eight for each.
DEPTH_SLACK = 16.0 * 2.0**-53

# Cancellation in a wall's area from which on plain float64 is too coarse for the depths.
CLEAR_AREA = 1e-7

TURN = 2.0 * np.pi

# Fans not wider than this [rad] are decided beam by beam.
NARROW = 1e-9

UNCLEAR = -1

# Walls or boxes whose bearings are taken together.
BATCH = 32

# Where the columns of a sketch begin: offsets from a, b to the laser [m], the line of depths and
# its slack [1/m], bearings [rad]. One array with fixed places shows the compiler that no two of
# them overlap, and it takes four walls at a time.
AX, AY, BX, BY, U, V, SLACK, START, WIDTH = (index_of(k * BATCH) for k in range(9))

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


class DepthBuffer(NamedTuple):
    """The depth buffer over the beams (beams,) of a fan."""

    low: Float  # 1 / t is not below this [1/m],
    high: Float  # nor above this.
    hit: Int  # The row of the wall that each beam has met first so far, or −1.
    contested: Int  # Room for the beams that `draw` leaves to `settle`.


# A box that waits on the path through the tree: its node, the first and the end of the beams that
# may meet it, and a bound on 1 / distance [1/m]. The nearest is on top.
WAITING = record(node=int, first=int, stop=int, near=float)


@inner
def trace(tree: Tree, fan: Fan, range_max: float, hit: Int) -> None:
    """Find for each beam the row of the wall that it meets first, or −1.

    Walls a little beyond range_max may be found.
    """
    beams = len(hit)
    edge = 1.0 / (range_max * ROOM)
    low = np.empty(beams)
    high = np.empty(beams)
    for i in range(beams):
        low[i] = high[i] = edge
        hit[i] = -1
    buffer = DepthBuffer(low, high, hit, np.empty(beams, np.int64))
    sketch = np.empty(SKETCH)
    waiting = root_waiting(beams)
    seen = tree, fan, 0.0
    top = min(len(tree.walls), 1)
    first, stop, top = leaf_in_view(seen, edge, low, sketch, waiting, top)
    while stop > 0:
        for base in range(first, stop, BATCH):
            batch = min(BATCH, stop - base)
            outline(tree.columns, base, batch, fan, sketch)
            for k in range(batch):
                left_open = draw(base + k, k, sketch, fan, buffer)
                if left_open != 0:
                    settle(left_open, base + k, tree, fan, buffer)
        first, stop, top = leaf_in_view(seen, edge, low, sketch, waiting, top)


@borrower
def leaf_in_view(
    seen: tuple[Tree, Fan, float], edge: float, low: Float, sketch: Float, waiting: Records,
    top: int,
) -> tuple[int, int, int]:  # fmt: skip
    """The next leaf that beams may meet: its first row and its end, which are 0 after all.

    The last number is that of the boxes that still wait; the record behind them is the leaf's.
    What is seen are a tree, a fan, and an angle [rad] by which boxes are widened on both sides; the
    edge is the least 1 / t that counts.
    """
    tree, fan, aside = seen
    while top > 0:
        top -= 1
        box = waiting[top]
        if hidden(low, box.first, box.stop, box.near):
            continue
        first = tree.links[box.node, 0]
        count = tree.links[box.node, 1]
        if count >= 0:
            return first, first + count, top
        view_boxes(tree.boxes, first, -count, fan, sketch)
        for k in range(index_of(-count)):
            sketch[START + k] -= aside
            sketch[WIDTH + k] += 2.0 * aside
        top = enter_boxes((first, -count), fan, edge, low, sketch, waiting, top)
    return 0, 0, top


@inner
def root_waiting(beams: int) -> Records:
    """Room for boxes that wait, and the root of a tree, which all beams may meet."""
    waiting = np.empty(STACK, WAITING)
    root = waiting[0]
    root.node = root.first = 0
    root.stop = beams
    root.near = np.inf
    return waiting


@borrower
def hidden(low: Float, first: int, stop: int, near: float) -> bool:
    """Whether all beams from first to before stop end nearer than 1 / near."""
    for i in range(index_of(first), index_of(stop)):
        if not low[i] > near:
            return False
    return True


@borrower
def enter_boxes(
    boxes: tuple[int, int], fan: Fan, edge: float, low: Float, sketch: Float, waiting: Records,
    top: int,
) -> int:  # fmt: skip
    """Let those wait that a beam may meet of boxes, the first and how many; the new height."""
    first, count = boxes
    beams = len(low)
    bottom = top
    for k in range(index_of(count)):
        near = sketch[SLACK + k]
        if near < edge:
            continue
        start = 0
        stop = beams
        if near < np.inf:
            start, stop = beams_between(sketch[START + k], sketch[WIDTH + k], fan, beams)
        if start >= stop or hidden(low, start, stop, near):
            continue
        place = top
        while place > bottom and waiting[place - 1].near > near:
            waiting[place] = waiting[place - 1]
            place -= 1
        box = waiting[place]
        box.node = first + int(k)
        box.first = start
        box.stop = stop
        box.near = near
        top += 1
    return top


@borrower
def view_boxes(boxes: Float, first: int, count: int, fan: Fan, sketch: Float) -> None:
    """Bearings of boxes; as SLACK a bound on 1 / distance, infinite for one around the laser."""
    ahead_x = fan.ahead_x
    ahead_y = fan.ahead_y
    _shift(boxes, first, count, fan, sketch)
    for k in range(whole(count)):
        x0 = sketch[AX + k]
        y0 = sketch[AY + k]
        x1 = sketch[BX + k]
        y1 = sketch[BY + k]
        gap_x = x0 if x0 > 0.0 else (-x1 if x1 < 0.0 else 0.0)
        gap_y = y0 if y0 > 0.0 else (-y1 if y1 < 0.0 else 0.0)
        sketch[SLACK + k] = ROOM / math.sqrt(gap_x * gap_x + gap_y * gap_y)
        # The corners that bound the box on the right and on the left, as seen from the laser.
        side_x = x0 if x0 > 0.0 else x1
        side_y = y0 if y0 > 0.0 else y1
        right_x = x1 if y0 > 0.0 else (x0 if y1 < 0.0 else side_x)
        left_x = x0 if y0 > 0.0 else (x1 if y1 < 0.0 else side_x)
        right_y = y0 if x0 > 0.0 else (y1 if x1 < 0.0 else side_y)
        left_y = y1 if x0 > 0.0 else (y0 if x1 < 0.0 else side_y)
        right = bearing(
            right_x * ahead_x + right_y * ahead_y, right_y * ahead_x - right_x * ahead_y
        )
        left = bearing(left_x * ahead_x + left_y * ahead_y, left_y * ahead_x - left_x * ahead_y)
        sketch[START + k] = right
        sketch[WIDTH + k] = span(right, left)


@borrower
def _shift(columns: Float, first: int, count: int, fan: Fan, sketch: Float) -> None:
    """Offsets to boxes or walls from the laser, and in U, V what they span."""
    for k in range(whole(count)):
        px, py, qx, qy = column_at(columns, index_of(first) + k)
        sketch[AX + k] = px - fan.x
        sketch[AY + k] = py - fan.y
        sketch[BX + k] = qx - fan.x
        sketch[BY + k] = qy - fan.y
        sketch[U + k] = qy - py
        sketch[V + k] = qx - px


@borrower
def beams_between(start: float, width: float, fan: Fan, beams: int) -> tuple[int, int]:
    """The beams from the first to before the second that may lie within bearings."""
    half = fan.half
    per_step = fan.per_step
    first = beams
    stop = 0
    before, after = turns_to_meet(start, width, half)
    for turn in range(before, after + 1):
        a = start + turn * TURN + half - BEARING_SLACK
        b = a + width + 2.0 * BEARING_SLACK
        if per_step == 0.0 and a <= 2.0 * half and b >= 0.0:
            return 0, beams
        first = min(first, reached(a * per_step, beams))
        stop = max(stop, reached(b * per_step, beams))
    return (first, stop) if per_step > 0.0 else (0, 0)


@inner
def bearing(x: float, y: float) -> float:
    """The angle of (x, y) in [−π, π], at most 1.7e-6 rad off."""
    across = abs(x)
    along = abs(y)
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


@borrower
def outline(walls: Float, first: int, count: int, fan: Fan, sketch: Float) -> None:
    """Bearings and depths of `count` walls from row `first` on, in one loop without branches.

    Where float64 cannot tell on which side a wall is seen, its slack is infinite.
    """
    ahead_x = fan.ahead_x
    ahead_y = fan.ahead_y
    _shift(walls, first, count, fan, sketch)
    for k in range(whole(count)):
        ax = sketch[AX + k]
        ay = sketch[AY + k]
        bx = sketch[BX + k]
        by = sketch[BY + k]
        ey = sketch[U + k]
        ex = sketch[V + k]
        left = ax * ey
        right = ay * ex
        area = left - right
        size = abs(left) + abs(right)
        sketch[U + k], sketch[V + k], slack = depth_line(area, size, ex, ey)
        sketch[SLACK + k] = slack if abs(area) > CLEAR_AREA * size else np.inf
        a = bearing(ax * ahead_x + ay * ahead_y, ay * ahead_x - ax * ahead_y)
        b = bearing(bx * ahead_x + by * ahead_y, by * ahead_x - bx * ahead_y)
        start, stop = (a, b) if area > 0.0 else (b, a)
        sketch[START + k] = start
        sketch[WIDTH + k] = span(start, stop)


@borrower
def draw(row: int, k: int, sketch: Float, fan: Fan, buffer: DepthBuffer) -> int:
    """Draw wall k of a sketch where that is sure, and leave the beams that are not in `contested`.

    Returns:
        How many beams are left to `settle`, those at the borders as −1 − beam; or UNCLEAR, where
        all of them are and none was drawn.
    """
    place = index_of(k)
    low, high, hit, contested = buffer
    dx = fan.dx
    dy = fan.dy
    half = fan.half
    per_step = fan.per_step
    beams = len(hit)
    start = sketch[START + place]
    width = sketch[WIDTH + place]
    u = sketch[U + place]
    v = sketch[V + place]
    slack = sketch[SLACK + place]
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
                low[i] = depth - slack
                high[i] = depth + slack
                hit[i] = row
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
    u = ey * scale
    v = ex * scale
    slack = DEPTH_SLACK + (FILTER * ROOM) * size * abs(scale)
    return u, v, slack * (abs(u) + abs(v))


@inner
def settle(left_open: int, row: int, tree: Tree, fan: Fan, buffer: DepthBuffer) -> None:
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
            low[i] = depth - slack
            high[i] = depth + slack
            hit[i] = row


@inner
def _settle_in_line(row: int, tree: Tree, fan: Fan, buffer: DepthBuffer) -> None:
    """Decide all beams for a wall whose line goes through the laser."""
    low, high, hit, _ = buffer
    wall = wall_at(tree.walls, row)
    inside = between(fan.x, fan.y, wall)
    for i in range(len(hit)):
        if not inside and not meets_in_line(_beam_of(fan, i), wall):
            continue
        if _nearer(row, i, tree, fan, hit):
            t = length(_beam_of(fan, i), wall)
            low[i] = (1.0 / ROOM) / t
            high[i] = ROOM / t
            hit[i] = row


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
