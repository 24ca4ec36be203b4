"""Noise of the laser range finder, which turns a true scan into a measured one.

All models are off by default. They are chained in physical order: the angle of the beam, the
surface hit, the loss of beams, the range, its rounding and limits::

    Chain([AngleNoise(0.002), MixedPixels(0.01), DropOuts(far=0.1), ConstantNoise(0.01),
           ProportionalNoise(0.04), Quantised(0.01), Limits()])

Each draws a fixed number of random numbers for each beam. A noise whose measured ranges scatter
about the true ones has an attribute ``spread``, for mappers: standard deviations [m] of the part
that is the same at every distance, and of the part that grows with the distance, at range_max.

A noise that computes along the last axis takes a `ScanBatch`, the scans of many robots, as well,
and says so by an attribute ``batched`` that is true; others are given one scan at a time.
"""

import inspect
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    Float,
    generator,
    least_of,
    number,
    numbers,
    read_only,
    sealed,
)
from lrf3d.laser.range_finder import LaserRangeFinder, within_limits
from lrf3d.laser.scan import LaserScan, ScanBatch, returned

Rng = np.random.Generator | int

Scan = TypeVar("Scan", bound=LaserScan | ScanBatch)


class Noise(Protocol):
    """Anything that turns a true scan into a measured one."""

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the measured scan."""
        ...


# [m] Default standard deviation of a range at range_max: that of the paper's city (Fig. 7).
SIGMA = 0.04

# [m] Default standard deviation of a range at zero distance: that of common range finders.
FLOOR = 0.01

# [m] The range at which the standard deviation is sigma, for scans without a range_max.
USUAL_RANGE: float = LaserRangeFinder.range_max

# [m, m] The spread of a noise that does not scatter ranges about the true ones.
NO_SPREAD = (0.0, 0.0)


class RangeNoise(NamedTuple):
    """The noise of ranges that mapping and localisation assume.

    The standard deviation [m] at the range r is hypot(floor, growth · r).

    Examples:
        >>> from lrf3d.laser import RangeNoise
        >>> RangeNoise.from_sigma(0.04, floor=0.0, range_max=80.0)
        RangeNoise(floor=0.0, growth=0.0005)
    """

    floor: float
    growth: float

    @classmethod
    def from_sigma(
        cls, sigma: float = SIGMA, floor: float = FLOOR, range_max: float = USUAL_RANGE
    ) -> "RangeNoise":
        """The noise of Eq. 7 with a sigma [m] at range_max [m], and a floor [m]."""
        growth = number(sigma, "range noise: sigma", "metres")
        growth /= number(range_max, "range noise: range_max", positive=True)
        return cls(number(floor, "range noise: floor", "metres"), growth)

    def variance(self, ranges: Float) -> Float:
        """Variance [m²] of ranges [m]."""
        return self.floor**2 + (self.growth * ranges) ** 2


def spread_of(noise: object) -> tuple[float, float] | None:
    """The spread of a noise, or None where it has none: see the head of this file."""
    try:
        constant, growing = noise.spread  # type: ignore[attr-defined]
        return float(constant), float(growing)
    except (AttributeError, TypeError, ValueError):
        # A noise written by the user may lack the attribute, or use the name for something else.
        return None


def check_scan(scan: object) -> None:
    """Check what a noise is given."""
    if not isinstance(scan, ScanBatch):
        expect(scan, LaserScan, "scan")


def with_ranges(scan: Scan, ranges: Float) -> Scan:
    """Return a scan, or a batch, with other ranges [m] of the same shape, as most noises do.

    For one scan it takes a third of the time of ``dataclasses.replace``, which checks all fields.

    Raises:
        InputError: The ranges are not numbers, or have another shape.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.laser import with_ranges
        >>> scan = lrf3d.LaserScan((0, 0, 0), [0.0, 0.5], [1.0, 2.0], range_max=9.0)
        >>> with_ranges(scan, scan.ranges + 0.25).ranges.tolist()
        [1.25, 2.25]
    """
    taken = read_only if isinstance(scan, LaserScan) else numbers
    distances = taken(ranges, "ranges")
    if distances.shape != scan.ranges.shape:
        raise InputError(f"ranges {distances.shape}: expected {scan.ranges.shape}, one a beam")
    if not isinstance(scan, LaserScan):
        return replace(scan, ranges=distances)
    made = scan.at_time(scan.time)
    made.__dict__["ranges"] = returned(distances, min(scan.range_max, LARGEST_COORDINATE))
    # Cached hits are those of the old ranges.
    made.__dict__.pop("hits", None)
    return made


def as_noise(noise: Any) -> Noise:
    """A noise that comes from outside, checked to be a function of a scan and an rng."""
    try:
        if not callable(noise):
            raise TypeError
        inspect.signature(noise).bind("scan", "rng")
    except (TypeError, ValueError):
        raise InputError(f"noise {shown(noise)}: expected a function of a scan and rng") from None
    return noise  # type: ignore[no-any-return]


def noises_of(noise: Any, lasers: Sequence[LaserRangeFinder]) -> tuple[Noise, ...]:
    """The noise of each laser: one for all of them, or one for each."""
    if not isinstance(noise, list | tuple):
        return (as_noise(noise),) * len(lasers)
    if len(noise) != len(lasers):
        raise InputError(
            f"noise: {len(noise)} of them for {len(lasers)} lasers; expected one, or one for each"
        )
    return tuple(as_noise(each) for each in noise)


@dataclass(frozen=True, slots=True)
class Gaussian:
    """Noise of a standard deviation [m] on each range; a beam without return stays without."""

    sigma: float
    batched: ClassVar[bool] = True
    # Whether the noise grows with the range, and sigma is that at range_max.
    grows: ClassVar[bool] = False

    def __post_init__(self) -> None:
        number(self.sigma, "sigma", "metres")

    @property
    def spread(self) -> tuple[float, float]:
        """Standard deviations [m]: the constant part, and the growing part at range_max."""
        return (0.0, self.sigma) if self.grows else (self.sigma, 0.0)

    def __call__(self, scan: Scan, rng: Rng) -> Scan:
        """Return the scan with noise on each range, which is raised to at least 0."""
        check_scan(scan)
        if self.sigma == 0.0:
            return scan
        # In place, as scans of many robots exceed the cache.
        ranges = generator(rng).standard_normal(scan.ranges.shape)
        ranges *= self.sigma
        if self.grows:
            ranges *= np.where(np.isfinite(scan.ranges), scan.ranges, 0.0) / known_range_max(scan)
        ranges += scan.ranges
        if least_of(ranges) < 0.0:
            ranges[(ranges < 0.0) & np.isfinite(ranges)] = 0.0
        return with_ranges(scan, sealed(ranges))


@dataclass(frozen=True, slots=True)
class ProportionalNoise(Gaussian):
    """Gaussian noise that grows with the distance (Eq. 7): d + d/d_max · N(0, σ).

    σ is the standard deviation [m] at range_max. A noisy range below 0 is reported as 0. With σ = 0
    the scan is returned unchanged and no random numbers are drawn.

    Raises:
        InputError: σ is invalid; or, when it is applied, the scan has no range_max.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> lrf = lrf3d.LaserRangeFinder(beams=3, range_max=10.0)
        >>> scan = lrf3d.PlanarCaster(lrf3d.World([[5, -9, 5, 9]])).cast(lrf, (0, 0, 0))
        >>> measured = lrf3d.ProportionalNoise(0.1)(scan, np.random.default_rng(0))
        >>> measured.ranges.round(3).tolist()
        [inf, 4.993, inf]
    """

    grows: ClassVar[bool] = True


@dataclass(frozen=True, slots=True)
class ConstantNoise(Gaussian):
    """Gaussian noise that is the same at every distance: d + N(0, σ), σ in metres.

    With ProportionalNoise in a chain the variances add up. A range below 0 is reported as 0.
    """


def known_range_max(scan: LaserScan | ScanBatch) -> float:
    """The range_max [m] of a scan, which must not be unknown."""
    if scan.range_max == np.inf:
        raise InputError("scan without range_max, by which its noise is scaled: give one")
    return scan.range_max


class Unscattered:
    """A noise that does not scatter ranges about the true ones, and takes many scans at once."""

    __slots__ = ()
    spread = NO_SPREAD
    batched = True


@dataclass(frozen=True, slots=True)
class Quantised(Unscattered):
    """Rounds ranges to the nearest multiple of a resolution [m]."""

    step: float

    def __post_init__(self) -> None:
        number(self.step, "resolution", "metres", positive=True)

    def __call__(self, scan: Scan, rng: Any) -> Scan:
        """Return the scan with rounded ranges; infinities stay."""
        return with_ranges(scan, sealed(np.round(scan.ranges / self.step) * self.step))


@dataclass(frozen=True, slots=True)
class Limits(Unscattered):
    """Reports ranges after REP 117: +inf above range_max, −inf below range_min.

    Noise may move a range past the limits of the range finder, so this comes last in a chain.
    """

    def __call__(self, scan: Scan, rng: Any) -> Scan:
        """Return the scan with +inf or −inf for the ranges beyond its limits."""
        return with_ranges(scan, sealed(within_limits(scan.ranges, scan.range_min, scan.range_max)))


@dataclass(frozen=True, slots=True)
class Chain:
    """Noises (n,) applied in order, to the ranges and to the echoes; without any, scans stay.

    The echo that is the range of a beam has the noise of that range; each other one has its own.
    Echoes that a noise loses are left out. A noise that changes echoes itself, as `MixedPixels`, is
    left alone.

    Raises:
        InputError: They are not functions of a scan and an rng.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.laser import Chain
        >>> true = lrf3d.LaserScan((0, 0, 0), [0.0], [1.0], echoes=[[1.0, 3.0]], range_max=9.0,
        ...                        intensities=[0.4], echo_intensities=[[0.4, 0.1]])
        >>> scan = Chain([lrf3d.ProportionalNoise(0.1)])(true, rng=0)
        >>> bool(scan.echoes[0, 0] == scan.ranges[0] != 1.0)
        True
    """

    noises: tuple[Noise, ...] = field(default=())

    def __init__(self, noises: Iterable[Noise] = ()) -> None:
        if not isinstance(noises, Iterable):
            raise InputError(f"chain of {shown(noises)}: expected a list of noises")
        parts = (one.noises if isinstance(one, Chain) else (as_noise(one),) for one in noises)
        object.__setattr__(self, "noises", tuple(part for each in parts for part in each))

    @property
    def spread(self) -> tuple[float, float] | None:
        """The spread of all its noises, whose variances add up; None if one has none."""
        parts = [NO_SPREAD, *map(spread_of, self.noises)]
        known = [part for part in parts if part is not None]
        if len(known) < len(parts):
            return None
        constant, growing = zip(*known, strict=True)
        return math.hypot(*constant), math.hypot(*growing)

    @property
    def batched(self) -> bool:
        """Whether all its noises take many scans at once."""
        return all(getattr(noise, "batched", False) is True for noise in self.noises)

    def __call__(self, scan: Scan, rng: Rng) -> Scan:
        """Return the scan after all noises."""
        check_scan(scan)
        rng = generator(rng)
        noise: Any
        for noise in self.noises:
            before = scan
            scan = noise(scan, rng)
            # What a user's noise returns is checked by who asked for the scan.
            if not isinstance(scan, type(before)):
                return scan
            true = before.echoes
            light = before.echo_intensities
            if true is not None and light is not None:
                scan = _with_echoes(before, true, light, scan, noise, rng)
        return scan


def _with_echoes(
    before: Scan, true_echoes: Float, light: Float, scan: Scan, noise: Any,
    rng: np.random.Generator,
) -> Scan:  # fmt: skip
    """What a noise made of a scan with echoes and their light (…, k), with noise on these."""
    if scan.echoes is not None and not np.array_equal(scan.echoes, true_echoes):
        return scan
    echoes = true_echoes.copy()
    lit = light.copy()
    bare = replace(before, echoes=None, echo_intensities=None)
    for column in range(echoes.shape[-1]):
        alone = replace(bare, ranges=true_echoes[..., column], intensities=light[..., column])
        echoes[..., column] = noise(alone, rng).ranges
    chosen = np.isfinite(true_echoes) & (true_echoes == before.ranges[..., None])
    # Two echoes at one place have one range as well.
    echoes = np.where(chosen, scan.ranges[..., None], echoes)
    lost = ~np.isfinite(echoes)
    echoes[lost] = np.inf
    lit[lost] = 0.0
    order = np.argsort(echoes, axis=-1, kind="stable")
    echoes, lit = (np.take_along_axis(values, order, axis=-1) for values in (echoes, lit))
    return replace(scan, echoes=echoes, echo_intensities=lit)


def at_sigma(noise: Noise, sigma: float) -> Noise:
    """The noise with another standard deviation [m] at range_max, of its ProportionalNoise."""
    other = ProportionalNoise(sigma)
    parts = Chain([noise]).noises
    if not any(isinstance(part, ProportionalNoise) for part in parts):
        raise InputError(f"sigma {shown(sigma)}: {noise!r} has no ProportionalNoise to give it to")
    changed = [other if isinstance(part, ProportionalNoise) else part for part in parts]
    return Chain(changed) if isinstance(noise, Chain) else other
