"""Lengths of beams in double-double, compiled: good to 65 bits, and aware of where they are not.

A double-double is a float64 and its rounding error, together good to 100 bits; sums of products
lose as many bits as cancel.
"""

import numpy as np

from lrf3d.casting.kernels.compiling import inner
from lrf3d.casting.kernels.floats import two_product, two_sum

SAFE_CANCELLATION = 2.0**-32
"""Least |a·b − c·d| / (|a·b| + |c·d|) at which double-double still gives 70 good bits."""

LANES = 4
"""Float64 numbers that a vector register holds."""

DOUBLE_DOUBLE = 2.0**-65
"""Bound on the relative error of a quotient of two such double-doubles, generously."""


@inner
def lengths(ox, oy, dx, dy, px, py, qx, qy, start, stop, out):
    """The t of a wall that the beams from start to before stop meet, NaN where this falls short.

    Whole vectors are computed: up to LANES − 1 numbers after stop are overwritten.
    """
    area, area_low, good = wall_area(ox, oy, px, py, qx, qy)
    ex, ex_low = two_sum(qx, -px)
    ey, ey_low = two_sum(qy, -py)
    least = SAFE_CANCELLATION if good else np.inf
    xs, ys, ts = dx[start:], dy[start:], out[start:]
    for i in range((stop - start + LANES - 1) // LANES * LANES):
        slope, slope_low, size = cross(xs[i], 0.0, ey, ey_low, ys[i], 0.0, ex, ex_low)
        t = quotient(area, area_low, slope, slope_low)[0]
        ts[i] = t if abs(slope) > least * size else np.nan


@inner
def cross(a, a_low, b, b_low, c, c_low, d, d_low):
    """The value a·b − c·d: rounded, the rest, and |a·b| + |c·d|; off by 2⁻¹⁰² of that."""
    left, left_low = two_product(a, b)
    right, right_low = two_product(c, d)
    high, low = two_sum(left, -right)
    low += (left_low + (a * b_low + a_low * b)) - (right_low + (c * d_low + c_low * d))
    total = high + low
    return total, low - (total - high), abs(left) + abs(right)


@inner
def quotient(a, a_low, b, b_low):
    """A / b of double-doubles as a rounded float64 and the rest."""
    guess = a / b
    back, back_low = two_product(guess, b)
    rest = (((a - back) - back_low) + (a_low - guess * b_low)) / b
    value = guess + rest
    return value, rest - (value - guess)


@inner
def wall_area(ox, oy, px, py, qx, qy):
    """The area as value, rest, and whether both together are good to 70 bits."""
    ax, ax_low = two_sum(px, -ox)
    ay, ay_low = two_sum(py, -oy)
    ex, ex_low = two_sum(qx, -px)
    ey, ey_low = two_sum(qy, -py)
    high, low, size = cross(ax, ax_low, ey, ey_low, ay, ay_low, ex, ex_low)
    return high, low, abs(high) > SAFE_CANCELLATION * size


@inner
def plain_length(ox, oy, dx, dy, px, py, qx, qy):
    """The t in double-double, and whether that is good enough to be used."""
    area, area_low, good = wall_area(ox, oy, px, py, qx, qy)
    ex, ex_low = two_sum(qx, -px)
    ey, ey_low = two_sum(qy, -py)
    slope, slope_low, size = cross(dx, 0.0, ey, ey_low, dy, 0.0, ex, ex_low)
    good = good and abs(slope) > SAFE_CANCELLATION * size
    if not good:
        return 0.0, 0.0, False
    value, low = quotient(area, area_low, slope, slope_low)
    return value, low, True
