"""Crossing: how many beams went which way through the cells along a line, compiled.

Enter a line and the cells of all beams; leaves whether any of them has crossed it.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import inner
from lrf3d.geometry import Float
from lrf3d.mapping.robust.blocks import SIDE, SIDE_BITS, block_at
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import (
    CELL,
    FREE_DEPTH,
    LINK_END,
    MOST_PASSES,
    PASS_DIRECTIONS,
)

COSINES = np.cos(2.0 * np.pi * np.arange(PASS_DIRECTIONS) / PASS_DIRECTIONS)
SINES = np.sin(2.0 * np.pi * np.arange(PASS_DIRECTIONS) / PASS_DIRECTIONS)
"""The directions by which the beams through a cell are told apart."""

PER_METRE = 1.0 / CELL
"""Cells in a metre: processors multiply several times faster than they divide."""

FLANK = 1.5 * CELL
"""[m] How far beside a line its sides begin: no cell there reaches the line."""

ALL_WAYS = (1 << PASS_DIRECTIONS) - 1
"""All directions of beams, each a bit."""

STRIDE = 8
"""Steps from one to the next where a line is first searched for beams that cross it."""


@inner
def ways_across(ux: float, uy: float, sine: float) -> int:
    """The directions of the beams that cross a direction (ux, uy), each a bit."""
    ways = 0
    for way in range(PASS_DIRECTIONS):
        if abs(COSINES[way] * uy - SINES[way] * ux) > sine:
            ways |= 1 << way
    return ways


@inner
def _passes(cells: Cells, x: float, y: float, way: int) -> int:
    """How many beams went one way through the cell of a place [m]."""
    column, row = int(np.floor(x * PER_METRE)), int(np.floor(y * PER_METRE))
    block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
    if block < 0:
        return 0
    place = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    passed: int = cells.passes[cells.planes[block, way], place] & MOST_PASSES
    return passed


class Walk(NamedTuple):
    """How a line is walked along, in steps of a cell.

    Args:
        x: Where the line begins [m].
        y: Where it begins [m].
        ux: Its direction.
        uy: Its direction.
        begin: Where on it the first step is [m].
        stride: How far it is from step to step [m].
        steps: How many there are.
    """

    x: float
    y: float
    ux: float
    uy: float
    begin: float
    stride: float
    steps: int


@inner
def _along(line: Float) -> Walk:
    """The walk along a line (4,) that has a length, without its ends, near which walls are."""
    x1, y1, x2, y2 = line
    length = np.hypot(x2 - x1, y2 - y1)
    end = min(LINK_END, 0.25 * length)
    middle = length - 2.0 * end
    steps = int(middle / CELL) + 1
    stride = middle / steps
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    return Walk(x1, y1, ux, uy, end + 0.5 * stride, stride, steps)


@inner
def _place(walk: Walk, step: int, aside: float) -> tuple[float, float]:
    """Where a step is [m], so far [m] to the left of the line."""
    along = walk.begin + step * walk.stride
    x, y = walk.x + along * walk.ux, walk.y + along * walk.uy
    return x - aside * walk.uy, y + aside * walk.ux


@inner
def _last_within(walk: Walk, step: int, aside: float, at_x: int, at_y: int) -> int:
    """A late step of a walk that is in the block of an earlier one.

    Args:
        walk: The walk.
        step: The earlier step.
        aside: How far to the left of the line it is [m].
        at_x: The column of its block.
        at_y: The row of its block.
    """
    side, ux, uy = SIDE * CELL, walk.ux, walk.uy
    x, y = walk.x - aside * uy, walk.y + aside * ux
    wide = ((at_x + (ux > 0.0)) * side - x) / ux if ux != 0.0 else np.inf
    high = ((at_y + (uy > 0.0)) * side - y) / uy if uy != 0.0 else np.inf
    late = min(int((min(wide, high) - walk.begin) / walk.stride), walk.steps - 1)
    if late <= step:
        return step
    # Places rise from step to step: what is between two steps in a block is in it, too.
    x, y = _place(walk, late, aside)
    column, row = int(np.floor(x * PER_METRE)), int(np.floor(y * PER_METRE))
    return late if column >> SIDE_BITS == at_x and row >> SIDE_BITS == at_y else step


@inner
def is_crossed(line: Float, cells: Cells, depth: float, spare: int, sine: float) -> bool:
    """Whether more beams than are to spare have crossed a line (4,) by more than a depth [m].

    The sine is that of the angle from which on a beam may cross it.
    """
    walk = _along(line)
    ways = ways_across(walk.ux, walk.uy, sine)
    deeper, at_x, at_y, block = depth - FREE_DEPTH, 1 << 40, 0, -1
    # Most lines are crossed in wide open space, which a few steps far from each other find first.
    for turn in range(2):
        step = 0 if turn else STRIDE // 2
        while step < walk.steps:
            x, y = _place(walk, step, 0.0)
            column, row = int(np.floor(x * PER_METRE)), int(np.floor(y * PER_METRE))
            if column >> SIDE_BITS != at_x or row >> SIDE_BITS != at_y:
                at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
                block = block_at(cells.open, at_x, at_y)
                if turn and block < 0:
                    step = _last_within(walk, step, 0.0, at_x, at_y)
            if block >= 0 and (not turn or step % STRIDE != STRIDE // 2):
                cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
                passed = ways & cells.passed[block, cell]
                if passed:
                    spare -= count_beams(cells, block, cell, passed, x, y, deeper)
                    if spare < 0:
                        return True
            step += 1 if turn else STRIDE
    return False


@inner
def count_beams(
    cells: Cells, block: int, cell: int, ways: int, x: float, y: float, deeper: float
) -> int:
    """How many beams went through a cell at a place (x, y) [m], and so much deeper [m] than it.

    Only directions count, each a bit, in which some went.
    """
    count = 0
    for way in range(PASS_DIRECTIONS):
        if (ways >> way) & 1:
            passed = cells.passes[cells.planes[block, way], cell] & MOST_PASSES
            if deeper > 0.0:
                dx, dy = COSINES[way], SINES[way]
                passed = min(passed, _passes(cells, x + deeper * dx, y + deeper * dy, way))
            count += passed
    return count


@inner
def _ways_along(walk: Walk, aside: float, ways: int, enough: int, cells: Cells, spare: int) -> int:
    """Those of some directions that more beams than are to spare went, somewhere beside a line.

    Args:
        walk: How the line is walked along.
        aside: How far to the left of it the beams went [m].
        ways: The directions, each a bit.
        enough: Those of which one is enough: further ones may then be missed.
        cells: The cells.
        spare: How many beams do not count.
    """
    at_x, at_y, block, found = 1 << 40, 0, -1, 0
    for turn in range(2):
        step = 0 if turn else STRIDE // 2
        while step < walk.steps and found != ways and found & enough == 0:
            x, y = _place(walk, step, aside)
            column, row = int(np.floor(x * PER_METRE)), int(np.floor(y * PER_METRE))
            if column >> SIDE_BITS != at_x or row >> SIDE_BITS != at_y:
                at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
                block = block_at(cells.open, at_x, at_y)
                if turn and block < 0:
                    step = _last_within(walk, step, aside, at_x, at_y)
            if block >= 0:
                cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
                passed = ways & cells.passed[block, cell] & ~found
                for way in range(PASS_DIRECTIONS if passed else 0):
                    if (passed >> way) & 1:
                        if cells.passes[cells.planes[block, way], cell] & MOST_PASSES > spare:
                            found |= 1 << way
            step += 1 if turn else STRIDE
    return found


@inner
def is_crossed_aslant(line: Float, cells: Cells, spare: int, sine: float) -> bool:
    """Whether more beams than are to spare have crossed a line (4,) at a small angle.

    Args:
        line: The line [m].
        cells: The cells.
        spare: How many beams may cross it.
        sine: That of the angle up to which they cross it.
    """
    walk = _along(line)
    ways = ALL_WAYS & ~ways_across(walk.ux, walk.uy, sine)
    return _changes_sides(walk, _ways_along(walk, 0.0, ways, 0, cells, spare), cells, spare)


@inner
def is_crossed_at_all(line: Float, cells: Cells, sine: float) -> bool:
    """Whether any beam has crossed a line (4,), at whatever angle.

    It is `is_crossed` or `is_crossed_aslant`, with nothing to spare, at once.
    """
    walk = _along(line)
    across = ways_across(walk.ux, walk.uy, sine)
    ways = _ways_along(walk, 0.0, ALL_WAYS, across, cells, 0)
    return ways & across != 0 or _changes_sides(walk, ways, cells, 0)


@inner
def _changes_sides(walk: Walk, ways: int, cells: Cells, spare: int) -> bool:
    """Whether more beams than are to spare that run along a line also cross it.

    Beams that run along the line go through its cells, too. One that crosses it is on its one side
    before it is on the line, and then on its other side.

    Args:
        walk: How the line is walked along.
        ways: The directions of the beams, each a bit.
        cells: The cells.
        spare: How many beams may cross it.
    """
    # Few lines have such beams at all, and most of those have them on one side only.
    for aside in (FLANK, -FLANK):
        if ways:
            ways = _ways_along(walk, aside, ways, 0, cells, spare)
    for way in range(PASS_DIRECTIONS):
        if not (ways >> way) & 1:
            continue
        # The most beams so far: on either side, and of each of them on the line after that.
        left = right = from_left = from_right = 0
        for step in range(walk.steps):
            middle = 0
            for aside in (0.0, 0.5 * FLANK, -0.5 * FLANK):
                x, y = _place(walk, step, aside)
                middle = max(middle, _passes(cells, x, y, way))
            x, y = _place(walk, step, FLANK)
            one = _passes(cells, x, y, way)
            x, y = _place(walk, step, -FLANK)
            other = _passes(cells, x, y, way)
            if min(from_right, one) > spare or min(from_left, other) > spare:
                return True
            if middle == 0 and one == 0 and other == 0:
                left = right = from_left = from_right = 0
                continue
            left, right = max(left, one), max(right, other)
            from_left = max(from_left, min(left, middle))
            from_right = max(from_right, min(right, middle))
    return False
