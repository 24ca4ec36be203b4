"""What beams hit, known for certain or not at all, compiled: a proof that shares no caster's code.

In go walls, origins and directions as they are in float64; out comes for each beam its nearest
wall and t as a double-double with a bound on its error, or UNDECIDED. Nothing is ever guessed:
where a bound does not settle a question the beam stays undecided, and rationals have the word.

With u = 2⁻⁵³, a = p − o, b = q − o, e = q − p for a wall from p to q:

- *Plain sign of d × a = dx·ay − dy·ax.* Each term is rounded twice (difference, product) and their
  difference once, so the error is at most γ₃ (|dx·ay| + |dy·ax|) with γₖ = k·u / (1 − k·u) (Higham,
  "Accuracy and Stability of Numerical Algorithms", lemma 3.1); in terms of the computed products
  3u + O(u²), as in Shewchuk's `ccwerrboundA` ("Adaptive precision floating-point arithmetic",
  1997, section 4.3). PLAIN = 4u covers it. The same holds for d · a.
- *Double-double.* two_sum gives a and e exactly, each as two floats (Knuth), two_product a product
  (Dekker). With S = |dx·ay| + |dy·ax|, a cross product of a single and a double-double vector loses
  3 u²S where low parts join the products, 2 u²S in their difference and 3 u²S where that joins the
  high one: 8 u²S, below SINGLE = 16 u². With low parts on both sides it is 8 + 3 + 4 = 15 u²S,
  below BOTH = 32 u²; so the room covers that S itself is computed.
- *Quotient.* One step of correction leaves 13 u² in the remainder, 5 u² in its division and 5 u²
  for dividing by the high part alone: below QUOTIENT = 32 u². The relative errors of t's numerator
  and denominator add to it; while they are below LOOSE, second-order terms are below 1 %.
- *Where t can lie.* A point x of the wall with x = o + t·d has t·|d|² = d·(x − o), between d·a and
  d·b. Directions are unit vectors to within UNIT. So every wall, decided or not, has a least t.

All of this asks that no product under- or overflows: coordinates and their differences are 0, or
of 1e-60 to 1e60.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int

UNIT_ROUNDOFF = 2.0**-53
PLAIN = 4.0 * UNIT_ROUNDOFF
SINGLE = 16.0 * UNIT_ROUNDOFF**2
BOTH = 32.0 * UNIT_ROUNDOFF**2
QUOTIENT = 32.0 * UNIT_ROUNDOFF**2

LOOSE = 2.0**-20
"""Relative error of a numerator or denominator from which on t counts as unknown."""

FINE = 2.0**-60
"""Relative error of t from which on it is too coarse to measure ranges by: 1/128 ulp."""

UNIT = 1e-14
"""By how much |d|² may differ from 1: cosines, sines and the turn of a fan round a dozen times."""

UNDECIDED = -2
"""Stands for the wall of a beam that the bounds do not settle."""

MISS, HIT, UNSURE = 0, 1, 2

Four = tuple[float, float, float, float]
"""A beam ox oy dx dy, the ends px py qx qy of a wall, or a vector of two double-doubles."""


@compiled
def certify(
    walls: Float,
    origins: Float,
    directions: Float,
    limits: tuple[float, float],
    hit: Int,
    high: Float,
    low: Float,
    slack: Float,
) -> None:
    """Fill in what each beam is certain to hit.

    Args:
        walls: (n, 4) ends of the walls [m].
        origins: (k, 2) where the beams start [m].
        directions: (k, beams, 2) unit vectors.
        limits: Nearest and farthest distance that count [m].
        hit: (k, beams) the wall with the least t, of equal ones the first; −1 for no range, with
            +inf or −inf in `high`; UNDECIDED.
        high: (k, beams) t rounded to a float64.
        low: (k, beams) what is missing to t.
        slack: (k, beams) bound on the error of high + low.
    """
    for k in range(origins.shape[0]):
        for i in range(directions.shape[1]):
            beam = (origins[k, 0], origins[k, 1], directions[k, i, 0], directions[k, i, 1])
            wall, t, rest, error = _nearest(walls, beam, limits[1])
            hit[k, i], high[k, i], low[k, i], slack[k, i] = _limited(
                wall, t, rest, error, limits[0], limits[1]
            )


@inner
def _limited(
    wall: int, t: float, rest: float, error: float, range_min: float, range_max: float
) -> tuple[int, float, float, float]:
    """The same within the limits of the range finder, or undecided."""
    if wall == UNDECIDED:
        return UNDECIDED, np.nan, 0.0, 0.0
    if wall < 0:
        return -1, np.inf, 0.0, 0.0
    over = (t - range_max) + rest
    under = (t - range_min) + rest
    # Twice the bound takes in the rounding of these two differences.
    if not (error < FINE * t and abs(over) > 2.0 * error and abs(under) > 2.0 * error):
        return UNDECIDED, np.nan, 0.0, 0.0
    if over > 0.0:
        return -1, np.inf, 0.0, 0.0
    if under < 0.0:
        return -1, -np.inf, 0.0, 0.0
    return wall, t, rest, error


@inner
def _nearest(walls: Float, beam: Four, range_max: float) -> tuple[int, float, float, float]:
    """The wall with the least t, t, the rest of it and the error; −1 or UNDECIDED for the wall."""
    best, t, rest, error = -1, range_max, 0.0, UNIT * range_max
    doubt = np.inf
    for wall in range(len(walls)):
        ends = (walls[wall, 0], walls[wall, 1], walls[wall, 2], walls[wall, 3])
        kind, near = _glance(beam, ends)
        if kind == MISS or near > (t + 2.0 * error) * (1.0 + UNIT):
            continue
        kind, found, found_rest, found_error = _look(beam, ends)
        if kind == MISS:
            continue
        if kind == UNSURE:
            doubt = min(doubt, near)
            continue
        if best >= 0:
            ahead = (t - found) + (rest - found_rest)
            if ahead < -2.0 * (error + found_error) or _alike(walls, wall, best):
                continue
            if not ahead > 2.0 * (error + found_error):
                doubt = min(doubt, t - 2.0 * error, found - 2.0 * found_error)
                continue
        best, t, rest, error = wall, found, found_rest, found_error
    # A wall in doubt is no matter where another is certainly nearer, or the range ends before.
    if doubt <= (t + 2.0 * error) * (1.0 + UNIT):
        return UNDECIDED, 0.0, 0.0, 0.0
    return best, t, rest, error


@inner
def _alike(walls: Float, one: int, other: int) -> bool:
    """Whether two walls are the same set of points, so that every t is the same."""
    a, b = walls[one], walls[other]
    same = a[0] == b[0] and a[1] == b[1] and a[2] == b[2] and a[3] == b[3]
    return bool(same or (a[0] == b[2] and a[1] == b[3] and a[2] == b[0] and a[3] == b[1]))


@inner
def _glance(beam: Four, ends: Four) -> tuple[int, float]:
    """In plain float64: MISS, or UNSURE and the least t that a point of the wall can have."""
    (ox, oy, dx, dy), (px, py, qx, qy) = beam, ends
    ax, ay, bx, by = px - ox, py - oy, qx - ox, qy - oy
    side_p, room_p = dx * ay - dy * ax, PLAIN * (abs(dx * ay) + abs(dy * ax))
    side_q, room_q = dx * by - dy * bx, PLAIN * (abs(dx * by) + abs(dy * bx))
    if (side_p > room_p and side_q > room_q) or (side_p < -room_p and side_q < -room_q):
        return MISS, 0.0
    ahead_p, slip_p = dx * ax + dy * ay, PLAIN * (abs(dx * ax) + abs(dy * ay))
    ahead_q, slip_q = dx * bx + dy * by, PLAIN * (abs(dx * bx) + abs(dy * by))
    if ahead_p < -slip_p and ahead_q < -slip_q:
        return MISS, 0.0
    return UNSURE, min(ahead_p - slip_p, ahead_q - slip_q) * (1.0 - UNIT)


@inner
def _look(beam: Four, ends: Four) -> tuple[int, float, float, float]:
    """In double-double: MISS, or HIT with t, its rest and its error, or UNSURE."""
    (ox, oy, dx, dy), (px, py, qx, qy) = beam, ends
    ax, ax_low = _sum(px, -ox)
    ay, ay_low = _sum(py, -oy)
    bx, bx_low = _sum(qx, -ox)
    by, by_low = _sum(qy, -oy)
    side_p, _, room_p = _cross((dx, 0.0, dy, 0.0), (ax, ax_low, ay, ay_low), SINGLE)
    side_q, _, room_q = _cross((dx, 0.0, dy, 0.0), (bx, bx_low, by, by_low), SINGLE)
    if not (abs(side_p) > room_p and abs(side_q) > room_q):
        return UNSURE, 0.0, 0.0, 0.0
    if (side_p > 0.0) == (side_q > 0.0):
        return MISS, 0.0, 0.0, 0.0
    ex, ex_low = _sum(qx, -px)
    ey, ey_low = _sum(qy, -py)
    area, area_low, area_room = _cross((ax, ax_low, ay, ay_low), (ex, ex_low, ey, ey_low), BOTH)
    slope, slope_low, slope_room = _cross((dx, 0.0, dy, 0.0), (ex, ex_low, ey, ey_low), SINGLE)
    if not abs(area) > area_room:
        return UNSURE, 0.0, 0.0, 0.0
    # The beam's line crosses the wall; its sense there is the sign of d × e = d × b − d × a.
    if (area > 0.0) != (side_q > 0.0):
        return MISS, 0.0, 0.0, 0.0
    if not (area_room < LOOSE * abs(area) and slope_room < LOOSE * abs(slope)):
        return UNSURE, 0.0, 0.0, 0.0
    t, rest = _quotient(area, area_low, slope, slope_low)
    relative = 1.01 * (area_room / abs(area) + slope_room / abs(slope) + QUOTIENT)
    return HIT, t, rest, relative * t


@inner
def _cross(one: Four, other: Four, bound: float) -> tuple[float, float, float]:
    """The value x·w − y·v of double-doubles: rounded, the rest, and the room for its error."""
    (x, x_low, y, y_low), (v, v_low, w, w_low) = one, other
    left, left_low = _product(x, w)
    right, right_low = _product(y, v)
    value, rest = _sum(left, -right)
    left_low += x * w_low + x_low * w
    right_low += y * v_low + y_low * v
    high, low = _sum(value, rest + (left_low - right_low))
    return high, low, bound * (abs(left) + abs(right))


@inner
def _quotient(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """A / b of double-doubles as a rounded float64 and the rest."""
    guess = a / b
    back, back_low = _product(guess, b)
    remainder = (((a - back) - back_low) + a_low) - guess * b_low
    return _sum(guess, remainder / b)


@inner
def _sum(a: float, b: float) -> tuple[float, float]:
    """The rounded a + b and its error, exactly, whichever is the larger (Knuth)."""
    total = a + b
    b_part = total - a
    a_part = total - b_part
    return total, (a - a_part) + (b - b_part)


@inner
def _product(a: float, b: float) -> tuple[float, float]:
    """The rounded a · b and its error, exactly (Dekker, with Veltkamp's halves)."""
    product = a * b
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    rest = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return product, rest


@inner
def _halves(a: float) -> tuple[float, float]:
    """A float64 as the sum of two floats of 26 bits."""
    shifted = 134217729.0 * a
    high = shifted - (shifted - a)
    return high, a - high
