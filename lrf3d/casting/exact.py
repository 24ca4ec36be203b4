"""The range of a beam as a rational number: the definition that casters are measured against.

Float64 numbers are fractions whose denominator is a power of two, so for every world and beam the
least t ≥ 0 with o + t·d on a wall is a fraction, too. It is computed here without any rounding.
That is slow: this is the reference for the casters.

Compiled casting is exact as long as its error-free products neither under- nor overflow. With
coordinates that are 0 or of 1e-44 to 1e44 m, their differences are 0 or at least 1e-60 m, and they
do not. Scans with other numbers have ranges as well, by definition: `RationalCaster` computes them.
The same holds for range finders whose beams are turned by less than that, or whose range_min is
beyond it.
"""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World

SMALLEST_NUMBER = 1e-44
"""Smallest size of a nonzero number that compiled casting accepts [m], [rad]."""

LARGEST_NUMBER = 1e44
"""Largest size of a number that compiled casting accepts [m]."""


class ExactWorld:
    """Walls and laser positions on one integer grid, so that beams are cast in integers.

    Args:
        segments: (n, 4) ends x1 y1 x2 y2 of the walls.
        origins: (k, 2) origins of the beams.
    """

    def __init__(self, segments: Float, origins: Sequence[Sequence[float]]) -> None:
        flat = [float(value) for row in segments for value in row]
        places = [float(value) for row in origins for value in row[:2]]
        whole, self.unit = integers(flat + places)
        count = len(flat) // 4
        self.walls = [tuple(whole[4 * i : 4 * i + 4]) for i in range(count)]
        self.origins = [
            (whole[4 * count + 2 * i], whole[4 * count + 2 * i + 1])
            for i in range(len(places) // 2)
        ]

    def hits(self, origin: int, direction: Sequence[float]) -> list[tuple[int, Fraction]]:
        """Every wall (index, t) that the beam from one of the origins meets."""
        (dx, dy), unit = integers(direction)
        x, y = self.origins[origin]
        found = []
        for wall, (x1, y1, x2, y2) in enumerate(self.walls):
            t = _meet(x1 - x, y1 - y, x2 - x, y2 - y, dx, dy)
            if t is not None:
                found.append((wall, Fraction(t[0] * unit, t[1] * self.unit)))
        return found

    def cast(self, origin: int, direction: Sequence[float]) -> tuple[int, Fraction | None]:
        """The nearest wall and t of a beam from one of the origins; −1 and None for a miss."""
        found = self.hits(origin, direction)
        if not found:
            return -1, None
        return min(found, key=lambda hit: (hit[1], hit[0]))


def integers(values: Iterable[float]) -> tuple[list[int], int]:
    """Values as integers over one common denominator, a power of two."""
    ratios = [float(value).as_integer_ratio() for value in values]
    unit = max((below for _, below in ratios), default=1)
    return [above * (unit // below) for above, below in ratios], unit


def _meet(ax: int, ay: int, bx: int, by: int, dx: int, dy: int) -> tuple[int, int] | None:
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


class RationalCaster:
    """Casts by rationals the scans whose numbers are beyond what compiled casting is exact for."""

    def __init__(self, world: World) -> None:
        self._world = world
        # Where the walls themselves are beyond it, no scan can be cast by compiled code.
        self.everywhere = not bool(_inside(world.segments).all())

    def needed(self, x: float, y: float, theta: float) -> bool:
        """Whether a pose needs rationals; plain floats keep this check fast."""
        return (
            not (x == 0.0 or SMALLEST_NUMBER <= abs(x) <= LARGEST_NUMBER)
            or not (y == 0.0 or SMALLEST_NUMBER <= abs(y) <= LARGEST_NUMBER)
            or not (theta == 0.0 or abs(theta) >= SMALLEST_NUMBER)
        )

    def all_needed(self, poses: Float) -> Bool:
        """Which of the poses (k, 3) need rationals."""
        return np.asarray(~_inside(poses).all(axis=1))

    def for_all(self, lrf: LaserRangeFinder) -> bool:
        """Whether all scans of a range finder need rationals."""
        return (
            self.everywhere or lrf.least_number < SMALLEST_NUMBER or lrf.range_min > LARGEST_NUMBER
        )

    def cast(self, lrf: LaserRangeFinder, pose: tuple[float, float, float]) -> tuple[Float, Int]:
        """Ranges and walls (beams,) of the scan from a pose."""
        tall = np.flatnonzero(self._world.heights >= lrf.height)
        exact = ExactWorld(self._world.segments[tall], [pose[:2]])
        ranges, walls = np.full(lrf.beams, np.inf), np.full(lrf.beams, -1)
        for beam, direction in enumerate(lrf.directions(pose)):
            row, distance = exact.cast(0, direction)
            if distance is None or distance > lrf.range_max:
                continue
            if distance < lrf.range_min:
                ranges[beam] = -math.inf
                continue
            ranges[beam], walls[beam] = float(distance), tall[row]
        return ranges, walls

    def correct(self, lrf: LaserRangeFinder, poses: Float, ranges: Float, walls: Int) -> None:
        """Cast the scans of a batch that need rationals, and put their ranges and walls into it.

        The walls are left out if the array is empty.
        """
        for k in np.flatnonzero(self.all_needed(poses) | self.for_all(lrf)).tolist():
            x, y, theta = poses[k].tolist()
            ranges[k], hit = self.cast(lrf, (x, y, theta))
            walls[k : k + 1] = hit


def _inside(values: Float) -> Bool:
    """Which numbers compiled casting accepts."""
    size = np.abs(values)
    return np.asarray((size == 0.0) | ((size >= SMALLEST_NUMBER) & (size <= LARGEST_NUMBER)))
