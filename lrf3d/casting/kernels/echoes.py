"""Echoes of a beam, compiled: which of them a laser keeps and reports.

The echoes of a beam come in, in any order, with their intensities and the walls on their ways. What
leaves are the range, wall and intensity of the chosen one, and the strongest ones in order.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import borrower
from lrf3d.geometry import Bool, Float, Int

MOST_WALLS = 16
"""Number of walls on the way of a beam, those that it passes through included."""

MOST_ECHOES = 16
"""Echoes of one beam that are kept, the strongest ones."""

NEAR_LIMIT = 1.0 + 1e-12
"""Ranges of opaque walls within this factor of range_min are decided by rationals."""

FIRST, LAST, STRONGEST = 0, 1, 2
"""Which echo is the range of a beam."""

WAY, LIGHT, LENGTH = 0, 1, 2
"""Columns of an echo: its range [m], its intensity, and the number of walls on its way."""


class Receiver(NamedTuple):
    """What the laser makes of the light.

    Attributes:
        threshold: Least intensity of an echo.
        near_field: Length of the near field [m].
        choice: FIRST, LAST or STRONGEST.
        range_min: Nearest distance that is measured [m].
    """

    threshold: float
    near_field: float
    choice: int
    range_min: float


PlainReceiver = tuple[float, float, int, float]


class Lit(NamedTuple):
    """Arrays that the light of a scan fills.

    Attributes:
        ranges: (beams,) ranges [m] of the chosen echoes; they come in as those among the walls.
        walls: (beams,) their walls; they come in likewise.
        intensities: (beams,) their intensities.
        echo_ranges: (beams, k) ranges [m] of the strongest echoes, the nearest first; k is 0 where
            one echo is reported.
        echo_intensities: (beams, k) their intensities.
        chains: (beams, MOST_WALLS) the walls on the way to the chosen echo, then −1; or (0, 0).
        undecided: (beams,) which beams are left to rationals.
    """

    ranges: Float
    walls: Int
    intensities: Float
    echo_ranges: Float
    echo_intensities: Float
    chains: Int
    undecided: Bool


PlainLit = tuple[Float, Int, Float, Float, Float, Int, Bool]


@borrower
def at_limit(echoes: Float, count: int, near: float) -> bool:
    """Whether an echo is so close to range_min [m] that rounding might decide."""
    if near > 0.0:
        for k in range(count):
            if near / NEAR_LIMIT <= echoes[k, WAY] <= near * NEAR_LIMIT:
                return True
    return False


@borrower
def report(echoes: Float, ways: Int, count: int, receiver: Receiver, i: int, lit: Lit) -> None:
    """Report the echoes of a beam: one as its range, and the strongest ones in order."""
    for k in range(1, count):
        # Sorted by their ranges, and at equal ranges the stronger first; there are few.
        j = k
        while j > 0 and (
            echoes[j - 1, WAY] > echoes[j, WAY]
            or (echoes[j - 1, WAY] == echoes[j, WAY] and echoes[j - 1, LIGHT] < echoes[j, LIGHT])
        ):
            for column in range(3):
                held = echoes[j, column]
                echoes[j, column] = echoes[j - 1, column]
                echoes[j - 1, column] = held
            for column in range(int(max(echoes[j, LENGTH], echoes[j - 1, LENGTH]))):
                name = ways[j, column]
                ways[j, column] = ways[j - 1, column]
                ways[j - 1, column] = name
            j -= 1
    ranges, walls, intensities, echo_ranges, echo_intensities, chains, _ = lit
    first = 0
    while first < count and echoes[first, WAY] < receiver.range_min:
        first += 1
    ranges[i] = -np.inf if first > 0 else np.inf
    walls[i], intensities[i] = -1, 0.0
    if len(chains) > 0:
        for k in range(MOST_WALLS):
            chains[i, k] = -1
    slots = echo_ranges.shape[1]
    for slot in range(slots):
        echo_ranges[i, slot], echo_intensities[i, slot] = np.inf, 0.0
    if first == count:
        return
    chosen = count - 1 if receiver.choice == LAST else first
    if receiver.choice == STRONGEST:
        for k in range(first, count):
            if echoes[k, LIGHT] > echoes[chosen, LIGHT]:
                chosen = k
    length = int(echoes[chosen, LENGTH])
    ranges[i], intensities[i] = echoes[chosen, WAY], echoes[chosen, LIGHT]
    walls[i] = ways[chosen, length - 1]
    if len(chains) > 0:
        for k in range(length):
            chains[i, k] = ways[chosen, k]
    if slots == 0:
        return
    slot = 0
    for k in range(first, count):
        stronger = 0
        for other in range(first, count):
            if echoes[other, LIGHT] > echoes[k, LIGHT] or (
                echoes[other, LIGHT] == echoes[k, LIGHT] and other < k
            ):
                stronger += 1
        if stronger < slots:
            echo_ranges[i, slot] = echoes[k, WAY]
            echo_intensities[i, slot] = echoes[k, LIGHT]
            slot += 1


@borrower
def keep(
    echoes: Float, ways: Int, count: int, way: float, light_back: float, chain: Int, walls: int
) -> int:
    """Keep an echo, in place of the weakest where there is no room; the number of echoes.

    Args:
        echoes: (MOST_ECHOES, 3) the echoes so far.
        ways: (MOST_ECHOES, MOST_WALLS) the walls on their ways.
        count: How many there are.
        way: Range [m] of the new one.
        light_back: Its intensity.
        chain: (MOST_WALLS,) the walls on its way.
        walls: How many those are.
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
