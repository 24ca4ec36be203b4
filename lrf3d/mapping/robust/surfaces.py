"""Surfaces: stretches of a line that are glass or a mirror, by what beams did at each piece of it.

Glass is where beams pass between flashes. A mirror is where what returns behind the line are images
of what is in front, all a little darker: no mirror reflects all light, and a room that is merely
symmetrical is as bright.
"""

from itertools import pairwise

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.ground import DEPTH, reflectance_at
from lrf3d.mapping.robust.light import (
    BRIGHT,
    DEVIATION,
    FREE,
    RANGE,
    REFLECTANCE,
    TURN,
    UX,
    UY,
)

PIECE, PIECES = 0.25, 256
"""[m, pieces] Length of a piece of a line, in which beams are counted, and their number: 64 m."""

SEEN = 3
"""[beams] A piece stays what it was thought to be before unless so many beams more belie it than
show it: what is seen from afar, or no longer, is not there any less."""

SHORTEST = 0.5
"""[m] Length of a pane or a mirror from which on it is found."""

FLASH, DIM = 5.0, 0.04
"""[usual brightness] A return is a flash above the one and dim below the other. Diffuse walls reach
about 3 at most, glass some hundreds and, askew, about a hundredth."""

FLASH_ANGLE = 0.04
"""[rad] How much the normals of two flashes of a pane differ at most: the lobe, and beams."""

ON_LINE, DEVIATIONS = 0.1, 3.0
"""[m, deviations] How far off a line a return of it may lie, and beside this by the noise."""

FARTHEST_OFF = 1.0
"""[m] No return that is farther off a line is of it."""

PASSED_BY = 0.1
"""[m] A beam passes a line if it goes on by more than this and the former."""

GRAZING = 0.26
"""[cosine] At 75° and more from the normal glass mirrors beams as much as it lets them pass: such
beams show neither glass nor mirrors."""

FLASHING = np.cos(np.radians(0.55))
"""[cosine] A beam that passes so near the normal shows that no glass is there: it would flash."""

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

COUNTS = SHOWN, FLASHED, PASSED, OPAQUE, MISSING, TURNED, IMAGE, WRONG, LIT, ALIKE = range(10)
"""Columns of what is counted at each piece: returns as of glass, and those of them that flash;
beams that passed; returns as of a wall; beams that passed where glass would have flashed; beams
that were turned before; images; other returns behind; images of walls of known reflectance, and
those of them that are as bright as a mirror's."""


@compiled
def count_beams(
    line: Float, mirror: bool, scans: tuple[Float, Float], cells: Cells, ground: Float,
    pieces: Float, stations: Float,
) -> None:  # fmt: skip
    """Count what the beams of scans did at a line that may be a mirror, or else glass.

    Args:
        line: (4,) its unit normal, of mirrors towards where they are seen from, its distance from
            the origin [m], and where its pieces have their middle, along the normal turned right.
        mirror: Whether it may be a mirror.
        scans: Where the scans were taken (k, 2) [m], and their rays (k, n, 9).
        cells: The mapper's.
        ground: What is there, in patches of these.
        pieces: (PIECES, 10) is added to, see `COUNTS`.
        stations: (PIECES, 2) is widened to those [m] of what shows glass or an image.
    """
    nx, ny, distance, middle = line
    half = 0.5 * PIECE * PIECES
    places, rays = scans
    for scan in range(len(places)):
        place = places[scan]
        ahead = nx * place[0] + ny * place[1] - distance
        if abs(ahead) < DEPTH:
            continue
        for beam in range(rays.shape[1]):
            rise = -(nx * rays[scan, beam, UX] + ny * rays[scan, beam, UY])
            reach = rays[scan, beam, FREE] * abs(rise)
            if rise * ahead <= 0.0 or reach + FARTHEST_OFF < abs(ahead):
                continue
            ray = rays[scan, beam]
            way, cos = ahead / rise, abs(rise)
            tolerance = ON_LINE + DEVIATIONS * ray[DEVIATION] * cos
            farther = (ray[FREE] - way) * cos
            x, y = place[0] + way * ray[UX], place[1] + way * ray[UY]
            station = ny * x - nx * y - middle
            if farther < -tolerance or abs(station) >= half:
                continue
            piece = int(np.floor((station + half) / PIECE))
            count, shows = pieces[piece], False
            if ray[TURN] < way - DEPTH:
                count[TURNED] += 1.0
            elif farther < tolerance:
                if ray[RANGE] > 0.0:
                    flash = cos > np.cos(FLASH_ANGLE) and ray[BRIGHT] > FLASH
                    shows = not mirror and (flash or ray[BRIGHT] < DIM)
                    count[FLASHED] += flash
                    count[SHOWN if shows else OPAQUE] += 1.0
            elif not mirror:
                if farther > tolerance + PASSED_BY and cos > GRAZING:
                    count[PASSED] += 1.0
                    count[MISSING] += cos > FLASHING
            elif ray[RANGE] > 0.0 and farther > DEPTH and cos > GRAZING:
                if ahead < 0.0:
                    # From behind nothing passes a mirror.
                    count[OPAQUE] += 1.0
                    continue
                # Mirrored back.
                x += (ray[RANGE] - way) * ray[UX] + 2.0 * farther * nx
                y += (ray[RANGE] - way) * ray[UY] + 2.0 * farther * ny
                reflectance = reflectance_at(cells, ground, x, y)
                shows = reflectance >= 0.0
                count[IMAGE if shows else WRONG] += 1.0
                if reflectance > 0.0 and ray[REFLECTANCE] > 0.0:
                    share = ray[REFLECTANCE] / reflectance
                    count[LIT] += 1.0
                    count[ALIKE] += DIMMED[0] < share < DIMMED[1]
            if shows:
                stations[piece, 0] = min(stations[piece, 0], station)
                stations[piece, 1] = max(stations[piece, 1], station)


def glass_pieces(pieces: Float) -> Bool:
    """Which pieces (PIECES,) of a line are glass."""
    shown, flashed, passed, opaque, missing = pieces[:, : MISSING + 1].T
    good = (shown + passed > 0) & (opaque <= MOST_OPAQUE * (shown + passed))
    good &= (missing == 0) | (shown > 0)
    good |= flashed > 0
    found = np.zeros(PIECES, np.bool_)
    for first, last in runs(good):
        lit = first + np.flatnonzero(shown[first:last])
        if flashed[first:last].any():
            own = slice(lit[0], lit[-1] + 1)
            seen_through = (passed[own] > 0).mean() >= PASSED_SHARE
            found[own] = seen_through and passed[own].sum() >= LEAST_PASSED
    return found


def mirror_pieces(pieces: Float) -> Bool:
    """Which pieces (PIECES,) of a line are a mirror."""
    images, wrong, opaque = pieces[:, IMAGE], pieces[:, WRONG], pieces[:, OPAQUE]
    known, alike = pieces[:, LIT], pieces[:, ALIKE]
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
    return good


def stretches(line: Float, mirror: bool, pieces: Float, reach: Float, former: Float) -> Float:
    """Stretches (s, 4) [m] of a line: pieces that are found, and former ones not belied."""
    shown, _, passed, opaque, _, _, images, wrong, known, alike = pieces.T
    found = mirror_pieces(pieces) if mirror else glass_pieces(pieces)
    if not (found.any() or len(former)):
        return former
    if mirror:
        belied = (opaque + wrong > images + SEEN) | (known > 2.0 * alike + SEEN)
    else:
        belied = opaque > shown + passed + SEEN
    normal, unit = line[:2], np.array([line[1], -line[0]])
    origin = line[2] * normal + line[3] * unit
    edges = PIECE * (np.arange(PIECES + 1) - PIECES // 2)
    for ends in (former.reshape(-1, 2, 2) - origin) @ unit:
        low, high = float(ends.min()), float(ends.max())
        old = (edges[1:] > low) & (edges[:-1] < high) & ~belied & ~found
        reach[old, 0] = edges[:-1][old].clip(low)
        reach[old, 1] = edges[1:][old].clip(None, high)
        found = found | old
    ends = [(reach[low:high, 0].min(), reach[low:high, 1].max()) for low, high in runs(found)]
    stations = np.array([pair for pair in ends if pair[1] - pair[0] > SHORTEST]).reshape(-1, 2, 1)
    segments: Float = (origin + stations * unit).reshape(-1, 4)
    return segments


def runs(chosen: Bool) -> list[tuple[int, int]]:
    """The first place of each run of chosen ones (n,), and the place behind its last."""
    edges = np.flatnonzero(np.diff(chosen, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
