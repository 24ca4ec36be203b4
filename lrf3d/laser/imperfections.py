"""Imperfections of a range finder, in addition to the noise of Eq. 7.

Beams deviate from their angle, do not return, or hit a near and a far surface at once (see
`mixed_pixels`). Each is a noise; `imperfect` chains those that are given.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import generator, number
from lrf3d.laser.mixed_pixels import MixedPixels, on_one_wall
from lrf3d.laser.noise import (
    NO_SPREAD,
    Chain,
    ConstantNoise,
    Limits,
    Noise,
    ProportionalNoise,
    Quantised,
    Rng,
)
from lrf3d.laser.range_finder import LaserRangeFinder
from lrf3d.laser.scan import LaserScan


def imperfect(
    sigma: float,
    lrf: LaserRangeFinder | None = None,
    *,
    constant: float = 0.0,
    angle_deg: float = 0.0,
    beam_deg: float = 0.0,
    drop_outs: float = 0.0,
    drop_outs_far: float = 0.0,
    resolution: float = 0.0,
) -> Noise:
    """The noise of Eq. 7, and the imperfections that are not 0, in physical order.

    They are named as in world files. Mixed pixels take the echo and the threshold of the range
    finder.

    Args:
        sigma: Standard deviation of the ranges [m] at range_max.
        lrf: The range finder.
        constant: Noise of every range [m]; see ConstantNoise.
        angle_deg: Noise of every angle [°]; see AngleNoise.
        beam_deg: Width of a beam [°]; see MixedPixels.
        drop_outs: Probability that any beam is lost; see DropOuts.
        drop_outs_far: Probability that a beam is lost at range_max.
        resolution: Ranges are rounded to multiples of it [m]; see Quantised.

    Raises:
        InputError: One is not a number of at least 0, or a probability is above 1.
    """
    chain: list[Noise] = []
    if angle_deg:
        chain.append(AngleNoise(math.radians(number(angle_deg, "angle_deg", "degrees"))))
    if beam_deg:
        light: dict[str, Any] = (
            {} if lrf is None else {"echo": lrf.echo, "threshold": lrf.threshold}
        )
        chain.append(MixedPixels(math.radians(number(beam_deg, "beam_deg", "degrees")), **light))
    if drop_outs or drop_outs_far:
        chain.append(DropOuts(drop_outs, drop_outs_far))
    if constant:
        chain.append(ConstantNoise(constant))
    chain.append(ProportionalNoise(sigma))
    if resolution:
        chain.append(Quantised(resolution))
    return chain[0] if len(chain) == 1 else Chain([*chain, Limits()])


@dataclass(frozen=True, slots=True)
class AngleNoise:
    """Gaussian noise of each beam's angle: reports the range at θ + N(0, σ) as the range at θ.

    σ is in radians. It comes first in a chain, because it needs true ranges: on a wall the range
    at the other angle is exact; a wall that ends between two beams is taken to end midway. The
    angles of the scan are in ascending order.
    """

    sigma: float
    spread: ClassVar[tuple[float, float]] = NO_SPREAD

    def __post_init__(self) -> None:
        number(self.sigma, "sigma", "radians")

    def __call__(self, scan: LaserScan, rng: Rng) -> LaserScan:
        """Return the scan that beams at the deviating angles measure."""
        if self.sigma == 0.0 or len(scan.angles) < 2:
            return scan
        angles = scan.angles + generator(rng).normal(0.0, self.sigma, len(scan.angles))
        after = np.clip(np.searchsorted(scan.angles, angles), 1, len(scan.angles) - 1)
        before = after - 1
        turn = scan.angles[after] - scan.angles[before]
        ahead = np.clip(angles - scan.angles[before], 0.0, turn)
        ranges = scan.ranges[np.where(2.0 * ahead > turn, after, before)]
        # At the beams themselves the measured ranges are kept, to the last bit.
        inside = on_one_wall(scan)[before] & (ahead > 0.0) & (ahead < turn)
        near, far = scan.ranges[before[inside]], scan.ranges[after[inside]]
        turn, ahead = turn[inside], ahead[inside]
        opposite = near * np.sin(ahead) + far * np.sin(turn - ahead)
        ranges[inside] = near * far * np.sin(turn) / opposite
        return replace(scan, ranges=ranges)


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
        number(self.share, "drop-outs: share", most=1.0)
        number(self.far, "drop-outs: far", most=1.0)

    def __call__(self, scan: LaserScan, rng: Rng) -> LaserScan:
        """Return the scan without the returns that are lost: +inf after REP 117."""
        kept = np.full(len(scan.ranges), 1.0 - self.share)
        if self.far:
            if not np.isfinite(scan.range_max):
                raise InputError(
                    "scan without range_max: drop-outs grow with the range up to it; give one"
                )
            kept *= 1.0 - self.far * np.clip(scan.ranges / scan.range_max, 0.0, 1.0) ** 2
        lost = generator(rng).random(len(scan.ranges)) < 1.0 - kept
        lost &= np.isfinite(scan.ranges)
        return replace(
            scan,
            ranges=np.where(lost, np.inf, scan.ranges),
            walls=np.where(lost, -1, scan.walls),
            intensities=None if scan.intensities is None else np.where(lost, 0.0, scan.intensities),
        )
