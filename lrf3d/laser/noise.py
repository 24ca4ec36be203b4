"""Noise of the laser range finder: what turns a true scan into a measured one.

All of it is off by default. The imperfections of a range finder are chained in the order in which
they arise: the beam's angle, what it meets, what comes back, what is measured, what is reported::

    Chain([AngleNoise(0.002), MixedPixels(0.01), DropOuts(far=0.1), ConstantNoise(0.01),
           ProportionalNoise(0.04), Quantised(0.01), Limits()])

Each draws one random number for each beam, or a multiple of that, so that a seed gives the same
noise whatever the scan shows.
"""

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, cast

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, is_finite
from lrf3d.laser.range_finder import within_limits
from lrf3d.laser.scan import LaserScan


class Noise(Protocol):
    """Anything that turns a true scan into a measured one."""

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the measured scan."""
        ...


AnyNoise = Noise | Callable[[LaserScan], LaserScan]
"""A noise as users write it: one that draws nothing needs no rng."""


@dataclass(frozen=True, slots=True)
class Undrawn:
    """A noise that makes a scan of a scan without drawing: ``noise(scan)``."""

    change: Callable[[LaserScan], LaserScan]

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return what it makes of the scan."""
        return self.change(scan)


def as_noise(noise: AnyNoise) -> Noise:
    """A noise as simulations call it, of ``noise(scan, rng)`` or ``noise(scan)``.

    Raises:
        InputError: It can be called in neither way.
    """
    try:
        signature = inspect.signature(noise)
    except (TypeError, ValueError):
        raise InputError(f"noise {noise!r}: expected a function of a scan and an rng") from None
    for count in (2, 1):
        try:
            signature.bind(*range(count))
        except TypeError:
            continue
        return cast(Noise, noise) if count == 2 else Undrawn(cast(Any, noise))
    raise InputError(f"noise {noise!r}: expected a function of a scan and an rng, or of a scan")


@dataclass(frozen=True, slots=True)
class ProportionalNoise:
    """Gaussian noise that grows with the distance (Eq. 7): d + d/d_max · N(0, σ).

    σ is the standard deviation [m] at range_max. A beam without return stays without; a noisy
    range below 0 is reported as 0, as no range finder measures less. With σ = 0 the scan is
    returned unchanged and no random numbers are drawn.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> lrf = lrf3d.LaserRangeFinder(beams=3, range_max=10.0)
        >>> scan = lrf3d.PlanarCaster(lrf3d.World([[5, -9, 5, 9]])).cast(lrf, (0, 0, 0))
        >>> measured = lrf3d.ProportionalNoise(0.1)(scan, np.random.default_rng(0))
        >>> measured.ranges.round(3).tolist()
        [inf, 4.993, inf]
    """

    sigma: float

    def __post_init__(self) -> None:
        check_sigma(self.sigma, "metres")

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
        return replace(scan, ranges=not_negative(ranges))


@dataclass(frozen=True, slots=True)
class ConstantNoise:
    """Gaussian noise that is the same at every distance: d + N(0, σ), σ in metres.

    With ProportionalNoise in a chain the variances add up. What goes below 0 is reported as there.
    """

    sigma: float

    def __post_init__(self) -> None:
        check_sigma(self.sigma, "metres")

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan with noise on each range; a beam without return stays without."""
        if self.sigma == 0.0:
            return scan
        # Adding to an infinity leaves it as it is.
        ranges = scan.ranges + rng.normal(0.0, self.sigma, len(scan.ranges))
        return replace(scan, ranges=not_negative(ranges))


@dataclass(frozen=True, slots=True)
class Quantised:
    """Rounds ranges to the nearest multiple of a resolution [m]."""

    step: float

    def __post_init__(self) -> None:
        if not (is_finite(self.step) and self.step > 0.0):
            raise InputError(f"resolution {self.step}: expected a positive number of metres")

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan with its ranges rounded; an infinity stays one."""
        return replace(scan, ranges=np.round(scan.ranges / self.step) * self.step)


@dataclass(frozen=True, slots=True)
class Limits:
    """Reports ranges after REP 117: +inf above range_max, −inf below range_min.

    Noise may move a range past the limits of the range finder, so this comes last in a chain.
    """

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan with +inf or −inf for the ranges beyond its limits."""
        return replace(scan, ranges=within_limits(scan.ranges, scan.range_min, scan.range_max))


@dataclass(frozen=True, slots=True)
class Chain:
    """Noise models applied in order; an empty chain returns the scan unchanged.

    Args:
        noises: The noises, the first to come about first.
    """

    noises: tuple[Noise, ...] = field(default=())

    def __init__(self, noises: Iterable[Noise] = ()) -> None:
        object.__setattr__(self, "noises", tuple(noises))

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return what the last noise makes of what the others made."""
        for noise in self.noises:
            scan = noise(scan, rng)
        return scan


def not_negative(ranges: Float) -> Float:
    """Noisy ranges as a range finder reports them: at least 0; infinities stay what they are."""
    return np.where((ranges < 0.0) & np.isfinite(ranges), 0.0, ranges)


def check_sigma(sigma: float, unit: str) -> None:
    """See that a standard deviation is one.

    Raises:
        InputError: It is not.
    """
    if not (is_finite(sigma) and sigma >= 0.0):
        raise InputError(f"sigma {shown(sigma)}: expected a finite number of {unit}, at least 0")
