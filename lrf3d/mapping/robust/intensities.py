"""Intensities: do those of a scan follow the laser equation, and how bright is what returned them?

The beams of a scan and the walls that it shows enter; the reflectance of each return leaves. Along
a diffuse wall the light of a beam falls with the cosine of the incidence and the square of the
range. Many devices report other numbers, from which nothing can be learnt about glass and mirrors.
"""

import warnings

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.errors import Lrf3dWarning
from lrf3d.geometry import Float
from lrf3d.mapping.robust.lit_scans import LIGHT, RANGE, UX, UY

ON_WALL = 0.1
"""[m] How far off a wall of the same scan a return of it lies at most."""

GRAZING = 0.1
"""[cosine] Beams at a smaller incidence are left out: the direction of a wall is not that well
known."""

LEAST_CHANGE = 0.2
"""[log] Two returns of a wall are compared if the laser equation has them differ by so much."""

LARGEST_MISFIT = 0.3
"""[share] By this part of the difference another one may deviate. Light that falls with the range
alone deviates by a third."""

LEAST_FITTING = 0.5
"""[share] Intensities are light if so many of the pairs fit: metal and glass never do."""

LEAST_PAIRS = 100
"""[pairs] … of at least so many."""

NO_LIGHT = (
    "intensities do not fall with range and incidence as light does: the map has no glass and no"
    " mirrors"
)


@compiled
def read_reflectance(rays: Float, walls: Float, reflectances: Float) -> tuple[int, int]:
    """Find the reflectance of each return, and how many pairs of returns fit the laser equation.

    Args:
        rays: (n, 7) the beams, see `lit_scans`.
        walls: (w, 4) the walls of the scan, around the laser [m].
        reflectances: (n,) is filled; NaN where a return lies on no wall.

    Returns:
        The number of pairs that fit, and that of all pairs.
    """
    fitting = pairs = 0
    expected, lights = np.empty(len(rays)), np.empty(len(rays))
    reflectances[:] = np.nan
    for row in range(len(walls)):
        x, y = walls[row, 0], walls[row, 1]
        dx, dy = walls[row, 2] - x, walls[row, 3] - y
        size = np.hypot(dx, dy)
        if size == 0.0:
            continue
        dx, dy = dx / size, dy / size
        count = 0
        for beam in range(len(rays)):
            reach, light = rays[beam, RANGE], rays[beam, LIGHT]
            if light <= 0.0:
                continue
            ux, uy = rays[beam, UX], rays[beam, UY]
            cos = abs(ux * dy - uy * dx)
            px, py = reach * ux - x, reach * uy - y
            along = px * dx + py * dy
            on = abs(py * dx - px * dy) < ON_WALL and -ON_WALL < along < size + ON_WALL
            if not on or cos < GRAZING:
                continue
            reflectances[beam] = light / cos
            expected[count] = np.log(cos / (reach * reach))
            lights[count] = np.log(light / (reach * reach))
            count += 1
        # Half of the wall apart: neighbours differ by too little.
        for first in range(count - count // 2):
            last = first + count // 2
            change = expected[last] - expected[first]
            if abs(change) > LEAST_CHANGE:
                misfit = abs(lights[last] - lights[first] - change)
                fitting += misfit < LARGEST_MISFIT * abs(change)
                pairs += 1
    return fitting, pairs


class LaserEquation:
    """Whether the intensities so far are light; a warning says so once if they are not."""

    def __init__(self) -> None:
        self.counts = np.zeros(2, np.int64)
        self._warned = False

    @property
    def fits(self) -> bool:
        """Whether enough returns were seen, and most of them fit."""
        fitting, pairs = self.counts.tolist()
        return pairs >= LEAST_PAIRS and fitting >= LEAST_FITTING * pairs

    def reflectances(self, rays: Float, walls: Float) -> Float:
        """The reflectance (n,) of each return of a scan, see `read_reflectance`."""
        found = np.empty(len(rays))
        self.counts = self.counts + read_reflectance(rays, walls, found)
        if not (self._warned or self.fits) and self.counts[1] >= LEAST_PAIRS:
            self._warned = True
            warnings.warn(NO_LIGHT, Lrf3dWarning, stacklevel=2)
        return found
