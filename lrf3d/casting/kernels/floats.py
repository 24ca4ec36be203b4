"""Float64 arithmetic with its rounding errors, compiled: error-free sums and products.

T. J. Dekker, "A floating-point technique for extending the available precision", 1971;
J. R. Shewchuk, "Adaptive precision floating-point arithmetic", 1997. An expansion is an array of
floats, smallest first, that do not overlap; its value is their exact sum. Everything holds as
long as no product under- or overflows: coordinates and their differences of 1e-60 to 1e60.
A double-double is a float64 and its rounding error, together good to 100 bits; sums of products
lose as many bits as cancel.

The compiler must not contract or reorder: none of these functions may ever get ``fastmath``.
"""

import numpy as np

from lrf3d.compiling import inner
from lrf3d.geometry import Float

SPLITTER = 134217729.0
"""2²⁷ + 1: multiplying by it cuts a float64 into two halves of 26 bits."""


@inner
def two_sum(a: float, b: float) -> tuple[float, float]:
    """The sum a + b as the rounded sum and its exact error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@inner
def two_product(a: float, b: float) -> tuple[float, float]:
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
def add_float(expansion: Float, count: int, value: float) -> int:
    """Add a float to the first `count` parts of an expansion, in place; the new count."""
    kept = 0
    carry = value
    for k in range(count):
        carry, error = two_sum(carry, expansion[k])
        if error != 0.0:
            expansion[kept] = error
            kept += 1
    if carry != 0.0:
        expansion[kept] = carry
        kept += 1
    return kept


@inner
def add_product(expansion: Float, count: int, a: float, b: float) -> int:
    """Add a · b to an expansion, in place; the new count."""
    product, error = two_product(a, b)
    count = add_float(expansion, count, error)
    return add_float(expansion, count, product)


@inner
def sign(expansion: Float, count: int) -> int:
    """Sign −1, 0 or 1 of an expansion: that of its largest part."""
    if count == 0:
        return 0
    return 1 if expansion[count - 1] > 0.0 else -1


@inner
def rounded(expansion: Float, count: int) -> tuple[float, float]:
    """An expansion as a float and the rest of it, good to 2⁻¹⁰⁰ of the value."""
    high = 0.0
    for k in range(count):
        high += expansion[k]
    rest = np.empty(count + 1)
    for k in range(count):
        rest[k] = expansion[k]
    left = add_float(rest, count, -high)
    low = 0.0
    for k in range(left):
        low += rest[k]
    return high, low


@inner
def sign_of_cross_products(
    a: Float, a_count: int, b: Float, b_count: int, c: Float, c_count: int, d: Float, d_count: int
) -> int:
    """Sign of a · b − c · d for four expansions."""
    total = np.empty(2 * (a_count * b_count + c_count * d_count) + 1)
    count = 0
    for i in range(a_count):
        for j in range(b_count):
            count = add_product(total, count, a[i], b[j])
    for i in range(c_count):
        for j in range(d_count):
            count = add_product(total, count, -c[i], d[j])
    return sign(total, count)


@inner
def cross(
    a: float, a_low: float, b: float, b_low: float, c: float, c_low: float, d: float, d_low: float
) -> tuple[float, float, float]:
    """The value a·b − c·d: rounded, the rest, and |a·b| + |c·d|; off by 2⁻¹⁰² of that."""
    left, left_low = two_product(a, b)
    right, right_low = two_product(c, d)
    high, low = two_sum(left, -right)
    low += (left_low + (a * b_low + a_low * b)) - (right_low + (c * d_low + c_low * d))
    total = high + low
    return total, low - (total - high), abs(left) + abs(right)


@inner
def quotient(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """A / b of double-doubles as a rounded float64 and the rest."""
    guess = a / b
    back, back_low = two_product(guess, b)
    rest = (((a - back) - back_low) + (a_low - guess * b_low)) / b
    value = guess + rest
    return value, rest - (value - guess)
