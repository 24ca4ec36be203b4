"""Echoes of a beam, compiled: which of them a laser keeps and reports.

The echoes of a beam come one by one, in any order. One of them is its range, and the strongest are
kept in the order of their ranges.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower
from lrf3d.geometry import Float, Int

MOST_WALLS = 16
"""Number of walls on the path of a beam, those that it passes through included."""

FIRST, LAST, STRONGEST = 0, 1, 2
"""Which echo is the range of a beam."""


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
def clear(i: int, lit: Lit) -> None:
    """Let beam i have no echo."""
    lit.ranges[i], lit.walls[i], lit.intensities[i] = np.inf, -1, 0.0
    for slot in range(lit.echoes.shape[1]):
        lit.echoes[i, slot], lit.echo_intensities[i, slot] = np.inf, 0.0
    for k in range(lit.chains.shape[1]):
        lit.chains[i, k] = -1


@borrower
def receive(
    way: float, light: float, chain: Int, walls: int, receiver: Receiver, i: int, lit: Lit
) -> None:
    """Take an echo of beam i from behind the first of a chain's walls."""
    nearest, strongest = lit.ranges[i], lit.intensities[i]
    if way < receiver.range_min:
        # Too near to be measured, which is reported where nothing else returns.
        lit.ranges[i] = -np.inf if nearest == np.inf else nearest
        return
    farther, brighter = way > nearest, light > strongest
    chosen = brighter or (light == strongest and not farther)
    if receiver.choice != STRONGEST:
        chosen = farther if receiver.choice == LAST else way < nearest
        chosen = chosen or (way == nearest and brighter)
    if chosen or lit.walls[i] < 0:
        lit.ranges[i], lit.walls[i], lit.intensities[i] = way, chain[walls - 1], light
        for k in range(lit.chains.shape[1]):
            lit.chains[i, k] = chain[k] if k < walls else -1
    _keep(way, light, lit.echoes[i], lit.echo_intensities[i])


@borrower
def _keep(way: float, light: float, ways: Float, lights: Float) -> None:
    """Keep an echo among the strongest (k,), which lie in order; free places are dark."""
    slot, slots = 0, len(ways)
    for k in range(1, slots):
        slot = k if lights[k] <= lights[slot] else slot
    if slots == 0 or light < lights[slot] or (light == lights[slot] and way >= ways[slot]):
        return
    # It takes the place of the weakest, and then its own.
    while slot + 1 < slots and ways[slot + 1] < way:
        ways[slot], lights[slot] = ways[slot + 1], lights[slot + 1]
        slot += 1
    while slot > 0 and (
        ways[slot - 1] > way or (ways[slot - 1] == way and lights[slot - 1] < light)
    ):
        ways[slot], lights[slot] = ways[slot - 1], lights[slot - 1]
        slot -= 1
    ways[slot], lights[slot] = way, light
