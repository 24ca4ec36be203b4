"""Surfaces: stretches of a line that are glass or a mirror, by what beams did at each piece of it.

Glass is where beams pass between flashes. A mirror is where what returns behind the line are images
of what is in front, all darker by one share: no mirror reflects all light, and a room that is
merely symmetrical is as bright.
"""

from itertools import pairwise

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.robust.ground import DEPTH, Ground, reflectance_at
from lrf3d.mapping.robust.light import (
    BRIGHT,
    DEVIATION,
    FREE,
    RANGE,
    REFLECTANCE,
    UX,
    UY,
    way_to_first,
)

PIECE, PIECES = 0.25, 256
"""[m, pieces] Length of a piece of a line, in which beams are counted, and their number: 64 m."""

SEEN = 3
"""[beams] A piece that fewer beams meet is what it was thought to be before."""

SHORTEST = 0.5
"""[m] Length of a pane or a mirror from which on it is found."""

FLASH, DIM = 5.0, 0.04
"""[usual brightness] A return is a flash above the one and dim below the other. Diffuse walls reach
about 3 at most, glass some hundreds and, askew, about a hundredth."""

FLASH_ANGLE = 0.04
"""[rad] How much the normals of two flashes of a pane differ at most: the lobe, and beams."""

ON_LINE, DEVIATIONS = 0.1, 3.0
"""[m, deviations] How far off a line a return of it may lie, and beside this by the noise."""

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

LEAST_LIT = 16
"""[beams] Images of walls of which the reflectance is known, at a mirror."""

DIMMED, SHARE_STEP, AGREE = (0.84, 0.97), 0.05, 0.7
"""[share] How bright images are beside what they are of: what is seen through a pane of glass is
darker. In which steps that is counted, and how many of the images lie in two steps beside each
other: others are of metal, or at an edge of two walls."""

SHARES = 11
"""Steps of brightness from half of what an image is of on; what lies outside is counted behind."""

LEAST_SPREAD = 0.2
"""[m] Spread of what images are of about their line: many lines mirror one wall into another."""

COUNTS = SHOWN, PASSED, OPAQUE, MISSING, TURNED, IMAGE, WRONG = range(7)
"""Columns of what is counted at each piece: returns as of glass; beams that passed; returns as of a
wall; beams that passed where glass would have flashed; beams that were turned before; images; and
other returns behind. Then the sums of x, y, xx, xy and yy of what the images are of, and of the
images by how bright they are."""

SUMS, LIT = 7, 12
COLUMNS = LIT + SHARES + 1


@compiled
def count_beams(
    line: Float, middle: float, own: float, mirror: bool, scans: tuple[Float, Float],
    blocking: Float, ground: Ground, pieces: Float, reach: Float,
) -> None:  # fmt: skip
    """Count what the beams of scans did at a line that may be a mirror, or else glass.

    Args:
        line: (3,) its unit normal, of mirrors towards where they are seen from, and its distance
            from the origin [m].
        middle: Where its pieces have their middle, along the normal turned right [m].
        own: Its number, as in what blocks beams.
        mirror: Whether it may be a mirror.
        scans: Where the scans were taken (k, 2) [m], and their rays (k, n, 8).
        blocking: (b, 5) glass and mirrors, and the line of each: beyond them beams show nothing.
        ground: What is there.
        pieces: (PIECES, COLUMNS) is added to, see `COUNTS`.
        reach: (PIECES, 2) is widened to the stations [m] of what shows glass or an image.
    """
    nx, ny, distance = line
    half = 0.5 * PIECE * PIECES
    # The middle of the pieces, about which places are summed.
    middle_x, middle_y = distance * nx + middle * ny, distance * ny - middle * nx
    places, all_rays = scans
    for scan in range(len(places)):
        place, rays = places[scan], all_rays[scan]
        ahead = nx * place[0] + ny * place[1] - distance
        if abs(ahead) < DEPTH:
            continue
        for beam in range(len(rays)):
            ray = rays[beam]
            rise = -(nx * ray[UX] + ny * ray[UY])
            if rise * ahead <= 0.0:
                continue
            way, cos = ahead / rise, abs(rise)
            tolerance = ON_LINE + DEVIATIONS * ray[DEVIATION] * cos
            farther = (ray[FREE] - way) * cos
            x, y = place[0] + way * ray[UX], place[1] + way * ray[UY]
            station = ny * x - nx * y - middle
            if farther < -tolerance or abs(station) >= half:
                continue
            piece = int(np.floor((station + half) / PIECE))
            count = pieces[piece]
            blocked = way_to_first(place, ray, blocking, own)
            shows = False
            if blocked < way:
                count[TURNED] += 1.0
            elif farther < tolerance:
                flash = ray[BRIGHT] > FLASH and cos > 1.0 - FLASH_ANGLE**2
                shows = ray[RANGE] > 0.0 and (flash or ray[BRIGHT] < DIM * cos)
                count[SHOWN] += shows
                count[OPAQUE] += ray[RANGE] > 0.0 and not shows
            elif not mirror:
                if farther > tolerance + PASSED_BY and cos > GRAZING:
                    count[PASSED] += 1.0
                    count[MISSING] += cos > FLASHING
            elif farther > DEPTH and 0.0 < ray[RANGE] < blocked and cos > GRAZING:
                if ahead > 0.0:
                    x += (ray[RANGE] - way) * ray[UX] + 2.0 * farther * nx
                    y += (ray[RANGE] - way) * ray[UY] + 2.0 * farther * ny
                    shows = _count_image(count, ray, x, y, middle_x, middle_y, ground)
                else:
                    # From behind nothing passes a mirror.
                    count[OPAQUE] += 1.0
            if shows:
                reach[piece, 0] = min(reach[piece, 0], station)
                reach[piece, 1] = max(reach[piece, 1], station)


@inner
def _count_image(
    count: Float,
    ray: Float,
    x: float,
    y: float,
    middle_x: float,
    middle_y: float,
    ground: Ground,
) -> bool:
    """Count a return behind a mirror, mirrored back to a place [m]; whether it is an image."""
    reflectance = reflectance_at(ground, x, y)
    if reflectance < 0.0:
        count[WRONG] += 1.0
        return False
    x, y = x - middle_x, y - middle_y
    count[IMAGE] += 1.0
    count[SUMS] += x
    count[SUMS + 1] += y
    count[SUMS + 2] += x * x
    count[SUMS + 3] += x * y
    count[SUMS + 4] += y * y
    if reflectance > 0.0 and ray[REFLECTANCE] > 0.0:
        step = int(np.floor((ray[REFLECTANCE] / reflectance - 0.5) / SHARE_STEP))
        count[LIT + (step if 0 <= step < SHARES else SHARES)] += 1.0
    return True


def glass_pieces(pieces: Float, flashed: Float, ends: Float) -> Bool:
    """Which pieces (PIECES,) of a line are glass, by the stations [m] of flashes.

    It ends at the stations at which walls meet the line.
    """
    shown, passed, opaque, missing = pieces[:, : MISSING + 1].T
    seeds, barriers = np.zeros((2, PIECES), np.bool_)
    seeds[pieces_at(flashed)], barriers[pieces_at(ends)] = True, True
    good = (shown + passed > 0) & (opaque <= MOST_OPAQUE * (shown + passed))
    good &= (missing == 0) | (shown > 0)
    good |= seeds
    # What walls part are several runs.
    part, found = np.cumsum(barriers), np.zeros(PIECES, np.bool_)
    for number in np.unique(part[seeds]).tolist():
        for first, last in runs(good & (part == number)):
            if not seeds[first:last].any():
                continue
            lit = first + np.flatnonzero((shown > 0)[first:last] | seeds[first:last])
            own = slice(lit[0], lit[-1] + 1)
            if (passed[own] > 0).mean() >= PASSED_SHARE and passed[own].sum() >= LEAST_PASSED:
                found[own] = True
    return found


def mirror_pieces(pieces: Float) -> Bool:
    """Which pieces (PIECES,) of a line are a mirror."""
    images, wrong, opaque = pieces[:, IMAGE], pieces[:, WRONG], pieces[:, OPAQUE]
    lit = pieces[:, LIT:]
    pairs = lit[:, : SHARES - 1] + lit[:, 1:SHARES]
    usual = int(np.argmax(pairs.sum(axis=0)))
    if not DIMMED[0] < 0.5 + SHARE_STEP * (usual + 1) < DIMMED[1]:
        return np.zeros(PIECES, np.bool_)
    inside, known = pairs[:, usual], lit.sum(axis=1)
    # What a mirror shows that was not seen otherwise is no image of anything.
    alike = np.where(known > 0.0, inside > AGREE * known, images > IMAGE_FACTOR * wrong)
    good = (images >= LEAST_IMAGES) & (images > IMAGE_FACTOR * opaque) & alike
    seen = runs(good)
    for (_, last), (first, _) in pairwise(seen):
        # A mirror goes on between two pieces of it where nothing stands.
        stands = opaque[last:first] > (images + wrong)[last:first] / IMAGE_FACTOR
        good[last:first] |= first - last <= LONGEST_GAP and not stands.any()
    found = np.zeros(PIECES, np.bool_)
    for first, last in runs(good):
        total = pieces[first:last].sum(axis=0)
        x, y, xx, xy, yy = total[SUMS : SUMS + 5] / total[IMAGE]
        spread = np.linalg.eigvalsh([[xx - x * x, xy - x * y], [xy - x * y, yy - y * y]])[0]
        agree = inside[first:last].sum() >= LEAST_LIT and total[IMAGE] > total[WRONG]
        found[first:last] = agree and spread > LEAST_SPREAD**2
    return found


def stretches(
    line: Float, middle: float, pieces: Float, reach: Float, found: Bool, former: Float
) -> Float:
    """Stretches (s, 4) [m] of a line: pieces that are found, and former ones no longer seen."""
    normal, unit = line[:2], np.array([line[1], -line[0]])
    origin = line[2] * normal + middle * unit
    beams = pieces[:, : WRONG + 1].sum(axis=1)
    edges = PIECE * (np.arange(PIECES + 1) - PIECES // 2)
    for ends in (former.reshape(-1, 2, 2) - origin) @ unit:
        low, high = float(ends.min()), float(ends.max())
        old = (edges[1:] > low) & (edges[:-1] < high) & (beams < SEEN) & ~found
        reach[old, 0] = edges[:-1][old].clip(low)
        reach[old, 1] = edges[1:][old].clip(None, high)
        found = found | old
    ends = [(reach[low:high, 0].min(), reach[low:high, 1].max()) for low, high in runs(found)]
    stations = np.array([pair for pair in ends if pair[1] - pair[0] > SHORTEST]).reshape(-1, 2, 1)
    segments: Float = (origin + stations * unit).reshape(-1, 4)
    return segments


def pieces_at(stations: Float) -> Int:
    """The pieces at stations [m] of a line, of those that it has."""
    places = np.floor(stations / PIECE).astype(np.int64) + PIECES // 2
    return places[(places >= 0) & (places < PIECES)]


def runs(chosen: Bool) -> list[tuple[int, int]]:
    """The first place of each run of chosen ones (n,), and the place behind its last."""
    padded = np.zeros(len(chosen) + 2, np.bool_)
    padded[1:-1] = chosen
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
