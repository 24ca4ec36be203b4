"""Blocks: squares of cells on the ground that are there only where beams went, found by hashing."""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import EMPTY, slot_of
from lrf3d.mapping.robust.constants import CELL

SIDE_BITS = 4
SIDE = 1 << SIDE_BITS
"""Cells along the side of a block."""


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
        """No blocks, with room for some (a power of two)."""
        return cls(
            np.full(2 * blocks, EMPTY), np.zeros(2 * blocks, np.int64), np.zeros(1, np.int64)
        )


@inner
def block_at(blocks: Blocks, x: int, y: int) -> int:  # pragma: no cover
    """The number of a block; −1 where there is none."""
    slot = slot_of(blocks.keys, x, y)
    return -1 if blocks.keys[slot] == EMPTY else blocks.numbers[slot]


@inner
def take_block(blocks: Blocks, x: int, y: int) -> bool:  # pragma: no cover
    """Make sure that there is a block; False where there is no room."""
    slot = slot_of(blocks.keys, x, y)
    if blocks.keys[slot] == EMPTY:
        if 2 * blocks.used[0] == len(blocks.keys):
            return False
        blocks.keys[slot], blocks.numbers[slot] = (x << 31) + y, blocks.used[0]
        blocks.used[0] += 1
    return True


@inner
def enter_cells(
    x: float, y: float, dx: float, dy: float, size: float
) -> tuple[int, int, int, int, float, float, float, float]:  # pragma: no cover
    """Where a ray from a place (x, y) [m] in a direction (dx, dy) begins its way through cells.

    Returns:
        The column and the row of its first cell; by how much it changes either (1 or −1); how far
        it is, in cells of a size [m], from column to column and from row to row; and how far to
        the next column and to the next row.
    """
    px, py = x / size, y / size
    column, row = int(np.floor(px)), int(np.floor(py))
    right, ahead = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    wide = np.inf if dx == 0.0 else 1.0 / abs(dx)
    high = np.inf if dy == 0.0 else 1.0 / abs(dy)
    across = np.inf if dx == 0.0 else ((column + 1.0 - px) if dx > 0.0 else (px - column)) * wide
    up = np.inf if dy == 0.0 else ((row + 1.0 - py) if dy > 0.0 else (py - row)) * high
    return column, row, right, ahead, wide, high, across, up


@compiled
def take_open(
    blocks: Blocks, x: float, y: float, units: Float, ranges: Float
) -> bool:  # pragma: no cover
    """Make sure of all blocks that the beams go through; False where there is no room."""
    size = CELL * SIDE
    for beam in range(len(ranges)):
        reach = abs(ranges[beam]) / size
        dx, dy = units[beam, 0], units[beam, 1]
        column, row, right, ahead, wide, high, across, up = enter_cells(x, y, dx, dy, size)
        while True:
            if not take_block(blocks, column, row):
                return False
            if min(across, up) > reach:
                break
            if across < up:
                column += right
                across += wide
            else:
                row += ahead
                up += high
    return True


@compiled
def take_solid(
    blocks: Blocks, x: float, y: float, units: Float, ranges: Float
) -> bool:  # pragma: no cover
    """Make sure of all blocks that the beams end in; False where there is no room."""
    for beam in range(len(ranges)):
        if ranges[beam] > 0.0:
            column = int(np.floor((x + ranges[beam] * units[beam, 0]) / CELL)) >> SIDE_BITS
            row = int(np.floor((y + ranges[beam] * units[beam, 1]) / CELL)) >> SIDE_BITS
            if not take_block(blocks, column, row):
                return False
    return True


def rehashed(blocks: Blocks) -> Blocks:
    """The same blocks with room for twice as many."""
    grown = Blocks.of_size(len(blocks.keys))
    move_blocks(blocks, grown)
    return grown


@compiled
def move_blocks(blocks: Blocks, grown: Blocks) -> None:  # pragma: no cover
    """Put blocks into a larger hash table."""
    for old in range(len(blocks.keys)):
        key = blocks.keys[old]
        if key == EMPTY:
            continue
        y = ((key + (1 << 30)) & ((1 << 31) - 1)) - (1 << 30)
        slot = slot_of(grown.keys, (key - y) >> 31, y)
        grown.keys[slot], grown.numbers[slot] = key, blocks.numbers[old]
    grown.used[0] = blocks.used[0]
