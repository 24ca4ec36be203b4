"""Imperfections of a range finder, in addition to the noise of Eq. 7.

Beams deviate from their angle, do not return, or hit a near and a far surface at once (see
`mixed_pixels`). Each is a separate noise; Imperfections chains those that are given.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, is_finite
from lrf3d.laser.mixed_pixels import MixedPixels, on_one_wall
from lrf3d.laser.noise import (
    NO_SPREAD,
    Chain,
    ConstantNoise,
    Limits,
    Noise,
    ProportionalNoise,
    Quantised,
    check_sigma,
)
from lrf3d.laser.range_finder import LaserRangeFinder
from lrf3d.laser.scan import LaserScan


@dataclass(frozen=True, slots=True)
class Imperfections:
    """Imperfections in addition to the noise of Eq. 7, as world files name them; all are off.

    Args:
        constant: Noise of every range [m]; see ConstantNoise.
        angle_deg: Noise of every angle [°]; see AngleNoise.
        beam_deg: Width of a beam [°]; see MixedPixels.
        drop_outs: Probability that any beam is lost; see DropOuts.
        drop_outs_far: Probability that a beam is lost at range_max.
        resolution: Ranges are rounded to multiples of it [m]; see Quantised.

    Raises:
        InputError: One is not a number of at least 0, or a probability is above 1.
    """

    constant: float = 0.0
    angle_deg: float = 0.0
    beam_deg: float = 0.0
    drop_outs: float = 0.0
    drop_outs_far: float = 0.0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        for name in (each.name for each in fields(self)):
            value = getattr(self, name)
            if not (is_finite(value) and value >= 0.0):
                raise InputError(f"noise: {name} {shown(value)}, expected a number, at least 0")
        DropOuts(self.drop_outs, self.drop_outs_far)

    def noise(self, sigma: float, lrf: LaserRangeFinder | None = None) -> Noise:
        """The chain of those that are on, in physical order, with sigma [m] at range_max.

        If all are off, it is the noise of Eq. 7 alone. Mixed pixels take the echo and the threshold
        of the range finder.
        """
        light: dict[str, Any] = (
            {} if lrf is None else {"echo": lrf.echo, "threshold": lrf.threshold}
        )
        chain: list[Noise] = []
        if self.angle_deg:
            chain.append(AngleNoise(math.radians(self.angle_deg)))
        if self.beam_deg:
            chain.append(MixedPixels(math.radians(self.beam_deg), **light))
        if self.drop_outs or self.drop_outs_far:
            chain.append(DropOuts(self.drop_outs, self.drop_outs_far))
        if self.constant:
            chain.append(ConstantNoise(self.constant))
        chain.append(ProportionalNoise(sigma))
        if self.resolution:
            chain.append(Quantised(self.resolution))
        return chain[0] if len(chain) == 1 else Chain([*chain, Limits()])


@dataclass(frozen=True, slots=True)
class AngleNoise:
    """Gaussian noise of each beam's angle: reports the range at θ + N(0, σ) as the range at θ.

    σ is in radians. It comes first in a chain, because it needs true ranges: on a wall the range
    at the other angle is exact; a wall that ends between two beams is taken to end midway.
    """

    sigma: float
    spread: ClassVar[tuple[float, float]] = NO_SPREAD

    def __post_init__(self) -> None:
        check_sigma(self.sigma, "radians")

    def __call__(self, scan: LaserScan, rng: np.random.Generator | int) -> LaserScan:
        """Return the scan that beams at the deviating angles measure."""
        rng = np.random.default_rng(rng)
        if self.sigma == 0.0 or len(scan.angles) < 2:
            return scan
        draws = rng.normal(0.0, self.sigma, len(scan.angles))
        return replace(scan, ranges=ranges_between(scan, scan.angles + draws))


@dataclass(frozen=True, slots=True)
class DropOuts:
    """Beams that do not return: some anywhere, more at long range.

    A beam is lost for one of two reasons, independent of each other: anywhere with the probability
    ``share``; at the range d with ``far`` · (d / range_max)², as the light spreads. Losses at a
    grazing angle come of the threshold of a laser in a world with materials.

    Raises:
        InputError: A probability is invalid; or, when it is applied, the scan has no range_max.
    """

    share: float = 0.0
    far: float = 0.0
    spread: ClassVar[tuple[float, float]] = NO_SPREAD

    def __post_init__(self) -> None:
        for name, value in (("share", self.share), ("far", self.far)):
            if not (is_finite(value) and 0.0 <= value <= 1.0):
                raise InputError(
                    f"drop-outs: {name} {shown(value)}, expected a probability, 0 to 1"
                )

    def probabilities(self, scan: LaserScan) -> Float:
        """The probability (beams,) that each beam is lost."""
        kept = np.full(len(scan.ranges), 1.0 - self.share)
        if self.far:
            if not np.isfinite(scan.range_max):
                raise InputError(
                    "scan without range_max: drop-outs grow with the range up to it; give one"
                )
            kept *= 1.0 - self.far * np.clip(scan.ranges / scan.range_max, 0.0, 1.0) ** 2
        return 1.0 - kept

    def __call__(self, scan: LaserScan, rng: np.random.Generator | int) -> LaserScan:
        """Return the scan without the returns that are lost: +inf after REP 117."""
        rng = np.random.default_rng(rng)
        lost = rng.random(len(scan.ranges)) < self.probabilities(scan)
        lost &= np.isfinite(scan.ranges)
        return replace(
            scan,
            ranges=np.where(lost, np.inf, scan.ranges),
            walls=np.where(lost, -1, scan.walls),
            intensities=None if scan.intensities is None else np.where(lost, 0.0, scan.intensities),
        )


def ranges_between(scan: LaserScan, angles: Float) -> Float:
    """Ranges (n,) [m] that beams at other angles (n,) of the fan would have had.

    Between two beams on one wall it is the exact range to this wall; where the two did not hit
    one wall, that of the nearer beam; beyond the fan, that of its last beam. The angles of the scan
    are in ascending order.
    """
    after = np.clip(np.searchsorted(scan.angles, angles), 1, len(scan.angles) - 1)
    before = after - 1
    turn = scan.angles[after] - scan.angles[before]
    ahead = np.clip(angles - scan.angles[before], 0.0, turn)
    ranges = scan.ranges[np.where(2.0 * ahead > turn, after, before)]
    # At the beams themselves the measured ranges are kept, to the last bit.
    inside = on_one_wall(scan)[before] & (ahead > 0.0) & (ahead < turn)
    near, far = scan.ranges[before[inside]], scan.ranges[after[inside]]
    turn, ahead = turn[inside], ahead[inside]
    ranges[inside] = near * far * np.sin(turn) / (near * np.sin(ahead) + far * np.sin(turn - ahead))
    return ranges
