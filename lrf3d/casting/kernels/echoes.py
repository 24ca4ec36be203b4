"""Echoes of a beam, compiled: which of them a laser keeps and reports.

The echoes of a beam come in, in any order, with their intensities and the walls on their ways. What
leaves are the range, wall and intensity of the chosen one, and the strongest ones in order.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import borrower
from lrf3d.geometry import Float, Int

MOST_WALLS = 16
"""Number of walls on the way of a beam, those that it passes through included."""

MOST_ECHOES = 16
"""Echoes of one beam that are kept, the strongest ones."""

FIRST, LAST, STRONGEST = 0, 1, 2
"""Which echo is the range of a beam."""

WAY, LIGHT, LENGTH = 0, 1, 2
"""Columns of an echo: its range [m], its intensity, and the number of walls on its way."""


class Receiver(NamedTuple):
    """What the laser makes of the light."""

    threshold: float  # Least intensity of an echo.
    near_field: float  # Length of the near field [m].
    choice: int  # FIRST, LAST or STRONGEST.
    range_min: float  # Nearest distance that is measured [m].


class Lit(NamedTuple):
    """Arrays that the light of a scan fills; those of several scans have one more axis in front.

    Ranges [m], walls and intensities (beams,) are those of the chosen echoes; ranges and walls come
    in as those among the walls. The strongest echoes (beams, k) come the nearest first; k is 0
    where one is reported. Chains (beams, MOST_WALLS) are the walls on the way, then −1; or (0, 0).
    """

    ranges: Float
    walls: Int
    intensities: Float
    echo_ranges: Float
    echo_intensities: Float
    chains: Int


@borrower
def report(echoes: Float, ways: Int, count: int, receiver: Receiver, i: int, lit: Lit) -> None:
    """Report the echoes of beam i: one as its range, and the strongest ones in order."""
    _sort(echoes, ways, count)
    first = 0
    while first < count and echoes[first, WAY] < receiver.range_min:
        first += 1
    lit.ranges[i] = -np.inf if first > 0 else np.inf
    lit.walls[i], lit.intensities[i] = -1, 0.0
    chains, slots = lit.chains, lit.echo_ranges.shape[1]
    if len(chains) > 0:
        for k in range(MOST_WALLS):
            chains[i, k] = -1
    for slot in range(slots):
        lit.echo_ranges[i, slot], lit.echo_intensities[i, slot] = np.inf, 0.0
    if first == count:
        return
    chosen = count - 1 if receiver.choice == LAST else first
    slot = 0
    for k in range(first, count):
        stronger = 0
        for other in range(first, count):
            if echoes[other, LIGHT] > echoes[k, LIGHT] or (
                echoes[other, LIGHT] == echoes[k, LIGHT] and other < k
            ):
                stronger += 1
        if stronger == 0 and receiver.choice == STRONGEST:
            chosen = k
        if stronger < slots:
            lit.echo_ranges[i, slot] = echoes[k, WAY]
            lit.echo_intensities[i, slot] = echoes[k, LIGHT]
            slot += 1
    length = int(echoes[chosen, LENGTH])
    lit.ranges[i], lit.intensities[i] = echoes[chosen, WAY], echoes[chosen, LIGHT]
    lit.walls[i] = ways[chosen, length - 1]
    if len(chains) > 0:
        for k in range(length):
            chains[i, k] = ways[chosen, k]


@borrower
def _sort(echoes: Float, ways: Int, count: int) -> None:
    """Sort echoes by their ranges, and at equal ranges the stronger first; there are few."""
    for k in range(1, count):
        j = k
        while j > 0 and (
            echoes[j - 1, WAY] > echoes[j, WAY]
            or (echoes[j - 1, WAY] == echoes[j, WAY] and echoes[j - 1, LIGHT] < echoes[j, LIGHT])
        ):
            for column in range(3):
                held = echoes[j, column]
                echoes[j, column] = echoes[j - 1, column]
                echoes[j - 1, column] = held
            for column in range(MOST_WALLS):
                name = ways[j, column]
                ways[j, column] = ways[j - 1, column]
                ways[j - 1, column] = name
            j -= 1


@borrower
def keep(
    echoes: Float, ways: Int, count: int, way: float, light_back: float, chain: Int, walls: int
) -> int:
    """Keep an echo behind the first of a chain's walls; the number of echoes that are kept.

    Where there is no room it takes the place of the weakest, if that is weaker.
    """
    place = count
    if count == MOST_ECHOES:
        place = 0
        for k in range(count):
            if echoes[k, LIGHT] < echoes[place, LIGHT]:
                place = k
        if echoes[place, LIGHT] >= light_back:
            return count
    echoes[place, WAY], echoes[place, LIGHT], echoes[place, LENGTH] = way, light_back, walls
    for k in range(walls):
        ways[place, k] = chain[k]
    return max(count, place + 1)
