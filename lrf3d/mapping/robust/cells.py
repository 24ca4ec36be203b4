"""Cells: what beams have shown of the ground, and how each beam adds to it, compiled.

A return adds to the moments of the returns in its cell that came the same way; each cell that a
beam goes through counts it as a pass, by the beam's direction. Sums do not depend on the order of
the scans. What beams go through, where others ended before, is forgotten bit by bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.blocks import (
    ROW_BITS,
    SIDE,
    SIDE_BITS,
    Blocks,
    block_at,
    enter_cells,
    take_block,
    unpacked,
)
from lrf3d.mapping.robust.constants import (
    CELL,
    FREE_DEPTH,
    GONE_AFTER,
    HIT_DEVIATIONS,
    HIT_DIRECTIONS,
    LEAST_HITS,
    MOST_HITS,
    MOST_PASSES,
    OPEN_WEIGHT,
    PASS_DIRECTIONS,
    SAME_WAY,
)

SOLID = np.uint8(128)
"""Bit of the numbers of passes of a cell in which beams ended."""

REACH_BITS = 52
"""A beam's way through the cells is measured in so small parts of its reach."""

ROW_MASK = (SIDE - 1) << SIDE_BITS
LEAVES = ~((SIDE - 1) + ((SIDE - 1) << ROW_BITS))
"""The bits of a packed cell that change when a step leaves a block."""


class Cells(NamedTuple):
    """The cells, as compiled code takes them.

    Args:
        open: The blocks of cells that beams went through.
        planes: (blocks, directions) which plane counts the beams of each direction; 0 where none
            went.
        passes: (planes, cells) numbers of beams that went through each; plane 0 stays empty.
        passed: (blocks, cells) in which directions any of them went, each a bit.
        solid: The blocks of cells that beams ended in.
        heads: (blocks, cells) the first cluster of returns in each cell, −1 where there is none.
        following: (clusters,) the next of the same cell, or of those given back; −1 at the end.
        ways: (clusters,) which way its beams came.
        moments: (clusters, 13) number of returns, weight 1/variance [1/m²] of their ranges, mean
            x, y [m], scatter xx, xy, yy about it, mean direction x, y of the beams, number of
            scans that they are from, and of beams that went through between them; beams that had
            gone through the cell before its first return, and the scan of that.
        seen: (clusters,) the last of these scans.
        owners: (clusters, 2) the wall that each hit, in the first round of the refinement and in
            the second; −1 where none.
        owner_stamps: (clusters, 2) the owner's stamp when it took the cluster, which is free where
            the owner has another stamp by now.
        apart: (clusters, 2) how far each lies off its owner [m].
        misses: (clusters,) beams that went on the way that its beams came, since the last hit.
        used: (4,) clusters that were taken, the first that was given back, scans, and planes that
            were taken.
        widest: (1,) greatest deviation [m] of a return.
    """

    open: Blocks
    planes: NDArray[np.int32]
    passes: NDArray[np.uint8]
    passed: NDArray[np.uint16]
    solid: Blocks
    heads: NDArray[np.int32]
    following: NDArray[np.int32]
    ways: NDArray[np.int8]
    moments: Float
    seen: NDArray[np.int32]
    owners: NDArray[np.int32]
    owner_stamps: NDArray[np.int32]
    apart: Float
    misses: NDArray[np.int32]
    used: Int
    widest: Float


class NewEvidence(NamedTuple):
    """What the beams of a scan have added to the evidence of which walls.

    Args:
        stamps: (walls,) the stamp of each wall.
        counts: (walls,) what is new of each wall since it was refit [hits].
        walls: (walls,) these walls, each once.
        last_scans: (walls,) the last scan that added to the evidence of each wall.
        unowned: (≥ beams,) clusters that are hits of no wall and grew.
        numbers: (3,) how many walls and clusters, and the number of the scan.
    """

    stamps: NDArray[np.int32]
    counts: Float
    walls: Int
    last_scans: Int
    unowned: Int
    numbers: Int

    @classmethod
    def of_no_walls(cls, beams: int) -> "NewEvidence":
        """No walls, for a scan of some beams."""
        none = np.zeros(0, np.int64)
        return cls(
            np.zeros(0, np.int32), np.zeros(0), none, none, np.empty(beams, np.int64),
            np.zeros(3, np.int64),
        )  # fmt: skip


@compiled
def add_beams(
    cells: Cells,
    begin: int,
    place: tuple[float, float],
    beams: Beams,
    fresh: NewEvidence,
) -> tuple[int, int]:
    """Add the beams of a scan, from one on.

    Args:
        cells: The cells; are written.
        begin: The first of the beams that are not added yet.
        place: Where the laser is [m].
        beams: The beams.
        fresh: Is written.

    Returns:
        The first beam that there is no room for, and what is too small for it: the open blocks (0),
        the solid ones (1), the clusters (2) or the planes (3).
    """
    x, y = place
    units, ranges, deviations = beams
    blocks, solid, planes = cells.open, cells.solid, cells.planes
    passes, directions = cells.passes, cells.passed
    if begin == 0:
        cells.used[2] += 1
    for beam in range(begin, len(ranges)):
        reading = ranges[beam]
        if reading == 0.0:
            continue
        dx, dy = units[beam, 0], units[beam, 1]
        most = int(abs(reading) * (abs(dx) + abs(dy)) / (CELL * SIDE)) + 4
        if 2 * (blocks.used[0] + most) > len(blocks.keys):
            return beam, 0
        if 2 * solid.used[0] == len(solid.keys):
            return beam, 1
        if cells.used[1] < 0 and cells.used[0] == len(cells.moments):
            return beam, 2
        if cells.used[3] + most > len(passes):
            return beam, 3
        turn = np.arctan2(dy, dx) / (2.0 * np.pi)
        free = (abs(reading) - FREE_DEPTH - HIT_DEVIATIONS * deviations[beam]) / CELL
        way = int(np.floor(turn * PASS_DIRECTIONS + 0.5)) % PASS_DIRECTIONS
        scale = (1 << REACH_BITS) / (abs(reading) / CELL + 2.0)
        cell, right, ahead, wide, high, across, up = enter_cells(x, y, dx, dy, scale)
        entered, left, last = 0, min(across, up), int(2.0 * free * scale)
        block, plane, inside, bit = 0, 0, cell ^ LEAVES, np.uint16(1 << way)
        # The middle of the beam's way through a cell decides.
        while entered + left <= last:
            if (cell ^ inside) & LEAVES:
                inside = cell
                at_x, at_y = unpacked(cell, SIDE_BITS)
                block = take_block(blocks, at_x, at_y)
                # What beams of one direction count lies together.
                plane = planes[block, way]
                if plane == 0:
                    plane = _take_plane(cells, block, way, block_at(solid, at_x, at_y))
            at = ((cell >> (ROW_BITS - SIDE_BITS)) & ROW_MASK) | (cell & (SIDE - 1))
            passed = passes[plane, at]
            if passed & MOST_PASSES == 0:
                directions[block, at] |= bit
            if passed & SOLID:
                _contradict(cells, plane, cell, dx, dy, fresh)
            elif passed < MOST_PASSES:
                passes[plane, at] = passed + 1
            entered = left
            # Choices instead of a branch, which no processor could predict.
            crosses = across < up
            cell += right if crosses else ahead
            across += wide if crosses else 0
            up += 0 if crosses else high
            left = min(across, up)
        if reading > 0.0:
            way = int(np.floor(turn * HIT_DIRECTIONS + 0.5)) % HIT_DIRECTIONS
            cells.widest[0] = max(cells.widest[0], deviations[beam])
            _add_hit(
                cells, x + reading * dx, y + reading * dy, dx, dy, deviations[beam], way, fresh
            )
    return len(ranges), -1


@inner
def _take_plane(cells: Cells, block: int, way: int, solid: int) -> int:
    """A new plane for the beams of a direction in an open block, which may be a solid one too."""
    plane: int = cells.used[3]
    cells.used[3] += 1
    cells.planes[block, way] = plane
    if solid >= 0:
        for cell in range(SIDE * SIDE):
            if cells.heads[solid, cell] >= 0:
                cells.passes[plane, cell] = SOLID
    return plane


@inner
def count_evidence(fresh: NewEvidence, wall: int, weight: float) -> None:
    """Add a beam of a weight [hits] to the new evidence of a wall."""
    fresh.counts[wall] += weight
    if fresh.last_scans[wall] != fresh.numbers[2]:
        fresh.last_scans[wall] = fresh.numbers[2]
        fresh.walls[fresh.numbers[0]] = wall
        fresh.numbers[0] += 1


@inner
def _contradict(
    cells: Cells,
    plane: int,
    packed_cell: int,
    dx: float,
    dy: float,
    fresh: NewEvidence,
) -> None:
    """Count a beam that goes on through a cell where others ended."""
    column, row = unpacked(packed_cell, 0)
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    if cells.passes[plane, cell] < SOLID + MOST_PASSES:
        cells.passes[plane, cell] += 1
    else:
        _forget(cells, column, row)
    # Only cells with clusters are marked SOLID, and blocks once taken stay.
    solid = block_at(cells.solid, column >> SIDE_BITS, row >> SIDE_BITS)
    moments, misses = cells.moments, cells.misses
    before, cluster = -1, cells.heads[solid, cell]
    while cluster >= 0:
        weight = OPEN_WEIGHT
        if cells.seen[cluster] != cells.used[2] and (
            dx * moments[cluster, 7] + dy * moments[cluster, 8] > SAME_WAY
        ):
            misses[cluster] += 1
            if misses[cluster] >= GONE_AFTER:
                # What beams hit there is gone: each further few halve what is left of it.
                misses[cluster] -= GONE_AFTER // 4
                weight += 0.5 * moments[cluster, 0]
                for k in (0, 1, 4, 5, 6, 9, 10):
                    moments[cluster, k] *= 0.5
        owner = cells.owners[cluster, 0]
        if owner >= 0 and fresh.stamps[owner] == cells.owner_stamps[cluster, 0]:
            count_evidence(fresh, owner, weight)
        after = cells.following[cluster]
        if moments[cluster, 0] < LEAST_HITS:
            _give_back(cells, solid, cell, before, cluster)
        else:
            before = cluster
        cluster = after
    if before < 0:
        block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
        for way in range(PASS_DIRECTIONS):
            cells.passes[cells.planes[block, way], cell] &= MOST_PASSES


@inner
def _give_back(cells: Cells, solid: int, cell: int, before: int, cluster: int) -> None:
    """Take a cluster out of the list of its cell, where another may be before it."""
    after = cells.following[cluster]
    if before < 0:
        cells.heads[solid, cell] = after
    else:
        cells.following[before] = after
    cells.following[cluster] = cells.used[1]
    cells.used[1] = cluster
    cells.misses[cluster] = 0
    for k in range(2):
        cells.owners[cluster, k] = -1
    cells.seen[cluster] = 0
    for k in range(13):
        cells.moments[cluster, k] = 0.0


@inner
def _forget(cells: Cells, column: int, row: int) -> None:
    """Halve the hits and the passes of a cell that has clusters.

    Their proportion stays, and what comes counts twice as much as what was.
    """
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    # The first hit in a cell takes an open block, too.
    block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
    for way in range(PASS_DIRECTIONS):
        plane = cells.planes[block, way]
        passed = cells.passes[plane, cell]
        cells.passes[plane, cell] = (passed & SOLID) + ((passed & MOST_PASSES) >> 1)
        if passed & MOST_PASSES == 1:
            cells.passed[block, cell] ^= np.uint16(1 << way)
    solid = block_at(cells.solid, column >> SIDE_BITS, row >> SIDE_BITS)
    cluster = cells.heads[solid, cell]
    while cluster >= 0:
        for k in (0, 1, 4, 5, 6, 9, 10, 11):
            cells.moments[cluster, k] *= 0.5
        cluster = cells.following[cluster]


@inner
def _passes_of(cells: Cells, column: int, row: int) -> float:
    """How many beams have gone through a cell of an open block, whichever way."""
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
    passed = 0.0
    for way in range(PASS_DIRECTIONS):
        passed += cells.passes[cells.planes[block, way], cell] & MOST_PASSES
    return passed


@inner
def _add_hit(
    cells: Cells,
    x: float,
    y: float,
    dx: float,
    dy: float,
    deviation: float,
    way: int,
    fresh: NewEvidence,
) -> None:
    """Add a return at a place [m] to the moments of its cell."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
    block = take_block(cells.solid, at_x, at_y)
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    if cells.heads[block, cell] < 0:
        open_block = take_block(cells.open, at_x, at_y)
        for passed in range(PASS_DIRECTIONS):
            plane = cells.planes[open_block, passed]
            if plane > 0:
                cells.passes[plane, cell] |= SOLID
    cluster = cells.heads[block, cell]
    while cluster >= 0 and cells.ways[cluster] != way:
        cluster = cells.following[cluster]
    if cluster < 0:
        cluster = cells.used[1]
        if cluster >= 0:
            cells.used[1] = cells.following[cluster]
        else:
            cluster = cells.used[0]
            cells.used[0] += 1
        cells.ways[cluster] = way
        moments, other = cells.moments, cells.heads[block, cell]
        moments[cluster, 11] = moments[other, 11] if other >= 0 else _passes_of(cells, column, row)
        moments[cluster, 12] = moments[other, 12] if other >= 0 else cells.used[2]
        cells.following[cluster] = other
        cells.heads[block, cell] = cluster
    total = cells.moments[cluster]
    if total[0] >= MOST_HITS:
        _forget(cells, column, row)
    if cells.seen[cluster] != cells.used[2]:
        if total[9] > 0.0:
            total[10] += cells.misses[cluster]
        cells.seen[cluster] = cells.used[2]
        total[9] += 1.0
    cells.misses[cluster] = 0
    weight = 1.0 / (deviation * deviation)
    total[0] += 1.0
    total[1] += weight
    share = weight / total[1]
    ox, oy = x - total[2], y - total[3]
    total[2] += share * ox
    total[3] += share * oy
    spread = weight * (1.0 - share)
    total[4] += spread * ox * ox
    total[5] += spread * ox * oy
    total[6] += spread * oy * oy
    total[7] += (dx - total[7]) / total[0]
    total[8] += (dy - total[8]) / total[0]
    owner = cells.owners[cluster, 0]
    if owner >= 0 and fresh.stamps[owner] == cells.owner_stamps[cluster, 0]:
        count_evidence(fresh, owner, 1.0)
    else:
        fresh.unowned[fresh.numbers[1]] = cluster
        fresh.numbers[1] += 1
