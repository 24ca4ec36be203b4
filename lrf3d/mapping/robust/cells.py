"""Cells: what all beams have shown of the ground, each beam judged once.

A return adds to the moments of the returns in its cell that came the same way, a cluster; each cell
that a beam goes through counts it as a pass, by the beam's direction. Sums do not depend on the
order of the scans. What beams go through, where others ended before, is forgotten bit by bit.

The ground is divided into squares, which a hash table finds. Only squares in which something was
hit, and those around them, have cells: memory grows with what was hit, not with how far beams go.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.beams import CELL, Beams

SIDE_BITS = 4
SIDE = 1 << SIDE_BITS
"""Cells along the side of a block, whose numbers lie together."""

SQUARE_BITS = SIDE_BITS + 3
"""A square has eight blocks along a side, 12.8 m: no place on the longest line by which two walls
are compared is farther than half of its 15 m from one of them."""

PASS_DIRECTIONS = 16
"""[directions] By how many directions the beams through a cell are told apart: those that run
along a wall do not violate it. Eight serve as well but for narrow lanes."""

HIT_DIRECTIONS = 8
"""[directions] By how many directions returns are told apart: thin walls are seen from both sides,
and at a corner two walls share a cell."""

MOST_PASSES, SOLID = 127, np.uint8(128)
"""[beams] When more have gone through a cell one way, all that is kept of the cell is halved: what
came later counts more, so that a wall that goes away, or comes, is noticed after some hundred
beams whatever was before. Seven bits: the eighth marks cells with returns."""

MOST_HITS = 255.0
"""[beams] The same for the returns in a cell from one direction."""

GONE_AFTER = 20
"""[beams] When so many have gone on where others ended, the same way and without a hit between
them, what stood there is gone. Less forgets panes and fences that one beam in so many hits."""

LEAST_HITS = 0.5
"""[beams] What fewer hits than this are left of is forgotten altogether."""

SAME_WAY = 0.7
"""[cosine] Angle between beams that go the same way."""

FREE_DEPTH = 0.2
"""[m] A beam that goes no farther than this behind a wall is no free-space violation: poses and
edges are a little wrong."""

HIT_DEVIATIONS = 3.0
"""[deviations] What the noise adds to how far a return may lie off a wall that its beam hit, and
how far a beam must go on behind a wall to violate it."""

OPEN_WEIGHT = 0.5
"""[hits] What a free-space violation weighs at a piece of a wall without hits, and as new evidence
of a wall."""

EMPTY = -(2**62)
"""Key of a slot that no square has taken."""

ROW_BITS, FIRST_COLUMN = 32, 1 << 31
"""A packed cell is its row, and its column counted from the first below the row's bits."""

REACH_BITS, FARTHEST = 52, 1 << 54
"""A beam's way through the cells is measured in so small parts of its reach; a distance that it
does not get to."""

ROW_MASK = (SIDE - 1) << SIDE_BITS
LEAVES = ~((SIDE - 1) + ((SIDE - 1) << ROW_BITS))
"""The bits of a packed cell that change when a step leaves a block."""

LEAST = 256
"""Squares and walls that there is room for at first; four times as many blocks."""


class Cells(NamedTuple):
    """The cells, as compiled code takes them. Blocks and clusters are counted from 1; 0 is none.

    Args:
        keys: (slots,) the square that has each slot of the hash table; slots is a power of two.
        squares: (slots,) its number.
        blocks: (squares, 64) the block of cells at each place of a square.
        passes: (blocks, directions, cells) numbers of beams that went through each.
        passed: (blocks, cells) in which directions any of them went, each a bit.
        heads: (blocks, cells) the first cluster of returns in each cell.
        following: (clusters,) the next of the same cell, or of those given back.
        ways: (clusters,) which way its beams came.
        moments: (clusters, 13) number of returns, weight 1/variance [1/m²] of their ranges, mean
            x, y [m], scatter xx, xy, yy about it, mean direction x, y of the beams, number of
            scans that they are from, and of beams that went through between them; beams that had
            gone through the cell before its first return, and the scan of that.
        seen: (clusters,) the last of these scans.
        owners: (clusters,) the wall that each hit.
        stamps: (clusters,) the owner's stamp when it took the cluster, which is free where the
            owner has another stamp by now.
        apart: (clusters,) how far each lies off its owner [m].
        pieces: (clusters,) the piece of its owner, while that is refit.
        misses: (clusters,) beams that went on the way that its beams came, since the last hit.
        used: (5,) squares, blocks and clusters that were taken, the first cluster that was given
            back, and scans.
        widest: (1,) greatest deviation [m] of a return.
    """

    keys: Int
    squares: Int
    blocks: NDArray[np.int32]
    passes: NDArray[np.uint8]
    passed: NDArray[np.uint16]
    heads: NDArray[np.int32]
    following: NDArray[np.int32]
    ways: NDArray[np.int8]
    moments: Float
    seen: NDArray[np.int32]
    owners: NDArray[np.int32]
    stamps: NDArray[np.int32]
    apart: Float
    pieces: NDArray[np.int32]
    misses: NDArray[np.int32]
    used: Int
    widest: Float

    @classmethod
    def of_size(cls, size: int) -> "Cells":
        """No cells, with room for this number of squares, and more of blocks and clusters."""
        blocks, clusters, cells = 4 * size, 16 * size, SIDE * SIDE
        return cls(
            np.full(2 * size, EMPTY), np.zeros(2 * size, np.int64),
            np.zeros((size, 64), np.int32), np.zeros((blocks, PASS_DIRECTIONS, cells), np.uint8),
            np.zeros((blocks, cells), np.uint16), np.zeros((blocks, cells), np.int32),
            np.zeros(clusters, np.int32), np.zeros(clusters, np.int8), np.zeros((clusters, 13)),
            np.zeros(clusters, np.int32), np.zeros(clusters, np.int32),
            np.zeros(clusters, np.int32), np.zeros(clusters), np.zeros(clusters, np.int32),
            np.zeros(clusters, np.int32), np.array([0, 1, 1, 0, 0]), np.zeros(1),
        )  # fmt: skip

    def doubled(self) -> "Cells":
        """The same with room for twice as many."""
        grown = Cells.of_size(2 * len(self.blocks))
        columns: list[NDArray[Any]] = list(self)
        for place, column in enumerate(columns[2:], 2):
            # What is zero takes no memory until it is written.
            used = self.used[0 if place == 2 else 1 if place < 6 else 2]
            grown[place][: used if place < 15 else None] = column[: used if place < 15 else None]
        move_squares(self, grown)
        return grown


class NewEvidence(NamedTuple):
    """What the beams of a scan have added to the evidence of which walls.

    Args:
        stamps: (rows,) the stamp of each wall.
        counts: (rows,) what is new of each wall since it was refit [hits].
        last_scans: (rows,) the last scan that added to the evidence of each wall.
        walls: (rows,) the walls that this scan added to, each once.
        unowned: (≥ beams,) clusters that are hits of no wall and grew.
        numbers: (3,) how many walls and clusters, and the number of the scan.
    """

    stamps: NDArray[np.int32]
    counts: Float
    last_scans: Int
    walls: Int
    unowned: Int
    numbers: Int


@borrower
def _slot_of(keys: Int, x: int, y: int) -> int:
    """The slot of a square in the hash table, or the free one that it would take."""
    key, mask = (x << 31) + y, len(keys) - 1
    mixed = key * 0x9E3779B97F4A7C1
    slot = (mixed ^ (mixed >> 29)) & mask
    while keys[slot] != key and keys[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@compiled
def move_squares(cells: Cells, grown: Cells) -> None:
    """Put the squares into a larger hash table."""
    for old in range(len(cells.keys)):
        key = cells.keys[old]
        if key != EMPTY:
            y = ((key + (1 << 30)) & ((1 << 31) - 1)) - (1 << 30)
            slot = _slot_of(grown.keys, (key - y) >> 31, y)
            grown.keys[slot], grown.squares[slot] = key, cells.squares[old]


@borrower
def block_at(cells: Cells, column: int, row: int) -> int:
    """The block of a cell; 0 where there is none."""
    slot = _slot_of(cells.keys, column >> SQUARE_BITS, row >> SQUARE_BITS)
    if cells.keys[slot] == EMPTY:
        return 0
    block: int = cells.blocks[cells.squares[slot], _place_of(column, row)]
    return block


@borrower
def cell_in(column: int, row: int) -> int:
    """The place of a cell in its block."""
    return ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))


@borrower
def _place_of(column: int, row: int) -> int:
    """The place of a cell's block in its square."""
    return (((row >> SIDE_BITS) & 7) << 3) + ((column >> SIDE_BITS) & 7)


@borrower
def _take_block(cells: Cells, column: int, row: int) -> int:
    """The block of a cell, which is made where there is none; −1 outside of all squares."""
    slot = _slot_of(cells.keys, column >> SQUARE_BITS, row >> SQUARE_BITS)
    if cells.keys[slot] == EMPTY:
        return -1
    square, place = cells.squares[slot], _place_of(column, row)
    if cells.blocks[square, place] == 0:
        cells.blocks[square, place] = cells.used[1]
        cells.used[1] += 1
    block: int = cells.blocks[square, place]
    return block


@compiled
def open_squares(cells: Cells, place: tuple[float, float], beams: Beams) -> bool:
    """Make the squares around all hits of a scan from a place [m]; False where room ran out."""
    side, before_x, before_y = CELL * (1 << SQUARE_BITS), 1 << 40, 0
    for beam in range(len(beams.ranges)):
        reach = beams.ranges[beam]
        if reach <= 0.0:
            continue
        x = int(np.floor((place[0] + reach * beams.units[beam, 0]) / side))
        y = int(np.floor((place[1] + reach * beams.units[beam, 1]) / side))
        if x == before_x and y == before_y:
            continue
        before_x, before_y = x, y
        if cells.used[0] + 9 > len(cells.blocks):
            return False
        for near_x in range(x - 1, x + 2):
            for near_y in range(y - 1, y + 2):
                slot = _slot_of(cells.keys, near_x, near_y)
                if cells.keys[slot] == EMPTY:
                    cells.keys[slot] = (near_x << 31) + near_y
                    cells.squares[slot] = cells.used[0]
                    cells.used[0] += 1
    return True


@borrower
def _unpacked(cell: int) -> tuple[int, int]:
    """Column and row of a packed cell."""
    return (cell & ((1 << ROW_BITS) - 1)) - FIRST_COLUMN, cell >> ROW_BITS


@inner
def _enter(
    x: float, y: float, dx: float, dy: float, scale: float
) -> tuple[int, int, int, int, int, int, int]:
    """Where a ray from a place (x, y) [m] in a direction (dx, dy) begins its way through cells.

    Distances are whole numbers, at so many to a cell: processors compare them, and choose by them,
    several times faster than floats.

    Returns:
        Its first cell, packed; what a step to the next column and to the next row adds to it; how
        far it is from column to column and from row to row; and how far to the next column and to
        the next row.
    """
    px, py = x / CELL, y / CELL
    column, row = int(np.floor(px)), int(np.floor(py))
    across = (column + 1.0 - px) if dx > 0.0 else (px - column)
    up = (row + 1.0 - py) if dy > 0.0 else (py - row)
    # A ray along an axis never gets to the next row or column.
    far = float(FARTHEST)
    wide = min(scale / abs(dx), far) if dx != 0.0 else far
    high = min(scale / abs(dy), far) if dy != 0.0 else far
    return (
        (row << ROW_BITS) + column + FIRST_COLUMN,
        1 if dx > 0.0 else -1, (1 if dy > 0.0 else -1) << ROW_BITS, int(wide), int(high),
        int(across * wide) if wide < far else FARTHEST, int(up * high) if high < far else FARTHEST,
    )  # fmt: skip


@borrower
def _steps_out(to_next: int, step: int, until: int) -> int:
    """How many edges lie no farther than a distance, the first so far away, the others a step."""
    return 0 if to_next > until else (until - to_next) // step + 1


@compiled
def add_beams(
    cells: Cells, begin: int, place: tuple[float, float], beams: Beams, fresh: NewEvidence
) -> int:
    """Add the beams of a scan from a place [m], from one on; returns the first without room."""
    x, y = place
    units, ranges, deviations = beams
    passes, passed_ways = cells.passes, cells.passed
    if begin == 0:
        cells.used[4] += 1
    side = (1 << SQUARE_BITS) - 1
    for beam in range(begin, len(ranges)):
        reading = ranges[beam]
        if reading == 0.0:
            continue
        dx, dy = units[beam, 0], units[beam, 1]
        most = int(abs(reading) * (abs(dx) + abs(dy)) / (CELL * SIDE)) + 4
        if cells.used[1] + most > len(cells.heads):
            return beam
        if cells.used[3] == 0 and cells.used[2] == len(cells.moments):
            return beam
        turn = np.arctan2(dy, dx) / (2.0 * np.pi)
        free = (abs(reading) - FREE_DEPTH - HIT_DEVIATIONS * deviations[beam]) / CELL
        way = int(np.floor(turn * PASS_DIRECTIONS + 0.5)) % PASS_DIRECTIONS
        scale = (1 << REACH_BITS) / (abs(reading) / CELL + 2.0)
        cell, right, ahead, wide, high, across, up = _enter(x, y, dx, dy, scale)
        entered, left, last = 0, min(across, up), int(2.0 * free * scale)
        block, inside, bit = 0, cell ^ LEAVES, np.uint16(1 << way)
        # The middle of the beam's way through a cell decides.
        while entered + left <= last:
            if (cell ^ inside) & LEAVES:
                column, row = _unpacked(cell)
                block = _take_block(cells, column, row)
                if block < 0:
                    # Nothing was hit around here: on to the next square.
                    wide_out = side - (column & side) if right > 0 else column & side
                    high_out = side - (row & side) if ahead > 0 else row & side
                    entered = min(across + wide_out * wide, up + high_out * high)
                    columns = _steps_out(across, wide, entered)
                    rows = _steps_out(up, high, entered)
                    cell += right * columns + ahead * rows
                    across += wide * columns
                    up += high * rows
                    left, inside = min(across, up), cell ^ LEAVES
                    continue
                inside = cell
            at = ((cell >> (ROW_BITS - SIDE_BITS)) & ROW_MASK) | (cell & (SIDE - 1))
            count = passes[block, way, at]
            if count & MOST_PASSES == 0:
                passed_ways[block, at] |= bit
            if count & SOLID:
                _contradict(cells, block, way, at, dx, dy, fresh)
            elif count < MOST_PASSES:
                passes[block, way, at] = count + 1
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
    return len(ranges)


@borrower
def count_evidence(fresh: NewEvidence, wall: int, weight: float) -> None:
    """Add a beam of a weight [hits] to the new evidence of a wall."""
    fresh.counts[wall] += weight
    if fresh.last_scans[wall] != fresh.numbers[2]:
        fresh.last_scans[wall] = fresh.numbers[2]
        fresh.walls[fresh.numbers[0]] = wall
        fresh.numbers[0] += 1


@borrower
def _contradict(
    cells: Cells, block: int, way: int, cell: int, dx: float, dy: float, fresh: NewEvidence
) -> None:
    """Count a beam that goes on through a cell where others ended."""
    if cells.passes[block, way, cell] < SOLID + MOST_PASSES:
        cells.passes[block, way, cell] += 1
    else:
        _forget(cells, block, cell)
    moments, misses = cells.moments, cells.misses
    before, cluster = 0, cells.heads[block, cell]
    while cluster > 0:
        weight = OPEN_WEIGHT
        if cells.seen[cluster] != cells.used[4] and (
            dx * moments[cluster, 7] + dy * moments[cluster, 8] > SAME_WAY
        ):
            misses[cluster] += 1
            if misses[cluster] >= GONE_AFTER:
                # What beams hit there is gone: each further few halve what is left of it.
                misses[cluster] -= GONE_AFTER // 4
                weight += 0.5 * moments[cluster, 0]
                for k in (0, 1, 4, 5, 6, 9, 10):
                    moments[cluster, k] *= 0.5
        owner = cells.owners[cluster]
        if fresh.stamps[owner] == cells.stamps[cluster]:
            count_evidence(fresh, owner, weight)
        after = cells.following[cluster]
        if moments[cluster, 0] < LEAST_HITS:
            _give_back(cells, block, cell, before, cluster)
        else:
            before = cluster
        cluster = after
    if before == 0:
        for other in range(PASS_DIRECTIONS):
            cells.passes[block, other, cell] &= MOST_PASSES


@borrower
def _give_back(cells: Cells, block: int, cell: int, before: int, cluster: int) -> None:
    """Take a cluster out of the list of its cell, where another may be before it."""
    if before == 0:
        cells.heads[block, cell] = cells.following[cluster]
    else:
        cells.following[before] = cells.following[cluster]
    cells.following[cluster] = cells.used[3]
    cells.used[3] = cluster
    cells.misses[cluster] = cells.stamps[cluster] = cells.seen[cluster] = 0
    for k in range(13):
        cells.moments[cluster, k] = 0.0


@borrower
def _forget(cells: Cells, block: int, cell: int) -> None:
    """Halve the hits and the passes of a cell that has clusters.

    Their proportion stays, and what comes counts twice as much as what was.
    """
    for way in range(PASS_DIRECTIONS):
        passed = cells.passes[block, way, cell]
        cells.passes[block, way, cell] = (passed & SOLID) + ((passed & MOST_PASSES) >> 1)
        if passed & MOST_PASSES == 1:
            cells.passed[block, cell] ^= np.uint16(1 << way)
    cluster = cells.heads[block, cell]
    while cluster > 0:
        for k in (0, 1, 4, 5, 6, 9, 10, 11):
            cells.moments[cluster, k] *= 0.5
        cluster = cells.following[cluster]


@borrower
def _new_cluster(cells: Cells, block: int, cell: int, way: int) -> int:
    """A cluster for the returns that come one way in a cell."""
    other, passed = cells.heads[block, cell], 0.0
    if other == 0:
        for passing in range(PASS_DIRECTIONS):
            passed += cells.passes[block, passing, cell]
            cells.passes[block, passing, cell] |= SOLID
    cluster: int = cells.used[3]
    if cluster > 0:
        cells.used[3] = cells.following[cluster]
    else:
        cluster = cells.used[2]
        cells.used[2] += 1
    cells.ways[cluster], moments = way, cells.moments
    moments[cluster, 11] = moments[other, 11] if other > 0 else passed
    moments[cluster, 12] = moments[other, 12] if other > 0 else cells.used[4]
    cells.following[cluster], cells.heads[block, cell] = other, cluster
    return cluster


@borrower
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
    block, cell = _take_block(cells, column, row), cell_in(column, row)
    cluster = cells.heads[block, cell]
    while cluster > 0 and cells.ways[cluster] != way:
        cluster = cells.following[cluster]
    if cluster == 0:
        cluster = _new_cluster(cells, block, cell, way)
    total = cells.moments[cluster]
    if total[0] >= MOST_HITS:
        _forget(cells, block, cell)
    if cells.seen[cluster] != cells.used[4]:
        if total[9] > 0.0:
            total[10] += cells.misses[cluster]
        cells.seen[cluster] = cells.used[4]
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
    owner = cells.owners[cluster]
    if fresh.stamps[owner] == cells.stamps[cluster]:
        count_evidence(fresh, owner, 1.0)
    else:
        fresh.unowned[fresh.numbers[1]] = cluster
        fresh.numbers[1] += 1
