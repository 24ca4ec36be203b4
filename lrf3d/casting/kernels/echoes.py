"""The light that returns to a laser, compiled: what surfaces send back, and the echoes it keeps.

Intensities are relative: 1 is that of a white wall at 1 m that is met at a right angle.

The laser equation is that of W. Wagner et al., "Gaussian decomposition and calibration of a novel
small-footprint full-waveform digitising airborne laser scanner", 2006, for targets wider than the
beam. Shares of a pane follow Fresnel's equations for unpolarised light, summed over all reflections
between its two faces (M. Born and E. Wolf, "Principles of Optics", section 1.5).

The echoes of a beam come one by one, in any order. One of them is its range, and the strongest are
kept in the order of their ranges.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, compiled, record
from lrf3d.geometry.lines import Float, Int, Records

# [m] Distance up to which intensities do not depend on the distance.
CLOSEST = 0.01

# [share] Least light, there and back, with which a beam goes on: less is lost in the noise of all
# but the strongest echoes.
LEAST_SHARE = 0.01

# [walls] Most walls on the path of a beam, those that it passes through included.
MOST_WALLS = 16

# The choices of the echo that is the range of a beam.
FIRST = 0
LAST = 1
STRONGEST = 2

# The optics of a material.
SURFACE = record(
    diffuse=float, specular=float, lobe=float, transmission=float, index=float, retro=float,
    mirrors=float,  # whether beams go on mirrored, 0 or 1
)  # fmt: skip


class Receiver(NamedTuple):
    """What the laser makes of the light."""

    threshold: float  # Least intensity of an echo.
    near_field: float  # Length of the near field [m].
    choice: int  # FIRST, LAST or STRONGEST.
    range_min: float  # Nearest distance that is measured [m].


class Lit(NamedTuple):
    """The light of a scan; that of several scans or layers has one more axis in front.

    Ranges [m], walls and intensities (beams,) are those of the chosen echoes; ranges and walls come
    in as those among the walls. The strongest echoes (beams, k) come the nearest first; k is 0
    where one is reported. Chains (beams, 16) are the walls on the path, then −1; or (beams, 0).
    """

    ranges: Float
    walls: Int
    intensities: Float
    echoes: Float
    echo_intensities: Float
    chains: Int

    def scans(self) -> "Iterator[Lit]":
        """The light of each of several scans."""
        return (Lit(*each) for each in zip(*self, strict=True))

    def arrays(self, echoes: int) -> tuple[Any, ...]:
        """What a LaserScan takes: ranges, walls and intensities, and the echoes if several are."""
        return self[: 5 if echoes > 1 else 3]

    def part(self, scans: slice) -> "Lit":
        """The light of some of several scans."""
        rows: tuple[Any, ...] = tuple(each[scans] for each in self)
        return Lit(*rows)


@borrower
def shares(cos: float, surface: Any) -> tuple[float, float]:
    """Shares of the light that a surface reflects in its lobe and lets through, at an incidence.

    Cos is the cosine of its angle. Without the refractive index of a pane, 0, the shares are those
    of the material: specular and transmission. The diffuse share is lost to both.
    """
    index = surface.index
    if index == 0.0:
        return surface.specular, surface.transmission
    sin = math.sqrt(max(0.0, 1.0 - cos * cos)) / index
    inside = math.sqrt(max(0.0, 1.0 - sin * sin))
    across = 1.0
    along = 1.0
    if cos + inside > 0.0:
        across = ((cos - index * inside) / (cos + index * inside)) ** 2
        along = ((inside - index * cos) / (inside + index * cos)) ** 2
    # With the share R at each face, 2 R / (1 + R) of each polarisation is mirrored.
    mirrored = across / (1.0 + across) + along / (1.0 + along)
    rest = 1.0 - surface.diffuse
    return rest * mirrored, rest * (1.0 - mirrored)


@borrower
def brightness(cos: float, sin: float, surface: Any, mirrored: float) -> float:
    """How bright a lit surface is for the laser, compared with a white wall at a right angle.

    The lobe [rad] about the mirrored direction is Gaussian, with the mirrored share of the light.
    Seen from the laser its middle lies twice the angle of incidence away.
    """
    lobe = surface.lobe
    bright = float((surface.diffuse + surface.retro) * cos)
    # Beyond forty standard deviations float64 has no light left, and exp takes its longest.
    if mirrored > 0.0 and lobe > 0.0 and sin < 20.0 * lobe:
        angle = 2.0 * math.atan2(sin, cos) / lobe
        # A share of 1 that is reflected diffusely has the density 1 / π along the normal.
        bright += mirrored / (2.0 * lobe * lobe) * math.exp(-0.5 * angle * angle)
    return bright


@borrower
def intensity(bright: float, distance: float, near_field: float) -> float:
    """The laser equation: intensity of the light from a surface of a brightness at a distance [m].

    In the near field the image of the spot is larger than the detector, which catches the share
    1 − exp(−2 (distance / near_field)²) of its light (W. Fang et al., "Intensity correction of
    terrestrial laser scanning data by estimating laser transmission function", 2015).
    """
    away = max(distance, CLOSEST)
    value = bright / (away * away)
    if near_field > 0.0:
        value *= math.expm1(-2.0 * (away / near_field) ** 2) / math.expm1(-2.0 / near_field**2)
    return value


@compiled
def reflect(cosines: Float, kinds: Int, surfaces: Records, ranges: Float, found: Float) -> None:
    """Fill the intensities (n,) of beams that end at surfaces of some kinds."""
    for i in range(len(ranges)):
        cos = cosines[i]
        surface = surfaces[kinds[i]]
        mirrored, _ = shares(cos, surface)
        sin = math.sqrt(max(0.0, 1.0 - cos * cos))
        found[i] = intensity(brightness(cos, sin, surface, mirrored), ranges[i], 0.0)


@borrower
def clear(i: int, lit: Lit) -> None:
    """Let beam i have no echo."""
    lit.ranges[i] = np.inf
    lit.walls[i] = -1
    lit.intensities[i] = 0.0
    for slot in range(lit.echoes.shape[1]):
        lit.echoes[i, slot] = np.inf
        lit.echo_intensities[i, slot] = 0.0
    for k in range(lit.chains.shape[1]):
        lit.chains[i, k] = -1


@borrower
def receive(
    way: float, light: float, chain: Int, walls: int, receiver: Receiver, i: int, lit: Lit
) -> None:
    """Take an echo of beam i from behind the first of a chain's walls."""
    nearest = lit.ranges[i]
    strongest = lit.intensities[i]
    if way < receiver.range_min:
        # Too near to be measured, which is reported where nothing else returns.
        lit.ranges[i] = -np.inf if nearest == np.inf else nearest
        return
    farther = way > nearest
    brighter = light > strongest
    chosen = brighter or (light == strongest and not farther)
    if receiver.choice != STRONGEST:
        chosen = farther if receiver.choice == LAST else way < nearest
        chosen = chosen or (way == nearest and brighter)
    if chosen or lit.walls[i] < 0:
        lit.ranges[i] = way
        lit.walls[i] = chain[walls - 1]
        lit.intensities[i] = light
        for k in range(lit.chains.shape[1]):
            lit.chains[i, k] = chain[k] if k < walls else -1
    _keep(way, light, lit.echoes[i], lit.echo_intensities[i])


@borrower
def _keep(way: float, light: float, ways: Float, lights: Float) -> None:
    """Keep an echo among the strongest (k,), which lie in order; free places are dark."""
    slot = 0
    slots = len(ways)
    for k in range(1, slots):
        slot = k if lights[k] <= lights[slot] else slot
    if slots == 0 or light < lights[slot] or (light == lights[slot] and way >= ways[slot]):
        return
    # It takes the place of the weakest, and then its own.
    while slot + 1 < slots and ways[slot + 1] < way:
        ways[slot] = ways[slot + 1]
        lights[slot] = lights[slot + 1]
        slot += 1
    while slot > 0 and (
        ways[slot - 1] > way or (ways[slot - 1] == way and lights[slot - 1] < light)
    ):
        ways[slot] = ways[slot - 1]
        lights[slot] = lights[slot - 1]
        slot -= 1
    ways[slot] = way
    lights[slot] = light
