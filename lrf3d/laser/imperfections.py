"""Imperfections of a range finder, in addition to the noise of Eq. 7.

Beams deviate from their angle, do not return, or hit a near and a far surface at once. Each is a
noise, whose keys in a world file stand in `NOISES`; `imperfect` chains those that are given.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.base.errors import check_names
from lrf3d.geometry.lines import Float, generator, number, sealed
from lrf3d.laser.noise import (
    Chain,
    ConstantNoise,
    Limits,
    Noise,
    ProportionalNoise,
    Quantised,
    Rng,
    Scan,
    Unscattered,
    check_scan,
    known_range_max,
    with_ranges,
)
from lrf3d.laser.range_finder import ECHO_CHOICES, LaserRangeFinder

# Light that returns: its range [m], its intensity, and its wall, −1 where it is mixed.
Echo = tuple[float, float, int]


@dataclass(frozen=True, slots=True)
class AngleNoise(Unscattered):
    """Gaussian noise of each beam's angle: reports the range at θ + N(0, σ) as the range at θ.

    σ is in radians. It comes first in a chain, because it needs true ranges, at ascending angles.
    On a wall the range at the other angle is exact; one that ends between two beams ends midway.
    """

    sigma: float

    def __post_init__(self) -> None:
        number(self.sigma, "sigma", "radians")

    def __call__(self, scan: Scan, rng: Rng) -> Scan:
        """Return the scan that beams at the deviating angles measure."""
        check_scan(scan)
        if self.sigma == 0.0 or len(scan.angles) < 2:
            return scan
        from lrf3d.laser.deviation import ranges_aside

        draws = generator(rng).normal(0.0, self.sigma, scan.ranges.shape)
        rows = (-1, len(scan.angles))
        ranges = np.empty(scan.ranges.shape)
        ranges_aside(
            scan.angles,
            np.sin(np.diff(scan.angles)),
            draws.reshape(rows),
            # Kernels are compiled again for arrays that can be written.
            sealed(np.ascontiguousarray(scan.ranges).reshape(rows)),
            sealed(np.ascontiguousarray(scan.walls, np.int64).reshape(rows)),
            ranges.reshape(rows),
        )
        return with_ranges(scan, sealed(ranges))


@dataclass(frozen=True, slots=True)
class DropOuts(Unscattered):
    """Beams that do not return: some anywhere, more at long range.

    A beam is lost for one of two reasons, independent of each other: anywhere with the probability
    ``share``; at the range d with ``far`` · (d / range_max)², as the light spreads.

    Raises:
        InputError: A probability is invalid; or, when it is applied, the scan has no range_max.
    """

    share: float = 0.0
    far: float = 0.0

    def __post_init__(self) -> None:
        number(self.share, "drop-outs: share", most=1.0)
        number(self.far, "drop-outs: far", most=1.0)

    def __call__(self, scan: Scan, rng: Rng) -> Scan:
        """Return the scan without the returns that are lost: +inf after REP 117."""
        check_scan(scan)
        kept = np.full(scan.ranges.shape, 1.0 - self.share)
        if self.far:
            kept *= 1.0 - self.far * np.clip(scan.ranges / known_range_max(scan), 0.0, 1.0) ** 2
        lost = generator(rng).random(scan.ranges.shape) < 1.0 - kept
        lost &= np.isfinite(scan.ranges)
        return replace(
            scan,
            ranges=np.where(lost, np.inf, scan.ranges),
            walls=np.where(lost, -1, scan.walls),
            intensities=None if scan.intensities is None else np.where(lost, 0.0, scan.intensities),
        )


@dataclass(frozen=True, slots=True)
class MixedPixels(Unscattered):
    """Beams with a width of ``divergence`` [rad]: at an edge the light of two surfaces is mixed.

    If two neighbouring beams hit different walls, more than ``jump`` [m] apart in range, the edge
    lies between them at a uniformly random angle. A beam whose light falls on both sides of it
    returns the mean of the two ranges, weighted by the share of the light on each, and its wall
    is −1. Beams that did not return are not mixed.

    In scans with intensities each surface returns its share of its own light. Within ``pulse``, the
    way of light there and back in the 5 ns that pulses usually last, the two are one echo, whose
    range is weighted by the light of both; farther apart they are two echoes, of which ``echo`` is
    the range, and those below ``threshold`` are not detected.

    Raises:
        InputError: A number is invalid, or there is no such choice of an echo.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> from lrf3d.laser import MixedPixels
        >>> pole = [[2, -1, 2, 0.01], [9, -9, 9, 9]]
        >>> world = lrf3d.World(pole, [0, 1], materials=["plaster", "plaster"])
        >>> lrf = lrf3d.LaserRangeFinder(-0.01, 0.02, beams=4, echoes=2)
        >>> scan = lrf3d.PlanarCaster(world).cast(lrf, (0, 0, 0))
        >>> MixedPixels(0.02)(scan, np.random.default_rng(1)).echoes.round(2).tolist()
        [[2.0, inf], [2.0, 9.0], [2.0, 9.0], [9.0, inf]]
    """

    divergence: float
    jump: float = 0.1
    pulse: float = 0.75
    echo: str = "strongest"
    threshold: float = 0.0

    def __post_init__(self) -> None:
        for name in ("divergence", "jump", "pulse"):
            number(getattr(self, name), f"mixed pixels: {name}", positive=True)
        number(self.threshold, "mixed pixels: threshold")
        check_names("mixed pixels: echo", [str(self.echo)], ECHO_CHOICES)

    def __call__(self, scan: Scan, rng: Rng) -> Scan:
        """Return the scan with mixed ranges, or two echoes, at its edges."""
        check_scan(scan)
        gaps = np.abs(np.diff(scan.angles))
        offsets = generator(rng).random(scan.ranges.shape)[..., 1:] * gaps
        returned = np.isfinite(scan.ranges)
        jumps = np.diff(np.where(returned, scan.ranges, 0.0))
        edge = returned[..., :-1] & returned[..., 1:] & (np.abs(jumps) > self.jump)
        wall = scan.walls[..., :-1]
        edge &= (wall < 0) | (wall != scan.walls[..., 1:])
        # The shares of each beam that fall on the surface of the beam before it, and after it.
        before, after = np.zeros((2, *scan.ranges.shape))
        after[..., :-1] = np.where(edge, self._beyond(offsets), 0.0)
        before[..., 1:] = np.where(edge, self._beyond(gaps - offsets), 0.0)
        if scan.intensities is not None:
            return self._lit(scan, scan.intensities, before, after)
        ranges = scan.ranges.copy()
        ranges[..., :-1] += after[..., :-1] * jumps
        ranges[..., 1:] -= before[..., 1:] * jumps
        walls = np.where(ranges == scan.ranges, scan.walls, -1)
        return replace(scan, ranges=ranges, walls=walls)

    def _beyond(self, away: Float) -> Float:
        """Share of a beam that falls beyond an edge at an angle (n,) from its middle [rad]."""
        return np.clip(0.5 - away / self.divergence, 0.0, 0.5)

    def _lit(self, scan: Scan, light: Float, before: Float, after: Float) -> Scan:
        """The scan with intensities (…, beams), with the light of both surfaces at its edges."""
        ranges = scan.ranges.copy()
        walls = scan.walls.copy()
        lights = light.copy()
        lit = scan.echoes is not None and scan.echo_intensities is not None
        echoes = np.array(scan.echoes if lit else ranges[..., None])
        echo_lights = np.array(scan.echo_intensities if lit else lights[..., None])
        slots = echoes.shape[-1]
        nothing = (np.inf, 0.0, -1)
        for beam in zip(*np.nonzero(before + after), strict=True):
            *row, number = beam
            own = 1.0 - (before[beam] + after[beam])
            parts = (
                (own, beam), (before[beam], (*row, number - 1)), (after[beam], (*row, number + 1))
            )  # fmt: skip
            met = [
                (float(scan.ranges[at]), float(part * light[at]), int(scan.walls[at]))
                for part, at in parts
                if part > 0.0
            ]
            others = [
                (away, own * back, -1)
                for away, back in zip(echoes[beam], echo_lights[beam], strict=True)
                if np.isfinite(away) and away != scan.ranges[beam]
            ]
            together = sorted([*self._together(met), *others])
            found = [echo for echo in together if echo[1] >= self.threshold]
            brightest = sorted(found, key=lambda echo: echo[1], reverse=True)
            choices = {"first": found[:1], "last": found[-1:], "strongest": brightest[:1]}
            ranges[beam], lights[beam], walls[beam] = [*choices[self.echo], nothing][0]
            kept = [*sorted(brightest[:slots]), *[nothing] * slots][:slots]
            echoes[beam], echo_lights[beam], _ = zip(*kept, strict=True)
        made = replace(scan, ranges=ranges, walls=walls, intensities=lights)
        return replace(made, echoes=echoes, echo_intensities=echo_lights) if lit else made

    def _together(self, echoes: list[Echo]) -> list[Echo]:
        """Echoes in the order of their ranges, those within a pulse as one."""
        found: list[Echo] = []
        for away, light, wall in sorted(echoes):
            if found and away - found[-1][0] <= self.pulse:
                nearer, back, _ = found.pop()
                both = back + light
                share = light / both if both else 0.5
                away = nearer + (away - nearer) * share
                light = both
                wall = -1
            found.append((away, light, wall))
        return found


def _degrees(angle: float, key: str) -> float:
    return math.radians(number(angle, key, "degrees", most=90))


def _mixed(lrf: LaserRangeFinder | None, width: float) -> Noise:
    light: Any = {} if lrf is None else {"echo": lrf.echo, "threshold": lrf.threshold}
    return MixedPixels(_degrees(width, "beam_deg"), **light)


# The kinds of noise in physical order: what makes one of a range finder, which may be unknown, and
# the values of its keys in a world file. Others may be entered, which world files then have, too.
NOISES: dict[tuple[str, ...], Callable[..., Noise]] = {
    ("angle_deg",): lambda lrf, sigma: AngleNoise(_degrees(sigma, "angle_deg")),
    ("beam_deg",): _mixed,
    ("drop_outs", "drop_outs_far"): lambda lrf, share, far: DropOuts(share, far),
    ("constant",): lambda lrf, sigma: ConstantNoise(sigma),
    ("sigma",): lambda lrf, sigma: ProportionalNoise(sigma),
    ("resolution",): lambda lrf, step: Quantised(step),
}


def imperfect(sigma: float, lrf: LaserRangeFinder | None = None, **values: float) -> Noise:
    """The noise of Eq. 7, with a sigma [m] at range_max, and the imperfections that are not 0.

    They are named as in world files, and chained in the order of `NOISES`. Mixed pixels take the
    echo and the threshold of the range finder.

    Raises:
        InputError: One is unknown, no number of at least 0, or a probability above 1.
    """
    given = {"sigma": sigma, **values}
    check_names("noise", given, [key for kind in NOISES for key in kind])
    chain = [
        make(lrf, *(given.get(key, 0.0) for key in kind))
        for kind, make in NOISES.items()
        if kind == ("sigma",) or any(given.get(key) for key in kind)
    ]
    return chain[0] if len(chain) == 1 else Chain([*chain, Limits()])
