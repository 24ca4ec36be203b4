"""Evidence: which walls the beams hit, and where they violate them by going on behind, compiled.

Enter walls and the cells of all beams; leave, for each piece of a wall, how many beams hit it and
how many are free-space violations.
"""

from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, inner
from lrf3d.geometry import Float, Int, Records
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import (
    HIT_DEVIATIONS,
    SIDE_BITS,
    Cells,
    NewEvidence,
    block_at,
    cell_in,
)
from lrf3d.mapping.robust.crossing import (
    WALL_SINE,
    count_beams,
    end_of,
    unit_of,
    ways_across,
)
from lrf3d.mapping.robust.extraction import LEAST_INCIDENCE
from lrf3d.mapping.robust.records import PIECE_COUNTS, PIECE_SUMS

PIECE = 0.1
"""[m] Length of a piece of a wall, within which its evidence is counted."""

FOLLOWED = 2.0
"""[m] How far a wall is followed beyond its ends, to what single beams hit."""

ROUNDING = 1e-6
"""[m] A wall may end just where its last hit is: rounding does not decide what continues it."""

CONTINUATION_STRICTNESS = 0.5
"""[share] How far off a return may lie that makes a wall longer, as a part of what is usual."""

CONTINUATION_PENALTY = 2.0
"""[share] By how much of what is usual a return counts as farther off a wall that it would make
longer, so that walls that were seen there come first."""

DEEPEST_HIT = 5.0
"""[share] How far a hit may lie from the wall along its beam, as a multiple of how far it may lie
off: beams that all but run along a wall hit it anywhere."""

WIDEST_BAND = 1.0
"""[m] How far off a wall noise lets its returns lie at most, however large it is."""

SPREAD_FACTOR = 16.0
"""[share] How many times the variance of the noise returns may be spread across a wall in a cell
and still be of that wall alone: four standard deviations. At 4 walls of rooms are a fifth nearer to
the truth, and a map of an office explains 0.1 % less of its returns."""


class Claims(NamedTuple):
    """Clusters (c,) that walls claim which lie so near [m], and the counts (pieces,) of these."""

    fresh: NewEvidence
    near: float
    counts: Records
    clusters: Int


class Lines(NamedTuple):
    """The rows (n,) of walls, how far each is followed (n, 4) [m], and its first piece."""

    rows: Int
    ends: Float
    first: Int


@inner
def follow(rows: Int, ends: Float) -> Lines:
    """Walls (rows, 4), those of some rows (n,), followed beyond their ends."""
    count = len(rows)
    followed, first = np.empty((count, 4)), np.zeros(count + 1, np.int64)
    for k in range(count):
        ux, uy, length = unit_of(ends[rows[k]])
        for side in range(4):
            along = FOLLOWED * (ux if side % 2 == 0 else uy)
            followed[k, side] = ends[rows[k], side] + (along if side > 1 else -along)
        first[k + 1] = first[k] + max(int(np.ceil((length + 2.0 * FOLLOWED) / PIECE)), 1)
    return Lines(rows, followed, first)


@inner
def gather_evidence(
    lines: Lines, cells: Cells, fresh: NewEvidence, near: float
) -> tuple[Records, Records, Int]:
    """Count the hits and the free-space violations of each piece of each line.

    A cluster of returns hits the wall that it lies nearest to, and no other; what other walls lose
    to these is new evidence of them.

    Returns:
        The :data:`PIECE_COUNTS` and :data:`PIECE_SUMS` of each piece; and the clusters (c, 2) that
        hit them, each with its piece.
    """
    pieces = lines.first[-1]
    counts, sums = np.zeros(pieces, PIECE_COUNTS), np.zeros(pieces, PIECE_SUMS)
    # What belongs to the walls before is free, so that all of it is claimed again.
    for k in range(len(lines.rows)):
        fresh.walls[lines.rows[k]].version += 1
    claimed, found = np.empty(cells.counters[0].clusters, np.int64), 0
    claims = Claims(fresh, near, counts, claimed)
    for k in range(len(lines.rows)):
        _count_violations(lines, k, cells, counts)
        found = _claim(lines, k, cells, claims, found)
    # What one of these walls has lost to another of them is counted already.
    for k in range(len(lines.rows)):
        fresh.walls[lines.rows[k]].fresh = 0.0
    places = np.empty(len(fresh.walls), np.int64)
    for k in range(len(lines.rows)):
        places[lines.rows[k]] = k
    owned = np.empty((found, 2), np.int64)
    for k in range(found):
        cluster = cells.clusters[claimed[k]]
        piece, cluster.piece = cluster.piece - 1, 0
        owned[k, 0], owned[k, 1] = claimed[k], piece
        _add_cluster(cluster, lines.ends[places[cluster.owner]], counts[piece], sums[piece])
    return counts, sums, owned


@borrower
def _add_cluster(cluster: Any, line: Float, count: Any, total: Any) -> None:
    """Add a cluster to the counts and the sums of the piece of a line (4,) that it hit."""
    ux, uy, _ = unit_of(line)
    hits, weights = cluster.hits, cluster.weight
    count.hits += hits
    count.nearer -= hits
    count.scans += cluster.scans
    count.passes_between += cluster.passes_between
    # Of these two, those of a piece are the hits' mean and the longest of its cells.
    count.passes_before += hits * cluster.passes_before
    count.spell = max(count.spell, cluster.last_scan - cluster.first_scan + 1.0)
    ox, oy = cluster.x - line[0], cluster.y - line[1]
    along, aside = ox * ux + oy * uy, oy * ux - ox * uy
    slope = max(abs(cluster.toward_x * uy - cluster.toward_y * ux), LEAST_INCIDENCE)
    factor = 1.0 / (slope * slope)
    xx, xy, yy = cluster.xx, cluster.xy, cluster.yy
    across = xx * uy * uy - 2.0 * xy * ux * uy + yy * ux * ux
    # Returns spread wider than by noise are of two walls in one cell, or of poses that err:
    # the mean of any number of them is no better than they are spread.
    excess = across / weights - SPREAD_FACTOR * hits / (factor * weights)
    if excess > 0.0:
        factor /= 1.0 + factor * weights * excess
    weight = factor * weights
    total.weight += weight
    total.along += weight * along
    total.aside += weight * aside
    total.along_along += weight * along * along
    total.along_along += factor * (xx * ux * ux + 2.0 * xy * ux * uy + yy * uy * uy)
    total.along_aside += weight * along * aside
    total.along_aside += factor * ((yy - xx) * ux * uy + xy * (ux * ux - uy * uy))
    total.aside_aside += weight * aside * aside + factor * across


@borrower
def _count_violations(lines: Lines, k: int, cells: Cells, counts: Records) -> None:
    """Count the beams that went through each piece of a line."""
    x1, y1 = end_of(lines.ends[k], 0)
    ux, uy, length = unit_of(lines.ends[k])
    begin, pieces = lines.first[k], lines.first[k + 1] - lines.first[k]
    ways = ways_across(ux, uy, WALL_SINE)
    at_x, at_y, block = 1 << 40, 0, 0
    for piece in range(pieces):
        along = (piece + 0.5) * length / pieces
        x, y = x1 + along * ux, y1 + along * uy
        column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
        # Most pieces are in the block of the one before, which is not looked up again.
        if column >> SIDE_BITS != at_x or row >> SIDE_BITS != at_y:
            at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
            block = block_at(cells, column, row)
        beams = count_beams(cells, block, cell_in(column, row), ways, x, y, 0.0)
        counts[begin + piece].violations = beams * (PIECE / CELL)


@borrower
def _claim(lines: Lines, k: int, cells: Cells, claims: Claims, found: int) -> int:
    """Claim the clusters that lie nearest to a line; how many are claimed by now."""
    band = claims.near + min(HIT_DEVIATIONS * cells.counters[0].widest, WIDEST_BAND)
    (x1, y1), (x2, y2) = end_of(lines.ends[k], 0), end_of(lines.ends[k], 1)
    ux, uy, _ = unit_of(lines.ends[k])
    steep = abs(uy) > abs(ux)
    # Columns of cells along the axis that the wall runs along more.
    begin, end = (min(y1, y2), max(y1, y2)) if steep else (min(x1, x2), max(x1, x2))
    main, aside = (uy, ux) if steep else (ux, uy)
    begin -= band * abs(aside)
    end += band * abs(aside)
    half = band / abs(main) + 0.5 * CELL * abs(aside / main)
    at_x, at_y, block = 1 << 40, 0, 0
    for column in range(int(np.floor(begin / CELL)), int(np.floor(end / CELL)) + 1):
        centre = (column + 0.5) * CELL
        middle = x1 + (centre - y1) * ux / uy if steep else y1 + (centre - x1) * uy / ux
        low, high = int(np.floor((middle - half) / CELL)), int(np.floor((middle + half) / CELL))
        for row in range(low, high + 1):
            cx, cy = (row, column) if steep else (column, row)
            if cx >> SIDE_BITS != at_x or cy >> SIDE_BITS != at_y:
                at_x, at_y = cx >> SIDE_BITS, cy >> SIDE_BITS
                block = block_at(cells, cx, cy)
            cluster = cells.heads[block, cell_in(cx, cy)]
            while cluster > 0:
                found = _claim_one(lines, k, cells, cluster, claims, band, found)
                cluster = cells.clusters[cluster].next
    return found


@borrower
def _claim_one(
    lines: Lines, k: int, cells: Cells, place: int, claims: Claims, band: float, found: int
) -> int:
    """Claim a cluster if it may be of a line and lies nearer to it than to what it is of."""
    cluster, ends, walls = cells.clusters[place], lines.ends[k], claims.fresh.walls
    ux, uy, length = unit_of(ends)
    ox, oy = cluster.x - ends[0], cluster.y - ends[1]
    along, away = ox * ux + oy * uy, abs(oy * ux - ox * uy)
    if away > band or along < 0.0 or along > length:
        return found
    incidence = cluster.toward_x * uy - cluster.toward_y * ux
    slope, hits = abs(incidence), cluster.hits
    off = claims.near + HIT_DEVIATIONS * np.sqrt(hits / cluster.weight) * slope
    # What continues a wall lies on its line, and takes what no wall has.
    continues = along < FOLLOWED - ROUNDING or along > length - FOLLOWED + ROUNDING
    allowed = CONTINUATION_STRICTNESS * off if continues else off
    if away > allowed or away >= DEEPEST_HIT * allowed * slope:
        return found
    pieces = lines.first[k + 1] - lines.first[k]
    piece = lines.first[k] + min(int(along / length * pieces), pieces - 1)
    claims.counts[piece].nearer += hits
    if continues:
        away += CONTINUATION_PENALTY * off
    # A wall seen from its back does not end a beam.
    if incidence < 0.0:
        away += off
    if walls[cluster.owner].version == cluster.owner_version:
        if away >= cluster.distance:
            return found
        walls[cluster.owner].fresh += hits
    cluster.owner, cluster.distance = lines.rows[k], away
    cluster.owner_version = walls[lines.rows[k]].version
    # Another of these walls may have claimed it before: then it is in the list already.
    if cluster.piece == 0:
        claims.clusters[found] = place
        found += 1
    cluster.piece = piece + 1
    return found
