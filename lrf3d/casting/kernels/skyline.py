"""Skylines: which walls the layers of one azimuth hit, compiled; every decision is exact.

The beams of one azimuth of a level sensor lie in an upright plane. A wall of height h that the
plane crosses at distance t stops the beam of slope s if z + t·s ≤ h, that is s ≤ (h − z) / t, the
slope of the wall's top. So one planar traversal serves all layers: each azimuth keeps its skyline,
the walls that rise above all nearer ones in the order of t, and its layers are read off from the
bottom up.

The top of a closed object lower than the sensor is visible from above. A beam that passes over the
wall where it enters the object, but not over the wall where it leaves, hits the top between them:
the latter wall is an entry that `exits`, whose beams end where they come down to its height. A low
wall along the beam is such an interval, too.

Bounds are kept in 1 / t, as in the depth buffer of `fan`; where they overlap, the comparison is
made exactly with expansions.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.predicates import (
    Beam,
    Wall,
    compare,
)
from lrf3d.compiling import borrower, inner, record
from lrf3d.geometry.lines import Float, Int, Records

# Bound on the relative rounding error of the slope of a wall's top, in addition to that of 1 / t.
TOP_SLACK = 8.0 * 2.0**-53

# Kinds of entries: a wall that beams hit from outside, the wall at the far end of an object's top,
# and the near end of a low wall along the beam.
MEETS = 0
EXITS = 1
BEGINS = 2

# Returned instead of the place of an entry: it is hidden, or its bounds do not decide.
HIDDEN = -1
AMBIGUOUS = -2

# An entry of a skyline: a wall, or where beams leave the space over a low object.
ENTRY = record(
    low=float, high=float,  # Bounds on 1 / t [1/m].
    sure=float, most=float,  # Bounds on the slope of its top.
    height=float,  # [m]
    px=float, py=float, qx=float, qy=float,  # Its ends [m].
    row=int,  # Its number in the world, or −1.
    exits=int,  # What it is: MEETS, EXITS or BEGINS.
)  # fmt: skip


class Skylines(NamedTuple):
    """The skylines of azimuths."""

    entries: Records  # (room · azimuths,) of kind ENTRY: the first of all azimuths, the second, ….
    counts: Int  # (azimuths,) number of entries.
    # (azimuths,) 1 where a low wall runs along the beam: entries then overlap.
    mixed: NDArray[np.int8]
    room: int  # Largest number of entries of an azimuth.
    covered: Float  # (azimuths,) bound on 1 / t of the wall that hides all behind it [1/m].


class Eye(NamedTuple):
    """The sensor that looks at skylines: its height, and the limits of its layers."""

    z: float  # Its height [m].
    least: float  # The least slope of its layers,
    most: float  # and the largest.
    reach: float  # The largest t that it measures [m].


class Entry(NamedTuple):
    """An entry that is to be inserted into a skyline: see ENTRY."""

    low: float
    high: float
    sure: float
    most: float
    height: float
    wall: Wall
    row: int
    exits: int


@borrower
def entry_of(
    low: float, high: float, height: float, wall: Wall, name: tuple[int, int], z: float
) -> Entry:
    """An entry from bounds on 1 / t and its name: its number, and its kind."""
    rise = height - z
    sure = np.inf if rise >= 0.0 else -np.inf
    most = sure
    if high < np.inf:
        sure = rise * (low if rise >= 0.0 else high)
        most = rise * (high if rise >= 0.0 else low)
        sure -= TOP_SLACK * abs(sure)
        most += TOP_SLACK * abs(most)
    return Entry(low, high, sure, most, height, wall, name[0], name[1])


@inner
def insert(new: Entry, i: int, beam: Beam, eye: Eye, highest: float, skies: Skylines) -> bool:
    """Insert an entry into an azimuth's skyline unless it is hidden; False if there is no room."""
    place = place_of(new, i, eye, skies)
    if place == AMBIGUOUS:
        place = place_exactly(new, i, beam, eye, skies)
    return place == HIDDEN or put(new, i, place, eye, highest, skies)


@borrower
def place_of(new: Entry, i: int, eye: Eye, skies: Skylines) -> int:
    """The place of an entry in a skyline, HIDDEN, or AMBIGUOUS if the bounds do not decide."""
    if new.most < eye.least and new.exits != BEGINS:
        return HIDDEN
    entries = skies.entries
    columns = len(skies.counts)
    count: int = skies.counts[i]
    mixed = skies.mixed[i] != 0
    for k in range(count):
        entry = entries[k * columns + i]
        if new.low > entry.high:
            return k
        if not new.high < entry.low:
            return AMBIGUOUS
        if _hides(entry, new, eye, mixed):
            return HIDDEN
    return count


@inner
def place_exactly(new: Entry, i: int, beam: Beam, eye: Eye, skies: Skylines) -> int:
    """The place of an entry in a skyline, or HIDDEN, decided exactly."""
    entries = skies.entries
    columns = len(skies.counts)
    count: int = skies.counts[i]
    for k in range(count):
        entry = entries[k * columns + i]
        if _comes_first(new, entry, beam):
            return k
        if _hides(entry, new, eye, skies.mixed[i] != 0):
            return HIDDEN
    return count


@borrower
def _hides(near: Any, far: Any, eye: Eye, mixed: bool) -> bool:
    """Whether no layer that passes over the near entry can hit the far one.

    The ends of a wall along the beam are never hidden.
    """
    if mixed and far.exits != MEETS:
        return False
    if near.sure >= far.most or near.sure >= eye.most:
        return True
    return bool(near.height >= far.height and far.height >= eye.z)


@borrower
def put(new: Entry, i: int, place: int, eye: Eye, highest: float, skies: Skylines) -> bool:
    """Insert an entry at its place and remove those that it hides; False if there is no room."""
    entries = skies.entries
    columns = len(skies.counts)
    count: int = skies.counts[i]
    kept = place
    for k in range(place, count):
        if not _hides(new, entries[k * columns + i], eye, skies.mixed[i] != 0):
            if kept < k:
                entries[kept * columns + i] = entries[k * columns + i]
            kept += 1
    if kept == skies.room:
        return False
    for k in range(kept, place, -1):
        entries[k * columns + i] = entries[(k - 1) * columns + i]
    skies.counts[i] = kept + 1
    entry = entries[place * columns + i]
    entry.low = new.low
    entry.high = new.high
    entry.sure = new.sure
    entry.most = new.most
    entry.height = new.height
    entry.px, entry.py, entry.qx, entry.qy = new.wall
    entry.row = new.row
    entry.exits = new.exits
    if new.sure >= eye.most or (new.height >= highest and new.height >= eye.z):
        skies.covered[i] = max(skies.covered[i], new.low)
    return True


@inner
def _comes_first(new: Entry, entry: Any, beam: Beam) -> bool:
    """Whether a new entry is nearer than another one of a skyline, decided exactly."""
    if new.low > entry.high:
        return True
    if new.high < entry.low:
        return False
    order = compare(beam, new.wall, wall_of(entry))
    if order != 0:
        return order < 0
    # A beam that comes through the inside of an object has hit its top before.
    if (new.exits == EXITS) != (entry.exits == EXITS):
        return new.exits == EXITS
    return bool(new.row < entry.row)


@inner
def wall_of(entry: Any) -> Wall:
    """The wall of an entry."""
    return Wall(entry.px, entry.py, entry.qx, entry.qy)
