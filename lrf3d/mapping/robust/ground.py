"""Ground: of each cell of the ground whether beams ended there straight, or by way of a mirror.

Returns of kept scans enter, as it is known which of them mirrors turned; leave how reflective the
walls there are, and the parts of walls that only mirrors showed.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.light import RANGE, REFLECTANCE, UX, UY, way_to_first

CELL = 0.15
"""[m] Size of a cell. Each return counts in the nine cells around it as well."""

LARGEST_SPREAD = 0.1
"""[share] Where the reflectance differs by more, nothing is compared with it: metal."""

NOTHING, UNSURE, DIRECT, TURNED, LIGHTS, SUM, SQUARES = range(7)
"""What a return shows where the beam ended: nothing, perhaps an image and perhaps not, what is
there, or an image. These are columns of the table; the others are the number of reflectances, their
sum, and that of their squares."""

DEPTH = 0.2
"""[m] How far behind a mirror an image lies at least."""

SAMPLE = 0.1
"""[m] Steps in which segments are searched for images."""

LEAST_LEFT, RIM = 5, 2
"""[samples] What is left of a segment beside its images stays from so many on that are seen; by so
many it is cut where an image begins."""

LEAST_CELLS = 1 << 14


class Ground(NamedTuple):
    """The cells, by hashing: the key of each row, −1 where it is free, and its `SQUARES` columns.

    `taken` (1,) is the number of rows that are taken.
    """

    keys: Int
    values: Float
    taken: Int

    @classmethod
    def of_size(cls, size: int = LEAST_CELLS) -> "Ground":
        """Empty ground."""
        return cls(np.full(size, -1), np.zeros((size, 7)), np.zeros(1, np.int64))

    def with_room(self, returns: int) -> "Ground":
        """The ground with room for so many more returns."""
        if 2 * (self.taken[0] + 9 * returns) <= len(self.keys):
            return self
        grown = Ground.of_size(2 * len(self.keys))
        move_cells(self, grown)
        return grown.with_room(returns)


@inner
def cell_of(x: float, y: float) -> int:
    """The cell of a point [m], as a number of its own."""
    column, line = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    return ((column & 0x7FFFFFFF) << 31) | (line & 0x7FFFFFFF)


@inner
def row_of(keys: Int, cell: int) -> int:
    """The row of a cell, or that in which it would be."""
    mask = len(keys) - 1
    row = ((cell ^ (cell >> 29)) * 0x9E3779B1 >> 7) & mask
    while keys[row] != cell and keys[row] != -1:
        row = (row + 1) & mask
    return row


@compiled
def move_cells(ground: Ground, grown: Ground) -> None:
    """Put the cells into a larger table."""
    for old in range(len(ground.keys)):
        if ground.keys[old] != -1:
            row = row_of(grown.keys, ground.keys[old])
            grown.keys[row], grown.values[row] = ground.keys[old], ground.values[old]
    grown.taken[0] = ground.taken[0]


@compiled
def sort_returns(
    places: Float, rays: Float, kinds: Int, mirrors: Float, wider: Float, ground: Ground
) -> None:
    """Count where the rays (k, n, 8) of kept scans ended, as it is known now which were turned.

    Kinds (k, n) are what each was counted as before, and are written. Mirrors (m, 5) with their
    rims are wider: beams through the rims show nothing. The ground has room.
    """
    for scan in range(len(places)):
        for beam in range(rays.shape[1]):
            ray = rays[scan, beam]
            if ray[RANGE] <= 0.0:
                continue
            kind, before = DIRECT, kinds[scan, beam]
            if way_to_first(places[scan], ray, mirrors, -1.0) < ray[RANGE] - DEPTH:
                kind = TURNED
            elif way_to_first(places[scan], ray, wider, -1.0) < ray[RANGE] - DEPTH:
                kind = UNSURE
            if kind == before:
                continue
            kinds[scan, beam] = kind
            x = places[scan, 0] + ray[RANGE] * ray[UX]
            y = places[scan, 1] + ray[RANGE] * ray[UY]
            for around in range(9):
                cell = cell_of(x + CELL * (around // 3 - 1), y + CELL * (around % 3 - 1))
                row = row_of(ground.keys, cell)
                if ground.keys[row] == -1:
                    ground.keys[row] = cell
                    ground.taken[0] += 1
                values = ground.values[row]
                values[kind] += 1.0
                if before != NOTHING:
                    values[before] -= 1.0
                elif ray[REFLECTANCE] > 0.0:
                    values[LIGHTS] += 1.0
                    values[SUM] += ray[REFLECTANCE]
                    values[SQUARES] += ray[REFLECTANCE] * ray[REFLECTANCE]


@inner
def reflectance_at(ground: Ground, x: float, y: float) -> float:
    """The reflectance at a point [m]: −1 where nothing is, 0 where it is not known, or not one."""
    row = row_of(ground.keys, cell_of(x, y))
    values = ground.values[row]
    if ground.keys[row] == -1 or values[DIRECT] <= 0.0:
        return -1.0
    if values[LIGHTS] == 0.0:
        return 0.0
    mean = values[SUM] / values[LIGHTS]
    spread = values[SQUARES] / values[LIGHTS] - mean * mean
    result: float = mean if spread <= (LARGEST_SPREAD * mean) ** 2 else 0.0
    return result


@compiled
def find_real_parts(ground: Ground, segments: Float, parts: Float) -> int:
    """Find the parts of segments (m, 4) [m] that not only turned beams show.

    ``parts`` (k, 3) is filled with a segment's row, and the shares of it where a part begins and
    ends; their number is returned.
    """
    found = 0
    for row in range(len(segments)):
        x1, y1, x2, y2 = segments[row]
        count = max(int(np.ceil(np.hypot(x2 - x1, y2 - y1) / SAMPLE)), 1)
        begin, first, last, seen = 0, 0, 0, 0
        for sample in range(count + 1):
            if sample < count:
                share = (sample + 0.5) / count
                cell = cell_of(x1 + share * (x2 - x1), y1 + share * (y2 - y1))
                at = row_of(ground.keys, cell)
                direct = ground.keys[at] != -1 and ground.values[at, DIRECT] > 0.0
                if direct:
                    first = first if seen else sample
                    last = sample + 1
                    seen += 1
                if direct or ground.keys[at] == -1 or ground.values[at, TURNED] <= 0.0:
                    continue
            whole = begin == 0 and sample == count
            if (whole or seen >= LEAST_LEFT) and found < len(parts):
                # A part reaches as far as it is seen, but the segment's own ends stay. What is
                # counted around a return reaches farther than itself.
                parts[found, 0] = row
                parts[found, 1] = 0.0 if begin == 0 else (first + RIM) / count
                parts[found, 2] = 1.0 if sample == count else (last - RIM) / count
                found += 1
            begin, seen = sample + 1, 0
    return found
