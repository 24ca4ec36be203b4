"""Surfaces: which pieces of a line are glass or a mirror, by what beams did there.

Glass is where beams pass between flashes: near its normal it returns many times the light of any
diffuse wall, and askew next to nothing. A mirror is where what returns behind the line are images
of what is in front, all a little darker: no mirror reflects all light, and a room that is merely
symmetrical is as bright.
"""

from itertools import pairwise

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.ground import DEPTH, GRAZING, reflectance_at
from lrf3d.mapping.robust.light import (
    BRIGHT,
    DEVIATION,
    FIRST,
    FREE,
    RANGE,
    REFLECTANCE,
    UX,
    UY,
)

IS_GLASS, IS_MIRROR = 1, 2
"""What the pieces of a line may be, or else 0."""

PIECE, PIECES = 0.25, 256
"""[m, pieces] Length of a piece of a line, in which beams are counted, and their number: 64 m."""

SEEN = 3
"""[beams] A piece stays what it was thought to be before unless so many beams more belie it than
show it: what is seen from afar, or no longer, is not there any less."""

FLASH, DIM = 5.0, 0.04
"""[usual brightness] A return is a flash above the one and dim below the other. Diffuse walls reach
about 3 at most, glass some hundreds and, askew, about a hundredth."""

FLASHES, FLASHING = np.cos(0.04), np.cos(np.radians(0.55))
"""[cosine] Glass may flash where a beam meets it so near its normal, and does so much nearer."""

ON_LINE, DEVIATIONS = 0.1, 3.0
"""[m, deviations] How far off a line a return of it may lie, and beside this by the noise."""

MOST_OPAQUE, PASSED_SHARE, LEAST_PASSED = 0.3, 0.6, 3
"""[share, share, beams] At a piece of glass fewer than this part of what shows glass shows a wall;
and beams pass so many of the pieces of a pane: it is seen through."""

LEAST_IMAGES, IMAGE_FACTOR = 3, 3.0
"""[beams, factor] Images at each piece of a mirror, and how many times more than other returns."""

LONGEST_GAP = 3
"""[pieces] Of a mirror, in which it shows what was not seen otherwise: narrower than a door."""

LEAST_LIT, ALIKE_SHARE = 16, 0.85
"""[beams, share] Images of walls of which the reflectance is known, at a mirror, and how many of
them are as bright as those of a mirror: others are of metal, or at an edge of two walls."""

DIMMED = 0.87, 0.98
"""[share] How bright an image in a mirror is beside what it is of: what is seen through a pane of
glass is darker, and a room as bright."""

COUNTS = SHOWN, FLASHED, PASSED, MISSING, OPAQUE, IMAGE, WRONG, LIT, ALIKE = range(9)
"""Columns of what is counted at each piece: returns as of glass, and those of them that flash;
beams that passed, and those of them that would have flashed on glass; returns as of a wall; returns
behind the line that are images, and others; images of walls of known reflectance, and those of them
that are as bright as a mirror's."""


@compiled
def count_beams(
    line: Float, places: Float, rays: Float, cells: Cells, ground: Float, pieces: Float
) -> None:
    """Count what rays (k, n, 9) from places (k, 2) [m] did at the pieces (PIECES, 9) of a line.

    The line (4,) is its unit normal, its distance from the origin [m], and where its pieces have
    their middle, along the normal turned right.
    """
    nx, ny, distance, middle = line
    half = 0.5 * PIECE * PIECES
    for scan in range(len(places)):
        x, y = places[scan]
        ahead = nx * x + ny * y - distance
        if abs(ahead) < DEPTH:
            continue
        for beam in range(rays.shape[1]):
            rise = -(nx * rays[scan, beam, UX] + ny * rays[scan, beam, UY])
            cos = abs(rise)
            farther = rays[scan, beam, FREE] * cos - abs(ahead)
            tolerance = ON_LINE + DEVIATIONS * rays[scan, beam, DEVIATION] * cos
            if rise * ahead <= 0.0 or farther < -tolerance:
                continue
            ray, way = rays[scan, beam], ahead / rise
            station = ny * (x + way * ray[UX]) - nx * (y + way * ray[UY]) - middle
            # What is behind another surface shows nothing of this one.
            if abs(station) >= half or ray[FIRST] < way - DEPTH:
                continue
            count = pieces[int(np.floor((station + half) / PIECE))]
            if farther < tolerance:
                if ray[RANGE] > 0.0:
                    flash = cos > FLASHES and ray[BRIGHT] > FLASH
                    count[FLASHED] += flash
                    count[SHOWN if flash or ray[BRIGHT] < DIM else OPAQUE] += 1.0
                continue
            if cos <= GRAZING:
                continue
            if farther > tolerance + DEPTH:
                count[PASSED] += 1.0
                count[MISSING] += cos > FLASHING
            if ray[RANGE] > 0.0 and farther > DEPTH:
                # Mirrored back to the side that it came from.
                behind = 2.0 * (nx * (x + ray[RANGE] * ray[UX]) + ny * (y + ray[RANGE] * ray[UY]))
                behind -= 2.0 * distance
                reflectance = reflectance_at(
                    cells, ground, x + ray[RANGE] * ray[UX] - behind * nx,
                    y + ray[RANGE] * ray[UY] - behind * ny,
                )  # fmt: skip
                count[IMAGE if reflectance >= 0.0 else WRONG] += 1.0
                if reflectance > 0.0 and ray[REFLECTANCE] > 0.0:
                    share = ray[REFLECTANCE] / reflectance
                    count[LIT] += 1.0
                    count[ALIKE] += DIMMED[0] < share < DIMMED[1]


def glass_pieces(pieces: Float) -> Bool:
    """Which pieces (PIECES,) of a line are glass."""
    shown, flashed, passed, missing, opaque = pieces[:, : OPAQUE + 1].T
    found = np.zeros(PIECES, np.bool_)
    if not flashed.any():
        return found
    good = (shown + passed > 0) & (opaque <= MOST_OPAQUE * (shown + passed))
    good &= (missing == 0) | (shown > 0)
    good |= flashed > 0
    for first, last in runs(good):
        if flashed[first:last].any():
            lit = first + np.flatnonzero(shown[first:last])
            own = slice(lit[0], lit[-1] + 1)
            seen_through = (passed[own] > 0).mean() >= PASSED_SHARE
            found[own] = seen_through and passed[own].sum() >= LEAST_PASSED
    return found


def mirror_pieces(pieces: Float) -> Bool:
    """Which pieces (PIECES,) of a line are a mirror."""
    opaque, images, wrong, known, alike = pieces[:, OPAQUE:].T
    if alike.sum() < LEAST_LIT:
        return np.zeros(PIECES, np.bool_)
    # What a mirror shows that was not seen otherwise is no image of anything.
    good = np.where(known > 0.0, alike > ALIKE_SHARE * known, images > IMAGE_FACTOR * wrong)
    good &= (images >= LEAST_IMAGES) & (images > IMAGE_FACTOR * opaque)
    for (_, last), (first, _) in pairwise(runs(good)):
        # A mirror goes on between two pieces of it where nothing stands.
        stands = opaque[last:first] > (images + wrong)[last:first] / IMAGE_FACTOR
        good[last:first] |= first - last <= LONGEST_GAP and not stands.any()
    for first, last in runs(good):
        enough = alike[first:last].sum() >= LEAST_LIT
        enough &= alike[first:last].sum() > ALIKE_SHARE * known[first:last].sum()
        good[first:last] = enough and images[first:last].sum() > 2.0 * wrong[first:last].sum()
    return np.asarray(good)


def find_pieces(pieces: Float, former: Bool, kind: int) -> tuple[Bool, int]:
    """Which pieces (PIECES,) of a line are glass, or a mirror, and which of the two they are.

    Former ones, of a kind or of none, stay unless they are belied.
    """
    shown, _, passed, _, opaque, images, wrong = pieces[:, : WRONG + 1].T
    found, belied = glass_pieces(pieces), opaque > shown + passed + SEEN
    # What is seen through glass is darker as well.
    if kind == IS_MIRROR or not (found.any() or kind):
        found, kind = mirror_pieces(pieces), IS_MIRROR
        belied = opaque + wrong > images + SEEN
    found |= former & ~belied
    return found, max(kind, IS_GLASS) if found.any() else 0


def runs(chosen: Bool) -> Int:
    """The first place of each run (r, 2) of chosen ones (n,), and the place behind its last."""
    return np.flatnonzero(np.diff(chosen, prepend=False, append=False)).reshape(-1, 2)
