"""MixedPixels: ranges that lie between a near and a far surface, because a beam met both."""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, is_finite
from lrf3d.laser.scan import LaserScan
from lrf3d.laser.surfaces import on_one_wall


@dataclass(frozen=True, slots=True)
class MixedPixels:
    """Beams as wide as ``divergence`` [rad]: at an edge the two ranges are mixed.

    Where neighbouring beams met different things, more than ``jump`` [m] apart in range, the edge
    lies somewhere between them, anywhere alike. A beam whose light falls on both sides of it
    tells the mean of the two ranges, each weighed by its part of the light, and counts as having
    met no wall. Beams that did not return mix with nothing.

    Args:
        divergence: How wide a beam is [rad].
        jump: Least difference of the ranges at an edge [m].

    Raises:
        InputError: One of them is not a positive number.
    """

    divergence: float
    jump: float = 0.1

    def __post_init__(self) -> None:
        for name in ("divergence", "jump"):
            if not (is_finite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InputError(
                    f"mixed pixels: {name} is {getattr(self, name)}, expected a positive number"
                )

    def edges(self, scan: LaserScan) -> Bool:
        """Between which beams (beams − 1,) and the next there is an edge."""
        returned = np.isfinite(scan.ranges)
        ranges = np.where(returned, scan.ranges, 0.0)
        apart = np.abs(np.diff(ranges)) > self.jump
        return np.asarray(returned[:-1] & returned[1:] & apart & ~on_one_wall(scan))

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan with mixed ranges at its edges."""
        gaps = np.abs(np.diff(scan.angles))
        places = rng.random(len(scan.ranges))[1:] * gaps
        edge = np.flatnonzero(self.edges(scan))
        ranges = scan.ranges.copy()
        near, far = scan.ranges[edge], scan.ranges[edge + 1]
        # A beam may have an edge on either side; the light beyond each of them is another's.
        ranges[edge] += self._beyond(places[edge]) * (far - near)
        ranges[edge + 1] += self._beyond((gaps - places)[edge]) * (near - far)
        walls = np.where(ranges == scan.ranges, scan.walls, -1)
        return replace(scan, ranges=ranges, walls=walls)

    def _beyond(self, away: Float) -> Float:
        """Part of the light of beams that falls beyond an edge so far from their middles [rad]."""
        return np.clip(0.5 - away / self.divergence, 0.0, 0.5)
