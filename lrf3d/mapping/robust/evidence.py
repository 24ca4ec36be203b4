"""Evidence: which walls the beams hit, and where they violate them by going on behind, compiled.

Enter walls and the cells of all beams; leave, for each piece of a wall, how many beams hit it and
how many are free-space violations, or whether any beam has crossed a line.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.blocks import SIDE, SIDE_BITS, block_at
from lrf3d.mapping.robust.constants import (
    CELL,
    CONTINUATION_PENALTY,
    CONTINUATION_STRICTNESS,
    DEEPEST_HIT,
    FREE_DEPTH,
    HIT_DEVIATIONS,
    LEAST_INCIDENCE,
    LINK_END,
    MOST_PASSES,
    PASS_DIRECTIONS,
    PIECE,
    WALL_SINE,
)
from lrf3d.mapping.robust.evidence_grid import Cells


@inner
def crossings(
    cells: Cells, x: float, y: float, ux: float, uy: float, deeper: float, sine: float
) -> int:  # pragma: no cover
    """How many beams went across the direction (ux, uy) at a place [m], and so much [m] deeper."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
    if block < 0:
        return 0
    place = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    count = 0
    for way in range(PASS_DIRECTIONS):
        passed = cells.passes[block, way * SIDE * SIDE + place] & MOST_PASSES
        if passed:
            turn = 2.0 * np.pi * way / PASS_DIRECTIONS
            if abs(np.cos(turn) * uy - np.sin(turn) * ux) > sine:
                if deeper > 0.0:
                    dx, dy = np.cos(turn), np.sin(turn)
                    passed = min(passed, _passes(cells, x + deeper * dx, y + deeper * dy, way))
                count += passed
    return count


@inner
def _passes(cells: Cells, x: float, y: float, way: int) -> int:  # pragma: no cover
    """How many beams went one way through the cell of a place [m]."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
    if block < 0:
        return 0
    place = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    passed: int = cells.passes[block, way * SIDE * SIDE + place] & MOST_PASSES
    return passed


class Round(NamedTuple):
    """The walls whose evidence is gathered in a round of the refinement.

    Args:
        number: 0 or 1.
        walls: (m,) their numbers.
        ends: (m, 4) where they are [m].
        first: (m + 1,) the first piece of each.
        stamps: (≥ all walls,) the stamp of each wall by its number.
        counts: (≥ all walls,) news of each wall: what it has lost to others is added.
    """

    number: int
    walls: Int
    ends: Float
    first: Int
    stamps: NDArray[np.int32]
    counts: Float


@inner
def longer(column: Int) -> Int:  # pragma: no cover
    """An array with as many numbers behind it, which may be anything."""
    grown = np.empty(2 * len(column), np.int64)
    for k in range(len(column)):
        grown[k] = column[k]
    return grown


@compiled
def gather_evidence(
    turn: Round, cells: Cells, near: float, margin: float
) -> tuple[Float, Float]:  # pragma: no cover
    """Count the hits and the free-space violations of each piece of each wall.

    A cluster of returns hits the wall that it lies nearest to, and no other.

    Args:
        turn: The walls.
        cells: The cells; whom the clusters belong to is written.
        near: How far from a wall [m] a return may lie, beside what noise explains.
        margin: How much of each wall [m], at either end, only continues what was seen.

    Returns:
        (pieces, 3) numbers of hits, of free-space violations, and of beams that would be hits had
        they not hit another wall more nearly; (pieces, 6) sums over the hits, of their weight,
        times place along the wall, offset from it, and the products of the two.
    """
    number, ends, first = turn.number, turn.ends, turn.first
    counts = np.zeros((first[-1], 3))
    # What belongs to the walls before is free, so that all of it is claimed anew.
    for k in range(len(ends)):
        turn.stamps[turn.walls[k]] += 1
    claimed, hit_wall = np.empty(256, np.int64), np.empty(256, np.int64)
    hit_piece = np.empty(256, np.int64)
    found = 0
    band = near + HIT_DEVIATIONS * cells.widest[0]
    for wall in range(len(ends)):
        x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
        length = np.hypot(x2 - x1, y2 - y1)
        if length == 0.0:
            continue
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        pieces = first[wall + 1] - first[wall]
        for piece in range(pieces):
            along = (piece + 0.5) * length / pieces
            passed = crossings(cells, x1 + along * ux, y1 + along * uy, ux, uy, 0.0, WALL_SINE)
            counts[first[wall] + piece, 1] += passed * (PIECE / CELL)
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
                block = block_at(cells.solid, cx >> SIDE_BITS, cy >> SIDE_BITS)
                if block < 0:
                    continue
                cluster = cells.heads[block, ((cy & (SIDE - 1)) << SIDE_BITS) + (cx & (SIDE - 1))]
                while cluster >= 0:
                    moments = cells.moments[cluster]
                    ox, oy = moments[2] - x1, moments[3] - y1
                    place = ox * ux + oy * uy
                    if 0.0 <= place <= length:
                        incidence = moments[7] * uy - moments[8] * ux
                        slope = abs(incidence)
                        deviation = np.sqrt(moments[0] / moments[1])
                        piece = first[wall] + min(int(place / length * pieces), pieces - 1)
                        off = near + HIT_DEVIATIONS * deviation * slope
                        away = abs(oy * ux - ox * uy)
                        # What continues a wall lies on its line, and takes what no wall has.
                        continues = place < margin or place > length - margin
                        allowed = CONTINUATION_STRICTNESS * off if continues else off
                        if away <= allowed and away < DEEPEST_HIT * allowed * slope:
                            counts[piece, 2] += moments[0]
                            if continues:
                                away += CONTINUATION_PENALTY * off
                            # A wall seen from its back does not end a beam.
                            if incidence < 0.0:
                                away += off
                            owner = cells.owners[cluster, number]
                            owned = (
                                owner >= 0 and turn.stamps[owner] == cells.claims[cluster, number]
                            )
                            if not owned or away < cells.apart[cluster, number]:
                                if owned:
                                    turn.counts[owner] += moments[0]
                                owner = turn.walls[wall]
                                cells.owners[cluster, number] = owner
                                cells.claims[cluster, number] = turn.stamps[owner]
                                cells.apart[cluster, number] = away
                                if found == len(claimed):
                                    claimed, hit_wall = longer(claimed), longer(hit_wall)
                                    hit_piece = longer(hit_piece)
                                claimed[found], hit_wall[found] = cluster, wall
                                hit_piece[found] = piece
                                found += 1
                    cluster = cells.following[cluster]
    sums = np.zeros((first[-1], 6))
    for k in range(found):
        cluster, wall, piece = claimed[k], hit_wall[k], hit_piece[k]
        if cells.owners[cluster, number] != turn.walls[wall]:
            continue
        moments = cells.moments[cluster]
        counts[piece, 0] += moments[0]
        counts[piece, 2] -= moments[0]
        x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
        length = np.hypot(x2 - x1, y2 - y1)
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        ox, oy = moments[2] - x1, moments[3] - y1
        along, aside = ox * ux + oy * uy, oy * ux - ox * uy
        slope = max(abs(moments[7] * uy - moments[8] * ux), LEAST_INCIDENCE)
        factor = 1.0 / (slope * slope)
        weight = factor * moments[1]
        xx, xy, yy = moments[4], moments[5], moments[6]
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


@inner
def is_crossed(
    line: Float, cells: Cells, depth: float, spare: int, sine: float
) -> bool:  # pragma: no cover
    """Whether more beams than are to spare have crossed a line (4,) by more than a depth [m].

    The sine is that of the angle from which on a beam may cross it.
    """
    x1, y1, x2, y2 = line
    length = np.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return False
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    end = min(LINK_END, 0.25 * length)
    length -= 2.0 * end
    steps = int(length / CELL) + 1
    for step in range(steps):
        along = end + (step + 0.5) * length / steps
        spare -= crossings(
            cells, x1 + along * ux, y1 + along * uy, ux, uy, depth - FREE_DEPTH, sine
        )
        if spare < 0:
            return True
    return False
