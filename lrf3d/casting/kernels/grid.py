"""A grid over obstacles, compiled: which of them have their origin in a box.

Places of obstacles enter; rows of those near a scan or a robot leave.
"""

from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, record
from lrf3d.geometry.lines import Int, Records

# A grid over obstacles: its corner [m], the size of its cells [m], how many are in a row and in a
# column, and the largest reach of an obstacle [m].
LATTICE = record(x=float, y=float, wide=float, deep=float, cells=int, reach=float)


class MoverGrid(NamedTuple):
    """Obstacles by the cells of a grid over their origins."""

    frames: Records  # (1,) of the kind LATTICE.
    firsts: Int  # (cells² + 1,) where those of each cell begin in the order.
    order: Int
    places: Records  # (n,) of the kind PLACED, in the order.


@borrower
def cell_at(frame: Any, x: float, y: float) -> tuple[int, int]:
    """The column and the row of the cell nearest to a point."""
    last = frame.cells - 1.0
    column = min(max((x - frame.x) / frame.wide, 0.0), last)
    row = min(max((y - frame.y) / frame.deep, 0.0), last)
    return int(column), int(row)


@borrower
def fill(grid: MoverGrid, placed: Records) -> None:
    """Fill the grid over the origins of obstacles (n,)."""
    frame = grid.frames[0]
    firsts = grid.firsts
    low_x = low_y = np.inf
    high_x = high_y = reach = -np.inf
    for j in range(len(placed)):
        at = placed[j]
        low_x = min(low_x, at.x)
        low_y = min(low_y, at.y)
        high_x = max(high_x, at.x)
        high_y = max(high_y, at.y)
        reach = max(reach, at.reach)
    frame.x = low_x
    frame.y = low_y
    # Obstacles in one place have an area, too.
    frame.wide = max((high_x - low_x) / frame.cells, 1.0)
    frame.deep = max((high_y - low_y) / frame.cells, 1.0)
    frame.reach = reach
    for cell in range(len(firsts)):
        firsts[cell] = 0
    for j in range(len(placed)):
        column, row = cell_at(frame, placed[j].x, placed[j].y)
        firsts[row * frame.cells + column] += 1
    total = 0
    for cell in range(len(firsts)):
        total += firsts[cell]
        firsts[cell] = total
    # Each cell is filled from its end on, until its first is where it begins.
    for j in range(len(placed) - 1, -1, -1):
        column, row = cell_at(frame, placed[j].x, placed[j].y)
        firsts[row * frame.cells + column] -= 1
        member = firsts[row * frame.cells + column]
        grid.order[member] = j
        grid.places[member] = placed[j]


@borrower
def cells_of(grid: MoverGrid, box: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """The cells in a box [m]: the first and the last column, and the first and the last row."""
    low_x, low_y, high_x, high_y = box
    frame = grid.frames[0]
    first_column, first_row = cell_at(frame, low_x, low_y)
    last_column, last_row = cell_at(frame, high_x, high_y)
    return first_column, last_column, first_row, last_row


@borrower
def members(grid: MoverGrid, row: int, first: int, last: int) -> tuple[int, int]:
    """Where in the order obstacles in a row of cells are, in columns from the first to the last."""
    cell = row * grid.frames[0].cells
    return grid.firsts[cell + first], grid.firsts[cell + last + 1]


@borrower
def rows_in(grid: MoverGrid, box: tuple[float, float, float, float], found: Int) -> int:
    """Fill the ascending rows of obstacles with their origin in a box [m]; returns their count."""
    low_x, low_y, high_x, high_y = box
    first, last, first_row, last_row = cells_of(grid, box)
    count = 0
    for row in range(first_row, last_row + 1):
        start, stop = members(grid, row, first, last)
        for member in range(start, stop):
            at = grid.places[member]
            if low_x <= at.x <= high_x and low_y <= at.y <= high_y:
                place = count
                while place > 0 and found[place - 1] > grid.order[member]:
                    found[place] = found[place - 1]
                    place -= 1
                found[place] = grid.order[member]
                count += 1
    return count
