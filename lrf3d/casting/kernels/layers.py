"""Reading the layers of lidars and the rows of cameras off skylines, compiled."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.beams import (
    counted,
    length_of,
    within,
)
from lrf3d.casting.kernels.predicates import (
    Beam,
    Wall,
    compare_height,
    index_of,
    lengths,
)
from lrf3d.casting.kernels.scans import PADDING
from lrf3d.casting.kernels.skyline import (
    BEGINS,
    EXITS,
    Skylines,
    wall_of,
)
from lrf3d.casting.kernels.tree import (
    ROOM,
    Plain,
)
from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import Float, Records

# Relative difference in distance of floor and wall above which float64 decides which is hit first.
CLEAR_FLOOR = 1e-12


class Layers(NamedTuple):
    """Layers by ascending slope, and what becomes of t."""

    slopes: Float  # (k, layers) for each azimuth, or of k = 1 for all.
    lengths: Float  # (layers,) how long a beam is at t = 1: its range is t times this.
    nears: Float  # (layers,) the least t that is measured [m],
    reaches: Float  # (layers,) and the largest.
    range_max: float  # [m]


@compiled
def read_layers(
    places: Float, directions: Float, z: float, plain_layers: Plain, plain_skies: Plain,
    ranges: Float, hits: NDArray[np.int32],
) -> None:  # fmt: skip
    """Fill ranges and walls (azimuths, layers) from skylines, over a floor at z = 0.

    The places x, y [m] of azimuths (k, 2 or 3) are those of all if k = 1. Their directions
    (2, azimuths) are followed by PADDING numbers of any value. The skylines are empty afterwards.
    """
    skies = Skylines(*plain_skies)
    layers = Layers(*plain_layers)
    slopes = layers.slopes
    entries = skies.entries
    columns = len(skies.counts)
    many = len(layers.lengths)
    floor = np.empty((1, many))
    ground = np.empty(many)
    # Walls between these distances are in the range of all layers.
    near = 0.0
    far = np.inf
    for r in range(many):
        near = max(near, layers.nears[r] * ROOM)
        far = min(far, layers.reaches[r] / ROOM)
    firsts = _first_lengths(places, directions, skies)
    for i in range(columns):
        beam = _beam_of(places, directions, i)
        own = min(i, len(slopes) - 1)
        if i < len(slopes):
            for r in range(many):
                slope = slopes[i, r]
                floor[0, r] = -z / slope if slope < 0.0 else np.inf
                ground[r] = _limited(floor[0, r], r, layers)
        count = skies.counts[i]
        mixed = skies.mixed[i] != 0
        skies.covered[i] = 0.0
        skies.mixed[i] = skies.counts[i] = 0
        for r in range(index_of(many)):
            ranges[i, r] = ground[r]
            hits[i, r] = -1
        if mixed:
            for r in range(many):
                ranges[i, r], hits[i, r] = _among_overlapping(
                    entries[i::columns][:count],
                    beam,
                    (z, slopes[own, r], r),
                    layers,
                    ground[r],
                )
            continue
        first = 0
        for j in range(count):
            entry = entries[j * columns + i]
            stop = many
            if slopes[own, many - 1] > entry.sure:
                stop = _beyond(slopes, own, (first, many), entry.sure)
            while stop < many and slopes[own, stop] <= entry.most:
                wall = wall_of(entry)
                if compare_height(slopes[own, stop], z, entry.height, beam, wall) > 0:
                    break
                stop += 1
            if stop == first:
                continue
            if entry.exits == EXITS:
                for r in range(first, stop):
                    t = (entry.height - z) / slopes[own, r]
                    ranges[i, r] = _limited(t, r, layers)
                    hits[i, r] = max(entry.row, -1) if math.isfinite(ranges[i, r]) else -1
                first = stop
                continue
            wall = wall_of(entry)
            t = firsts[i] if j == 0 else np.nan
            t = t if t >= 0.0 else length_of(beam, wall)
            begin = _beyond(floor, 0, (first, stop), t * (1.0 - CLEAR_FLOOR))
            while begin < stop and floor[0, begin] < t * (1.0 + CLEAR_FLOOR):
                if compare_height(slopes[own, begin], z, 0.0, beam, wall) >= 0:
                    break
                begin += 1
            if near < t < far:
                for r in range(index_of(begin), index_of(stop)):
                    ranges[i, r] = t * layers.lengths[r]
                    hits[i, r] = max(entry.row, -1)
            else:
                for r in range(begin, stop):
                    ranges[i, r] = _within(t, r, beam, wall, layers)
                    hits[i, r] = max(entry.row, -1) if math.isfinite(ranges[i, r]) else -1
            first = stop


@inner
def _first_lengths(places: Float, directions: Float, skies: Skylines) -> Float:
    """The t (azimuths,) of the first entries, NaN where float64 falls short.

    Neighbouring azimuths from one place at one wall share its area, and the loop over them is
    vectorised.
    """
    entries = skies.entries
    columns = len(skies.counts)
    found = np.empty(columns + PADDING)
    stop = 0
    while stop < columns:
        start = stop
        stop += 1
        if skies.counts[start] == 0:
            continue
        beam = _beam_of(places, directions, start)
        wall = wall_of(entries[start])
        while (
            stop < columns
            and wall_of(entries[stop]) == wall
            and _beam_of(places, directions, stop)[:2] == beam[:2]
        ):  # fmt: skip
            stop += 1
        lengths(beam[:2], directions[0], directions[1], wall, (start, stop), found)
    return found


@borrower
def _beam_of(places: Float, directions: Float, i: int) -> Beam:
    """The beam of an azimuth, from a place of its own or that of all."""
    row = min(i, len(places) - 1)
    return Beam(
        counted(places[row, 0]), counted(places[row, 1]),
        counted(directions[0, i]), counted(directions[1, i]),
    )  # fmt: skip


@borrower
def _beyond(values: Float, row: int, part: tuple[int, int], limit: float) -> int:
    """Index of the first value above a limit in an ascending part of a row, or the part's end."""
    low, high = part
    while low < high:
        middle = (low + high) // 2
        if values[row, middle] <= limit:
            low = middle + 1
        else:
            high = middle
    return low


@inner
def _within(t: float, r: int, beam: Beam, wall: Wall, layers: Layers) -> float:
    """The range of a layer at a wall that it hits at t; limits are decided exactly."""
    t = within(t, layers.nears[r], layers.reaches[r], beam, wall)
    return min(t * layers.lengths[r], layers.range_max) if t < np.inf else np.inf


@borrower
def _limited(t: float, r: int, layers: Layers) -> float:
    """The range of a layer at t: +inf above its largest, −inf below its least."""
    if not t <= layers.reaches[r]:
        return np.inf
    return min(t * layers.lengths[r], layers.range_max) if t >= layers.nears[r] else -np.inf


@inner
def _among_overlapping(
    row: Records, beam: Beam, place: tuple[float, float, int], layers: Layers, ground: float
) -> tuple[float, int]:  # fmt: skip
    """The range and the wall of a layer in a skyline with low walls along the beam."""
    z, slope, r = place
    for j in range(len(row)):
        entry = row[j]
        wall = wall_of(entry)
        if compare_height(slope, z, entry.height, beam, wall) > 0:
            continue
        top = entry.height if entry.exits == EXITS else -np.inf
        name = entry.row
        for k in range(j):
            # The beam came down earlier, onto a wall along it that has begun and not ended.
            along = row[k]
            if (
                along.exits == BEGINS
                and along.height > top
                and _ends_after(row, j, along.row)
                and compare_height(slope, z, along.height, beam, wall) <= 0
            ):
                top = along.height
                name = along.row
        if top > -np.inf:
            found = _limited((top - z) / slope, r, layers)
        elif compare_height(slope, z, 0.0, beam, wall) >= 0:
            found = _within(length_of(beam, wall), r, beam, wall, layers)
        else:
            break
        return found, max(name, -1) if math.isfinite(found) else -1
    return ground, -1


@inner
def _ends_after(row: Records, first: int, name: int) -> bool:
    """Whether a wall along the beam ends at one of the entries from the first on."""
    for k in range(first, len(row)):
        if row[k].exits == EXITS and row[k].row == name:
            return True
    return False
