"""Exact decisions about one beam and one wall, compiled.

A beam is an origin o and a direction d, a wall has the ends p and q; all are float64 and taken as
they are. With a = p − o and e = q − p (differences that float64 cannot hold, so they are carried
with their rounding error)

    area = a × e        twice the signed area of o, p, q: its sign says how the wall is seen
    slope = d × e       the beam meets the wall's line at t = area / slope
    side = d × (p − o)  its sign says on which side of the beam an end lies

Every sign is first taken from plain float64, where a bound on the rounding error allows it, and
else from an expansion that holds the number exactly.
"""

import numpy as np

from lrf3d.casting.kernels.compiling import inner
from lrf3d.casting.kernels.double_double import DOUBLE_DOUBLE, plain_length, quotient, wall_area
from lrf3d.casting.kernels.floats import (
    add_float,
    add_product,
    rounded,
    sign,
    sign_of_cross_products,
    two_sum,
)  # fmt: skip

FILTER = 5.0 * 2.0**-53
"""Bound on the relative error of a·b − c·d against |a·b| + |c·d|, where a and c are rounded
differences and b and d are too: (1 + 2⁻⁵³)⁴ − 1, and what the bound's own rounding takes."""


@inner
def side(ox, oy, dx, dy, px, py):
    """On which side of the beam the point lies: 1 left, −1 right, 0 on its line."""
    left = dx * (py - oy)
    right = dy * (px - ox)
    cross = left - right
    if abs(cross) > FILTER * (abs(left) + abs(right)):
        return 1 if cross > 0.0 else -1
    if left == 0.0 and right == 0.0:
        return 0
    parts = np.empty(9)
    return sign(parts, _slope(parts, dx, dy, ox, oy, px, py))


@inner
def area_sign(ox, oy, px, py, qx, qy):
    """Sign of the area o, p, q: 1 where the wall is seen counter-clockwise from p to q."""
    left = (px - ox) * (qy - py)
    right = (py - oy) * (qx - px)
    cross = left - right
    if abs(cross) > FILTER * (abs(left) + abs(right)):
        return 1 if cross > 0.0 else -1
    if left == 0.0 and right == 0.0:
        return 0
    parts = np.empty(17)
    return sign(parts, _area(parts, ox, oy, px, py, qx, qy))


@inner
def between(ox, oy, px, py, qx, qy):
    """Whether o, which lies on the line of the wall, lies on the wall."""
    return min(px, qx) <= ox <= max(px, qx) and min(py, qy) <= oy <= max(py, qy)


@inner
def meets(ox, oy, dx, dy, px, py, qx, qy):
    """Whether the beam meets the wall, both ends and t = 0 included."""
    area = area_sign(ox, oy, px, py, qx, qy)
    if area != 0:
        return meets_seen(area, ox, oy, dx, dy, px, py, qx, qy)
    if between(ox, oy, px, py, qx, qy):
        return True
    return meets_in_line(ox, oy, dx, dy, px, py)


@inner
def meets_seen(area, ox, oy, dx, dy, px, py, qx, qy):
    """Whether the beam meets a wall that is seen with this sign of its area, not zero.

    The wall covers less than half a turn, from p to q in the sense of the sign, and the beam
    meets it just where it has neither end on the wrong side. Nothing behind can pass.
    """
    return area * side(ox, oy, dx, dy, px, py) <= 0 and area * side(ox, oy, dx, dy, qx, qy) >= 0


@inner
def meets_in_line(ox, oy, dx, dy, px, py):
    """Whether the beam runs into a wall whose line goes through o and that does not hold o."""
    if side(ox, oy, dx, dy, px, py) != 0:
        return False
    # On the beam's line p lies ahead where the signs of its offset are those of the direction.
    return dx * (px - ox) > 0.0 if dx != 0.0 else dy * (py - oy) > 0.0


@inner
def compare(ox, oy, dx, dy, px, py, qx, qy, rx, ry, sx, sy):
    """Sign of t(p, q) − t(r, s) for two walls that the beam meets."""
    if _same_line(px, py, qx, qy, rx, ry, sx, sy) and area_sign(ox, oy, px, py, qx, qy) != 0:
        return 0
    first, first_low, first_good = plain_length(ox, oy, dx, dy, px, py, qx, qy)
    second, second_low, second_good = plain_length(ox, oy, dx, dy, rx, ry, sx, sy)
    if first_good and second_good:
        difference = (first - second) + (first_low - second_low)
        if abs(difference) > DOUBLE_DOUBLE * (first + second):
            return 1 if difference > 0.0 else -1
    above, below, other_above, other_below = np.empty(17), np.empty(9), np.empty(17), np.empty(9)
    a, b = _fraction(above, below, ox, oy, dx, dy, px, py, qx, qy)
    c, d = _fraction(other_above, other_below, ox, oy, dx, dy, rx, ry, sx, sy)
    return sign_of_cross_products(above, a, other_below, d, other_above, c, below, b)


@inner
def compare_limit(limit, ox, oy, dx, dy, px, py, qx, qy):
    """Sign of t − limit for a wall that the beam meets."""
    above, below = np.empty(17), np.empty(9)
    a, b = _fraction(above, below, ox, oy, dx, dy, px, py, qx, qy)
    bound = np.empty(2)
    one = np.ones(1)
    count = add_float(bound, 0, limit)
    return sign_of_cross_products(above, a, one, 1, bound, count, below, b)


@inner
def length(ox, oy, dx, dy, px, py, qx, qy):
    """The t of a wall that the beam meets, at most 0.51 ulp off."""
    t, low, good = plain_length(ox, oy, dx, dy, px, py, qx, qy)
    if good:
        return t
    above, below = np.empty(17), np.empty(9)
    a, b = _fraction(above, below, ox, oy, dx, dy, px, py, qx, qy)
    if a == 0:
        return 0.0
    high, low = rounded(above, a)
    slope, slope_low = rounded(below, b)
    return quotient(high, low, slope, slope_low)[0]


@inner
def precise_area(ox, oy, px, py, qx, qy):
    """The area rounded to a float64, exact in its sign and good to 2⁻⁵² of its value."""
    high, _, good = wall_area(ox, oy, px, py, qx, qy)
    if good:
        return high
    parts = np.empty(17)
    return rounded(parts, _area(parts, ox, oy, px, py, qx, qy))[0]


@inner
def _same_line(px, py, qx, qy, rx, ry, sx, sy):
    """Whether two walls plainly lie on one line: the same ends, or upright or level alike."""
    if px == rx and py == ry and qx == sx and qy == sy:
        return True
    if px == sx and py == sy and qx == rx and qy == ry:
        return True
    return (px == qx and px == rx and px == sx) or (py == qy and py == ry and py == sy)


@inner
def _fraction(above, below, ox, oy, dx, dy, px, py, qx, qy):
    """The t as the quotient, ≥ 0, of two expansions, the second positive; their counts."""
    a = _area(above, ox, oy, px, py, qx, qy)
    if a != 0:
        b = _slope(below, dx, dy, px, py, qx, qy)
    elif between(ox, oy, px, py, qx, qy):
        below[0] = 1.0
        return 0, 1
    elif dx != 0.0:
        near = min(px, qx) if px > ox else max(px, qx)
        a = add_float(above, add_float(above, 0, near), -ox)
        b = add_float(below, 0, dx)
    else:
        near = min(py, qy) if py > oy else max(py, qy)
        a = add_float(above, add_float(above, 0, near), -oy)
        b = add_float(below, 0, dy)
    if sign(below, b) < 0:
        for k in range(a):
            above[k] = -above[k]
        for k in range(b):
            below[k] = -below[k]
    return a, b


@inner
def _area(parts, ox, oy, px, py, qx, qy):
    """The area as an expansion of at most 16 parts; their count."""
    count = _add_cross(parts, 0, px - ox, py - oy, px, py, qx, qy)
    ax_low = two_sum(px, -ox)[1]
    ay_low = two_sum(py, -oy)[1]
    if ax_low != 0.0 or ay_low != 0.0:
        count = _add_cross(parts, count, ax_low, ay_low, px, py, qx, qy)
    return count


@inner
def _slope(parts, dx, dy, px, py, qx, qy):
    """The product d × (q − p) as an expansion of at most 8 parts; their count."""
    return _add_cross(parts, 0, dx, dy, px, py, qx, qy)


@inner
def _add_cross(parts, count, dx, dy, px, py, qx, qy):
    """Add d × (q − p) to an expansion, in place; the new count."""
    ex, ex_low = two_sum(qx, -px)
    ey, ey_low = two_sum(qy, -py)
    count = add_product(parts, count, dx, ey)
    count = add_product(parts, count, -dy, ex)
    if ey_low != 0.0:
        count = add_product(parts, count, dx, ey_low)
    if ex_low != 0.0:
        count = add_product(parts, count, -dy, ex_low)
    return count
