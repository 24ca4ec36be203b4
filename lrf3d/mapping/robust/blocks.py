"""Blocks: squares of cells on the ground that are there only where beams went, found by hashing."""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Int
from lrf3d.mapping.grid import EMPTY
from lrf3d.mapping.robust.constants import CELL

SIDE_BITS = 4
SIDE = 1 << SIDE_BITS
"""Cells along the side of a block."""

GROUP_BITS = 2
"""Neighbours whose slots lie together in the hash table: the blocks of a square of four a side."""

ROW_BITS, FIRST_COLUMN = 32, 1 << 31
"""A packed cell is its row, and its column counted from the first below the row's bits."""

FARTHEST = float(1 << 60)
"""A distance along a ray that none gets to."""


class Blocks(NamedTuple):
    """Which blocks of cells there are: a hash table.

    Args:
        keys: (slots,) the block that has each slot; slots is a power of two.
        numbers: (slots,) its number.
        used: (1,) how many blocks there are.
    """

    keys: Int
    numbers: Int
    used: Int

    @classmethod
    def of_size(cls, blocks: int) -> "Blocks":
        """No blocks, with room for some (a power of two, at least eight)."""
        return cls(
            np.full(2 * blocks, EMPTY), np.zeros(2 * blocks, np.int64), np.zeros(1, np.int64)
        )


@inner
def _slot_of(keys: Int, x: int, y: int) -> int:
    """The slot of a block in the hash table, or the free one that it would take.

    Beams go from block to block: those that are near each other share lines of the cache.
    """
    key, mask = (x << 31) + y, len(keys) - 1
    mixed = (x >> GROUP_BITS) * 0x9E3779B97F4A7C1 ^ (y >> GROUP_BITS) * 0x2545F4914F6CDD1D
    group = (1 << GROUP_BITS) - 1
    slot = ((mixed ^ (mixed >> 29)) << (2 * GROUP_BITS)) & mask
    slot += ((y & group) << GROUP_BITS) + (x & group)
    # An odd step comes to all slots: one like place in each group might be taken in all of them.
    while keys[slot] != key and keys[slot] != EMPTY:
        slot = (slot + (1 << (2 * GROUP_BITS)) + 1) & mask
    return slot


@inner
def block_at(blocks: Blocks, x: int, y: int) -> int:
    """The number of a block; −1 where there is none."""
    slot = _slot_of(blocks.keys, x, y)
    return -1 if blocks.keys[slot] == EMPTY else blocks.numbers[slot]


@inner
def take_block(blocks: Blocks, x: int, y: int) -> int:
    """The number of a block, which is made where there is none; there is room for it."""
    slot = _slot_of(blocks.keys, x, y)
    if blocks.keys[slot] == EMPTY:
        blocks.keys[slot], blocks.numbers[slot] = (x << 31) + y, blocks.used[0]
        blocks.used[0] += 1
    number: int = blocks.numbers[slot]
    return number


@inner
def packed(column: int, row: int) -> int:
    """A column and a row of cells in one number, in which either may change alone."""
    return (row << ROW_BITS) + column + FIRST_COLUMN


@inner
def unpacked(cell: int, bits: int) -> tuple[int, int]:
    """Column and row of a packed cell, or of the square of 1 << bits cells a side that it is in."""
    return ((cell & ((1 << ROW_BITS) - 1)) - FIRST_COLUMN) >> bits, cell >> (ROW_BITS + bits)


@inner
def enter_cells(
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
    wide = scale / abs(dx) if dx != 0.0 else FARTHEST
    high = scale / abs(dy) if dy != 0.0 else FARTHEST
    return (
        packed(column, row), 1 if dx > 0.0 else -1, (1 if dy > 0.0 else -1) << ROW_BITS,
        int(min(wide, FARTHEST)), int(min(high, FARTHEST)),
        int(min(across * wide, FARTHEST)), int(min(up * high, FARTHEST)),
    )  # fmt: skip


def rehashed(blocks: Blocks) -> Blocks:
    """The same blocks with room for twice as many."""
    grown = Blocks.of_size(len(blocks.keys))
    move_blocks(blocks, grown)
    return grown


@compiled
def move_blocks(blocks: Blocks, grown: Blocks) -> None:
    """Put blocks into a larger hash table."""
    for old in range(len(blocks.keys)):
        key = blocks.keys[old]
        if key == EMPTY:
            continue
        y = ((key + (1 << 30)) & ((1 << 31) - 1)) - (1 << 30)
        slot = _slot_of(grown.keys, (key - y) >> 31, y)
        grown.keys[slot], grown.numbers[slot] = key, blocks.numbers[old]
    grown.used[0] = blocks.used[0]
