"""AngleNoise: beams that look a little beside the angle that is told of them."""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.laser.noise import check_sigma
from lrf3d.laser.scan import LaserScan
from lrf3d.laser.surfaces import ranges_between


@dataclass(frozen=True, slots=True)
class AngleNoise:
    """Gaussian noise of each beam's angle: the range is that at θ + N(0, σ), told as that at θ.

    σ is in radians. It belongs first into a chain, since it wants true ranges: on a wall the
    range at the other angle is exact; where a wall ends between two beams, it ends midway.
    """

    sigma: float

    def __post_init__(self) -> None:
        check_sigma(self.sigma, "radians")

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan that beams at the deviating angles measured."""
        if self.sigma == 0.0 or len(scan.angles) < 2:
            return scan
        draws = rng.normal(0.0, self.sigma, len(scan.angles))
        return replace(scan, ranges=ranges_between(scan, scan.angles + draws))
