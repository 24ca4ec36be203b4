"""The numbers that compiled casting is exact for, and rational casting for those it is not.

Error-free products must neither under- nor overflow. With coordinates that are 0 or of 1e-44 to
1e44 m, their differences are 0 or at least 1e-60 m, and all is well. Numbers beyond are no
places that anyone goes to, yet they have a range by its definition: rationals give it, slowly.
The same goes for range finders whose beams are turned by less than that, or that measure from so
near or so far on.
"""

import math

import numpy as np

from lrf3d.casting.exact import ExactWorld
from lrf3d.casting.kernels.scans import PlainLaser
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World

SMALLEST_NUMBER = 1e-44
"""Least size of a number, other than 0, that compiled casting takes [m], [rad]."""

LARGEST_NUMBER = 1e44
"""Largest size of a number that compiled casting takes [m]."""

BEYOND_WALLS = 1e50
"""A distance [m] that is beyond every wall that compiled casting takes."""


def laser_of(lrf: LaserRangeFinder) -> PlainLaser:
    """What kernels take of a range finder; no product with its range_max overflows."""
    return lrf.fan, *lrf.spread, float(lrf.range_min), float(min(lrf.range_max, BEYOND_WALLS))


class Rationals:
    """Casts by rationals where the numbers are beyond what compiled casting is exact for."""

    def __init__(self, world: World) -> None:
        self._world = world
        # Whether the walls themselves are beyond: then no scan can be compiled.
        self.everywhere = not bool(_inside(world.segments).all())

    def needed(self, lrf: LaserRangeFinder, x: float, y: float, theta: float) -> bool:
        """Whether a scan from this pose needs them; plain floats, since each scan asks."""
        return (
            self.for_all(lrf)
            or not (x == 0.0 or SMALLEST_NUMBER <= abs(x) <= LARGEST_NUMBER)
            or not (y == 0.0 or SMALLEST_NUMBER <= abs(y) <= LARGEST_NUMBER)
            or not (theta == 0.0 or abs(theta) >= SMALLEST_NUMBER)
        )

    def for_all(self, lrf: LaserRangeFinder) -> bool:
        """Whether all scans of a range finder need them."""
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

    def mend(self, lrf: LaserRangeFinder, poses: Float, ranges: Float, walls: Int) -> None:
        """Put the right ranges and walls (k, beams) into a batch from poses (k, 3).

        The walls may be empty where none are asked for.
        """
        beyond = ~_inside(poses).all(axis=1) | self.for_all(lrf)
        for k in np.flatnonzero(beyond).tolist():
            x, y, theta = poses[k].tolist()
            ranges[k], hit = self.cast(lrf, (x, y, theta))
            walls[k : k + 1] = hit


def _inside(values: Float) -> Bool:
    """Which numbers compiled casting takes."""
    size = np.abs(values)
    return np.asarray((size == 0.0) | ((size >= SMALLEST_NUMBER) & (size <= LARGEST_NUMBER)))
