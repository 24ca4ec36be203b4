"""Cast a fan of evenly spaced beams into a tree of walls, compiled; every decision exact.

Walls are drawn into a depth buffer over the beams, near boxes first. A box is passed over when
no beam can meet it: it lies beyond the range or beside the fan, or each beam that could meet it
ends nearer than the box begins.
"""

import math

import numpy as np

from lrf3d.casting.kernels.buffer import (
    AX,
    AY,
    BATCH,
    BEARING_SLACK,
    BX,
    BY,
    ROOM,
    SKETCH,
    SLACK,
    START,
    TURN,
    WIDTH,
    Buffer,
    Fan,
    bearing,
    draw,
    index_of,
    outline,
    reached,
    settle,
    span,
    turns_to_meet,
)
from lrf3d.casting.kernels.predicates import wall_at
from lrf3d.casting.kernels.tree import STACK, Tree
from lrf3d.compiling import inner, record
from lrf3d.geometry import Float, Int, Records

WAITING = record(node=int, first=int, stop=int, near=float)
"""A box that waits on the path through the tree: its node, the first and the end of the beams that
may meet it, and a bound on 1 / distance [1/m]. The nearest is on top."""


@inner
def trace(tree: Tree, fan: Fan, range_max: float, hit: Int) -> None:
    """Find for each beam the row of the wall that it meets first, or −1.

    Walls a little beyond range_max may be found.
    """
    beams = len(hit)
    edge = 1.0 / (range_max * ROOM)
    low, high = np.empty(beams), np.empty(beams)
    for i in range(beams):
        low[i], high[i], hit[i] = edge, edge, -1
    buffer = Buffer(low, high, hit, np.empty(beams, np.int64))
    sketch = np.empty(SKETCH)
    waiting = np.empty(STACK, WAITING)
    root, top = waiting[0], 1 if len(tree.walls) > 0 else 0
    root.node, root.first, root.stop, root.near = 0, 0, beams, np.inf
    while top > 0:
        top -= 1
        box = waiting[top]
        if _hidden(low, box.first, box.stop, box.near):
            continue
        node = box.node
        first, count = tree.links[node, 0], tree.links[node, 1]
        if count < 0:
            _view(tree.boxes, first, -count, fan, sketch)
            top = _enter(first, -count, fan, edge, low, sketch, waiting, top)
            continue
        for base in range(first, first + count, BATCH):
            batch = min(BATCH, first + count - base)
            outline(tree.walls, base, batch, fan, sketch)
            for k in range(batch):
                left_open = draw(base + k, k, sketch, fan, buffer)
                if left_open != 0:
                    settle(left_open, base + k, tree, fan, buffer)


@inner
def _hidden(low: Float, first: int, stop: int, near: float) -> bool:
    """Whether all beams from first to before stop end nearer than 1 / near."""
    for i in range(index_of(first), index_of(stop)):
        if not low[i] > near:
            return False
    return True


@inner
def _enter(
    first: int, count: int, fan: Fan, edge: float, low: Float, sketch: Float, waiting: Records,
    top: int,
) -> int:  # fmt: skip
    """Let those of the boxes in a sketch wait that a beam may meet; the new height."""
    beams, bottom = len(low), top
    for k in range(index_of(count)):
        near = sketch[SLACK + k]
        if near < edge:
            continue
        start, stop = 0, beams
        if near < np.inf:
            start, stop = beams_between(sketch[START + k], sketch[WIDTH + k], fan, beams)
        if start >= stop or _hidden(low, start, stop, near):
            continue
        place = top
        while place > bottom and waiting[place - 1].near > near:
            waiting[place] = waiting[place - 1]
            place -= 1
        box = waiting[place]
        box.node, box.first, box.stop, box.near = first + int(k), start, stop, near
        top += 1
    return top


@inner
def _view(boxes: Float, first: int, count: int, fan: Fan, sketch: Float) -> None:
    """Bearings of boxes; as SLACK a bound on 1 / distance, infinite for one around the laser."""
    ox, oy, ahead_x, ahead_y = fan.x, fan.y, fan.ahead_x, fan.ahead_y
    for k in range(index_of(count)):
        node = index_of(first) + k
        x0, y0, x1, y1 = wall_at(boxes, node)
        sketch[AX + k], sketch[AY + k] = x0 - ox, y0 - oy
        sketch[BX + k], sketch[BY + k] = x1 - ox, y1 - oy
    for k in range(index_of(count)):
        x0, y0, x1, y1 = sketch[AX + k], sketch[AY + k], sketch[BX + k], sketch[BY + k]
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


@inner
def beams_between(start: float, width: float, fan: Fan, beams: int) -> tuple[int, int]:
    """The beams from the first to before the second that may lie within bearings."""
    half, per_step = fan.half, fan.per_step
    first, stop = beams, 0
    before, after = turns_to_meet(start, width, half)
    for turn in range(before, after + 1):
        a = start + turn * TURN + half - BEARING_SLACK
        b = a + width + 2.0 * BEARING_SLACK
        if per_step == 0.0 and a <= 2.0 * half and b >= 0.0:
            return 0, beams
        first = min(first, reached(a * per_step, beams))
        stop = max(stop, reached(b * per_step, beams))
    return (first, stop) if per_step > 0.0 else (0, 0)
