"""Pieces: the hits and free-space violations of each cell's length of a wall.

Walls and cells enter; each wall is extended at both ends and divided into pieces, and each cluster
of returns is assigned to the nearest wall.
"""

from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, inner, record
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import (
    HIT_DEVIATIONS,
    MOST_EXPLAINED,
    SIDE_BITS,
    WALL_SINE,
    Cells,
    block_at,
    cell_in,
    cell_of,
    count_beams,
    ways_across,
)
from lrf3d.mapping.robust.extraction import LEAST_INCIDENCE
from lrf3d.mapping.robust.walls import Walls, end_of, unit_of

# [m] Extension of a wall beyond both ends, to reach single hits.
FOLLOWED = 2.0


# What the beams did at a piece of a wall, which is as long as a cell.
PIECE = record(
    hits=float, violations=float,  # [beams] that hit it, and that went through it
    nearer=float,  # [beams] that would be hits had they not hit another wall more nearly
    scans=float,  # scans that hit it
    passes_between=float,  # [beams] that went through between these
    passes_before=float,  # [beams] that went through before the first, a sum over the hits
    spell=float,  # [scans] from the first to the last
    weight=float,  # [1/m²] the weight of its hits
    along=float, aside=float,  # the weighted sums of their places along the wall and beside it
    along_along=float, along_aside=float, aside_aside=float,  # and those of their products
    part=int,  # the part of a wall that it becomes, from 1, or 0
)  # fmt: skip


class ExtendedWalls(NamedTuple):
    """Walls extended at both ends and divided into pieces.

    Args:
        rows: (n,) the rows of the walls.
        ends: (n, 4) how far each is followed [m].
        first: (n + 1,) the first piece of each.
        pieces: (pieces,) of :data:`PIECE`.
        near: How far off a wall returns of it may lie beside what noise explains [m].
        claimed: (≥ clusters,) the clusters that they claim.
    """

    rows: Int
    ends: Float
    first: Int
    pieces: Records
    near: float
    claimed: Int


@inner
def follow(rows: Int, ends: Float, near: float, clusters: int) -> ExtendedWalls:
    """Extend walls (rows, 4), of some rows (n,), at both ends and divide them into pieces."""
    count = len(rows)
    followed = np.empty((count, 4))
    first = np.zeros(count + 1, np.int64)
    for k in range(count):
        ux, uy, length = unit_of(ends[rows[k]])
        for side in range(4):
            along = FOLLOWED * (ux if side % 2 == 0 else uy)
            followed[k, side] = ends[rows[k], side] + (along if side > 1 else -along)
        first[k + 1] = first[k] + max(int(np.ceil((length + 2.0 * FOLLOWED) / CELL)), 1)
    claimed = np.empty(clusters, np.int64)
    return ExtendedWalls(rows, followed, first, np.zeros(first[count], PIECE), near, claimed)


@inner
def gather_evidence(lines: ExtendedWalls, cells: Cells, walls: Walls) -> int:
    """Count the hits and the free-space violations of each piece of each line.

    A cluster is assigned to the nearest wall alone; what other walls lose is new evidence of them.
    Returns the number of assigned clusters; each has its piece.
    """
    found = 0
    # A new version releases the clusters of a wall; all of them are claimed again below.
    for k in range(len(lines.rows)):
        walls.rows[lines.rows[k]].version += 1
    for k in range(len(lines.rows)):
        _count_violations(lines, k, cells)
        found = _claim(lines, k, cells, walls, found)
    places = np.empty(len(walls.rows), np.int64)
    for k in range(len(lines.rows)):
        # What one of these walls has lost to another of them is not new evidence.
        walls.rows[lines.rows[k]].fresh = 0.0
        places[lines.rows[k]] = k
    for k in range(found):
        cluster = cells.clusters[lines.claimed[k]]
        _add_cluster(cluster, lines.ends[places[cluster.owner]], lines.pieces[cluster.piece - 1])
    return found


@borrower
def _add_cluster(cluster: Any, line: Float, piece: Any) -> None:
    """Add a cluster to the piece of a line (4,) that it hit."""
    ux, uy, _ = unit_of(line)
    hits = cluster.hits
    weights = cluster.weight
    piece.hits += hits
    piece.nearer -= hits
    piece.scans += cluster.scans
    piece.passes_between += cluster.passes_between
    # Of these two, those of a piece are the hits' mean and the longest of its cells.
    piece.passes_before += hits * cluster.passes_before
    piece.spell = max(piece.spell, cluster.last_scan - cluster.first_scan + 1.0)
    ox = cluster.x - line[0]
    oy = cluster.y - line[1]
    along = ox * ux + oy * uy
    aside = oy * ux - ox * uy
    slope = max(abs(cluster.toward_x * uy - cluster.toward_y * ux), LEAST_INCIDENCE)
    factor = 1.0 / (slope * slope)
    xx = cluster.xx
    xy = cluster.xy
    yy = cluster.yy
    across = xx * uy * uy - 2.0 * xy * ux * uy + yy * ux * ux
    # [share] Largest spread of the returns in a cell across a wall, in variances of the noise;
    # above it they are of two walls. At 4 walls of rooms are a fifth closer to the truth, and a map
    # of an office explains 0.1 % less of its returns.
    spread_factor = 16.0
    # Returns that spread wider than noise belong to two walls in one cell, or have wrong poses:
    # their mean is no more accurate than their spread.
    excess = across / weights - spread_factor * hits / (factor * weights)
    if excess > 0.0:
        factor /= 1.0 + factor * weights * excess
    weight = factor * weights
    piece.weight += weight
    piece.along += weight * along
    piece.aside += weight * aside
    piece.along_along += weight * along * along
    piece.along_along += factor * (xx * ux * ux + 2.0 * xy * ux * uy + yy * uy * uy)
    piece.along_aside += weight * along * aside
    piece.along_aside += factor * ((yy - xx) * ux * uy + xy * (ux * ux - uy * uy))
    piece.aside_aside += weight * aside * aside + factor * across


@borrower
def _count_violations(lines: ExtendedWalls, k: int, cells: Cells) -> None:
    """Count the beams that passed through each piece of a line."""
    x1, y1 = end_of(lines.ends[k], 0)
    ux, uy, length = unit_of(lines.ends[k])
    pieces = lines.first[k + 1] - lines.first[k]
    ways = ways_across(ux, uy, WALL_SINE)
    at_x = 1 << 40
    at_y = 0
    block = 0
    for piece in range(pieces):
        along = (piece + 0.5) * length / pieces
        x = x1 + along * ux
        y = y1 + along * uy
        column, row = cell_of(x, y)
        # Most pieces lie in the block of the previous one: look it up only when it changes.
        if column >> SIDE_BITS != at_x or row >> SIDE_BITS != at_y:
            at_x = column >> SIDE_BITS
            at_y = row >> SIDE_BITS
            block = block_at(cells, column, row)
        beams = count_beams(cells, block, cell_in(column, row), ways, x, y, 0.0)
        lines.pieces[lines.first[k] + piece].violations = beams


@borrower
def _claim(lines: ExtendedWalls, k: int, cells: Cells, walls: Walls, found: int) -> int:
    """Assign the clusters that are nearest to a line; returns how many are assigned so far."""
    band = lines.near + min(HIT_DEVIATIONS * cells.counters[0].widest, MOST_EXPLAINED)
    x1, y1 = end_of(lines.ends[k], 0)
    x2, y2 = end_of(lines.ends[k], 1)
    ux, uy, _ = unit_of(lines.ends[k])
    steep = abs(uy) > abs(ux)
    # Columns of cells along the axis that the wall runs along more.
    begin, end = (min(y1, y2), max(y1, y2)) if steep else (min(x1, x2), max(x1, x2))
    main, aside = (uy, ux) if steep else (ux, uy)
    begin -= band * abs(aside)
    end += band * abs(aside)
    half = band / abs(main) + 0.5 * CELL * abs(aside / main)
    at_x = 1 << 40
    at_y = 0
    block = 0
    for column in range(int(np.floor(begin / CELL)), int(np.floor(end / CELL)) + 1):
        centre = (column + 0.5) * CELL
        middle = x1 + (centre - y1) * ux / uy if steep else y1 + (centre - x1) * uy / ux
        low = int(np.floor((middle - half) / CELL))
        high = int(np.floor((middle + half) / CELL))
        for row in range(low, high + 1):
            cx, cy = (row, column) if steep else (column, row)
            if cx >> SIDE_BITS != at_x or cy >> SIDE_BITS != at_y:
                at_x = cx >> SIDE_BITS
                at_y = cy >> SIDE_BITS
                block = block_at(cells, cx, cy)
            cluster = cells.heads[block, cell_in(cx, cy)]
            while cluster > 0:
                found = _claim_one(lines, k, cells, cluster, walls, band, found)
                cluster = cells.clusters[cluster].next
    return found


@borrower
def _claim_one(
    lines: ExtendedWalls, k: int, cells: Cells, place: int, walls: Walls, band: float,
    found: int,
) -> int:  # fmt: skip
    """Assign a cluster to a line if it may hit it and is nearer to it than to its owner."""
    cluster = cells.clusters[place]
    ends = lines.ends[k]
    rows = walls.rows
    ux, uy, length = unit_of(ends)
    ox = cluster.x - ends[0]
    oy = cluster.y - ends[1]
    along = ox * ux + oy * uy
    away = abs(oy * ux - ox * uy)
    if away > band or along < 0.0 or along > length:
        return found
    incidence = cluster.toward_x * uy - cluster.toward_y * ux
    slope = abs(incidence)
    hits = cluster.hits
    off = lines.near + HIT_DEVIATIONS * np.sqrt(hits / cluster.weight) * slope
    # [m] A wall may end exactly at its last hit: rounding must not make that hit an extension.
    rounding = 1e-6
    # What continues a wall lies on its line, and takes what no wall has.
    continues = along < FOLLOWED - rounding or along > length - FOLLOWED + rounding
    # [share] Tolerance for returns beyond the ends of a wall, relative to that along it.
    continuation_strictness = 0.5
    allowed = continuation_strictness * off if continues else off
    # [share] Largest distance from a hit to the wall along its beam, in tolerances: beams that
    # almost run along a wall hit it anywhere.
    deepest_hit = 5.0
    if away > allowed or away >= deepest_hit * allowed * slope:
        return found
    pieces = lines.first[k + 1] - lines.first[k]
    piece = lines.first[k] + min(int(along / length * pieces), pieces - 1)
    lines.pieces[piece].nearer += hits
    # [share] Distance added to returns beyond the ends, in tolerances, so that walls that were seen
    # there come first.
    continuation_penalty = 2.0
    if continues:
        away += continuation_penalty * off
    # A beam that comes from behind a wall is no hit of it.
    if incidence < 0.0:
        away += off
    if rows[cluster.owner].version == cluster.owner_version:
        if away >= cluster.distance:
            return found
        rows[cluster.owner].fresh += hits
    cluster.owner = lines.rows[k]
    cluster.distance = away
    cluster.owner_version = rows[lines.rows[k]].version
    # Another of these walls may have claimed it before: then it is in the list already.
    if cluster.piece == 0:
        lines.claimed[found] = place
        found += 1
    cluster.piece = piece + 1
    return found
