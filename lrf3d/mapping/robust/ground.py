"""Ground: of each patch of the ground whether beams ended there straight, or by way of a mirror.

Returns of kept scans enter, as it is known which of them mirrors turned; leave how reflective the
walls there are, and the parts of walls that only mirrors showed. The patches lie in the blocks of
the mapper's cells.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Float
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import SIDE, SIDE_BITS, Cells, block_at
from lrf3d.mapping.robust.light import KIND, RANGE, REFLECTANCE, TURN, UX, UY

PATCH = 2.0 * CELL
"""[m] Side of a patch. Each return counts in the four patches around it: within 0.1 m at least."""

PATCHES = SIDE * SIDE // 4
"""Patches of a block."""

LARGEST_SPREAD = 0.1
"""[share] Where the reflectance differs by more, nothing is compared with it: metal."""

NOTHING, UNSURE, DIRECT, TURNED, LIGHTS, SUM, SQUARES = range(7)
"""What a return shows where the beam ended: nothing, perhaps an image and perhaps not, what is
there, or an image. These are columns of the patches; the others are the number of reflectances,
their sum, and that of their squares."""

DEPTH = 0.2
"""[m] How far behind a mirror an image lies at least."""

EDGE = 0.3
"""[m] Beams that pass a mirror by less show neither what is there nor what is not."""

SAMPLE = PATCH
"""[m] Steps in which segments are searched for images."""

LEAST_LEFT, RIM = 3, 1
"""[samples] What is left of a segment beside its images stays from so many on that are seen; by so
many it is cut where an image begins."""


@borrower
def patch_at(cells: Cells, x: float, y: float) -> int:
    """The row of the patch of a point [m], 0 where there is none."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    half = SIDE // 2 - 1
    block = block_at(cells, column, row)
    inside = (((row >> 1) & half) << (SIDE_BITS - 1)) + ((column >> 1) & half)
    return block * PATCHES + inside if block > 0 else 0


@borrower
def way_to_first(
    px: float, py: float, ux: float, uy: float, surfaces: Float, wider: float
) -> float:
    """How far [m] a ray goes to the first of surfaces (s, 5), a little wider, or infinity."""
    first = np.inf
    for row in range(len(surfaces)):
        x, y = surfaces[row, 0] - px, surfaces[row, 1] - py
        dx, dy = surfaces[row, 2] - surfaces[row, 0], surfaces[row, 3] - surfaces[row, 1]
        across, size = ux * dy - uy * dx, np.hypot(dx, dy)
        if across == 0.0:
            continue
        way, share = (x * dy - y * dx) / across, (x * uy - y * ux) / across
        if 0.0 < way < first and abs(share - 0.5) * size <= 0.5 * size + wider:
            first = way
    return first


@compiled
def turn_beams(
    places: Float, rays: Float, changed: Float, surfaces: Float, cells: Cells, ground: Float
) -> None:
    """Find which rays (k, n, 9) of scans surfaces (s, 5) turned, and count where they ended.

    Only those are looked at that are new, or meet what has changed (c, 5). The ground (p, 7) is
    what returns showed of each patch.
    """
    mirrors = surfaces[surfaces[:, 4] > 0.0]
    for scan in range(len(places)):
        x, y = places[scan]
        for beam in range(rays.shape[1]):
            ux, uy = rays[scan, beam, UX], rays[scan, beam, UY]
            reach, before = rays[scan, beam, RANGE], int(rays[scan, beam, KIND])
            if before != NOTHING and way_to_first(x, y, ux, uy, changed, EDGE) == np.inf:
                continue
            rays[scan, beam, TURN] = way_to_first(x, y, ux, uy, surfaces, 0.0)
            if reach <= 0.0:
                continue
            kind = DIRECT
            if way_to_first(x, y, ux, uy, mirrors, 0.0) < reach - DEPTH:
                kind = TURNED
            elif way_to_first(x, y, ux, uy, mirrors, EDGE) < reach - DEPTH:
                kind = UNSURE
            if kind != before:
                rays[scan, beam, KIND] = kind
                _count_return(
                    x + reach * ux, y + reach * uy, rays[scan, beam], before, cells, ground
                )


@borrower
def _count_return(x: float, y: float, ray: Float, before: int, cells: Cells, ground: Float) -> None:
    """Count a return as what it shows, and no longer as what it was taken for before."""
    for corner in range(4):
        row = patch_at(cells, x + CELL * (corner // 2 * 2 - 1), y + CELL * (corner % 2 * 2 - 1))
        ground[row, int(ray[KIND])] += 1.0
        if before != NOTHING:
            ground[row, before] -= 1.0
        elif ray[REFLECTANCE] > 0.0:
            ground[row, LIGHTS] += 1.0
            ground[row, SUM] += ray[REFLECTANCE]
            ground[row, SQUARES] += ray[REFLECTANCE] * ray[REFLECTANCE]


@borrower
def reflectance_at(cells: Cells, ground: Float, x: float, y: float) -> float:
    """The reflectance at a point [m]: −1 where nothing is, 0 where it is not known, or not one."""
    row = patch_at(cells, x, y)
    if row == 0 or ground[row, DIRECT] <= 0.0:
        return -1.0
    if ground[row, LIGHTS] == 0.0:
        return 0.0
    mean = ground[row, SUM] / ground[row, LIGHTS]
    spread = ground[row, SQUARES] / ground[row, LIGHTS] - mean * mean
    result: float = mean if spread <= (LARGEST_SPREAD * mean) ** 2 else 0.0
    return result


@compiled
def find_real_parts(cells: Cells, ground: Float, segments: Float, parts: Float) -> int:
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
                at = patch_at(cells, x1 + share * (x2 - x1), y1 + share * (y2 - y1))
                direct = at > 0 and ground[at, DIRECT] > 0.0
                if direct:
                    first = first if seen else sample
                    last = sample + 1
                    seen += 1
                if direct or at == 0 or ground[at, TURNED] <= 0.0:
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
