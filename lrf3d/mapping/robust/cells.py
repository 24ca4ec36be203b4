"""Cells: a sparse grid that counts the beams through each cell by their direction.

Beams enter; each cell that one passes through counts it, and the cell that it ends in keeps its
return in a cluster (see `clusters`). `is_crossed` returns whether beams crossed a line. Sums do not
depend on the order of the scans.

The grid is divided into squares, which a hash table finds. Only squares with returns, and those
around them, have cells: memory grows with the surfaces seen, not with the length of the beams.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled, record
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.mapping.robust.beams import CELL, Beams

# Cells along the side of a block; their numbers are adjacent in memory.
SIDE_BITS = 4
SIDE = 1 << SIDE_BITS

# A square is eight blocks, 12.8 m, wide: no point of the longest link between two walls, 15 m, is
# farther than half of that from one of them.
SQUARE_BITS = SIDE_BITS + 3

# [bins] Directions of the beams through a cell: those that run along a wall do not violate it.
# Eight are as good except in narrow lanes.
PASS_DIRECTIONS = 16

# [bins] Directions of returns: thin walls are seen from both sides, and two walls share the cell of
# a corner.
HIT_DIRECTIONS = 8

# [beams] Above this count in one direction all counts of the cell are halved, so that recent beams
# weigh more: a wall that appears or disappears is noticed after about a hundred beams. Seven bits;
# the eighth marks cells with returns.
MOST_PASSES = 127
SOLID = np.uint8(128)

# [m] A beam that ends less than this behind a wall is no free-space violation: poses and edges have
# small errors.
FREE_DEPTH = 0.2

# [deviations] Tolerance for noise: how far a return, or another segment, may lie from a wall, and
# how far a beam must continue behind a wall to violate it.
HIT_DEVIATIONS = 3.0

# [m] Largest offset that noise may explain: a short, distant segment would explain almost any.
MOST_EXPLAINED = 1.0

# [hits] Weight of a free-space violation at a piece of wall without hits, and as new evidence of a
# wall.
OPEN_WEIGHT = 0.5

# Unit vectors of the directions.
COSINES = np.cos(2.0 * np.pi * np.arange(PASS_DIRECTIONS) / PASS_DIRECTIONS)
SINES = np.sin(2.0 * np.pi * np.arange(PASS_DIRECTIONS) / PASS_DIRECTIONS)

# [sine] Least angle at which a beam through the cells of a wall crosses it: at a smaller one it may
# run in front of the wall, through the same cells.
WALL_SINE = 0.5

# [m] Length ignored at both ends of a line: beams that pass the end of a wall go on through the
# same cells.
LINE_END = 1.5 * CELL

# Key of an empty slot.
EMPTY = -(2**62)

# Initial capacity in squares and in walls.
LEAST = 256

# [squares] Room, of 0.4 GB, up to which a map grows fourfold, as copies take long.
# Larger ones grow twofold: some systems refuse room that is far more than what is taken.
LARGE = 4096


# The returns in one cell that came the same way.
CLUSTER = record(
    hits=float,  # [beams] returns
    weight=float,  # [1/m²] sum of the inverse variances of their ranges
    x=float, y=float,  # [m] their mean
    xx=float, xy=float, yy=float,  # their weighted scatter about it
    toward_x=float, toward_y=float,  # mean direction of their beams
    scans=float,  # scans that they are from
    passes_between=float,  # [beams] that went through between two of these scans
    passes_before=float,  # [beams] that had gone through the cell before its first return
    first_scan=float,  # the scan of that return
    distance=float,  # [m] to its owner
    last_scan=np.int32,  # the last scan that hit it
    owner=np.int32,  # the wall that it hits
    owner_version=np.int32,  # the owner's version when it took the cluster; free if it has another
    misses=np.int32,  # [beams] of its direction that went on, since the last hit
    piece=np.int32,  # the piece of its owner, while that is refit
    next=np.int32,  # the next cluster of the same cell, or of those given back
    way=np.int32,  # direction of its beams, one of HIT_DIRECTIONS (passes have PASS_DIRECTIONS)
)  # fmt: skip

COUNTERS = record(
    squares=int, blocks=int, clusters=int,  # taken so far
    free_cluster=int,  # the first cluster that was given back
    scans=int,
    widest=float,  # [m] greatest deviation of a return
)  # fmt: skip


class Cells(NamedTuple):
    """The grid, as kernels use it. Blocks and clusters are numbered from 1; 0 stands for none.

    Args:
        keys: (slots,) the square that has each slot of the hash table; slots is a power of two.
        squares: (slots,) its number.
        blocks: (squares, 64) the block of cells at each place of a square.
        passes: (blocks, directions, cells) numbers of beams that went through each.
        passed: (blocks, cells) in which directions any of them went, each a bit.
        heads: (blocks, cells) the first cluster of returns in each cell.
        clusters: (clusters,) of :data:`CLUSTER`.
        counters: (1,) of :data:`COUNTERS`.
    """

    keys: Int
    squares: Int
    blocks: NDArray[np.int32]
    passes: NDArray[np.uint8]
    passed: NDArray[np.uint16]
    heads: NDArray[np.int32]
    clusters: Records
    counters: Records

    @classmethod
    def of_size(cls, size: int) -> "Cells":
        """No cells, with room for this number of squares, and more of blocks and clusters.

        Room that is not taken takes no memory but addresses.
        """
        blocks = 16 * size
        cells = SIDE * SIDE
        counters = np.zeros(1, COUNTERS)
        counters["blocks"] = counters["clusters"] = 1
        return cls(
            np.full(2 * size, EMPTY), np.zeros(2 * size, np.int64),
            np.zeros((size, 64), np.int32), np.zeros((blocks, PASS_DIRECTIONS, cells), np.uint8),
            np.zeros((blocks, cells), np.uint16), np.zeros((blocks, cells), np.int32),
            np.zeros(64 * size, CLUSTER), counters,
        )  # fmt: skip

    def enlarged(self) -> "Cells":
        """The same with more room."""
        size = len(self.blocks)
        grown = Cells.of_size(4 * size if size < LARGE else 2 * size)
        taken = self.counters[0]
        grown.blocks[: taken.squares] = self.blocks[: taken.squares]
        for name in ("passes", "passed", "heads"):
            getattr(grown, name)[: taken.blocks] = getattr(self, name)[: taken.blocks]
        grown.clusters[: taken.clusters] = self.clusters[: taken.clusters]
        grown.counters[0] = taken
        move_squares(self.keys, self.squares, grown.keys, grown.squares)
        return grown


@borrower
def _slot_of(keys: Int, x: int, y: int) -> int:
    """The slot of a square in the hash table, or the empty slot for it."""
    key = (x << 31) + y
    mask = len(keys) - 1
    mixed = key * 0x9E3779B97F4A7C1
    slot = (mixed ^ (mixed >> 29)) & mask
    while keys[slot] != key and keys[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@compiled
def move_squares(keys: Int, squares: Int, larger: Int, moved: Int) -> None:
    """Put squares (slots,) with keys (slots,) into a larger hash table."""
    for old in range(len(keys)):
        key = keys[old]
        if key != EMPTY:
            y = ((key + (1 << 30)) & ((1 << 31) - 1)) - (1 << 30)
            slot = _slot_of(larger, (key - y) >> 31, y)
            larger[slot] = key
            moved[slot] = squares[old]


@borrower
def cell_of(x: float, y: float) -> tuple[int, int]:
    """The column and the row of the cell of a place [m]."""
    return int(np.floor(x / CELL)), int(np.floor(y / CELL))


@borrower
def block_at(cells: Cells, column: int, row: int) -> int:
    """The block of a cell; 0 if it has none."""
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
def take_block(cells: Cells, column: int, row: int) -> int:
    """The block of a cell, made if it does not exist; −1 outside of all squares."""
    slot = _slot_of(cells.keys, column >> SQUARE_BITS, row >> SQUARE_BITS)
    if cells.keys[slot] == EMPTY:
        return -1
    square = cells.squares[slot]
    place = _place_of(column, row)
    if cells.blocks[square, place] == 0:
        counters = cells.counters[0]
        cells.blocks[square, place] = counters.blocks
        counters.blocks += 1
    block: int = cells.blocks[square, place]
    return block


@compiled
def open_squares(cells: Cells, place: tuple[float, float], beams: Beams) -> bool:
    """Count a scan from a place [m] and make the squares around its hits; False without room."""
    side = CELL * (1 << SQUARE_BITS)
    before_x = 1 << 40
    before_y = 0
    counters = cells.counters[0]
    for beam in range(len(beams.ranges)):
        reach = beams.ranges[beam]
        if reach <= 0.0:
            continue
        x = int(np.floor((place[0] + reach * beams.units[beam, 0]) / side))
        y = int(np.floor((place[1] + reach * beams.units[beam, 1]) / side))
        if x == before_x and y == before_y:
            continue
        before_x = x
        before_y = y
        if counters.squares + 9 > len(cells.blocks):
            return False
        for near_x in range(x - 1, x + 2):
            for near_y in range(y - 1, y + 2):
                slot = _slot_of(cells.keys, near_x, near_y)
                if cells.keys[slot] == EMPTY:
                    cells.keys[slot] = (near_x << 31) + near_y
                    cells.squares[slot] = counters.squares
                    counters.squares += 1
    counters.scans += 1
    return True


@borrower
def ways_across(ux: float, uy: float, sine: float) -> int:
    """The directions of beams that cross a direction (ux, uy), as a bit mask."""
    ways = 0
    for way in range(PASS_DIRECTIONS):
        if abs(COSINES[way] * uy - SINES[way] * ux) > sine:
            ways |= 1 << way
    return ways


@borrower
def count_beams(
    cells: Cells, block: int, cell: int, ways: int, x: float, y: float, deeper: float
) -> int:
    """The number of beams of some directions through a cell, that also went deeper [m]."""
    count = 0
    ways = ways & cells.passed[block, cell]
    for way in range(PASS_DIRECTIONS if ways else 0):
        if (ways >> way) & 1:
            passed = cells.passes[block, way, cell] & MOST_PASSES
            if deeper > 0.0:
                column, row = cell_of(x + deeper * COSINES[way], y + deeper * SINES[way])
                # Nothing has passed the cells of block 0.
                behind = cells.passes[block_at(cells, column, row), way, cell_in(column, row)]
                passed = min(passed, behind & MOST_PASSES)
            count += passed
    return count


@borrower
def is_crossed(line: Float, cells: Cells, depth: float, spare: int, sine: float) -> bool:
    """Whether more beams than a number crossed a line (4,) and continued to a depth [m] behind it.

    They cross it at an angle of at least the sine; beams near its ends do not count.
    """
    x1, y1, x2, y2 = line
    length = np.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return False
    ux = (x2 - x1) / length
    uy = (y2 - y1) / length
    end = min(LINE_END, 0.25 * length)
    steps = int((length - 2.0 * end) / CELL) + 1
    step = (length - 2.0 * end) / steps
    ways = ways_across(ux, uy, sine)
    # [cells] A line is checked in this many interleaved passes: most lines that are crossed lie in
    # open space, where the first pass finds it.
    stride = 8
    for first in range(stride):
        for k in range(first, steps, stride):
            x = x1 + (end + (k + 0.5) * step) * ux
            y = y1 + (end + (k + 0.5) * step) * uy
            column, row = cell_of(x, y)
            block = block_at(cells, column, row)
            cell = cell_in(column, row)
            spare -= count_beams(cells, block, cell, ways, x, y, depth - FREE_DEPTH)
            if spare < 0:
                return True
    return False
