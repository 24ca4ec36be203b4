"""Exact decisions about one beam and one wall, compiled.

A beam is an origin o and a direction d, a wall has the ends p and q; all are float64 and taken as
they are. With a = p − o and e = q − p (differences that float64 cannot hold, so they are carried
with their rounding error)

    area = a × e        twice the signed area of o, p, q: its sign says how the wall is seen
    slope = d × e       the beam meets the wall's line at t = area / slope
    side = d × (p − o)  its sign says on which side of the beam an end lies

Every sign is first taken from plain float64, where a bound on the rounding error allows it, and
else from an expansion that holds the number exactly. A length t is taken in double-double, and
where that falls short from expansions too.
"""

from typing import NamedTuple, SupportsIndex

import numpy as np

from lrf3d.casting.kernels.floats import (
    add_float,
    add_product,
    cross,
    quotient,
    rounded,
    sign,
    sign_of_cross_products,
    two_sum,
)
from lrf3d.compiling import borrower, inner
from lrf3d.geometry import Float

FILTER = 5.0 * 2.0**-53
"""Bound on the relative error of a·b − c·d against |a·b| + |c·d|, where a and c are rounded
differences and b and d are too: (1 + 2⁻⁵³)⁴ − 1, and what the bound's own rounding takes."""

SAFE_CANCELLATION = 2.0**-32
"""Least |a·b − c·d| / (|a·b| + |c·d|) at which double-double still gives 70 good bits."""

LANES = 4
"""Float64 numbers that a vector register holds."""

DOUBLE_DOUBLE = 2.0**-65
"""Bound on the relative error of a quotient of two such double-doubles, generously."""


class Beam(NamedTuple):
    """A beam: where it starts [m], and its direction."""

    ox: float
    oy: float
    dx: float
    dy: float


class Wall(NamedTuple):
    """The ends p and q of a wall [m]."""

    px: float
    py: float
    qx: float
    qy: float


@inner
def wall_at(walls: Float, row: SupportsIndex) -> Wall:
    """The wall in a row."""
    return Wall(walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3])


@inner
def side(beam: Beam, px: float, py: float) -> int:
    """On which side of the beam the point lies: 1 left, −1 right, 0 on its line."""
    left = beam.dx * (py - beam.oy)
    right = beam.dy * (px - beam.ox)
    cross = left - right
    if abs(cross) > FILTER * (abs(left) + abs(right)):
        return 1 if cross > 0.0 else -1
    if left == 0.0 and right == 0.0:
        return 0
    parts = np.empty(9)
    return sign(parts, _add_cross(parts, 0, beam.dx, beam.dy, Wall(beam.ox, beam.oy, px, py)))


@inner
def area_sign(ox: float, oy: float, wall: Wall) -> int:
    """Sign of the area o, p, q: 1 where the wall is seen counter-clockwise from p to q."""
    left = (wall.px - ox) * (wall.qy - wall.py)
    right = (wall.py - oy) * (wall.qx - wall.px)
    cross = left - right
    if abs(cross) > FILTER * (abs(left) + abs(right)):
        return 1 if cross > 0.0 else -1
    if left == 0.0 and right == 0.0:
        return 0
    parts = np.empty(17)
    return sign(parts, _area(parts, ox, oy, wall))


@inner
def between(ox: float, oy: float, wall: Wall) -> bool:
    """Whether o, which lies on the line of the wall, lies on the wall."""
    px, py, qx, qy = wall
    return min(px, qx) <= ox <= max(px, qx) and min(py, qy) <= oy <= max(py, qy)


@inner
def meets_seen(area: int, beam: Beam, wall: Wall) -> bool:
    """Whether the beam meets a wall that is seen with this sign of its area, not zero.

    The wall covers less than half a turn, from p to q in the sense of the sign, and the beam
    meets it just where it has neither end on the wrong side. Nothing behind can pass.
    """
    return area * side(beam, wall.px, wall.py) <= 0 and area * side(beam, wall.qx, wall.qy) >= 0


@inner
def meets_in_line(beam: Beam, wall: Wall) -> bool:
    """Whether the beam runs into a wall whose line goes through o and that does not hold o."""
    if side(beam, wall.px, wall.py) != 0:
        return False
    # On the beam's line p lies ahead where the signs of its offset are those of the direction.
    if beam.dx != 0.0:
        return beam.dx * (wall.px - beam.ox) > 0.0
    return beam.dy * (wall.py - beam.oy) > 0.0


@inner
def compare(beam: Beam, wall: Wall, other: Wall) -> int:
    """Sign of t(wall) − t(other) for two walls that the beam meets."""
    if same_line(wall, other) and area_sign(beam.ox, beam.oy, wall) != 0:
        return 0
    first, first_low, first_good = plain_length(beam, wall)
    second, second_low, second_good = plain_length(beam, other)
    if first_good and second_good:
        difference = (first - second) + (first_low - second_low)
        if abs(difference) > DOUBLE_DOUBLE * (first + second):
            return 1 if difference > 0.0 else -1
    above, below, other_above, other_below = np.empty(17), np.empty(9), np.empty(17), np.empty(9)
    a, b = _fraction(above, below, beam, wall)
    c, d = _fraction(other_above, other_below, beam, other)
    return sign_of_cross_products(above, a, other_below, d, other_above, c, below, b)


@inner
def compare_limit(limit: float, beam: Beam, wall: Wall) -> int:
    """Sign of t − limit for a wall that the beam meets."""
    above, below = np.empty(17), np.empty(9)
    a, b = _fraction(above, below, beam, wall)
    bound = np.empty(2)
    one = np.empty(1)
    one[0] = 1.0
    count = add_float(bound, 0, limit)
    return sign_of_cross_products(above, a, one, 1, bound, count, below, b)


@inner
def length(beam: Beam, wall: Wall) -> float:
    """The t of a wall that the beam meets, at most 0.51 ulp off; `plain_length` costs less."""
    above, below = np.empty(17), np.empty(9)
    a, b = _fraction(above, below, beam, wall)
    if a == 0:
        return 0.0
    high, low = rounded(above, a)
    slope, slope_low = rounded(below, b)
    return quotient(high, low, slope, slope_low)[0]


@borrower
def lengths(
    ox: float, oy: float, dx: Float, dy: Float, wall: Wall, start: int, stop: int, out: Float
) -> None:
    """The t of a wall that the beams from start to stop meet, NaN where this falls short.

    Whole vectors are computed: up to LANES − 1 more numbers are read and overwritten.
    """
    area, area_low, good = wall_area(ox, oy, wall)
    ex, ex_low = two_sum(wall.qx, -wall.px)
    ey, ey_low = two_sum(wall.qy, -wall.py)
    least = SAFE_CANCELLATION if good else np.inf
    for i in range(start, start + (stop - start + LANES - 1) // LANES * LANES):
        slope, slope_low, size = cross(dx[i], 0.0, ey, ey_low, dy[i], 0.0, ex, ex_low)
        t = quotient(area, area_low, slope, slope_low)[0]
        out[i] = t if abs(slope) > least * size else np.nan


@inner
def wall_area(ox: float, oy: float, wall: Wall) -> tuple[float, float, bool]:
    """The area as value, rest, and whether both together are good to 70 bits."""
    ax, ax_low = two_sum(wall.px, -ox)
    ay, ay_low = two_sum(wall.py, -oy)
    ex, ex_low = two_sum(wall.qx, -wall.px)
    ey, ey_low = two_sum(wall.qy, -wall.py)
    high, low, size = cross(ax, ax_low, ey, ey_low, ay, ay_low, ex, ex_low)
    return high, low, abs(high) > SAFE_CANCELLATION * size


@inner
def plain_length(beam: Beam, wall: Wall) -> tuple[float, float, bool]:
    """The t in double-double, and whether that is good enough to be used."""
    area, area_low, good = wall_area(beam.ox, beam.oy, wall)
    ex, ex_low = two_sum(wall.qx, -wall.px)
    ey, ey_low = two_sum(wall.qy, -wall.py)
    slope, slope_low, size = cross(beam.dx, 0.0, ey, ey_low, beam.dy, 0.0, ex, ex_low)
    good = good and abs(slope) > SAFE_CANCELLATION * size
    if not good:
        return 0.0, 0.0, False
    value, low = quotient(area, area_low, slope, slope_low)
    return value, low, True


@inner
def precise_area(ox: float, oy: float, wall: Wall) -> float:
    """The area rounded to a float64, exact in its sign and good to 2⁻⁵² of its value."""
    high, _, good = wall_area(ox, oy, wall)
    if good:
        return high
    parts = np.empty(17)
    return rounded(parts, _area(parts, ox, oy, wall))[0]


@inner
def same_line(wall: Wall, other: Wall) -> bool:
    """Whether two walls plainly lie on one line: the same ends, or upright or level alike."""
    px, py, qx, qy = wall
    rx, ry, sx, sy = other
    if px == rx and py == ry and qx == sx and qy == sy:
        return True
    if px == sx and py == sy and qx == rx and qy == ry:
        return True
    return (px == qx and px == rx and px == sx) or (py == qy and py == ry and py == sy)


@inner
def _fraction(above: Float, below: Float, beam: Beam, wall: Wall) -> tuple[int, int]:
    """The t as the quotient, ≥ 0, of two expansions, the second positive; their counts."""
    px, py, qx, qy = wall
    a = _area(above, beam.ox, beam.oy, wall)
    if a != 0:
        b = _add_cross(below, 0, beam.dx, beam.dy, wall)
    elif between(beam.ox, beam.oy, wall):
        below[0] = 1.0
        return 0, 1
    elif beam.dx != 0.0:
        near = min(px, qx) if px > beam.ox else max(px, qx)
        a = add_float(above, add_float(above, 0, near), -beam.ox)
        b = add_float(below, 0, beam.dx)
    else:
        near = min(py, qy) if py > beam.oy else max(py, qy)
        a = add_float(above, add_float(above, 0, near), -beam.oy)
        b = add_float(below, 0, beam.dy)
    if sign(below, b) < 0:
        for k in range(a):
            above[k] = -above[k]
        for k in range(b):
            below[k] = -below[k]
    return a, b


@inner
def _area(parts: Float, ox: float, oy: float, wall: Wall) -> int:
    """The area as an expansion of at most 16 parts; their count."""
    count = _add_cross(parts, 0, wall.px - ox, wall.py - oy, wall)
    ax_low = two_sum(wall.px, -ox)[1]
    ay_low = two_sum(wall.py, -oy)[1]
    if ax_low != 0.0 or ay_low != 0.0:
        count = _add_cross(parts, count, ax_low, ay_low, wall)
    return count


@inner
def _add_cross(parts: Float, count: int, dx: float, dy: float, wall: Wall) -> int:
    """Add d × (q − p) to an expansion, in place: at most 8 parts; the new count."""
    ex, ex_low = two_sum(wall.qx, -wall.px)
    ey, ey_low = two_sum(wall.qy, -wall.py)
    count = add_product(parts, count, dx, ey)
    count = add_product(parts, count, -dy, ex)
    if ey_low != 0.0:
        count = add_product(parts, count, dx, ey_low)
    if ex_low != 0.0:
        count = add_product(parts, count, -dy, ex_low)
    return count
