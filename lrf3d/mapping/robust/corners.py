"""Corners: the ends of two walls of one object are moved to where their lines cross.

The walls of a map and their objects enter; the walls with closed corners leave.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.walls import end_of, vector_of

CORNER_REACH = 0.3
"""[m] Largest distance from an end to the corner."""

CORNER_SINE = 0.25
"""[sine] Least angle of a corner: lines that are almost parallel cross at an arbitrary place."""


def close_corners(ends: Float, objects: Int) -> Float:
    """The walls (m, 4), each of an object (m,), with closed corners."""
    return _close(ends, objects, np.argsort(ends.reshape(-1, 2)[:, 0], kind="stable"))


@compiled
def _close(ends: Float, objects: Int, order: Int) -> Float:
    """Walls with closed corners; the order is that of their ends (2 m,) by rising x."""
    closed, places = ends.copy(), ends.copy().reshape(-1, 2)
    count, partners, corner = len(places), np.full(len(places), -1), np.empty(2)
    # Ends that are farther apart meet nowhere near to both.
    farthest = 2.01 * CORNER_REACH
    least = np.full(count, farthest * farthest)
    for k in range(count):
        end = order[k]
        after = k + 1
        # An end is named by twice its wall, and one more for the second one.
        while after < count and places[order[after], 0] - places[end, 0] <= farthest:
            other = order[after]
            after += 1
            dx, dy = places[other, 0] - places[end, 0], places[other, 1] - places[end, 1]
            away = dx * dx + dy * dy
            if away > max(least[end], least[other]) or objects[end >> 1] != objects[other >> 1]:
                continue
            if end >> 1 == other >> 1 or not _crossing(ends, end, other, corner):
                continue
            # Of equally near ones the order of the rows decides.
            for one, two in ((end, other), (other, end)):
                if away < least[one] or (away == least[one] and two < partners[one]):
                    partners[one], least[one] = two, away
    for end in range(count):
        other = partners[end]
        if other >= 0 and partners[other] == end and _crossing(ends, end, other, corner):
            closed[end >> 1, 2 * (end & 1)] = corner[0]
            closed[end >> 1, 2 * (end & 1) + 1] = corner[1]
    return closed


@borrower
def _crossing(ends: Float, end: int, other: int, corner: Float) -> bool:
    """Fill in the corner (2,) where the walls of two ends cross; whether both may end there."""
    one, side, two, turned = end >> 1, end & 1, other >> 1, other & 1
    (ux, uy), (vx, vy) = vector_of(ends[one]), vector_of(ends[two])
    own, across = np.hypot(ux, uy), np.hypot(vx, vy)
    turn = ux * vy - uy * vx
    if abs(turn) < CORNER_SINE * own * across:
        return False
    x, y = end_of(ends[one], side)
    its_x, its_y = end_of(ends[two], turned)
    dx, dy = its_x - x, its_y - y
    ahead, back = (dx * vy - dy * vx) / turn, (dx * uy - dy * ux) / turn
    if abs(ahead) * own > CORNER_REACH or abs(back) * across > CORNER_REACH:
        return False
    # Beams hit a wall beyond its corner: it is shortened by no more than a cell. The first end
    # (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(CELL, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(CELL, 0.5 * across):
        return False
    corner[0], corner[1] = x + ahead * ux, y + ahead * uy
    return True
