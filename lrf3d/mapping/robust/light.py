"""Light: scans with their intensities, of which the last ones are kept.

Do the intensities of a scan follow the laser equation, and how reflective is what returned them?
Along a diffuse wall the light of a beam falls with the cosine of the incidence and the square of
the range. Many devices report other numbers, from which nothing can be learnt about glass and
mirrors.
"""

import warnings

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.errors import Lrf3dWarning
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.robust.beams import Beams

UX, UY, RANGE, FREE, DEVIATION, BRIGHT, REFLECTANCE, TURN, KIND = range(9)
"""Columns of kept rays: the unit vector of each beam; its range [m], 0 where nothing returned; how
far it is free at least [m]; the standard deviation of the range [m]; the light of the return as if
from 1 m, compared with the usual one; how reflective the wall is that it is on, 0 where it is on
none; how far it goes to the first known glass or mirror [m]; and what its return shows, see
`ground`."""

MOST_SCANS = 160
"""[scans] So many are kept: of a drive at least the last 80 m. What mirrors showed before stays."""

LEAST_WAY, LEAST_TURN = 0.5, 0.5
"""[m, rad] A scan is kept if the robot has moved or turned by so much since the last one."""

USUAL_SHARE = 0.7
"""[share] The usual light of a scan's returns is that which so many have at most: next to a front
of glass most are dim."""

ON_WALL = 0.1
"""[m] How far off a wall of the same scan a return of it lies at most."""

WEAKEST_COSINE = 0.1
"""[cosine] Beams at a smaller incidence are left out: the direction of a wall is not that well
known."""

LEAST_CHANGE = 0.2
"""[log] Two returns of a wall are compared if the laser equation has them differ by so much."""

LARGEST_MISFIT = 0.3
"""[share] By this part of the difference another one may deviate. Light that falls with the range
alone deviates by a third."""

LEAST_FITTING, LEAST_PAIRS = 0.5, 100
"""[share, pairs] Intensities are light if so many of at least so many pairs fit: metal and glass
never do."""

NO_LIGHT = (
    "intensities do not fall with range and incidence as light does: the map has no glass and no"
    " mirrors"
)


class LitScans:
    """The last kept scans: their places (k, 2) [m], and rays (k, n, 9) by rising angle.

    `reflectances` (w,) are those of the walls of the newest, 0 where they are not known.
    """

    def __init__(self) -> None:
        self.reflectances = np.empty(0)
        self._places, self._rays = np.zeros((MOST_SCANS, 2)), np.zeros((MOST_SCANS, 9, 0))
        self._last, self._usual = np.full(3, np.inf), 0.0
        self._fitting = self._pairs = 0
        self._warned = False
        self.count = 0

    def rows(self, newest: bool) -> tuple[Float, Float]:
        """Places and rays of all kept scans, or of the newest alone."""
        last = (self.count - 1) % MOST_SCANS
        rows = slice(last, last + 1) if newest else slice(0, self.count)
        # Each column lies together: most rays do not reach what is looked at.
        return self._places[rows], self._rays[rows].transpose(0, 2, 1)

    @property
    def are_light(self) -> bool:
        """Whether enough returns were seen, and most of them follow the laser equation."""
        return self._pairs >= LEAST_PAIRS and self._fitting >= LEAST_FITTING * self._pairs

    def keep(
        self, scan: LaserScan, pose: tuple[float, float, float], noise: RangeNoise, walls: Float
    ) -> bool:
        """Keep a scan with its walls (w, 4) around the laser in place of the oldest.

        Not if it has no light, or the robot stands nearly where it did.
        """
        off = np.abs(np.array(pose) - self._last)
        if scan.intensities is None or (np.hypot(*off[:2]) <= LEAST_WAY and off[2] <= LEAST_TURN):
            return False
        lights = scan.intensities[np.argsort(scan.angles, kind="stable")]
        units, free, _ = Beams.of(scan, pose[2], noise)
        ranges = free.clip(0.0)
        light = np.where((lights > 0.0) & (lights < np.inf), lights * ranges * ranges, 0.0)
        if not light.any():
            return False
        usual = float(np.log(np.quantile(light[light > 0.0], USUAL_SHARE)))
        self._usual = (self.count * self._usual + usual) / (self.count + 1)
        more = max(len(light) - self._rays.shape[2], 0)
        self._rays = np.pad(self._rays, ((0, 0), (0, 0), (0, more))) if more else self._rays
        row = self.count % MOST_SCANS
        self._places[row], self._rays[row], self._last = pose[:2], 0.0, np.array(pose)
        rays = self._rays[row, :, : len(light)].T
        rays[:, : UY + 1], rays[:, RANGE], rays[:, FREE] = units, ranges, np.abs(free)
        rays[:, DEVIATION] = np.sqrt(noise.variance(ranges))
        rays[:, BRIGHT] = light / np.exp(self._usual)
        self.reflectances = np.zeros(len(walls))
        fitting, pairs = read_reflectances(rays, light, walls, self.reflectances)
        self._fitting, self._pairs = self._fitting + fitting, self._pairs + pairs
        self.count += 1
        if not (self._warned or self.are_light) and self._pairs >= LEAST_PAIRS:
            self._warned = True
            warnings.warn(NO_LIGHT, Lrf3dWarning, stacklevel=2)
        return self.are_light


@compiled
def read_reflectances(
    rays: Float, light: Float, walls: Float, reflectances: Float
) -> tuple[int, int]:
    """Fill in how reflective walls (w, 4) around the laser [m] are, and rays (n, 9) that end there.

    Returns the number of pairs of returns that fit the laser equation, and that of all pairs.
    """
    fitting = pairs = 0
    expected, lights = np.empty(len(rays)), np.empty(len(rays))
    for row in range(len(walls)):
        x, y = walls[row, 0], walls[row, 1]
        dx, dy = walls[row, 2] - x, walls[row, 3] - y
        size = np.hypot(dx, dy)
        if size == 0.0:
            continue
        dx, dy = dx / size, dy / size
        count = 0
        for beam in range(len(rays)):
            reach = rays[beam, RANGE]
            if light[beam] <= 0.0:
                continue
            ux, uy = rays[beam, UX], rays[beam, UY]
            cos = abs(ux * dy - uy * dx)
            px, py = reach * ux - x, reach * uy - y
            along = px * dx + py * dy
            on = abs(py * dx - px * dy) < ON_WALL and -ON_WALL < along < size + ON_WALL
            if not on or cos < WEAKEST_COSINE:
                continue
            rays[beam, REFLECTANCE] = light[beam] / cos
            reflectances[row] += light[beam] / cos
            expected[count] = np.log(cos / (reach * reach))
            lights[count] = np.log(light[beam] / (reach * reach))
            count += 1
        reflectances[row] /= max(count, 1)
        # Half of the wall apart: neighbours differ by too little.
        for first in range(count - count // 2):
            last = first + count // 2
            change = expected[last] - expected[first]
            if abs(change) > LEAST_CHANGE:
                misfit = abs(lights[last] - lights[first] - change)
                fitting += misfit < LARGEST_MISFIT * abs(change)
                pairs += 1
    return fitting, pairs
