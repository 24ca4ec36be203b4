"""Surfaces: which pieces of a line are glass or a mirror, by what beams did there.

Glass is where beams pass between flashes: near its normal it returns many times the light of any
diffuse wall, and askew almost none. A mirror is where returns behind the line are images of what is
in front, all a little darker: no mirror reflects all light, and a symmetrical room is as bright.

The rays of kept scans enter. The ground is divided into patches, two cells wide, with the
reflectance of what stands there. As soon as a mirror is known to have turned a ray, its return no
longer counts, and is deleted from the cells where it seemed to end: walls that only a mirror showed
are gone at their next refit.
"""

from itertools import pairwise

import numpy as np

from lrf3d.compiling import borrower, compiled, record
from lrf3d.geometry.lines import Bool, Float, Int, Records
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import (
    FREE_DEPTH,
    HIT_DEVIATIONS,
    SIDE,
    SIDE_BITS,
    Cells,
    block_at,
    cell_of,
)
from lrf3d.mapping.robust.rays import forget_hits
from lrf3d.mapping.robust.walls import Walls

# Patches of a block, two cells wide. A return counts in the four around it: within 0.1 m.
PATCHES = SIDE * SIDE // 4

# What the rays of kept scans showed of a patch.
PATCH = record(
    returns=float, lights=float,  # the number of returns, and of those with a reflectance
    total=float, squares=float,  # the sum of these, and that of their squares
)  # fmt: skip

# [cosine] Above 75° from the normal glass reflects as much as it transmits: such beams show neither
# glass nor mirrors.
GRAZING = 0.26

# Class of the pieces of a line that are glass; 0 is neither.
IS_GLASS = 1

# Class of those that are a mirror.
IS_MIRROR = 2

# [m] Length of a piece of a line in which beams are counted.
PIECE_LENGTH = 0.25

# [pieces] Pieces of a line: 64 m.
PIECES = 256

# [beams] Fewest that show glass, or a mirror. Hysteresis: a piece changes class only when
# contradicting beams outnumber supporting ones by this many.
SEEN = 3

# [usual light] Brighter returns are flashes: diffuse walls reach 3 at most, glass some hundreds.
FLASH = 5.0

# [usual light] Darker returns are dim: glass that is met askew returns about a hundredth.
DIM = 0.04

# [cosine] Incidence at which glass may flash.
FLASHES = np.cos(0.04)

# [cosine] Incidence at which glass always flashes.
FLASHING = np.cos(np.radians(0.55))

# The rays that are counted at a piece of a line.
COUNTS = record(
    shown=float, flashed=float,  # returns as of glass, and those of them that flash
    passed=float, missing=float,  # beams that passed, and those that would have flashed on glass
    opaque=float,  # returns as of a wall
    images=float, wrong=float,  # returns behind the line that are images, and others
    lit=float, alike=float,  # images of walls of known reflectance; as bright as a mirror's
)  # fmt: skip


@borrower
def _patch_at(cells: Cells, x: float, y: float) -> int:
    """The row of the patch of a point [m], 0 where there is none."""
    column, row = cell_of(x, y)
    half = SIDE // 2 - 1
    block = block_at(cells, column, row)
    inside = (((row >> 1) & half) << (SIDE_BITS - 1)) + ((column >> 1) & half)
    return block * PATCHES + inside if block > 0 else 0


@borrower
def _distances(x: float, y: float, ux: float, uy: float, surfaces: Float) -> tuple[float, float]:
    """Distances [m] of a ray to the first of surfaces (s, 5), and to the first that may turn it."""
    first = turn = np.inf
    edge = 0.3  # [m] Beams that pass a mirror by less may have met it.
    for x1, y1, x2, y2, mirror in surfaces:
        dx = x2 - x1
        dy = y2 - y1
        across = ux * dy - uy * dx
        size = np.hypot(dx, dy)
        if across == 0.0:
            continue
        way = ((x1 - x) * dy - (y1 - y) * dx) / across
        aside = abs(((x1 - x) * uy - (y1 - y) * ux) / across - 0.5) * size - 0.5 * size
        if way > 0.0 and aside <= edge:
            if aside <= 0.0:
                first = min(first, way)
            if mirror > 0.0 or abs(across) <= GRAZING * size:
                turn = min(turn, way)
    return first, turn


@compiled
def find_turned(
    place: Float, headings: Float, ranges: Float, surfaces: Float, turned: Bool
) -> None:
    """Mark the beams (n,) that continue behind surfaces (s, 5), which may have turned them."""
    for beam in range(len(headings)):
        ahead = np.cos(headings[beam]), np.sin(headings[beam])
        _, turn = _distances(place[0], place[1], *ahead, surfaces)
        turned[beam] = turn < ranges[beam] - FREE_DEPTH


@compiled
def turn_rays(
    places: Float, rays: Records, surfaces: Float, cells: Cells, ground: Records, walls: Walls
) -> None:
    """Find the distances of the rays (k, n) of scans to surfaces (s, 5), and which these turn.

    The ground (p,) holds what the other rays showed of each patch.
    """
    # [rad] Half of the largest angle between two beams: beams between those of the kept scans met
    # the same mirror.
    spacing = 0.02
    for scan in range(len(places)):
        x, y = places[scan]
        for beam in range(rays.shape[1]):
            ray = rays[scan, beam]
            reach = ray.range
            ray.first, turn = _distances(x, y, ray.ux, ray.uy, surfaces)
            direct = turn >= reach - FREE_DEPTH
            if reach <= 0.0 or direct == (ray.direct > 0.0):
                continue
            sign = 1.0 if direct else -1.0
            ray.direct += sign
            x2 = x + reach * ray.ux
            y2 = y + reach * ray.uy
            light = ray.reflectance
            for corner in range(4):
                dx = CELL * (corner // 2 * 2 - 1)
                dy = CELL * (corner % 2 * 2 - 1)
                patch = ground[_patch_at(cells, x2 + dx, y2 + dy)]
                patch.returns += sign
                patch.lights += sign * (light > 0.0)
                patch.total += sign * light
                patch.squares += sign * light * light
            if not direct:
                forget_hits(cells, x2, y2, ray.ux, ray.uy, CELL + spacing * reach, walls)


@borrower
def _reflectance_at(cells: Cells, ground: Records, x: float, y: float) -> float:
    """The reflectance at a point [m]: −1 if nothing is there, 0 if it is unknown or varies."""
    row = _patch_at(cells, x, y)
    patch = ground[row]
    if row == 0 or patch.returns <= 0.0:
        return -1.0
    if patch.lights <= 0.0:
        return 0.0
    mean = patch.total / patch.lights
    spread = patch.squares / patch.lights - mean * mean
    # [share] Largest relative deviation of the reflectance of a patch; it is unknown where it
    # varies more, as on metal.
    largest_spread = 0.1
    result: float = mean if spread <= (largest_spread * mean) ** 2 else 0.0
    return result


@compiled
def count_rays(
    line: Float, places: Float, rays: Records, cells: Cells, ground: Records, pieces: Records
) -> None:
    """Classify the rays (k, n) from places (k, 2) [m] at the pieces (PIECES,) of a line.

    The line (4,) is its unit normal, its distance from the origin [m], and the position of the
    middle of its pieces along the normal turned right.
    """
    nx, ny, distance, middle = line
    half = 0.5 * PIECE_LENGTH * PIECES
    # [share] Brightness of an image in a mirror relative to its object: through a pane of glass it
    # is lower, in a real room equal.
    dimmed = 0.87, 0.98
    for scan in range(len(places)):
        x, y = places[scan]
        ahead = nx * x + ny * y - distance
        if abs(ahead) < FREE_DEPTH:
            continue
        for beam in range(rays.shape[1]):
            ray = rays[scan, beam]
            rise = -(nx * ray.ux + ny * ray.uy)
            cos = abs(rise)
            farther = ray.free * cos - abs(ahead)
            tolerance = CELL + HIT_DEVIATIONS * ray.deviation * cos
            if rise * ahead <= 0.0 or farther < -tolerance:
                continue
            way = ahead / rise
            station = ny * (x + way * ray.ux) - nx * (y + way * ray.uy) - middle
            # What is behind another surface shows nothing of this one.
            if abs(station) >= half or ray.first < way - FREE_DEPTH:
                continue
            count = pieces[int(np.floor((station + half) / PIECE_LENGTH))]
            if farther < tolerance:
                if ray.range > 0.0:
                    flash = cos > FLASHES and ray.bright > FLASH
                    count.flashed += flash
                    count.shown += flash or ray.bright < DIM
                    count.opaque += not (flash or ray.bright < DIM)
                continue
            if cos <= GRAZING:
                continue
            if farther > tolerance + FREE_DEPTH:
                count.passed += 1.0
                count.missing += cos > FLASHING
            if ray.range > 0.0 and farther > FREE_DEPTH:
                # Mirrored back to the side that it came from.
                px = x + ray.range * ray.ux
                py = y + ray.range * ray.uy
                behind = 2.0 * (nx * px + ny * py) - 2.0 * distance
                reflectance = _reflectance_at(cells, ground, px - behind * nx, py - behind * ny)
                count.images += reflectance >= 0.0
                count.wrong += reflectance < 0.0
                if reflectance > 0.0 and ray.reflectance > 0.0:
                    count.lit += 1.0
                    count.alike += dimmed[0] < ray.reflectance / reflectance < dimmed[1]


def glass_pieces(pieces: Records) -> Bool:
    """Which pieces (PIECES,) of a line are glass."""
    shown = pieces["shown"]
    passed = pieces["passed"]
    flashed = pieces["flashed"]
    found = np.zeros(PIECES, np.bool_)
    if not flashed.any():
        return found
    # [share] Largest share of returns as of a wall at a piece of glass.
    most_opaque = 0.3
    # [share] Least share of the pieces of a pane that beams pass.
    passed_share = 0.6
    good = (shown + passed > 0) & (pieces["opaque"] <= most_opaque * (shown + passed))
    good &= (pieces["missing"] == 0) | (shown > 0)
    good |= flashed > 0
    for first, last in runs(good):
        if flashed[first:last].any():
            lit = first + np.flatnonzero(shown[first:last])
            own = slice(lit[0], lit[-1] + 1)
            seen_through = (passed[own] > 0).mean() >= passed_share
            found[own] = seen_through and passed[own].sum() >= SEEN
    return found


def mirror_pieces(pieces: Records) -> Bool:
    """Which pieces (PIECES,) of a line are a mirror."""
    opaque = pieces["opaque"]
    images = pieces["images"]
    wrong = pieces["wrong"]
    known = pieces["lit"]
    alike = pieces["alike"]
    # [beams] Fewest images of walls of known reflectance.
    least_lit = 16
    # [share] Least share of them that is as bright as in a mirror: others are of metal, or at an
    # edge of two walls.
    alike_share = 0.85
    if alike.sum() < least_lit:
        return np.zeros(PIECES, np.bool_)
    image_factor = 3.0  # [factor] Least ratio of images to other returns at a piece of a mirror.
    # Reflections of things that were seen nowhere else do not show a mirror.
    good = np.where(known > 0.0, alike > alike_share * known, images > image_factor * wrong)
    good &= (images >= SEEN) & (images > image_factor * opaque)
    # [pieces] Longest gap of a mirror, where it shows what was not seen otherwise: narrower than a
    # door.
    widest_hole = 3
    for (_, last), (first, _) in pairwise(runs(good)):
        # A mirror goes on between two pieces of it where nothing stands.
        stands = opaque[last:first] > (images + wrong)[last:first] / image_factor
        good[last:first] |= first - last <= widest_hole and not stands.any()
    for first, last in runs(good):
        enough = alike[first:last].sum() >= least_lit
        enough &= alike[first:last].sum() > alike_share * known[first:last].sum()
        good[first:last] = enough and images[first:last].sum() > 2.0 * wrong[first:last].sum()
    return np.asarray(good)


def find_pieces(pieces: Records, former: Bool, kind: int) -> tuple[Bool, int]:
    """Which pieces (PIECES,) of a line are glass or mirrors, and which of the two.

    Former ones, of a kind or of none, stay unless they are contradicted.
    """
    found = glass_pieces(pieces)
    belied = pieces["opaque"] > pieces["shown"] + pieces["passed"] + SEEN
    # What is seen through glass is darker as well.
    if kind == IS_MIRROR or not (found.any() or kind):
        found = mirror_pieces(pieces)
        kind = IS_MIRROR
        belied = pieces["opaque"] + pieces["wrong"] > pieces["images"] + SEEN
    found |= former & ~belied
    return found, max(kind, IS_GLASS) if found.any() else 0


def runs(chosen: Bool) -> Int:
    """The first place of each run (r, 2) of chosen ones (n,), and the place behind its last."""
    return np.flatnonzero(np.diff(chosen, prepend=False, append=False)).reshape(-1, 2)
