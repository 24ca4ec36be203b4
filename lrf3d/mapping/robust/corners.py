"""Corners: ends of walls of one object that all but meet are moved to where their lines cross."""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.constants import CORNER_REACH, CORNER_SINE, CORNER_TRIM
from lrf3d.mapping.robust.grid import order_of, with_more_room


@compiled
def close_corners(ends: Float, objects: Int) -> None:  # pragma: no cover
    """Move the ends of walls (m, 4) of one object that meet to the crossing of their lines."""
    count = len(ends)
    # First the one end of all walls, then the other.
    xs, ys = np.empty(2 * count), np.empty(2 * count)
    for place in range(2 * count):
        wall, side = place % count, place // count
        xs[place], ys[place] = ends[wall, 2 * side], ends[wall, 2 * side + 1]
    order = order_of(xs)
    pairs = np.empty((64, 2), np.int64)
    found = 0
    for place in range(2 * count):
        one = order[place]
        after = place + 1
        while after < 2 * count:
            other = order[after]
            after += 1
            if xs[other] - xs[one] > 2.0 * CORNER_REACH:
                break
            if abs(ys[other] - ys[one]) > 2.0 * CORNER_REACH:
                continue
            if one % count == other % count or objects[one % count] != objects[other % count]:
                continue
            if found == len(pairs):
                pairs = with_more_room(pairs)
            pairs[found, 0], pairs[found, 1] = one, other
            found += 1
    steps = np.empty(found)
    for k in range(found):
        one, other = pairs[k, 0], pairs[k, 1]
        steps[k] = (xs[other] - xs[one]) ** 2 + (ys[other] - ys[one]) ** 2
    taken = np.zeros(2 * count, np.bool_)
    # The nearest ends go first, and each meets but one other.
    order = order_of(steps)
    for place in range(found):
        one, other = pairs[order[place], 0], pairs[order[place], 1]
        if not (taken[one] or taken[other]) and _close(
            ends, one % count, one // count, other % count, other // count
        ):
            taken[one] = taken[other] = True


@inner
def _close(ends: Float, one: int, side: int, other: int, turned: int) -> bool:  # pragma: no cover
    """Move an end of each of two walls to where their lines cross, if that is near to both."""
    ux, uy = ends[one, 2] - ends[one, 0], ends[one, 3] - ends[one, 1]
    vx, vy = ends[other, 2] - ends[other, 0], ends[other, 3] - ends[other, 1]
    own, across = np.hypot(ux, uy), np.hypot(vx, vy)
    turn = ux * vy - uy * vx
    if abs(turn) < CORNER_SINE * own * across:
        return False
    dx = ends[other, 2 * turned] - ends[one, 2 * side]
    dy = ends[other, 2 * turned + 1] - ends[one, 2 * side + 1]
    ahead, back = (dx * vy - dy * vx) / turn, (dx * uy - dy * ux) / turn
    if abs(ahead) * own > CORNER_REACH or abs(back) * across > CORNER_REACH:
        return False
    x, y = ends[one, 2 * side] + ahead * ux, ends[one, 2 * side + 1] + ahead * uy
    # The first end (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(CORNER_TRIM, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(CORNER_TRIM, 0.5 * across):
        return False
    ends[one, 2 * side], ends[one, 2 * side + 1] = x, y
    ends[other, 2 * turned], ends[other, 2 * turned + 1] = x, y
    return True
