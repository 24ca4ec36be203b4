"""Light: scans with their intensities, of which the last ones are kept.

Do the intensities of a scan follow the laser equation, and how reflective is what returned them?
Along a diffuse wall the light of a beam falls with the cosine of the incidence and the square of
the range. Many devices report other numbers, from which nothing can be learnt about glass and
mirrors.
"""

import warnings
from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.errors import Lrf3dWarning
from lrf3d.geometry import Float, Int

UX, UY, RANGE, FREE, DEVIATION, LIGHT, BRIGHT, REFLECTANCE = range(8)
"""Columns of `LitScan.rays`: the unit vector of each beam; its range [m], 0 where nothing returned;
how far it is free at least [m]; the standard deviation of the range [m]; the light of the return
as if from 1 m, how bright it was compared with the usual one, and how reflective the wall is that
it is on, 0 where it is on none."""

MOST_SCANS = 160
"""[scans] So many are kept: of a drive at least the last 80 m. What mirrors showed before stays."""

LEAST_WAY, LEAST_TURN = 0.5, 0.5
"""[m, rad] A scan is kept if the robot has moved or turned by so much since the last one."""

USUAL_SHARE = 0.7
"""[share] The usual brightness of a return is that which so many have at most: beside a front of
glass most are dim."""

BRIGHTNESSES, STEPS_AN_OCTAVE = 512, 4
"""[steps] Steps in which brightness is counted, in all and for each factor of two."""

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

LEAST_FITTING = 0.5
"""[share] Intensities are light if so many of the pairs fit: metal and glass never do."""

LEAST_PAIRS = 100
"""[pairs] … of at least so many."""

NO_LIGHT = (
    "intensities do not fall with range and incidence as light does: the map has no glass and no"
    " mirrors"
)


class LitScan(NamedTuple):
    """A scan in the map's frame: its place (2,), heading, and rays (n, 8) by rising angle."""

    place: Float
    heading: float
    rays: Float


class LitScans:
    """The last kept scans, and the number of all that were kept."""

    def __init__(self) -> None:
        self._places, self._rays = (
            np.zeros((MOST_SCANS, 2)),
            np.zeros((MOST_SCANS, 0, 8)),
        )
        self._kinds = np.zeros((MOST_SCANS, 0), np.int64)
        self._brightness = np.zeros(BRIGHTNESSES, np.int64)
        self._last = np.full(3, np.inf)
        self.count = 0

    def rows(self, newest: bool) -> tuple[Float, Float, Int]:
        """Of all kept scans, or of the newest alone: places, rays, and what returns show."""
        last = (self.count - 1) % MOST_SCANS
        rows = slice(last, last + 1) if newest else slice(0, self.count)
        return self._places[rows], self._rays[rows], self._kinds[rows]

    @property
    def newest_place(self) -> Float:
        """Where the newest was taken (2,) [m]."""
        return self._last[:2]

    def usual_brightness(self, brightness: Float) -> float:
        """The usual brightness of a return, which those (n,) of another scan add to."""
        steps = np.floor(STEPS_AN_OCTAVE * np.log2(brightness)) + BRIGHTNESSES // 2
        steps = steps.clip(0, BRIGHTNESSES - 1).astype(np.int64)
        self._brightness += np.bincount(steps, minlength=BRIGHTNESSES)
        below = np.cumsum(self._brightness)
        step = int(np.searchsorted(below, USUAL_SHARE * below[-1]))
        return float(2.0 ** ((step + 0.5 - BRIGHTNESSES // 2) / STEPS_AN_OCTAVE))

    def keep(self, scan: LitScan) -> bool:
        """Keep a scan in place of the oldest, unless the robot stands nearly where it did."""
        moved = np.hypot(*(scan.place - self._last[:2])) > LEAST_WAY
        if not (moved or abs(scan.heading - self._last[2]) > LEAST_TURN):
            return False
        more = len(scan.rays) - self._rays.shape[1]
        if more > 0:
            self._rays = np.pad(self._rays, ((0, 0), (0, more), (0, 0)))
            self._kinds = np.pad(self._kinds, ((0, 0), (0, more)))
        row = self.count % MOST_SCANS
        self._places[row], self._rays[row], self._kinds[row] = scan.place, 0.0, 0
        self._rays[row, : len(scan.rays)] = scan.rays
        self._last = np.array([*scan.place, scan.heading])
        self.count += 1
        return True


@compiled
def read_reflectances(rays: Float, walls: Float) -> tuple[int, int]:
    """Fill in the reflectances of the rays (n, 8) that end on walls (w, 4) around the laser [m].

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
            reach, light = rays[beam, RANGE], rays[beam, LIGHT]
            if light <= 0.0:
                continue
            ux, uy = rays[beam, UX], rays[beam, UY]
            cos = abs(ux * dy - uy * dx)
            px, py = reach * ux - x, reach * uy - y
            along = px * dx + py * dy
            on = abs(py * dx - px * dy) < ON_WALL and -ON_WALL < along < size + ON_WALL
            if not on or cos < WEAKEST_COSINE:
                continue
            rays[beam, REFLECTANCE] = light / cos
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
        self._fitting = self._pairs = 0
        self._warned = False

    @property
    def fits(self) -> bool:
        """Whether enough returns were seen, and most of them fit."""
        return self._pairs >= LEAST_PAIRS and self._fitting >= LEAST_FITTING * self._pairs

    def read(self, rays: Float, walls: Float) -> None:
        """Fill in the reflectances of the rays of a scan, see `read_reflectances`."""
        fitting, pairs = read_reflectances(rays, walls)
        self._fitting, self._pairs = self._fitting + fitting, self._pairs + pairs
        if not (self._warned or self.fits) and self._pairs >= LEAST_PAIRS:
            self._warned = True
            warnings.warn(NO_LIGHT, Lrf3dWarning, stacklevel=2)


@inner
def way_to_first(place: Float, ray: Float, segments: Float, but: float) -> float:
    """How far [m] a ray goes to the first of segments (m, 5) that it crosses, or infinity.

    The fifth column is the line that a segment is of: those of one line are left out.
    """
    first = np.inf
    for row in range(len(segments)):
        if segments[row, 4] == but:
            continue
        x, y = segments[row, 0] - place[0], segments[row, 1] - place[1]
        dx, dy = (
            segments[row, 2] - segments[row, 0],
            segments[row, 3] - segments[row, 1],
        )
        across = ray[UX] * dy - ray[UY] * dx
        if across == 0.0:
            continue
        way = (x * dy - y * dx) / across
        share = (x * ray[UY] - y * ray[UX]) / across
        if 0.0 < way < first and 0.0 <= share <= 1.0:
            first = way
    return first
