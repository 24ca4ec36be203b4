"""Corners: ends of walls of one object that all but meet are moved to where their lines cross.

Two ends meet where each is the nearest to the other of all that it could meet, so that a corner
depends on nothing but the ends around it, and an update closes just those that it changes.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.grid import Grid, Search, near
from lrf3d.mapping.robust.constants import CORNER_REACH, CORNER_SINE, CORNER_TRIM, MERGE_CELL
from lrf3d.mapping.robust.walls import Walls


@compiled
def close_corners(
    rows: Int,
    walls: Walls,
    objects: Int,
    grid: Grid,
    search: Search,
    closed: Float,
    marks: Bool,
) -> Int:
    """Close the corners of some walls anew, and of those that they meet or have met.

    Args:
        rows: (n,) the walls that changed, those that are gone among them.
        walls: All walls.
        objects: (rows,) the object of each.
        grid: Where the walls are, in cells of MERGE_CELL.
        search: Is written by searches of the grid.
        closed: (rows, 4) the walls with closed corners [m]; is written.
        marks: (rows,) False; is written, and restored.

    Returns:
        (m,) the walls whose corners were closed.
    """
    ends, points = walls.ends, walls.points
    around, place = np.empty(len(points), np.int64), np.empty(4)
    count = 0
    for k in range(len(rows)):
        row = rows[k]
        for side in range(4):
            # Where the wall ended before, and where it ends now.
            own, first = closed[row] if side < 2 else ends[row], 2 * (side % 2)
            place[0] = place[2] = own[first]
            place[1] = place[3] = own[first + 1]
            if side >= 2 and place[0] == closed[row, first] and place[1] == closed[row, first + 1]:
                continue
            size = _search(place, grid, search)
            for i in range(size):
                other = search.found[i]
                if points[other] > 0 and not marks[other]:
                    if _ends_near(ends[other], place[0], place[1]):
                        marks[other] = True
                        around[count] = other
                        count += 1
    corner, back = np.empty(2), np.empty(2)
    for k in range(count):
        row = around[k]
        marks[row] = False
        for side in range(2):
            end = 2 * row + side
            closed[row, 2 * side], closed[row, 2 * side + 1] = ends[row, 2 * side : 2 * side + 2]
            other = _partner(end, ends, points, objects, grid, search, corner)
            if other >= 0 and _partner(other, ends, points, objects, grid, search, back) == end:
                closed[row, 2 * side], closed[row, 2 * side + 1] = corner[0], corner[1]
    return around[:count]


@inner
def _search(place: Float, grid: Grid, search: Search) -> int:
    """Collect the walls near a place (4,); returns how many there are."""
    search.number[0] += 1
    stamp = search.number[0]
    return near(grid, place, 2.0 * CORNER_REACH, MERGE_CELL, search.stamps, stamp, search.found)


@inner
def _ends_near(wall: Float, x: float, y: float) -> bool:
    """Whether a wall (4,) ends near a place [m]."""
    for side in range(2):
        if abs(wall[2 * side] - x) <= 2.0 * CORNER_REACH:
            if abs(wall[2 * side + 1] - y) <= 2.0 * CORNER_REACH:
                return True
    return False


@inner
def _partner(
    end: int, ends: Float, points: Int, objects: Int, grid: Grid, search: Search, corner: Float
) -> int:
    """The nearest end that an end could meet, or −1; fills in the corner (2,) [m].

    An end is named by twice its wall, and one more for the second one.
    """
    wall, side = end >> 1, end & 1
    place = np.empty(4)
    place[0] = place[2] = ends[wall, 2 * side]
    place[1] = place[3] = ends[wall, 2 * side + 1]
    count = _search(place, grid, search)
    # Ends that are farther apart meet nowhere near to both.
    best, least = -1, (2.01 * CORNER_REACH) ** 2
    for k in range(count):
        other = search.found[k]
        if other == wall or points[other] == 0 or objects[other] != objects[wall]:
            continue
        for turned in range(2):
            dx = ends[other, 2 * turned] - place[0]
            dy = ends[other, 2 * turned + 1] - place[1]
            away = dx * dx + dy * dy
            # Of equally near ones the order of the rows decides.
            if away > least or (away == least and 2 * other + turned > best):
                continue
            if _crossing(ends, wall, side, other, turned, corner):
                best, least = 2 * other + turned, away
    if best >= 0:
        _crossing(ends, wall, side, best >> 1, best & 1, corner)
    return best


@inner
def _crossing(ends: Float, one: int, side: int, other: int, turned: int, corner: Float) -> bool:
    """Fill in the corner (2,) where the lines of two walls cross; whether it is near to both."""
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
    # The first end (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(CORNER_TRIM, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(CORNER_TRIM, 0.5 * across):
        return False
    corner[0], corner[1] = ends[one, 2 * side] + ahead * ux, ends[one, 2 * side + 1] + ahead * uy
    return True
