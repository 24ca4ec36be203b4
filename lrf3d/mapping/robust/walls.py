"""Walls: the table of a growing map's walls, which finds those near a place.

A row holds a wall: its ends, the moments of the points that it is fitted to, the new evidence of
beams, and its links to other walls. Free rows are used again. Lines are x1 y1 x2 y2 [m].
"""

from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, inner, record
from lrf3d.geometry.lines import Bool, Float, Int, Records

# [walls] Rows that share a bounding box. It changes speed only.
BLOCK = 64

# [links] Largest number of links of a wall, to the nearest others.
MOST_LINKS = 24

# What a segment is fitted to.
FIT = record(
    weight=float,  # [1/m²] sum of the inverse variances of the points
    x=float, y=float,  # [m] their mean
    xx=float, xy=float, yy=float,  # their weighted scatter about it
    points=int,  # their number; 0 where the row is free
    evidence=float,  # [hits] hits and weighed violations
    shown=bool,  # whether the beams showed enough of it: the map is these
)  # fmt: skip

# What has happened to a wall since it was fitted.
WALL_STATE = record(
    fresh=float,  # [beams] that hit it, or went through its hits, since it was refit
    last_scan=int,  # the last scan that added to this evidence
    version=np.int32,  # how often it was refit, from 1; see CLUSTER
    linked=np.int32,  # how often its links were made, which voids the links of others to it
    links=int,  # number of its links
)  # fmt: skip

# A link of a wall to another.
LINK = record(
    wall=np.int32,  # the wall at the other end
    linked=np.int32,  # the `linked` of that wall then: the link is void if it has changed since
)  # fmt: skip

WALL_COUNTERS = record(
    taken=int,  # rows that were ever taken
    free=int,  # how many of these were given back
    refit=int,  # the wall whose turn it is to be refit
    asked=int,  # the wall whose links were tested last
    scan=int,  # the number of the scan
    changed=int,  # how many walls the beams of this scan have hit or gone through
    unowned=int,  # how many beams of this scan hit what no wall owns
)  # fmt: skip


class Walls(NamedTuple):
    """The walls of a map, a row each, with free rows for more.

    Args:
        ends: (rows, 4) x1 y1 x2 y2 [m]; the laser saw the wall from its left.
        fits: (rows,) of :data:`FIT`.
        rows: (rows,) of :data:`WALL_STATE`.
        placed: (rows, 4) where it was when it was linked with others [m]; ∞ without links.
        links: (rows, MOST_LINKS) of :data:`LINK`.
        free: (rows,) rows that were given back, the last of them first to be taken again.
        changed: (rows,) the rows whose evidence the last scan has changed.
        found: (rows,) the rows that the last search found.
        boxes: (rows / BLOCK, 4) what each block of rows lies in: left, bottom, right, top [m].
        counters: (1,) of :data:`WALL_COUNTERS`.
    """

    ends: Float
    fits: Records
    rows: Records
    placed: Float
    links: Records
    free: Int
    changed: Int
    found: Int
    boxes: Float
    counters: Records

    @classmethod
    def of_size(cls, rows: int) -> "Walls":
        """Free rows, a multiple of a block of them."""
        walls = np.zeros(rows, WALL_STATE)
        boxes = np.full((rows // BLOCK, 4), np.inf)
        walls["version"] = 1
        boxes[:, 2:] = -np.inf
        return cls(
            np.zeros((rows, 4)), np.zeros(rows, FIT), walls, np.full((rows, 4), np.inf),
            np.zeros((rows, MOST_LINKS), LINK), np.zeros(rows, np.int64), np.zeros(rows, np.int64),
            np.zeros(rows, np.int64), boxes, np.zeros(1, WALL_COUNTERS),
        )  # fmt: skip

    def with_room(self, count: int) -> "Walls":
        """The walls with room for a number of new ones."""
        rows = len(self.rows)
        while self.counters["taken"][0] - self.counters["free"][0] + count > rows:
            rows *= 2
        if rows == len(self.rows):
            return self
        grown = Walls.of_size(rows)
        for own, column in zip(self, grown, strict=True):
            column[: len(own)] = own
        return grown


@borrower
def count_evidence(walls: Walls, row: int, weight: float) -> None:
    """Add a beam of a weight [hits] to the new evidence of a wall."""
    wall = walls.rows[row]
    counters = walls.counters[0]
    wall.fresh += weight
    if wall.last_scan != counters.scan:
        wall.last_scan = counters.scan
        walls.changed[counters.changed] = row
        counters.changed += 1


@inner
def marked_rows(walls: Walls, marks: Bool) -> Int:
    """The rows, rising, of the walls with a mark (≥ taken,)."""
    taken = walls.counters[0].taken
    rows = np.empty(taken, np.int64)
    count = 0
    for row in range(taken):
        if marks[row] and walls.fits[row].points > 0:
            rows[count] = row
            count += 1
    return rows[:count]


@borrower
def take_row(walls: Walls) -> int:
    """A free row; there is room for it."""
    counters = walls.counters[0]
    if counters.free:
        counters.free -= 1
        row: int = walls.free[counters.free]
    else:
        row = counters.taken
        counters.taken += 1
    return row


@borrower
def give_back(walls: Walls, row: int) -> None:
    """Make a row free."""
    counters = walls.counters[0]
    walls.fits[row].points = 0
    walls.fits[row].shown = False
    walls.rows[row].version += 1
    walls.placed[row] = np.inf
    walls.free[counters.free] = row
    counters.free += 1


@borrower
def widen_box(walls: Walls, row: int) -> None:
    """Extend the box of a row's block to the ends of its wall, so that searches find it."""
    box = walls.boxes[row // BLOCK]
    x1, y1, x2, y2 = walls.ends[row]
    put_line(
        box, min(box[0], x1, x2), min(box[1], y1, y2), max(box[2], x1, x2), max(box[3], y1, y2)
    )


@borrower
def near(walls: Walls, line: Float, reach: float) -> int:
    """Fill in `found` with the walls whose boxes are within a reach [m] of that of a line.

    Returns their number.
    """
    x1, y1, x2, y2 = line
    left = min(x1, x2) - reach
    right = max(x1, x2) + reach
    low = min(y1, y2) - reach
    high = max(y1, y2) + reach
    count = 0
    taken = walls.counters[0].taken
    for first in range(0, taken, BLOCK):
        x1, y1, x2, y2 = walls.boxes[first // BLOCK]
        if x1 > right or x2 < left or y1 > high or y2 < low:
            continue
        for row in range(first, min(first + BLOCK, taken)):
            x1, y1, x2, y2 = walls.ends[row]
            if min(x1, x2) > right or max(x1, x2) < left:
                continue
            if min(y1, y2) <= high and max(y1, y2) >= low and walls.fits[row].points > 0:
                walls.found[count] = row
                count += 1
    return count


@inner
def put_row(rows: Float, row: int, values: Float) -> None:
    """Copy values (k,) into a row of rows (n, k).

    An assignment takes a second to compile, because it also checks shapes and writes messages.
    """
    for k in range(len(values)):
        rows[row, k] = values[k]


@borrower
def end_of(line: Float, end: int) -> tuple[float, float]:
    """The first (0) or the second (1) end of a line (4,)."""
    return line[2 * end], line[2 * end + 1]


@borrower
def vector_of(line: Float) -> tuple[float, float]:
    """The vector from the first to the second end of a line (4,)."""
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
    """Positions of the ends of a line (4,) from a place along a vector (u, v), in its lengths."""
    return (line[0] - x) * u + (line[1] - y) * v, (line[2] - x) * u + (line[3] - y) * v


@borrower
def put_line(line: Float, x1: float, y1: float, x2: float, y2: float) -> None:
    """Fill in a line (4,)."""
    line[0] = x1
    line[1] = y1
    line[2] = x2
    line[3] = y2


@borrower
def add_point(moments: Any, weight: float, x: float, y: float) -> None:
    """Add a point to a weight, a mean and the scatter about it, exact at any offset."""
    moments.weight += weight
    share = weight / moments.weight
    dx = x - moments.x
    dy = y - moments.y
    moments.x += share * dx
    moments.y += share * dy
    spread = weight * (1.0 - share)
    moments.xx += spread * dx * dx
    moments.xy += spread * dx * dy
    moments.yy += spread * dy * dy
