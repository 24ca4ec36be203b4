"""Noise of the laser range finder: what turns a true scan into a measured one."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from lrf3d.errors import InputError
from lrf3d.laser.scan import LaserScan


class Noise(Protocol):
    """Anything that turns a true scan into a measured one."""

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the measured scan."""
        ...


@dataclass(frozen=True, slots=True)
class ProportionalNoise:
    """Gaussian noise that grows with the distance (Eq. 7): d + d/d_max · N(0, σ).

    σ is the standard deviation [m] at range_max. A beam without return stays without; with
    σ = 0 the scan is given back as it is and nothing is drawn.
    """

    sigma: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sigma) and self.sigma >= 0.0):
            raise InputError(f"sigma {self.sigma}: expected a finite number of metres, at least 0")

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan with noise on each range.

        Raises:
            InputError: The scan has no finite range_max, which Eq. 7 divides by.
        """
        if self.sigma == 0.0:
            return scan
        if not np.isfinite(scan.range_max):
            raise InputError("scan without range_max: Eq. 7 scales its noise by it; give one")
        ranges = scan.ranges.copy()
        finite = np.isfinite(ranges)
        draws = rng.normal(0.0, self.sigma, len(ranges))[finite]
        ranges[finite] += ranges[finite] / scan.range_max * draws
        return replace(scan, ranges=ranges)
