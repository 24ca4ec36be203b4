"""Beams by rational numbers: the definition of a range, which casters are measured against.

Float64 numbers are fractions whose denominator is a power of two, so for every world and beam the
least t ≥ 0 with o + t·d on a wall is a fraction, too. It is computed without any rounding.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction

from lrf3d.geometry.lines import Float


class ExactWorld:
    """Walls (n, 4) and origins (k, 2) of beams on one integer grid: beams are cast in integers."""

    def __init__(self, segments: Float, origins: Sequence[Sequence[float]] | Float) -> None:
        flat = [float(value) for row in segments for value in row]
        places = [float(value) for row in origins for value in row[:2]]
        whole, self.unit = integers(flat + places)
        count = len(flat) // 4
        self.walls = [tuple(whole[4 * i : 4 * i + 4]) for i in range(count)]
        self.origins = [
            (whole[4 * count + 2 * i], whole[4 * count + 2 * i + 1])
            for i in range(len(places) // 2)
        ]

    def hits(self, origin: int, direction: Sequence[float] | Float) -> list[tuple[int, Fraction]]:
        """Every wall (index, t) that the beam from one of the origins meets."""
        (dx, dy), unit = integers(direction)
        x, y = self.origins[origin]
        found = []
        for wall, (x1, y1, x2, y2) in enumerate(self.walls):
            t = meet(x1 - x, y1 - y, x2 - x, y2 - y, dx, dy)
            if t is not None:
                found.append((wall, Fraction(t[0] * unit, t[1] * self.unit)))
        return found

    def cast(self, origin: int, direction: Sequence[float] | Float) -> tuple[int, Fraction | None]:
        """The nearest wall and t of a beam, of equal t the first wall; −1 and None for a miss."""
        (dx, dy), unit = integers(direction)
        x, y = self.origins[origin]
        wall, above, below = -1, 0, 0
        for number, (x1, y1, x2, y2) in enumerate(self.walls):
            t = meet(x1 - x, y1 - y, x2 - x, y2 - y, dx, dy)
            if t is not None and (wall < 0 or t[0] * below < above * t[1]):
                wall, (above, below) = number, t
        return wall, None if wall < 0 else Fraction(above * unit, below * self.unit)


def cast_exact(
    segments: Float, origin: Sequence[float] | Float, direction: Sequence[float] | Float
) -> tuple[int, Fraction | None]:
    """Cast one beam against segments (n, 4)."""
    return ExactWorld(segments, [list(origin)]).cast(0, direction)


def integers(values: Iterable[float]) -> tuple[list[int], int]:
    """Values as integers over one common denominator, a power of two."""
    ratios = [float(value).as_integer_ratio() for value in values]
    unit = max((below for _, below in ratios), default=1)
    return [above * (unit // below) for above, below in ratios], unit


def meet(ax: int, ay: int, bx: int, by: int, dx: int, dy: int) -> tuple[int, int] | None:
    """Least t ≥ 0, as numerator and denominator > 0, with t·d on the segment from a to b."""
    area = ax * by - ay * bx
    if area == 0:
        return _meet_in_line(ax, ay, bx, by, dx, dy)
    side_a = dx * ay - dy * ax
    side_b = dx * by - dy * bx
    if area < 0:
        area, side_a, side_b = -area, -side_a, -side_b
    # Seen from the origin, b is counter-clockwise of a by less than half a turn. So the beam meets
    # the segment if and only if a is not on its left and b is not on its right.
    if side_a > 0 or side_b < 0:
        return None
    return area, side_b - side_a


def _meet_in_line(ax: int, ay: int, bx: int, by: int, dx: int, dy: int) -> tuple[int, int] | None:
    """The same for a segment whose line goes through the origin."""
    if ax * bx + ay * by <= 0:
        return 0, 1
    if dx * ay != dy * ax or dx * ax + dy * ay < 0:
        return None
    above_a, above_b, below = (ax, bx, dx) if dx else (ay, by, dy)
    return min(abs(above_a), abs(above_b)), abs(below)


def cast_layer(
    walls: Sequence[tuple[Sequence[float], float]],
    tops: Sequence[tuple[Sequence[Sequence[float]], float]],
    place: Sequence[float],
    beam: Sequence[float],
) -> Fraction | None:
    """The least t at which a beam x, y, rise from a place x, y, z meets walls, tops or the floor.

    Walls are their ends and heights, tops their corners and heights.
    """
    x, y, z = map(Fraction, place)
    dx, dy, rise = map(Fraction, beam)
    found = [-z / rise] if rise < 0 else []
    for ends, height in walls:
        ax, ay, bx, by = map(Fraction, ends)
        for begin, end in _stretch(ax - x, ay - y, bx - x, by - y, dx, dy):
            high = Fraction(height) - z
            # On a wall along the beam it comes down to the top between the two ends.
            if rise < 0 and begin * rise > high:
                begin = max(begin, high / rise)
            if begin <= end and -z <= begin * rise <= high:
                found.append(begin)
    for corners, height in tops:
        drop = Fraction(height) - z
        if rise < 0 and drop < 0:
            t = drop / rise
            if _inside(x + t * dx, y + t * dy, [(Fraction(a), Fraction(b)) for a, b in corners]):
                found.append(t)
    return min(found, default=None)


def _stretch(
    ax: Fraction, ay: Fraction, bx: Fraction, by: Fraction, dx: Fraction, dy: Fraction
) -> list[tuple[Fraction, Fraction]]:
    """From which t ≥ 0 to which a beam is on the segment from a to b."""
    slope = dx * (by - ay) - dy * (bx - ax)
    if slope != 0:
        t = (ax * by - ay * bx) / slope
        share = (ax * dy - ay * dx) / slope
        return [(t, t)] if t >= 0 and 0 <= share <= 1 else []
    if dx * ay != dy * ax:
        return []
    size = dx * dx + dy * dy
    low, high = sorted(((ax * dx + ay * dy) / size, (bx * dx + by * dy) / size))
    return [(max(low, Fraction(0)), high)] if high >= 0 else []


def _inside(x: Fraction, y: Fraction, corners: list[tuple[Fraction, Fraction]]) -> bool:
    """Whether a place is in a polygon; on its boundary either answer."""
    inside = False
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside
