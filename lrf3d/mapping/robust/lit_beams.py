"""LitBeams: the beams of a scan with their light, and what of glass they show by themselves.

A scan enters as `Optics` takes it; what leaves are the returns that flash or are dim, as segments
with the moments of walls, and where beams cross lines.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, cross
from lrf3d.mapping.robust.optics_constants import (
    DIM_SHARE,
    FLASH_DEVIATION,
    FLASH_SHARE,
    LONGEST_PAIRED,
    PANE_GRAZING_COSINE,
)


class LitBeams(NamedTuple):
    """The beams of a scan with their light, by rising angle.

    Args:
        place: (2,) where the laser is [m].
        units: (n, 2) their unit vectors.
        ranges: (n,) measured ranges [m]; where nothing returned, 0.
        free: (n,) how far [m] each is free at least, from what is known.
        deviations: (n,) standard deviations of the ranges [m].
        intensities: (n,) intensities.
        usual: The usual brightness of a return.
    """

    place: Float
    units: Float
    ranges: Float
    free: Float
    deviations: Float
    intensities: Float
    usual: float

    def brightness(self) -> Float:
        """Their intensities (n,) as if from 1 m."""
        return self.intensities * self.ranges**2

    def returns(self, chosen: Bool) -> Float:
        """Some of the returns as `DimReturns` keeps them (k, 6)."""
        ranges, units = self.ranges[chosen], self.units[chosen]
        bright = self.brightness()[chosen] / self.usual
        places = self.place + ranges[:, None] * units
        return np.column_stack([places, units, self.deviations[chosen] ** 2, bright])

    def classes(self, cosine: Float | float = 1.0) -> tuple[Bool, Bool]:
        """Which beams (…, n) return a flash, and which are dim, beside what is usual.

        Args:
            cosine: That of the incidence, where it is known.
        """
        hit = (self.ranges > 0.0) & (self.intensities > 0.0)
        bright = self.brightness()
        flash, dim = bright > FLASH_SHARE * self.usual, bright < DIM_SHARE * self.usual * cosine
        return hit & flash, hit & dim


def flashes(beams: LitBeams, flash: Bool) -> tuple[Float, Float]:
    """Segments (m, 4) and moments (m, 6) of the brightest beams of flashes.

    Each is met at a right angle: it is a point with a direction.
    """
    bright = np.where(flash, beams.brightness(), 0.0)
    before, after = np.roll(bright, 1), np.roll(bright, -1)
    peaks = np.flatnonzero(flash & (bright > before) & (bright >= after))
    points = beams.place + beams.ranges[peaks, None] * beams.units[peaks]
    sure = 1.0 / FLASH_DEVIATION**2
    x, y = -beams.units[peaks, 1], beams.units[peaks, 0]
    weight = beams.deviations[peaks] ** -2.0
    moments = np.column_stack([weight, points, sure * x * x, sure * x * y, sure * y * y])
    return np.hstack([points, points]), moments


def pairs(beams: LitBeams, dim: Bool) -> tuple[Float, Float]:
    """Segments (m, 4) and moments (m, 6) of two dim beams each that follow each other.

    Far walls return few beams, too few for a wall of a scan. Long runs are left out: these are.
    """
    edges = np.flatnonzero(np.diff(dim, prepend=False, append=False)).reshape(-1, 2)
    runs = edges[np.diff(edges, axis=1)[:, 0] <= LONGEST_PAIRED]
    first = np.array([k for low, high in runs for k in range(low, high - 1)], np.int64)
    ends = beams.place + beams.ranges[:, None] * beams.units
    one, other = ends[first], ends[first + 1]
    apart = other - one
    across = beams.ranges[first] * np.abs(cross(beams.units[first], beams.units[first + 1]))
    size = np.hypot(apart[:, 0], apart[:, 1])
    sure = (size > 0.0) & (across > PANE_GRAZING_COSINE * size)
    one, apart = one[sure], apart[sure]
    variance = beams.deviations[first[sure]] ** 2
    weight = 0.5 / variance
    moments = np.column_stack(
        [
            2.0 / variance,
            one + 0.5 * apart,
            weight * apart[:, 0] ** 2,
            weight * apart[:, 0] * apart[:, 1],
            weight * apart[:, 1] ** 2,
        ]
    )
    return np.hstack([one, one + apart]), moments


def crossings(
    place: Float, units: Float, points: Float, along: Float
) -> tuple[Float, Float, Float]:
    """Where beams (n,) from a place (2,) cross lines (m,).

    Returns:
        (m, n) how far along the beam [m], where along the line [m], and the cosine of the
        incidence; for beams that go away from a line the first is not above 0.
    """
    x, y = points[:, 0] - place[0], points[:, 1] - place[1]
    across = along[:, :1] * units[:, 1] - along[:, 1:] * units[:, 0]
    safe = np.where(across == 0.0, 1e-300, across)
    way = (along[:, 0] * y - along[:, 1] * x)[:, None] / safe
    way = np.where((across == 0.0) | (way > 1e9), -1.0, way)
    run = along[:, :1] * units[:, 0] + along[:, 1:] * units[:, 1]
    stations = way * run - (along[:, 0] * x + along[:, 1] * y)[:, None]
    return way, stations, np.abs(across)
