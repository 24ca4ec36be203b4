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
from lrf3d.compiling import inner
from lrf3d.geometry import Float, Int

COARSE = 8.0 * 2.0**-53
"""Bound on the rounding of a cross product of float64 offsets, in parts of the sizes of all terms:
two units for each offset and direction, one for the product, one for the difference."""

FINE = 2.0**-98
"""The same for double-doubles, generously."""

BOX_SLACK = 1e-9
"""Room for rounding at boxes, in parts of their coordinates."""

CERTAIN = 2.0**-56
"""Largest error of a way, in parts of it; its float64 is then 0.57 ulp off."""

NONE = -1
"""The ray meets no wall within its reach."""

OPEN = -2
"""Float64 cannot tell which wall the ray meets."""


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


@inner
def ray_of(x: float, y: float, dx: float, dy: float) -> Ray:
    """The ray of a beam."""
    return Ray(x, 0.0, y, 0.0, dx, 0.0, dy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inner
def next_wall(
    tree: Tree, ray: Ray, last: int, mirrored: bool, reach: float, stack: Int, nears: Float
) -> int:
    """The row of the wall that a ray meets next within a reach [m], or NONE or OPEN.

    Args:
        tree: The walls.
        ray: The ray.
        last: Row of the wall that the ray starts from.
        mirrored: Whether that wall has mirrored it; otherwise it has passed through.
        reach: How far the ray may go [m].
        stack: (STACK,) room.
        nears: (STACK,) room.
    """
    ox, oy, dx, dy = ray.x, ray.y, ray.dx, ray.dy
    wide, tall = abs(dx), abs(dy)
    boxes, links, walls, rows = tree.boxes, tree.links, tree.walls, tree.rows
    if len(walls) == 0:
        return NONE
    # Bounds that hold for all walls, so that they are worked out once: on all coordinates, and on
    # the errors of sides and of offsets.
    most = abs(ox) + abs(oy)
    for k in range(4):
        most += abs(boxes[0, k])
    room = COARSE * most * (wide + tall) + ray.place_error * (wide + tall)
    room += 2.0 * most * ray.turn_error
    shift = COARSE * most + ray.place_error
    slack = 4.0 * BOX_SLACK * most
    best, best_low, best_high = NONE, reach * ROOM, reach * ROOM
    doubt = np.inf
    start = wall_at(walls, last)
    stack[0], nears[0] = 0, 0.0
    top = 1
    while top > 0:
        top -= 1
        if nears[top] > best_high:
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
            if along + extent < 0.0 or near > best_high:
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
            if row == last or min(side_p, side_q) > room or max(side_p, side_q) < -room:
                continue
            wall = wall_at(walls, row)
            if same_line(wall, start) and (mirrored or not _may_hold(wall, ox, oy)):
                # The ray leaves the line of the wall that it comes from for good.
                continue
            if min(abs(side_p), abs(side_q)) <= room:
                # It passes an end too closely to tell. The place counts if no wall is nearer.
                one, other = dx * ax + dy * ay, dx * bx + dy * by
                if max(one, other) + slack >= 0.0:
                    doubt = min(doubt, max(min(one, other) - slack, 0.0))
                continue
            slope = side_q - side_p
            ex, ey = wall.qx - wall.px, wall.qy - wall.py
            t = (ax * ey - ay * ex) / slope
            size = abs(slope)
            if size <= 4.0 * room:
                doubt = 0.0
                continue
            error = 2.0 * (shift * (abs(ex) + abs(ey)) + 2.0 * abs(t) * room) / size
            low, high = t - error, t + error
            if high < 0.0 or low > best_high:
                continue
            if low <= 0.0:
                doubt = 0.0
            elif high < best_low:
                best, best_low, best_high = row, low, high
            elif best >= 0 and same_line(wall, wall_at(walls, best)):
                if rows[row] < rows[best]:
                    best = row
            else:
                doubt = min(doubt, min(low, best_low))
                if high < best_high:
                    best, best_low, best_high = row, low, high
    return OPEN if doubt <= best_high else best


@inner
def _may_hold(wall: Wall, x: float, y: float) -> bool:
    """Whether a wall may hold a point that is rounded, on its line."""
    slack = BOX_SLACK * (abs(x) + abs(y))
    beside_x = x < min(wall.px, wall.qx) - slack or x > max(wall.px, wall.qx) + slack
    beside_y = y < min(wall.py, wall.qy) - slack or y > max(wall.py, wall.qy) + slack
    return not (beside_x or beside_y)


@inner
def arrive(ray: Ray, wall: Wall) -> Ray:
    """The ray from where it meets a wall, straight on; its way_error is infinite if unknown."""
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
    if not size > 4.0 * slope_error:
        error = np.inf
    x, x_low = _step(ray.x, ray.x_low, t, t_low, ray.dx, ray.dx_low)
    y, y_low = _step(ray.y, ray.y_low, t, t_low, ray.dy, ray.dy_low)
    way, way_low = _plus(ray.way, ray.way_low, t, t_low)
    rounding = FINE * (abs(ray.x) + abs(ray.y) + abs(t))
    place_error = ray.place_error + error + abs(t) * ray.turn_error + rounding
    way_error = ray.way_error + error + FINE * way
    return Ray(
        x, x_low, y, y_low, ray.dx, ray.dx_low, ray.dy, ray.dy_low,
        way, way_low, place_error, ray.turn_error, way_error,
    )  # fmt: skip


@inner
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


@inner
def _minus(a: float, b: float, b_low: float) -> tuple[float, float]:
    """A float64 less a double-double."""
    high, low = two_sum(a, -b)
    return _settled(high, low - b_low)


@inner
def _plus(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """The sum of two double-doubles."""
    high, low = two_sum(a, b)
    return _settled(high, low + (a_low + b_low))


@inner
def _step(
    a: float, a_low: float, t: float, t_low: float, d: float, d_low: float
) -> tuple[float, float]:
    """The value a + t · d of double-doubles."""
    product, low = two_product(t, d)
    product, low = _settled(product, low + (t * d_low + t_low * d))
    return _plus(a, a_low, product, low)


@inner
def _settled(high: float, low: float) -> tuple[float, float]:
    """A double-double whose parts do not overlap."""
    total = high + low
    return total, low - (total - high)
