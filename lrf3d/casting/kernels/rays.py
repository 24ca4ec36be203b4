"""Rays that mirrors have turned, compiled: where they go, with a bound on every error.

Behind a mirror neither the origin nor the direction of a beam is a float64. Both are carried as
double-doubles, with bounds on their errors. The next wall is found in plain float64: if a wall is
missed or met, or nearer than another one, by less than the rounding error may be, the ray is
reported as open, and rationals decide it. Its way is then summed in double-double.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM
from lrf3d.casting.kernels.floats import cross, quotient, two_product, two_sum
from lrf3d.casting.kernels.predicates import Wall, same_line, wall_at
from lrf3d.casting.kernels.tree import Tree
from lrf3d.compiling import borrower
from lrf3d.geometry import Bool, Float, Int

COARSE = 8.0 * 2.0**-53
"""Bound on the rounding of a cross product of float64 offsets, in parts of the sizes of all terms:
two units for each offset and direction, one for the product, one for the difference."""

FINE = 2.0**-98
"""The same for double-doubles, generously."""

BOX_SLACK = 1e-9
"""Room for rounding at boxes, in parts of their coordinates."""

CERTAIN = 2.0**-56
"""Largest error of a way, in parts of it; its float64 is then 0.57 ulp off."""

ROUNDED = 2.0**-50
"""Bound on the rounding of a range, in parts of it, generously."""

NONE = -1
"""The ray meets no wall within its reach."""

OPEN = -2
"""Float64 cannot tell which wall the ray meets."""


class Met(NamedTuple):
    """Walls that a ray meets, in order, and room to look for them.

    Attributes:
        rows: (MOST_MET,) their rows.
        gaps: (MOST_MET, 2) bounds on their distances [m].
        stack: (STACK,) room.
        nears: (STACK,) room.
    """

    rows: Int
    gaps: Float
    stack: Int
    nears: Float


MOST_MET = 17
"""Walls of a leg that are found: one more than those that count."""


class Ray(NamedTuple):
    """A ray, each number with its rest.

    Attributes:
        x: Where it starts [m].
        x_low: Its rest.
        y: The same.
        y_low: Its rest.
        dx: Its direction.
        dx_low: Its rest.
        dy: The same.
        dy_low: Its rest.
        way: Length of the way up to its start [m].
        way_low: Its rest.
        place_error: Bound on the errors of x and y [m].
        turn_error: Bound on the errors of dx and dy.
        way_error: Bound on the error of the way [m].
    """

    x: float
    x_low: float
    y: float
    y_low: float
    dx: float
    dx_low: float
    dy: float
    dy_low: float
    way: float
    way_low: float
    place_error: float
    turn_error: float
    way_error: float


RAY = 13
"""Numbers of a ray."""


@borrower
def ray_of(x: float, y: float, dx: float, dy: float) -> Ray:
    """The ray of a beam."""
    return Ray(x, 0.0, y, 0.0, dx, 0.0, dy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@borrower
def walls_along(
    tree: Tree, solid: Bool, ray: Ray, last: int, since: float, reach: float, met: Met
) -> tuple[int, float]:
    """Find the walls that a ray meets, in order, up to the first that lets nothing pass.

    Args:
        tree: The walls.
        solid: Which of them, row by row, let nothing pass.
        ray: The ray.
        last: Row of a wall that it has met, and has either passed or starts from.
        since: How far away that is [m]; 0 where the ray starts from there, mirrored.
        reach: How far the ray may go [m].
        met: What is filled.

    Returns:
        The number of walls that were filled in, and the nearest distance [m] from which on float64
        cannot tell what is met.
    """
    ox, oy, dx, dy = ray.x, ray.y, ray.dx, ray.dy
    wide, tall = abs(dx), abs(dy)
    boxes, links, walls = tree.boxes, tree.links, tree.walls
    met_rows, gaps, stack, nears = met
    # Bounds that hold for all walls, so that they are worked out once: on all coordinates, and on
    # the errors of sides and of offsets.
    most = abs(ox) + abs(oy)
    for k in range(4):
        most += abs(boxes[0, k])
    room = COARSE * most * (wide + tall) + ray.place_error * (wide + tall)
    room += 2.0 * most * ray.turn_error
    shift = COARSE * most + ray.place_error
    slack = 4.0 * BOX_SLACK * most
    early, late = since * (1.0 - ROUNDED), since * (1.0 + ROUNDED)
    here_x, here_y = ox + since * dx, oy + since * dy
    start = wall_at(walls, last)
    found, end, doubt = 0, reach * ROOM, np.inf
    stack[0], nears[0] = 0, 0.0
    top = 1
    while top > 0:
        top -= 1
        if nears[top] > end:
            continue
        node = stack[top]
        first, count = links[node, 0], links[node, 1]
        bottom = top
        for child in range(first, first - count):
            x0, y0, x1, y1 = boxes[child, 0], boxes[child, 1], boxes[child, 2], boxes[child, 3]
            half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
            cx, cy = 0.5 * (x0 + x1) - ox, 0.5 * (y0 + y1) - oy
            if abs(dx * cy - dy * cx) > wide * half_y + tall * half_x + slack:
                continue
            along, extent = dx * cx + dy * cy, wide * half_x + tall * half_y + slack
            near = along - extent
            if along + extent < early or near > end:
                continue
            # The nearest box is looked at first, so that walls in it hide others.
            place = top
            while place > bottom and nears[place - 1] < near:
                stack[place], nears[place] = stack[place - 1], nears[place - 1]
                place -= 1
            stack[place], nears[place] = child, near
            top += 1
        for row in range(first, first + count):
            ax, ay, bx, by = (
                walls[row, 0] - ox, walls[row, 1] - oy, walls[row, 2] - ox, walls[row, 3] - oy
            )  # fmt: skip
            side_p, side_q = dx * ay - dy * ax, dx * by - dy * bx
            if (side_p > room and side_q > room) or (side_p < -room and side_q < -room):
                continue
            wall = wall_at(walls, row)
            if row == last or (
                same_line(wall, start) and (since == 0.0 or not _may_hold(wall, here_x, here_y))
            ):
                # The ray leaves the line of that wall for good.
                continue
            if min(abs(side_p), abs(side_q)) <= room:
                # It passes an end too closely to tell. The place counts if no wall is nearer.
                one, other = dx * ax + dy * ay, dx * bx + dy * by
                if max(one, other) + slack >= early:
                    doubt = min(doubt, max(min(one, other) - slack, 0.0))
                continue
            slope = side_q - side_p
            size = abs(slope)
            if size <= 4.0 * room:
                doubt = 0.0
                continue
            ex, ey = wall.qx - wall.px, wall.qy - wall.py
            t = (ax * ey - ay * ex) / slope
            error = 2.0 * (shift * (abs(ex) + abs(ey)) + 2.0 * abs(t) * room) / size
            low, high = t - error, t + error
            if high < early or low > end:
                continue
            if low <= late:
                doubt = 0.0
                continue
            if solid[row]:
                end = min(end, high)
            # Where there is no room, the farthest one is dropped: no way has so many walls.
            place = min(found, MOST_MET - 1)
            while place > 0 and gaps[place - 1, 0] > low:
                met_rows[place] = met_rows[place - 1]
                gaps[place, 0], gaps[place, 1] = gaps[place - 1, 0], gaps[place - 1, 1]
                place -= 1
            met_rows[place], gaps[place, 0], gaps[place, 1] = row, low, high
            found = min(found + 1, MOST_MET)
    return found, doubt


@borrower
def met_at(
    tree: Tree, solid: Bool, met: Met, at: int, found: int, doubt: float, reach: float
) -> int:
    """The row of a wall that `walls_along` has found, in order, or NONE or OPEN."""
    if at >= found:
        return OPEN if doubt <= reach * ROOM else NONE
    row, high = met.rows[at], met.gaps[at, 1]
    if doubt <= high:
        return OPEN
    alike = at + 1
    while alike < found and met.gaps[alike, 0] <= high:
        # Of walls on one line the first of the world is met. If it lets the beam pass, the others
        # are met at the same place, which is left to rationals.
        other = met.rows[alike]
        if not same_line(wall_at(tree.walls, row), wall_at(tree.walls, other)):
            return OPEN
        row = other if tree.rows[other] < tree.rows[row] else row
        alike += 1
    return OPEN if alike > at + 1 and not solid[row] else row


@borrower
def _may_hold(wall: Wall, x: float, y: float) -> bool:
    """Whether a wall may hold a point that is rounded, on its line."""
    slack = BOX_SLACK * (abs(x) + abs(y))
    beside_x = x < min(wall.px, wall.qx) - slack or x > max(wall.px, wall.qx) + slack
    beside_y = y < min(wall.py, wall.qy) - slack or y > max(wall.py, wall.qy) + slack
    return not (beside_x or beside_y)


@borrower
def distance_to(ray: Ray, wall: Wall) -> tuple[float, float, float]:
    """How far away a ray meets a wall [m], its rest, and a bound on its error: infinite if none."""
    ex, ex_low = two_sum(wall.qx, -wall.px)
    ey, ey_low = two_sum(wall.qy, -wall.py)
    ax, ax_low = _minus(wall.px, ray.x, ray.x_low)
    ay, ay_low = _minus(wall.py, ray.y, ray.y_low)
    extent = abs(ex) + abs(ey)
    area, area_low, area_size = cross(ax, ax_low, ey, ey_low, ay, ay_low, ex, ex_low)
    slope, slope_low, slope_size = cross(
        ray.dx, ray.dx_low, ey, ey_low, ray.dy, ray.dy_low, ex, ex_low
    )
    area_error = FINE * area_size + ray.place_error * extent
    slope_error = FINE * slope_size + ray.turn_error * extent
    t, t_low = quotient(area, area_low, slope, slope_low)
    size = abs(slope)
    error = 2.0 * (area_error + abs(t) * slope_error) / size + FINE * abs(t)
    return t, t_low, error if size > 4.0 * slope_error else np.inf


@borrower
def arrive(ray: Ray, wall: Wall) -> Ray:
    """The ray from where it meets a wall, straight on; its way_error is infinite if unknown."""
    t, t_low, error = distance_to(ray, wall)
    x, x_low = _step(ray.x, ray.x_low, t, t_low, ray.dx, ray.dx_low)
    y, y_low = _step(ray.y, ray.y_low, t, t_low, ray.dy, ray.dy_low)
    way, way_low = plus(ray.way, ray.way_low, t, t_low)
    rounding = FINE * (abs(ray.x) + abs(ray.y) + abs(t))
    place_error = ray.place_error + error + abs(t) * ray.turn_error + rounding
    way_error = ray.way_error + error + FINE * way
    return Ray(
        x, x_low, y, y_low, ray.dx, ray.dx_low, ray.dy, ray.dy_low,
        way, way_low, place_error, ray.turn_error, way_error,
    )  # fmt: skip


@borrower
def turned_by(ray: Ray, wall: Wall) -> Ray:
    """The ray that a wall mirrors: d + 2 (d × e) / (e · e) (−e_y, e_x) with the wall's e."""
    ex, ex_low = two_sum(wall.qx, -wall.px)
    ey, ey_low = two_sum(wall.qy, -wall.py)
    slope, slope_low, _ = cross(ray.dx, ray.dx_low, ey, ey_low, ray.dy, ray.dy_low, ex, ex_low)
    square, square_low, _ = cross(ex, ex_low, ex, ex_low, -ey, -ey_low, ey, ey_low)
    c, c_low = quotient(2.0 * slope, 2.0 * slope_low, square, square_low)
    dx, dx_low = _step(ray.dx, ray.dx_low, c, c_low, -ey, -ey_low)
    dy, dy_low = _step(ray.dy, ray.dy_low, c, c_low, ex, ex_low)
    return Ray(
        ray.x, ray.x_low, ray.y, ray.y_low, dx, dx_low, dy, dy_low,
        ray.way, ray.way_low, ray.place_error, 5.0 * ray.turn_error + 16.0 * FINE, ray.way_error,
    )  # fmt: skip


@borrower
def _minus(a: float, b: float, b_low: float) -> tuple[float, float]:
    """A float64 less a double-double."""
    high, low = two_sum(a, -b)
    return _settled(high, low - b_low)


@borrower
def plus(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """The sum of two double-doubles."""
    high, low = two_sum(a, b)
    return _settled(high, low + (a_low + b_low))


@borrower
def _step(
    a: float, a_low: float, t: float, t_low: float, d: float, d_low: float
) -> tuple[float, float]:
    """The value a + t · d of double-doubles."""
    product, low = two_product(t, d)
    product, low = _settled(product, low + (t * d_low + t_low * d))
    return plus(a, a_low, product, low)


@borrower
def _settled(high: float, low: float) -> tuple[float, float]:
    """A double-double whose parts do not overlap."""
    total = high + low
    return total, low - (total - high)
