"""Rational references: what sums of float64 numbers truly are, and π to sixty digits."""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache

from lrf3d.geometry import Float

DIGITS = 60
"""Decimal digits of π: enough to wrap an angle of 1e30 rad."""

Matrix = list[list[Fraction]]


@cache
def pi() -> Fraction:
    """π, by Machin's formula: 16 arccot 5 − 4 arccot 239."""
    unit: int = 10 ** (DIGITS + 10)

    def arccot(x: int) -> int:
        term = total = unit // x
        power, sign = 3, -1
        while term:
            term //= x * x
            total += sign * (term // power)
            power, sign = power + 2, -sign
        return total

    return Fraction(16 * arccot(5) - 4 * arccot(239), unit)


def wrapped(angle: float) -> Fraction:
    """An angle brought into (−π, π]."""
    turn = 2 * pi()
    turns = math.ceil((Fraction(angle) - pi()) / turn)
    return Fraction(angle) - turns * turn


def fitted(
    points: Float, weights: Iterable[float] | None = None
) -> tuple[Fraction, Fraction, float]:
    """The mean x and y of points (n, 2) and the angle [rad] of the line of total least squares."""
    x, y = ([Fraction(value) for value in column] for column in points.T.tolist())
    w = [Fraction(1)] * len(x) if weights is None else [Fraction(value) for value in weights]
    total = sum(w, Fraction())
    mx = sum((a * b for a, b in zip(w, x, strict=True)), Fraction()) / total
    my = sum((a * b for a, b in zip(w, y, strict=True)), Fraction()) / total
    xx = sum((a * (b - mx) ** 2 for a, b in zip(w, x, strict=True)), Fraction())
    yy = sum((a * (b - my) ** 2 for a, b in zip(w, y, strict=True)), Fraction())
    xy = sum((a * (b - mx) * (c - my) for a, b, c in zip(w, x, y, strict=True)), Fraction())
    return mx, my, 0.5 * math.atan2(2 * xy, xx - yy)


def matrix(values: Float) -> Matrix:
    """A matrix of float64 numbers as rationals."""
    return [[Fraction(value) for value in row] for row in values.tolist()]


def times(one: Matrix, other: Matrix) -> Matrix:
    """The product of two matrices."""
    columns = list(zip(*other, strict=True))
    return [[_dot(row, column) for column in columns] for row in one]


def transposed(one: Matrix) -> Matrix:
    """A matrix turned over."""
    return [list(column) for column in zip(*one, strict=True)]


def plus(one: Matrix, other: Matrix, sign: int = 1) -> Matrix:
    """The sum of two matrices, or with −1 their difference."""
    return [
        [a + sign * b for a, b in zip(row, line, strict=True)]
        for row, line in zip(one, other, strict=True)
    ]


def solved(left: Matrix, right: Matrix) -> Matrix:
    """X in left · X = right, by Gauss's elimination; `left` is not singular."""
    rows = [[*a, *b] for a, b in zip(left, right, strict=True)]
    count = len(rows)
    for k in range(count):
        pivot = next(row for row in range(k, count) if rows[row][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for row in range(count):
            if row != k and rows[row][k]:
                factor = rows[row][k]
                rows[row] = [a - factor * b for a, b in zip(rows[row], rows[k], strict=True)]
    return [row[count:] for row in rows]


def _dot(one: Sequence[Fraction], other: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, other, strict=True)), Fraction())
