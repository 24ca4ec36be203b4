"""Evidence: which walls the beams hit, and where they violate them by going on behind, compiled.

Enter walls and the cells of all beams; leave, for each piece of a wall, how many beams hit it and
how many are free-space violations.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.blocks import SIDE, SIDE_BITS, block_at
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import (
    CELL,
    CONTINUATION_PENALTY,
    CONTINUATION_STRICTNESS,
    DEEPEST_HIT,
    HIT_DEVIATIONS,
    HIT_DIRECTIONS,
    LEAST_INCIDENCE,
    MOST_EXPLAINED,
    PIECE,
    SPREAD_FACTOR,
    WALL_SINE,
)
from lrf3d.mapping.robust.crossing import count_beams, ways_across


@inner
def _add_violations(ends: Float, counts: Float, cells: Cells) -> None:
    """Count the beams that went through each piece (n, 3) of a wall (4,)."""
    x1, y1, x2, y2 = ends[0], ends[1], ends[2], ends[3]
    pieces = len(counts)
    length = np.hypot(x2 - x1, y2 - y1)
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    ways = ways_across(ux, uy, WALL_SINE)
    at_x, at_y, block = 1 << 40, 0, -1
    for piece in range(pieces):
        along = (piece + 0.5) * length / pieces
        x, y = x1 + along * ux, y1 + along * uy
        column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
        # Most pieces are in the block of the one before, which is not looked up again.
        if column >> SIDE_BITS != at_x or row >> SIDE_BITS != at_y:
            at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
            block = block_at(cells.open, at_x, at_y)
        if block >= 0:
            place = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
            passed = ways & cells.passed[block, place]
            if passed:
                beams = count_beams(cells, block, place, passed, x, y, 0.0)
                counts[piece, 1] += beams * (PIECE / CELL)


class Round(NamedTuple):
    """The walls whose evidence is gathered in a round of the refinement.

    Args:
        number: 0 or 1.
        walls: (m,) their numbers.
        ends: (m, 4) where they are [m].
        first: (m + 1,) the first piece of each.
        stamps: (≥ all walls,) the stamp of each wall by its number.
        counts: (≥ all walls,) new evidence of each wall: 0 is set for these, and what others
            lose to them is added.
    """

    number: int
    walls: Int
    ends: Float
    first: Int
    stamps: NDArray[np.int32]
    counts: Float


@compiled
def gather_evidence(turn: Round, cells: Cells, near: float, margin: float) -> tuple[Float, Float]:
    """Count the hits and the free-space violations of each piece of each wall.

    A cluster of returns hits the wall that it lies nearest to, and no other.

    Args:
        turn: The walls.
        cells: The cells; whom the clusters belong to is written.
        near: How far from a wall [m] a return may lie, beside what noise explains.
        margin: How much of each wall [m], at either end, only continues what was seen.

    Returns:
        (pieces, 7) numbers of hits, of free-space violations, of beams that would be hits had they
        not hit another wall more nearly, of scans that hit, and of beams that went through between
        them; the sum over the hits of beams that went through before the first; and the scans from
        the first to the last. (pieces, 6) sums over the hits, of their weight, times place along
        the wall, offset from it, and the products of the two.
    """
    # Arrays of named tuples are taken out once: compiled code counts references at each access.
    number, ends, first, stamps = turn.number, turn.ends, turn.first, turn.stamps
    walls, lost = turn.walls, turn.counts
    following, owners, owner_stamps = cells.following, cells.owners, cells.owner_stamps
    apart, seen, solid = cells.apart, cells.seen, cells.solid
    counts = np.zeros((first[-1], 7))
    # What belongs to the walls before is free, so that all of it is claimed anew.
    for k in range(len(ends)):
        stamps[walls[k]] += 1
    band = near + min(HIT_DEVIATIONS * cells.widest[0], MOST_EXPLAINED)
    # Room for the clusters of all cells by the walls: an array that is put in another's place in a
    # loop makes all of the loop slow.
    cells_by = 0.0
    for wall in range(len(ends)):
        length = np.hypot(ends[wall, 2] - ends[wall, 0], ends[wall, 3] - ends[wall, 1])
        cells_by += (length + 1.5 * band + 3.0 * CELL) * (3.0 * band + 4.0 * CELL) / (CELL * CELL)
    hits_by = np.empty((int(cells_by) * HIT_DIRECTIONS, 3), np.int64)
    found = 0
    heads, moments = cells.heads, cells.moments
    at_x, at_y, block = 1 << 40, 0, -1
    for wall in range(len(ends)):
        x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
        length = np.hypot(x2 - x1, y2 - y1)
        if length == 0.0:
            continue
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        pieces = first[wall + 1] - first[wall]
        _add_violations(ends[wall], counts[first[wall] : first[wall + 1]], cells)
        steep = abs(uy) > abs(ux)
        # Columns of cells along the axis that the wall runs along more.
        begin, end = (min(y1, y2), max(y1, y2)) if steep else (min(x1, x2), max(x1, x2))
        main, aside = (uy, ux) if steep else (ux, uy)
        begin -= band * abs(aside)
        end += band * abs(aside)
        half = band / abs(main) + 0.5 * CELL * abs(aside / main)
        for column in range(int(np.floor(begin / CELL)), int(np.floor(end / CELL)) + 1):
            centre = (column + 0.5) * CELL
            middle = x1 + (centre - y1) * ux / uy if steep else y1 + (centre - x1) * uy / ux
            low, high = int(np.floor((middle - half) / CELL)), int(np.floor((middle + half) / CELL))
            for row in range(low, high + 1):
                cx, cy = (row, column) if steep else (column, row)
                if cx >> SIDE_BITS != at_x or cy >> SIDE_BITS != at_y:
                    at_x, at_y = cx >> SIDE_BITS, cy >> SIDE_BITS
                    block = block_at(solid, at_x, at_y)
                if block < 0:
                    continue
                cluster = heads[block, ((cy & (SIDE - 1)) << SIDE_BITS) + (cx & (SIDE - 1))]
                while cluster >= 0:
                    ox, oy = moments[cluster, 2] - x1, moments[cluster, 3] - y1
                    place = ox * ux + oy * uy
                    away = abs(oy * ux - ox * uy)
                    if away <= band and 0.0 <= place <= length:
                        incidence = moments[cluster, 7] * uy - moments[cluster, 8] * ux
                        slope = abs(incidence)
                        hits = moments[cluster, 0]
                        deviation = np.sqrt(hits / moments[cluster, 1])
                        piece = first[wall] + min(int(place / length * pieces), pieces - 1)
                        off = near + HIT_DEVIATIONS * deviation * slope
                        # What continues a wall lies on its line, and takes what no wall has.
                        continues = place < margin or place > length - margin
                        allowed = CONTINUATION_STRICTNESS * off if continues else off
                        if away <= allowed and away < DEEPEST_HIT * allowed * slope:
                            counts[piece, 2] += hits
                            if continues:
                                away += CONTINUATION_PENALTY * off
                            # A wall seen from its back does not end a beam.
                            if incidence < 0.0:
                                away += off
                            owner = owners[cluster, number]
                            owned = owner >= 0 and stamps[owner] == owner_stamps[cluster, number]
                            if not owned or away < apart[cluster, number]:
                                if owned:
                                    lost[owner] += hits
                                owner = walls[wall]
                                owners[cluster, number] = owner
                                owner_stamps[cluster, number] = stamps[owner]
                                apart[cluster, number] = away
                                hits_by[found, 0] = cluster
                                hits_by[found, 1], hits_by[found, 2] = wall, piece
                                found += 1
                    cluster = following[cluster]
    # What one of these walls has lost to another of them is counted already.
    for k in range(len(ends)):
        lost[walls[k]] = 0.0
    sums = np.zeros((first[-1], 6))
    before, length, ux, uy = -1, 0.0, 0.0, 0.0
    for k in range(found):
        cluster, wall, piece = hits_by[k]
        if owners[cluster, number] != walls[wall]:
            continue
        x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
        if wall != before:
            before, length = wall, np.hypot(x2 - x1, y2 - y1)
            ux, uy = (x2 - x1) / length, (y2 - y1) / length
        total = moments[cluster]
        counts[piece, 0] += total[0]
        counts[piece, 2] -= total[0]
        counts[piece, 3] += total[9]
        counts[piece, 4] += total[10]
        # Of these two, those of a piece are the hits' mean and the longest of its cells.
        counts[piece, 5] += total[0] * total[11]
        counts[piece, 6] = max(counts[piece, 6], seen[cluster] - total[12] + 1.0)
        ox, oy = total[2] - x1, total[3] - y1
        along, aside = ox * ux + oy * uy, oy * ux - ox * uy
        slope = max(abs(total[7] * uy - total[8] * ux), LEAST_INCIDENCE)
        factor = 1.0 / (slope * slope)
        xx, xy, yy = total[4], total[5], total[6]
        # Returns spread wider than by noise are of two walls in one cell, or of poses that err:
        # the mean of any number of them is no better than they are spread.
        spread = (xx * uy * uy - 2.0 * xy * ux * uy + yy * ux * ux) / total[1]
        excess = spread - SPREAD_FACTOR * total[0] / (factor * total[1])
        if excess > 0.0:
            factor /= 1.0 + factor * total[1] * excess
        weight = factor * total[1]
        sums[piece, 0] += weight
        sums[piece, 1] += weight * along
        sums[piece, 2] += weight * aside
        sums[piece, 3] += weight * along * along + factor * (
            xx * ux * ux + 2.0 * xy * ux * uy + yy * uy * uy
        )
        sums[piece, 4] += weight * along * aside + factor * (
            (yy - xx) * ux * uy + xy * (ux * ux - uy * uy)
        )
        sums[piece, 5] += weight * aside * aside + factor * (
            xx * uy * uy - 2.0 * xy * ux * uy + yy * ux * ux
        )
    return counts, sums
