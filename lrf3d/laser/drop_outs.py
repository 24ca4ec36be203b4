"""DropOuts: beams of which too little light comes back."""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, is_finite
from lrf3d.laser.scan import LaserScan
from lrf3d.laser.surfaces import incidences


@dataclass(frozen=True, slots=True)
class DropOuts:
    """Beams that do not return: some anywhere, more from afar, more at a grazing angle.

    A beam is lost for one of three reasons, independent of each other: anywhere with the
    probability ``share``; at the range d with ``far`` · (d / range_max)², as the light spreads;
    at the angle i from the wall's normal with ``grazing`` · (1 − cos i), as a dull wall reflects.
    In a chain it belongs before what changes ranges, from which the angle is known.

    Args:
        share: Probability anywhere.
        far: Probability at range_max.
        grazing: Probability along a wall.

    Raises:
        InputError: A probability is none.
    """

    share: float = 0.0
    far: float = 0.0
    grazing: float = 0.0

    def __post_init__(self) -> None:
        for name in ("share", "far", "grazing"):
            if not (is_finite(getattr(self, name)) and 0.0 <= getattr(self, name) <= 1.0):
                raise InputError(
                    f"drop-outs: {name} is {getattr(self, name)}, expected a probability, 0 to 1"
                )

    def probabilities(self, scan: LaserScan) -> Float:
        """How likely each of the beams (beams,) is to be lost.

        Raises:
            InputError: Losses by range are asked for, and the scan has no finite range_max.
        """
        if self.far and not np.isfinite(scan.range_max):
            raise InputError("scan without range_max: drop-outs by range grow up to it; give one")
        kept = np.full(len(scan.ranges), 1.0 - self.share)
        if self.far:
            kept *= 1.0 - self.far * np.clip(scan.ranges / scan.range_max, 0.0, 1.0) ** 2
        if self.grazing:
            kept *= 1.0 - self.grazing * (1.0 - np.cos(incidences(scan)))
        return 1.0 - kept

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan without the returns that are lost: +inf after REP 117."""
        lost = rng.random(len(scan.ranges)) < self.probabilities(scan)
        lost &= np.isfinite(scan.ranges)
        return replace(
            scan,
            ranges=np.where(lost, np.inf, scan.ranges),
            walls=np.where(lost, -1, scan.walls),
        )
