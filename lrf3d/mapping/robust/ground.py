"""Ground: how reflective each patch of the ground is, as beams show that no mirror turned.

Returns of kept scans enter. As soon as it is known that a mirror turned a beam, its return no
longer counts, and the cells where it seemed to end forget it: walls that only a mirror showed are
gone at their next refit. The patches lie in the blocks of the mapper's cells.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Bool, Float
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import SIDE, SIDE_BITS, Cells, block_at
from lrf3d.mapping.robust.clusters import forget_hits
from lrf3d.mapping.robust.light import DIRECT, FIRST, RANGE, REFLECTANCE, UX, UY
from lrf3d.mapping.robust.walls import NewEvidence

PATCHES = SIDE * SIDE // 4
"""Patches of a block, two cells wide. A return counts in the four around it: within 0.1 m."""

LARGEST_SPREAD = 0.1
"""[share] Where the reflectance differs by more, nothing is compared with it: metal."""

RETURNS, LIGHTS, SUM, SQUARES = range(4)
"""Columns of the patches: the number of returns, and of those with a reflectance, the sum of these
and that of their squares."""

DEPTH = 0.2
"""[m] How far behind a mirror an image lies at least, and behind glass what is seen through it."""

EDGE = 0.3
"""[m] Beams that pass a mirror by less may have met it."""

SPACING = 0.02
"""[rad] Half of the angle between two beams at most: between the returns of kept scans others did
the same."""

GRAZING = 0.26
"""[cosine] At 75° and more from the normal glass mirrors beams as much as it lets them pass: such
beams show neither glass nor mirrors."""


@borrower
def _patch_at(cells: Cells, x: float, y: float) -> int:
    """The row of the patch of a point [m], 0 where there is none."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    half = SIDE // 2 - 1
    block = block_at(cells, column, row)
    inside = (((row >> 1) & half) << (SIDE_BITS - 1)) + ((column >> 1) & half)
    return block * PATCHES + inside if block > 0 else 0


@borrower
def _ways(x: float, y: float, ux: float, uy: float, surfaces: Float) -> tuple[float, float]:
    """How far [m] a ray goes to the first of surfaces (s, 5), and to the first that may turn it."""
    first = turn = np.inf
    for x1, y1, x2, y2, mirror in surfaces:
        dx, dy = x2 - x1, y2 - y1
        across, size = ux * dy - uy * dx, np.hypot(dx, dy)
        if across == 0.0:
            continue
        way = ((x1 - x) * dy - (y1 - y) * dx) / across
        aside = abs(((x1 - x) * uy - (y1 - y) * ux) / across - 0.5) * size - 0.5 * size
        if way > 0.0 and aside <= EDGE:
            if aside <= 0.0:
                first = min(first, way)
            if mirror > 0.0 or abs(across) <= GRAZING * size:
                turn = min(turn, way)
    return first, turn


@compiled
def find_turned(
    place: Float, headings: Float, ranges: Float, surfaces: Float, turned: Bool
) -> None:
    """Mark the beams (n,) that go on behind surfaces (s, 5), which may have turned them."""
    for beam in range(len(headings)):
        ux, uy = np.cos(headings[beam]), np.sin(headings[beam])
        _, turn = _ways(place[0], place[1], ux, uy, surfaces)
        turned[beam] = turn < ranges[beam] - DEPTH


@compiled
def turn_rays(
    places: Float, rays: Float, surfaces: Float, cells: Cells, ground: Float, fresh: NewEvidence
) -> None:
    """Find how far the rays (k, n, 9) of scans go to surfaces (s, 5), and which these turn.

    The ground (p, 4) is what the others showed of each patch.
    """
    for scan in range(len(places)):
        x, y = places[scan]
        for beam in range(rays.shape[1]):
            ray = rays[scan, beam]
            ux, uy, reach = ray[UX], ray[UY], ray[RANGE]
            ray[FIRST], turn = _ways(x, y, ux, uy, surfaces)
            direct = turn >= reach - DEPTH
            if reach <= 0.0 or direct == (ray[DIRECT] > 0.0):
                continue
            sign = 1.0 if direct else -1.0
            ray[DIRECT] += sign
            x2, y2, light = x + reach * ux, y + reach * uy, ray[REFLECTANCE]
            for corner in range(4):
                dx, dy = CELL * (corner // 2 * 2 - 1), CELL * (corner % 2 * 2 - 1)
                patch = ground[_patch_at(cells, x2 + dx, y2 + dy)]
                patch[RETURNS] += sign
                patch[LIGHTS] += sign * (light > 0.0)
                patch[SUM] += sign * light
                patch[SQUARES] += sign * light * light
            if not direct:
                forget_hits(cells, x2, y2, ux, uy, CELL + SPACING * reach, fresh)


@borrower
def reflectance_at(cells: Cells, ground: Float, x: float, y: float) -> float:
    """The reflectance at a point [m]: −1 where nothing is, 0 where it is not known, or not one."""
    row = _patch_at(cells, x, y)
    if row == 0 or ground[row, RETURNS] <= 0.0:
        return -1.0
    if ground[row, LIGHTS] <= 0.0:
        return 0.0
    mean = ground[row, SUM] / ground[row, LIGHTS]
    spread = ground[row, SQUARES] / ground[row, LIGHTS] - mean * mean
    result: float = mean if spread <= (LARGEST_SPREAD * mean) ** 2 else 0.0
    return result
