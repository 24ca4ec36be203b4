"""Imperfections of a range finder, in addition to the noise of Eq. 7.

Beams deviate from their angle, do not return, or hit a near and a far surface at once (see
`mixed_pixels`). Each is a separate noise; Imperfections chains those that are given.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from lrf3d.errors import InputError
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
    """Imperfections in addition to the noise of Eq. 7; all are off by default.

    Args:
        constant: Noise of every range [m]; see ConstantNoise.
        angle_deg: Noise of every angle [°]; see AngleNoise.
        beam_deg: Width of a beam [°]; see MixedPixels.
        drop_outs: Probability that any beam is lost; see DropOuts.
        drop_outs_far: Probability that a beam is lost at range_max.
        drop_outs_grazing: Probability that a beam along a wall is lost, of world files of earlier
            versions. In worlds with materials the threshold of the laser decides instead.
        resolution: Ranges are rounded to multiples of it [m]; see Quantised.
    """

    constant: float = 0.0
    angle_deg: float = 0.0
    beam_deg: float = 0.0
    drop_outs: float = 0.0
    drop_outs_far: float = 0.0
    drop_outs_grazing: float = 0.0
    resolution: float = 0.0

    def noise(self, sigma: float, lrf: LaserRangeFinder | None = None) -> Noise:
        """The chain of all imperfections, in physical order.

        Imperfections that are off are left out; if all are off, it is the noise of Eq. 7 alone.

        Args:
            sigma: Noise [m] at range_max.
            lrf: The range finder, whose echo and threshold mixed pixels take.
        """
        probabilities = self.drop_outs, self.drop_outs_far, self.drop_outs_grazing
        chain: list[Noise] = []
        if self.angle_deg:
            chain.append(AngleNoise(float(np.radians(self.angle_deg))))
        if self.beam_deg:
            light: dict[str, Any] = (
                {} if lrf is None else {"echo": lrf.echo, "threshold": lrf.threshold}
            )
            chain.append(MixedPixels(float(np.radians(self.beam_deg)), **light))
        if any(probabilities):
            chain.append(DropOuts(*probabilities))
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

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan that beams at the deviating angles measure."""
        if self.sigma == 0.0 or len(scan.angles) < 2:
            return scan
        draws = rng.normal(0.0, self.sigma, len(scan.angles))
        return replace(scan, ranges=ranges_between(scan, scan.angles + draws))


@dataclass(frozen=True, slots=True)
class DropOuts:
    """Beams that do not return: some anywhere, more at long range, more at a grazing angle.

    A beam is lost for one of three reasons, independent of each other: anywhere with the
    probability ``share``; at the range d with ``far`` · (d / range_max)², as the light spreads;
    at the angle i from the wall's normal with ``grazing`` · (1 − cos i), as a dull wall reflects.
    Scans with intensities have no such losses: there the threshold of the laser makes them. In a
    chain it comes before noises of the range, because it derives the angle from the ranges.

    Args:
        share: Probability anywhere.
        far: Probability at range_max.
        grazing: Probability along a wall.

    Raises:
        InputError: A probability is invalid.
    """

    share: float = 0.0
    far: float = 0.0
    grazing: float = 0.0
    spread: ClassVar[tuple[float, float]] = NO_SPREAD

    def __post_init__(self) -> None:
        for name in ("share", "far", "grazing"):
            if not (is_finite(getattr(self, name)) and 0.0 <= getattr(self, name) <= 1.0):
                raise InputError(
                    f"drop-outs: {name} is {getattr(self, name)}, expected a probability, 0 to 1"
                )

    def probabilities(self, scan: LaserScan) -> Float:
        """The probability (beams,) that each beam is lost.

        Raises:
            InputError: Losses grow with the range, and the scan has no finite range_max.
        """
        if self.far and not np.isfinite(scan.range_max):
            raise InputError(
                "scan without range_max: drop-outs grow with the range up to it; give one"
            )
        kept = np.full(len(scan.ranges), 1.0 - self.share)
        if self.far:
            kept *= 1.0 - self.far * np.clip(scan.ranges / scan.range_max, 0.0, 1.0) ** 2
        if self.grazing and scan.intensities is None:
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
            intensities=None if scan.intensities is None else np.where(lost, 0.0, scan.intensities),
        )


def losses_by_light(noise: Noise) -> str | None:
    """A warning for a world with materials if a noise loses beams at grazing incidence, or None."""
    parts = noise.noises if isinstance(noise, Chain) else (noise,)
    if not any(isinstance(part, DropOuts) and part.grazing for part in parts):
        return None
    return (
        "noise.drop_outs_grazing has no effect in a world with materials, where laser.threshold"
        " decides which walls return light; remove it"
    )


def incidences(scan: LaserScan) -> Float:
    """Angles (beams,) [rad] of the beams to the normal of their wall: 0 straight, π/2 grazing.

    A beam that is alone on its wall does not show its incidence, and counts as straight.
    """
    joined = on_one_wall(scan)
    angles = np.zeros(len(scan.ranges))
    pair = np.flatnonzero(joined)
    near, far = scan.ranges[pair], scan.ranges[pair + 1]
    turn = np.abs(scan.angles[pair + 1] - scan.angles[pair])
    # The vector from one point to the other, along and across the beam of the first.
    along, across = far * np.cos(turn) - near, far * np.sin(turn)
    first = np.arctan2(np.abs(along), np.abs(across))
    along, across = near * np.cos(turn) - far, near * np.sin(turn)
    second = np.arctan2(np.abs(along), np.abs(across))
    angles[pair + 1] = second
    angles[pair] = first
    return angles


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
    nearest = np.where(2.0 * ahead > turn, after, before)
    ranges = scan.ranges[nearest]
    # At the beams themselves the measured ranges are kept, to the last bit.
    inside = on_one_wall(scan)[before] & (ahead > 0.0) & (ahead < turn)
    near, far = scan.ranges[before[inside]], scan.ranges[after[inside]]
    turn, ahead = turn[inside], ahead[inside]
    ranges[inside] = near * far * np.sin(turn) / (near * np.sin(ahead) + far * np.sin(turn - ahead))
    return ranges
