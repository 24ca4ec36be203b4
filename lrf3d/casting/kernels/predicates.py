"""Exact decisions about one beam and one wall, compiled.

A beam is an origin o and a direction d, a wall has the ends p and q; all are float64 and taken as
they are. With a = p − o and e = q − p (differences that float64 cannot hold, so they are carried
with their rounding error)

    area = a × e        twice the signed area of o, p, q: its sign says how the wall is seen
    slope = d × e       the beam meets the wall's line at t = area / slope
    side = d × (p − o)  its sign says on which side of the beam an end lies

Every sign is first taken from plain float64, where a bound on the rounding error allows it, and
else from an expansion that holds the number exactly. A length t is taken in double-double, a
float64 and its rounding error, together good to 100 bits, of which sums of products lose as many as
cancel; and where that falls short from expansions too. An expansion is an array of floats, smallest
first, that do not overlap; its value is their exact sum. Everything holds as long as no product
under- or overflows: coordinates and their differences of 1e-60 to 1e60.

T. J. Dekker, "A floating-point technique for extending the available precision", 1971;
J. R. Shewchuk, "Adaptive precision floating-point arithmetic", 1997.
"""

from typing import NamedTuple, SupportsIndex

import numpy as np

from lrf3d.compiling import LANES, borrower, inner
from lrf3d.geometry.lines import Float

# 2²⁷ + 1: multiplying by it cuts a float64 into two halves of 26 bits.
SPLITTER = 134217729.0

# Bound on the relative error of a·b − c·d against |a·b| + |c·d|, where a and c are rounded
# differences and b and d are too: (1 + 2⁻⁵³)⁴ − 1, and what the bound's own rounding takes.
FILTER = 5.0 * 2.0**-53

# Least |a·b − c·d| / (|a·b| + |c·d|) at which double-double still gives 70 good bits.
SAFE_CANCELLATION = 2.0**-32

# Indices of this type are never negative, which spares each access in a hot loop the question
# whether it counts from the end.
index_of = np.uint64

# Bound on the relative error of a quotient of two such double-doubles, generously.
DOUBLE_DOUBLE = 2.0**-65

# In place of a sign that float64 does not show.
AMBIGUOUS = 2

# A rounded number and the rest of it.
Double = tuple[float, float]

Vector = tuple[float, float]


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


class Exact(NamedTuple):
    """An expansion: the first of its parts."""

    parts: Float
    size: int


@inner
def wall_at(walls: Float, row: SupportsIndex) -> Wall:
    """The wall in a row."""
    return Wall(walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3])


@inner
def edge_of(wall: Wall) -> tuple[Double, Double]:
    """The vector e from p to q."""
    return two_sum(wall.qx, -wall.px), two_sum(wall.qy, -wall.py)


@inner
def side(beam: Beam, px: float, py: float) -> int:
    """On which side of the beam the point lies: 1 left, −1 right, 0 on its line."""
    left = beam.dx * (py - beam.oy)
    right = beam.dy * (px - beam.ox)
    found = _plain_sign(left, right)
    if found != AMBIGUOUS:
        return found
    return _sign(_cross(_zero(9), beam.dx, beam.dy, Wall(beam.ox, beam.oy, px, py)))


@inner
def area_sign(ox: float, oy: float, wall: Wall) -> int:
    """Sign of the area o, p, q: 1 where the wall is seen counter-clockwise from p to q."""
    left = (wall.px - ox) * (wall.qy - wall.py)
    right = (wall.py - oy) * (wall.qx - wall.px)
    found = _plain_sign(left, right)
    return found if found != AMBIGUOUS else _sign(_area(ox, oy, wall))


@inner
def _plain_sign(left: float, right: float) -> int:
    """Sign of a difference of two rounded products, or AMBIGUOUS."""
    cross = left - right
    if abs(cross) > FILTER * (abs(left) + abs(right)):
        return 1 if cross > 0.0 else -1
    return 0 if left == 0.0 and right == 0.0 else AMBIGUOUS


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
    if _on_one_line(wall, other) and area_sign(beam.ox, beam.oy, wall) != 0:
        return 0
    (first, first_low), first_good = plain_length(beam, wall)
    (second, second_low), second_good = plain_length(beam, other)
    if first_good and second_good:
        difference = (first - second) + (first_low - second_low)
        if abs(difference) > DOUBLE_DOUBLE * (first + second):
            return 1 if difference > 0.0 else -1
    above, below = _fraction(beam, wall)
    other_above, other_below = _fraction(beam, other)
    return _sign_of_cross(above, other_below, other_above, below)


@inner
def compare_limit(limit: float, beam: Beam, wall: Wall) -> int:
    """Sign of t − limit for a wall that the beam meets."""
    above, below = _fraction(beam, wall)
    return _sign_of_cross(above, _plus(_zero(1), 1.0), _plus(_zero(1), limit), below)


@inner
def compare_height(slope: float, start: float, height: float, beam: Beam, wall: Wall) -> int:
    """Sign of start + t · slope − height: whether a rising beam at t is above a height."""
    above, below = _fraction(beam, wall)
    rise = _plus(_plus(_zero(2), height), -start)
    return _sign_of_cross(above, _plus(_zero(1), slope), rise, below)


@inner
def length(beam: Beam, wall: Wall) -> float:
    """The t of a wall that the beam meets, at most 0.51 ulp off; `plain_length` costs less."""
    above, below = _fraction(beam, wall)
    return 0.0 if above.size == 0 else quotient(_rounded(above), _rounded(below))[0]


@borrower
def lengths(
    place: Vector, dx: Float, dy: Float, wall: Wall, part: tuple[int, int], out: Float
) -> None:
    """The t of a wall that the beams of a part meet from a place, NaN where this falls short.

    Whole vectors are computed: up to LANES − 1 more numbers are read and overwritten.
    """
    area, good = _plain_area(place[0], place[1], wall)
    ex, ey = edge_of(wall)
    start, stop = part
    least = SAFE_CANCELLATION if good else np.inf
    for i in range(start, start + (stop - start + LANES - 1) // LANES * LANES):
        slope, size = cross((dx[i], 0.0), ey, (dy[i], 0.0), ex)
        t = quotient(area, slope)[0]
        out[i] = t if abs(slope[0]) > least * size else np.nan


@inner
def _plain_area(ox: float, oy: float, wall: Wall) -> tuple[Double, bool]:
    """The area in double-double, and whether it is good to 70 bits."""
    ax = two_sum(wall.px, -ox)
    ay = two_sum(wall.py, -oy)
    ex, ey = edge_of(wall)
    area, size = cross(ax, ey, ay, ex)
    return area, abs(area[0]) > SAFE_CANCELLATION * size


@borrower
def plain_length(beam: Beam, wall: Wall) -> tuple[Double, bool]:
    """The t in double-double, and whether that is good enough to be used."""
    area, good = _plain_area(beam.ox, beam.oy, wall)
    ex, ey = edge_of(wall)
    slope, size = cross((beam.dx, 0.0), ey, (beam.dy, 0.0), ex)
    if not (good and abs(slope[0]) > SAFE_CANCELLATION * size):
        return (0.0, 0.0), False
    return quotient(area, slope), True


@inner
def precise_area(ox: float, oy: float, wall: Wall) -> float:
    """The area rounded to a float64, exact in its sign and good to 2⁻⁵² of its value."""
    area, good = _plain_area(ox, oy, wall)
    return area[0] if good else _rounded(_area(ox, oy, wall))[0]


@inner
def _on_one_line(wall: Wall, other: Wall) -> bool:
    """Whether two walls plainly lie on one line: the same ends, or upright or level alike."""
    px, py, qx, qy = wall
    rx, ry, sx, sy = other
    if (px == rx and py == ry and qx == sx and qy == sy) or (
        px == sx and py == sy and qx == rx and qy == ry
    ):
        return True
    return (px == qx and px == rx and px == sx) or (py == qy and py == ry and py == sy)


@inner
def _fraction(beam: Beam, wall: Wall) -> tuple[Exact, Exact]:
    """The t as the quotient, ≥ 0, of two expansions, the second positive."""
    ox, oy, dx, dy = beam
    px, py, qx, qy = wall
    above = _area(ox, oy, wall)
    below = _zero(9)
    if above.size != 0:
        below = _cross(below, dx, dy, wall)
    elif between(ox, oy, wall):
        below = _plus(below, 1.0)
    elif dx != 0.0:
        near = min(px, qx) if px > ox else max(px, qx)
        above = _plus(_plus(above, near), -ox)
        below = _plus(below, dx)
    else:
        near = min(py, qy) if py > oy else max(py, qy)
        above = _plus(_plus(above, near), -oy)
        below = _plus(below, dy)
    if _sign(below) < 0:
        for k in range(above.size):
            above.parts[k] = -above.parts[k]
        for k in range(below.size):
            below.parts[k] = -below.parts[k]
    return above, below


@inner
def _area(ox: float, oy: float, wall: Wall) -> Exact:
    """The area as an expansion of at most 16 parts."""
    area = _cross(_zero(17), wall.px - ox, wall.py - oy, wall)
    ax_low = two_sum(wall.px, -ox)[1]
    ay_low = two_sum(wall.py, -oy)[1]
    return _cross(area, ax_low, ay_low, wall) if ax_low != 0.0 or ay_low != 0.0 else area


@inner
def _cross(exact: Exact, dx: float, dy: float, wall: Wall) -> Exact:
    """Add d × (q − p) to an expansion, in place: at most 8 parts."""
    (ex, ex_low), (ey, ey_low) = edge_of(wall)
    exact = _plus_product(_plus_product(exact, dx, ey), -dy, ex)
    exact = _plus_product(exact, dx, ey_low) if ey_low != 0.0 else exact
    return _plus_product(exact, -dy, ex_low) if ex_low != 0.0 else exact


@inner
def _zero(room: int) -> Exact:
    """An expansion without parts, and with room for some."""
    return Exact(np.empty(room), 0)


@inner
def _plus(exact: Exact, value: float) -> Exact:
    """Add a float to an expansion, in place."""
    parts = exact.parts
    kept = 0
    carry = value
    for k in range(exact.size):
        carry, error = two_sum(carry, parts[k])
        if error != 0.0:
            parts[kept] = error
            kept += 1
    if carry != 0.0:
        parts[kept] = carry
        kept += 1
    return Exact(parts, kept)


@inner
def _plus_product(exact: Exact, a: float, b: float) -> Exact:
    """Add a · b to an expansion, in place."""
    product, error = two_product(a, b)
    return _plus(_plus(exact, error), product)


@inner
def _sign(exact: Exact) -> int:
    """Sign −1, 0 or 1 of an expansion: that of its largest part."""
    if exact.size == 0:
        return 0
    return 1 if exact.parts[exact.size - 1] > 0.0 else -1


@inner
def _rounded(exact: Exact) -> Double:
    """An expansion as a float and the rest of it, good to 2⁻¹⁰⁰ of the value."""
    rest = _zero(exact.size + 1)
    high = 0.0
    low = 0.0
    for k in range(exact.size):
        high += exact.parts[k]
        rest.parts[k] = exact.parts[k]
    rest = _plus(Exact(rest.parts, exact.size), -high)
    for k in range(rest.size):
        low += rest.parts[k]
    return high, low


@inner
def _sign_of_cross(a: Exact, b: Exact, c: Exact, d: Exact) -> int:
    """Sign of a · b − c · d."""
    total = _zero(2 * (a.size * b.size + c.size * d.size) + 1)
    for i in range(a.size):
        for j in range(b.size):
            total = _plus_product(total, a.parts[i], b.parts[j])
    for i in range(c.size):
        for j in range(d.size):
            total = _plus_product(total, -c.parts[i], d.parts[j])
    return _sign(total)


# The compiler must not contract or reorder what follows: nothing here may ever get ``fastmath``.


@inner
def two_sum(a: float, b: float) -> Double:
    """The sum a + b as the rounded sum and its exact error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@inner
def two_product(a: float, b: float) -> Double:
    """The product a · b as the rounded product and its exact error."""
    product = a * b
    cut = SPLITTER * a
    a_high = cut - (cut - a)
    a_low = a - a_high
    cut = SPLITTER * b
    b_high = cut - (cut - b)
    b_low = b - b_high
    error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    return product, error


@inner
def cross(a: Double, b: Double, c: Double, d: Double) -> tuple[Double, float]:
    """The value a·b − c·d, and |a·b| + |c·d|; it is off by 2⁻¹⁰² of that."""
    left, left_low = two_product(a[0], b[0])
    right, right_low = two_product(c[0], d[0])
    high, low = two_sum(left, -right)
    low += (left_low + (a[0] * b[1] + a[1] * b[0])) - (right_low + (c[0] * d[1] + c[1] * d[0]))
    total = high + low
    return (total, low - (total - high)), abs(left) + abs(right)


@inner
def quotient(a: Double, b: Double) -> Double:
    """A / b as a rounded float64 and the rest."""
    guess = a[0] / b[0]
    back, back_low = two_product(guess, b[0])
    rest = (((a[0] - back) - back_low) + (a[1] - guess * b[1])) / b[0]
    value = guess + rest
    return value, rest - (value - guess)
