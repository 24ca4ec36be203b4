"""Crossing: whether beams went across a line, as the cells along it show."""

import numpy as np

from lrf3d.compiling import borrower
from lrf3d.geometry import Float
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import (
    FREE_DEPTH,
    MOST_PASSES,
    PASS_DIRECTIONS,
    Cells,
    block_at,
    cell_in,
)

COSINES = np.cos(2.0 * np.pi * np.arange(PASS_DIRECTIONS) / PASS_DIRECTIONS)
SINES = np.sin(2.0 * np.pi * np.arange(PASS_DIRECTIONS) / PASS_DIRECTIONS)
"""The directions by which the beams through a cell are distinguished."""

WALL_SINE = 0.5
"""[sine] Angle from which on a beam through a cell of a wall crosses it: at less it may run before
the wall as well, in the same cells."""

LINK_SINE = 0.35
"""[sine] The same for a link between two walls, which no beam need run along."""

LINE_END = 1.5 * CELL
"""[m] How much of a line's ends is left out: beams that go by the end of a wall, through the same
cells, go on as far as they like."""

STRIDE = 8
"""Steps from one to the next in each of the walks that together meet all cells of a line: most are
crossed in wide open space, which the first walk finds."""


@borrower
def end_of(line: Float, end: int) -> tuple[float, float]:
    """The first (0) or the second (1) end of a line (4,)."""
    return line[2 * end], line[2 * end + 1]


@borrower
def vector_of(line: Float) -> tuple[float, float]:
    """From where a line (4,) begins to where it ends."""
    return line[2] - line[0], line[3] - line[1]


@borrower
def length_of(line: Float) -> float:
    """The length [m] of a line (4,)."""
    dx, dy = vector_of(line)
    length: float = np.hypot(dx, dy)
    return length


@borrower
def unit_of(line: Float) -> tuple[float, float, float]:
    """The direction and the length [m] of a line (4,)."""
    dx, dy = vector_of(line)
    length = np.hypot(dx, dy)
    return dx / length, dy / length, length


@borrower
def along_of(line: Float, x: float, y: float, u: float, v: float) -> tuple[float, float]:
    """How far the ends of a line (4,) lie from a place along a vector (u, v), in its lengths."""
    return (line[0] - x) * u + (line[1] - y) * v, (line[2] - x) * u + (line[3] - y) * v


@borrower
def put_line(line: Float, x1: float, y1: float, x2: float, y2: float) -> None:
    """Fill in a line (4,)."""
    line[0], line[1], line[2], line[3] = x1, y1, x2, y2


@borrower
def ways_across(ux: float, uy: float, sine: float) -> int:
    """The directions of the beams that cross a direction (ux, uy), each a bit."""
    ways = 0
    for way in range(PASS_DIRECTIONS):
        if abs(COSINES[way] * uy - SINES[way] * ux) > sine:
            ways |= 1 << way
    return ways


@borrower
def _passes(cells: Cells, x: float, y: float, way: int) -> int:
    """How many beams went one way through the cell of a place [m]."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    # Nothing has passed the cells of block 0.
    passed: int = cells.passes[block_at(cells, column, row), way, cell_in(column, row)]
    return passed & MOST_PASSES


@borrower
def count_beams(
    cells: Cells, block: int, cell: int, ways: int, x: float, y: float, deeper: float
) -> int:
    """How many beams went in some directions through a cell at a place, and so much deeper [m]."""
    count, ways = 0, ways & cells.passed[block, cell]
    for way in range(PASS_DIRECTIONS if ways else 0):
        if (ways >> way) & 1:
            passed = cells.passes[block, way, cell] & MOST_PASSES
            if deeper > 0.0:
                dx, dy = COSINES[way], SINES[way]
                passed = min(passed, _passes(cells, x + deeper * dx, y + deeper * dy, way))
            count += passed
    return count


@borrower
def is_crossed(line: Float, cells: Cells, depth: float, spare: int, sine: float) -> bool:
    """Whether more beams than are to spare crossed a line (4,) and went so deep [m] behind it.

    They cross it at the angle of the sine, or more; what is near its ends does not count.
    """
    x1, y1, x2, y2 = line
    length = np.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return False
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    end = min(LINE_END, 0.25 * length)
    steps = int((length - 2.0 * end) / CELL) + 1
    step = (length - 2.0 * end) / steps
    ways = ways_across(ux, uy, sine)
    for first in range(STRIDE):
        for k in range(first, steps, STRIDE):
            x, y = x1 + (end + (k + 0.5) * step) * ux, y1 + (end + (k + 0.5) * step) * uy
            column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
            block, cell = block_at(cells, column, row), cell_in(column, row)
            spare -= count_beams(cells, block, cell, ways, x, y, depth - FREE_DEPTH)
            if spare < 0:
                return True
    return False
