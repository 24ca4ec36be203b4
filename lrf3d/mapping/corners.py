"""Corners: where two walls meet, both end at one point, compiled."""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int

MEET = 0.3
"""Two walls meet where their lines cross no farther than this [m] from an end of each."""

TRIMMED = 0.1
"""An end is taken back to a corner by no more than this [m]: beams were seen to end beyond it."""

STRAIGHT = 0.25
"""Sine of the turn below which two walls are no corner: their lines cross just anywhere."""


@njit(cache=True, nogil=True)
def close_corners(ends: Float, objects: Int) -> None:  # pragma: no cover
    """Move the ends of walls (m, 4) of one object that meet to the crossing of their lines."""
    count = len(ends)
    order = np.argsort(np.concatenate((ends[:, 0], ends[:, 2])), kind="mergesort")
    pairs = np.empty((64, 2), np.int64)
    steps = np.empty(64)
    found = 0
    for place in range(2 * count):
        one = order[place]
        x, y = ends[one % count, 2 * (one // count)], ends[one % count, 2 * (one // count) + 1]
        after = place + 1
        while after < 2 * count:
            other = order[after]
            after += 1
            u = ends[other % count, 2 * (other // count)]
            v = ends[other % count, 2 * (other // count) + 1]
            if u - x > 2.0 * MEET:
                break
            if objects[one % count] != objects[other % count]:
                continue
            if one % count == other % count or abs(v - y) > 2.0 * MEET:
                continue
            if found == len(pairs):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
                steps = np.concatenate((steps, np.empty_like(steps)))
            pairs[found, 0], pairs[found, 1] = one, other
            steps[found] = (u - x) ** 2 + (v - y) ** 2
            found += 1
    taken = np.zeros(2 * count, np.bool_)
    # The nearest ends go first, and each meets but one other.
    for place in np.argsort(steps[:found], kind="mergesort"):
        one, other = pairs[place]
        if not (taken[one] or taken[other]) and _close(
            ends, one % count, one // count, other % count, other // count
        ):
            taken[one] = taken[other] = True


@njit(cache=True, nogil=True)
def _close(ends: Float, one: int, side: int, other: int, turned: int) -> bool:  # pragma: no cover
    """Move an end of each of two walls to where their lines cross, if that is near to both."""
    ux, uy = ends[one, 2] - ends[one, 0], ends[one, 3] - ends[one, 1]
    vx, vy = ends[other, 2] - ends[other, 0], ends[other, 3] - ends[other, 1]
    own, across = np.hypot(ux, uy), np.hypot(vx, vy)
    turn = ux * vy - uy * vx
    if abs(turn) < STRAIGHT * own * across:
        return False
    dx = ends[other, 2 * turned] - ends[one, 2 * side]
    dy = ends[other, 2 * turned + 1] - ends[one, 2 * side + 1]
    ahead, back = (dx * vy - dy * vx) / turn, (dx * uy - dy * ux) / turn
    if abs(ahead) * own > MEET or abs(back) * across > MEET:
        return False
    x, y = ends[one, 2 * side] + ahead * ux, ends[one, 2 * side + 1] + ahead * uy
    # The first end (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(TRIMMED, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(TRIMMED, 0.5 * across):
        return False
    ends[one, 2 * side], ends[one, 2 * side + 1] = x, y
    ends[other, 2 * turned], ends[other, 2 * turned + 1] = x, y
    return True
