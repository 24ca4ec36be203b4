"""MixedPixels: beams with a width, which meet two surfaces at an edge.

A true scan comes in; what leaves is the scan with mixed ranges at its edges, or, where the light is
known and the two surfaces are farther apart than a pulse is long, with an echo of each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Bool, Float, Int, is_finite
from lrf3d.laser.noise import NO_SPREAD
from lrf3d.laser.range_finder import ECHO_CHOICES
from lrf3d.laser.scan import LaserScan

PULSE = 0.75
"""Distance [m] within which two surfaces return one echo: light's way there and back in the 5 ns
that the pulses of common range finders last."""


class _Echo(NamedTuple):
    """Light that returns: its range [m], its intensity, and its wall, −1 where it is mixed."""

    range: float
    light: float
    wall: int


@dataclass(frozen=True, slots=True)
class MixedPixels:
    """Beams with a width of ``divergence`` [rad]: at an edge the light of two surfaces is mixed.

    If two neighbouring beams hit different walls, more than ``jump`` [m] apart in range, the edge
    lies between them at a uniformly random angle. A beam whose light falls on both sides of it
    returns the mean of the two ranges, weighted by the share of the light on each, and its wall
    is −1. Beams that did not return are not mixed.

    In scans with intensities each surface returns its share of its own light. Within ``pulse`` the
    two are one echo, whose range is weighted by the light of both; farther apart they are two
    echoes, of which ``echo`` is the range, and those below ``threshold`` are not detected.

    Args:
        divergence: Width of a beam [rad].
        jump: Least difference of the ranges at an edge [m].
        pulse: Distance [m] within which two surfaces return one echo.
        echo: Which echo is the range, as `LaserRangeFinder.echo`.
        threshold: Least intensity that is detected, as `LaserRangeFinder.threshold`.

    Raises:
        InputError: A length is not a positive number, or there is no such choice of an echo.

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
    pulse: float = PULSE
    echo: str = "strongest"
    threshold: float = 0.0
    spread: ClassVar[tuple[float, float]] = NO_SPREAD

    def __post_init__(self) -> None:
        for name in ("divergence", "jump", "pulse"):
            if not (is_finite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InputError(
                    f"mixed pixels: {name} is {getattr(self, name)}, expected a positive number"
                )
        if self.echo not in ECHO_CHOICES:
            raise InputError(
                f"mixed pixels: echo {shown(self.echo)}, expected one of {', '.join(ECHO_CHOICES)}"
            )

    def edges(self, scan: LaserScan) -> Bool:
        """Whether there is an edge between each beam and the next (beams − 1,)."""
        returned = np.isfinite(scan.ranges)
        ranges = np.where(returned, scan.ranges, 0.0)
        apart = np.abs(np.diff(ranges)) > self.jump
        return np.asarray(returned[:-1] & returned[1:] & apart & ~on_one_wall(scan))

    def __call__(self, scan: LaserScan, rng: np.random.Generator) -> LaserScan:
        """Return the scan with mixed ranges, or two echoes, at its edges."""
        gaps = np.abs(np.diff(scan.angles))
        offsets = rng.random(len(scan.ranges))[1:] * gaps
        edge = np.flatnonzero(self.edges(scan))
        # A beam may have an edge on either side, each with light on the neighbour's surface.
        beyond = self._beyond(offsets[edge]), self._beyond((gaps - offsets)[edge])
        if scan.intensities is not None:
            return self._lit(scan, scan.intensities, edge, beyond)
        ranges = scan.ranges.copy()
        near, far = scan.ranges[edge], scan.ranges[edge + 1]
        ranges[edge] += beyond[0] * (far - near)
        ranges[edge + 1] += beyond[1] * (near - far)
        walls = np.where(ranges == scan.ranges, scan.walls, -1)
        return replace(scan, ranges=ranges, walls=walls)

    def _beyond(self, away: Float) -> Float:
        """Share of a beam that falls beyond an edge at an angle (n,) from its middle [rad]."""
        return np.clip(0.5 - away / self.divergence, 0.0, 0.5)

    def _lit(
        self, scan: LaserScan, light: Float, edge: Int, beyond: tuple[Float, Float]
    ) -> LaserScan:
        """The scan with the light of both surfaces at its edges.

        Args:
            scan: The scan.
            light: (beams,) its intensities.
            edge: (e,) the beams that have an edge after them.
            beyond: The shares (e,) of these beams beyond the edge, and of those after it.
        """
        ranges, walls, lights = scan.ranges.copy(), scan.walls.copy(), light.copy()
        echoes, echo_lights = scan.echoes, scan.echo_intensities
        if echoes is None or echo_lights is None:
            echoes, echo_lights = ranges[:, None], lights[:, None]
        echoes, echo_lights = echoes.copy(), echo_lights.copy()
        shares = np.zeros((len(ranges), 2))
        shares[edge + 1, 0], shares[edge, 1] = beyond[1], beyond[0]
        for beam in np.flatnonzero(shares.any(axis=1)).tolist():
            own = 1.0 - float(shares[beam].sum())
            met = [
                _Echo(float(scan.ranges[at]), share * float(light[at]), int(scan.walls[at]))
                for at, share in zip(
                    (beam, beam - 1, beam + 1), (own, *shares[beam].tolist()), strict=True
                )
                if share > 0.0
            ]
            others = [
                _Echo(float(away), own * float(back), -1)
                for away, back in zip(echoes[beam], echo_lights[beam], strict=True)
                if np.isfinite(away) and away != scan.ranges[beam]
            ]
            found = sorted([*self._together(met), *others])
            found = [one for one in found if one.light >= self.threshold]
            chosen = _Echo(np.inf, 0.0, -1)
            if found:
                strongest = max(found, key=lambda one: one.light)
                chosen = {"first": found[0], "last": found[-1]}.get(self.echo, strongest)
            ranges[beam], lights[beam], walls[beam] = chosen
            slots = echoes.shape[1]
            kept = sorted(sorted(found, key=lambda one: -one.light)[:slots])
            none = [_Echo(np.inf, 0.0, -1)] * (slots - len(kept))
            echoes[beam] = [one.range for one in (*kept, *none)]
            echo_lights[beam] = [one.light for one in (*kept, *none)]
        several = scan.echoes is not None
        return replace(
            scan,
            ranges=ranges,
            walls=walls,
            intensities=lights,
            echoes=echoes if several else None,
            echo_intensities=echo_lights if several else None,
        )

    def _together(self, echoes: Sequence[_Echo]) -> list[_Echo]:
        """Echoes in the order of their ranges, those within a pulse as one."""
        found: list[_Echo] = []
        for echo in sorted(echoes):
            if found and echo.range - found[-1].range <= self.pulse:
                last = found.pop()
                light = last.light + echo.light
                away = last.range + (echo.range - last.range) * echo.light / light
                echo = _Echo(away, light, -1)
            found.append(echo)
        return found


def on_one_wall(scan: LaserScan) -> Bool:
    """Which beams (beams − 1,) hit the same wall as the next one."""
    known = scan.walls >= 0
    return np.asarray(known[:-1] & known[1:] & (scan.walls[:-1] == scan.walls[1:]))
