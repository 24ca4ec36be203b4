"""MixedPixels: beams with a width, which meet two surfaces at an edge.

A true scan comes in; what leaves is the scan with mixed ranges at its edges, or, where the light is
known and the two surfaces are farther apart than a pulse is long, with an echo of each.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Bool, Float, generator, number
from lrf3d.laser.noise import NO_SPREAD, Rng
from lrf3d.laser.range_finder import ECHO_CHOICES
from lrf3d.laser.scan import LaserScan

PULSE = 0.75
"""Distance [m] within which two surfaces return one echo: light's way there and back in the 5 ns
that the pulses of common range finders last."""

Echo = tuple[float, float, int]
"""Light that returns: its range [m], its intensity, and its wall, −1 where it is mixed."""


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
    pulse: float = PULSE
    echo: str = "strongest"
    threshold: float = 0.0
    spread: ClassVar[tuple[float, float]] = NO_SPREAD

    def __post_init__(self) -> None:
        for name in ("divergence", "jump", "pulse"):
            number(getattr(self, name), f"mixed pixels: {name}", positive=True)
        number(self.threshold, "mixed pixels: threshold")
        if not isinstance(self.echo, str) or self.echo not in ECHO_CHOICES:
            raise InputError(
                f"mixed pixels: echo {shown(self.echo)}, expected one of {', '.join(ECHO_CHOICES)}"
            )

    def __call__(self, scan: LaserScan, rng: Rng) -> LaserScan:
        """Return the scan with mixed ranges, or two echoes, at its edges."""
        gaps = np.abs(np.diff(scan.angles))
        offsets = generator(rng).random(len(scan.ranges))[1:] * gaps
        returned = np.isfinite(scan.ranges)
        apart = np.abs(np.diff(np.where(returned, scan.ranges, 0.0))) > self.jump
        edge = np.flatnonzero(returned[:-1] & returned[1:] & apart & ~on_one_wall(scan))
        # The shares of each beam that fall on the surface of the beam before it, and after it.
        before, after = np.zeros((2, len(scan.ranges)))
        after[edge] = self._beyond(offsets[edge])
        before[edge + 1] = self._beyond((gaps - offsets)[edge])
        if scan.intensities is not None:
            return self._lit(scan, scan.intensities, before, after)
        ranges = scan.ranges.copy()
        near, far = scan.ranges[edge], scan.ranges[edge + 1]
        ranges[edge] += after[edge] * (far - near)
        ranges[edge + 1] += before[edge + 1] * (near - far)
        walls = np.where(ranges == scan.ranges, scan.walls, -1)
        return replace(scan, ranges=ranges, walls=walls)

    def _beyond(self, away: Float) -> Float:
        """Share of a beam that falls beyond an edge at an angle (n,) from its middle [rad]."""
        return np.clip(0.5 - away / self.divergence, 0.0, 0.5)

    def _lit(self, scan: LaserScan, light: Float, before: Float, after: Float) -> LaserScan:
        """The scan with intensities (beams,), with the light of both surfaces at its edges."""
        ranges, walls, lights = scan.ranges.copy(), scan.walls.copy(), light.copy()
        lit = scan.echoes is not None and scan.echo_intensities is not None
        echoes = np.array(scan.echoes if lit else ranges[:, None])
        echo_lights = np.array(scan.echo_intensities if lit else lights[:, None])
        for beam in np.flatnonzero(before + after).tolist():
            own = 1.0 - (before[beam] + after[beam])
            parts = (own, beam), (before[beam], beam - 1), (after[beam], beam + 1)
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
            found = [
                echo
                for echo in sorted([*self._together(met), *others])
                if echo[1] >= self.threshold
            ]
            brightest = sorted(found, key=lambda echo: echo[1], reverse=True)
            choices = {"first": found[:1], "last": found[-1:], "strongest": brightest[:1]}
            ranges[beam], lights[beam], walls[beam] = [*choices[self.echo], (np.inf, 0.0, -1)][0]
            kept = sorted(brightest[: echoes.shape[1]])
            echoes[beam], echo_lights[beam] = np.inf, 0.0
            for slot, (away, back, _) in enumerate(kept):
                echoes[beam, slot], echo_lights[beam, slot] = away, back
        made = replace(scan, ranges=ranges, walls=walls, intensities=lights)
        if scan.echoes is None:
            return made
        return replace(made, echoes=echoes, echo_intensities=echo_lights)

    def _together(self, echoes: list[Echo]) -> list[Echo]:
        """Echoes in the order of their ranges, those within a pulse as one."""
        found: list[Echo] = []
        for away, light, wall in sorted(echoes):
            if found and away - found[-1][0] <= self.pulse:
                nearer, back, _ = found.pop()
                both = back + light
                share = light / both if both else 0.5
                away, light, wall = nearer + (away - nearer) * share, both, -1
            found.append((away, light, wall))
        return found


def on_one_wall(scan: LaserScan) -> Bool:
    """Which beams (beams − 1,) hit the same wall as the next one."""
    known = scan.walls >= 0
    return np.asarray(known[:-1] & known[1:] & (scan.walls[:-1] == scan.walls[1:]))
