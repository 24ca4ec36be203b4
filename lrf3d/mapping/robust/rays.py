"""Rays: the path of each beam of a scan through the cells.

The beams of a scan enter; the cells count those that pass, the clusters gain those that end, and
the walls both as new evidence.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Int
from lrf3d.mapping.robust.beams import CELL, Beams
from lrf3d.mapping.robust.cells import (
    FREE_DEPTH,
    HIT_DEVIATIONS,
    MOST_PASSES,
    PASS_DIRECTIONS,
    SIDE,
    SIDE_BITS,
    SOLID,
    SQUARE_BITS,
    Cells,
    take_block,
)
from lrf3d.mapping.robust.clusters import add_hit, contradict
from lrf3d.mapping.robust.walls import Walls

ROW_BITS = 32
"""A packed cell is its row, shifted by these bits, and its column, counted from −2³¹."""

REACH_BITS, FARTHEST = 52, 1 << 54
"""Distances along a beam are integers in units of 2⁻⁵² of its range; and one that no beam
reaches."""

LEAVES = ~((SIDE - 1) + ((SIDE - 1) << ROW_BITS))
"""Bits of a packed cell that change when a step leaves a block."""


@borrower
def _unpacked(cell: int) -> tuple[int, int]:
    """Column and row of a packed cell."""
    return (cell & ((1 << ROW_BITS) - 1)) - (1 << 31), cell >> ROW_BITS


@inner
def _enter(
    x: float, y: float, dx: float, dy: float, scale: float
) -> tuple[int, int, int, int, int, int, int]:
    """Start the traversal of the cells by a ray from a place (x, y) [m] in a direction (dx, dy).

    Returns its first cell, packed; the steps to the next column and row; the distances between
    columns and between rows; and those to the next column and row. Distances are integers, which
    processors compare and select several times faster than floats.
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
        (row << ROW_BITS) + column + (1 << 31),
        1 if dx > 0.0 else -1, (1 if dy > 0.0 else -1) << ROW_BITS, int(wide), int(high),
        int(across * wide) if wide < far else FARTHEST, int(up * high) if high < far else FARTHEST,
    )  # fmt: skip


@borrower
def _steps_out(to_next: int, step: int, until: int) -> int:
    """The number of edges within a distance: the first at one, the others a step apart."""
    return 0 if to_next > until else (until - to_next) // step + 1


@compiled
def add_beams(
    cells: Cells, begin: int, place: tuple[float, float], beams: Beams, walls: Walls, unowned: Int
) -> int:
    """Add the beams of a scan from a place [m], from one on; returns the first without room.

    The clusters that gained a return but are hits of no wall are listed (n,).
    """
    x, y = place
    units, ranges, deviations = beams
    passes, passed_ways = cells.passes, cells.passed
    counters = cells.counters[0]
    if begin == 0:
        counters.scans += 1
    side = (1 << SQUARE_BITS) - 1
    for beam in range(begin, len(ranges)):
        reading = ranges[beam]
        if reading == 0.0:
            continue
        dx, dy = units[beam, 0], units[beam, 1]
        most = int(abs(reading) * (abs(dx) + abs(dy)) / (CELL * SIDE)) + 4
        if counters.blocks + most > len(cells.heads):
            return beam
        if counters.free_cluster == 0 and counters.clusters == len(cells.clusters):
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
                block = take_block(cells, column, row)
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
            at = (((cell >> ROW_BITS) & (SIDE - 1)) << SIDE_BITS) | (cell & (SIDE - 1))
            count = passes[block, way, at]
            if count & MOST_PASSES == 0:
                passed_ways[block, at] |= bit
            if count & SOLID:
                contradict(cells, block, way, at, dx, dy, walls)
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
            add_hit(cells, place, beams, beam, turn, walls, unowned)
    return len(ranges)
