"""Walls of a growing map: the one pool that they are kept in, and how two of them become one.

Two segments stand for one wall where the shorter one's ends lie on the longer one's line within
what noise explains and a wall may bend, where they overlap or nearly so, and where the laser
stood on the same side of both. The merged wall is the exact fit to all points of both. A gap is
bridged only where no beam crossed it. Each merge takes one wall away, so the loop ends.

The walls of a scan enter. Those that known walls cover add nothing that the cells do not know;
the others are merged with what they fit, and are to be refit.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Float, Int, Records
from lrf3d.mapping.grid import Grid, insert, near, remove
from lrf3d.mapping.robust.cells import FREE_DEPTH, Cells
from lrf3d.mapping.robust.crossing import (
    WALL_SINE,
    along_of,
    end_of,
    is_crossed,
    put_line,
    unit_of,
    vector_of,
)
from lrf3d.mapping.robust.records import MOMENTS, WALL, WALL_COUNTERS

SAME_DIRECTION = 0.5
"""[cosine] Largest angle between two segments that may be one wall. Far more than noise explains;
the offsets of the ends decide."""

MERGE_DEVIATIONS = 3.0
"""[deviations] How many standard deviations of its place a segment may lie beside a wall."""

BEND = 0.4
"""[share of merge_distance] How far a wall may bend where it is continued: two views of a wall
differ by the error of the poses, but next to each other they share it. More bridges slight
bends of a wall into one."""

MOST_EXPLAINED = 1.0
"""[m] Largest offset that noise may explain when walls are merged: a short far segment explains
almost any."""

LONGEST_GAP = 3.0
"""[m] Longest gap of a wall that is bridged where no beam crossed it: behind a longer one there may
as well be a recess that beams could not look into."""

GROWN = 0.1
"""[m] How much of a scan's wall may be new and the wall still be one that is known."""

SPARE_BEAMS = 20
"""[beams] How many may cross a gap no longer than merge_length: as many as a refit needs to cut a
wall there. So what is merged and what is cut agree."""

UNLINKED = np.inf
"""Where a wall is placed that is not shown, and so is linked with no other."""


class Walls(NamedTuple):
    """The walls of a map, a row each; arrays have room for more.

    Args:
        ends: (rows, 4) x1 y1 x2 y2 [m]; the laser saw the wall from its left.
        moments: (rows,) of :data:`MOMENTS`.
        rows: (rows,) of :data:`WALL`.
        placed: (rows, 4) where it was when it was linked with others [m].
        free: (rows,) rows that were given back, the last of them first to be taken again.
        counters: (1,) of :data:`WALL_COUNTERS`.
    """

    ends: Float
    moments: Records
    rows: Records
    placed: Float
    free: Int
    counters: Records

    @classmethod
    def of_size(cls, rows: int) -> "Walls":
        """Free rows."""
        walls = np.zeros(rows, WALL)
        walls["version"] = 1
        return cls(
            np.zeros((rows, 4)), np.zeros(rows, MOMENTS), walls, np.full((rows, 4), UNLINKED),
            np.zeros(rows, np.int64), np.zeros(1, WALL_COUNTERS),
        )  # fmt: skip

    def with_room(self, count: int) -> "Walls":
        """The walls with room for a number of new ones."""
        rows = len(self.rows)
        while self.counters[0].taken - self.counters[0].free + count > rows:
            rows *= 2
        if rows == len(self.rows):
            return self
        grown = Walls.of_size(rows)
        copy_columns(self, grown)
        return grown


def copy_columns(table: Iterable[Any], grown: Iterable[Any]) -> None:
    """Copy the columns of a table into those of a larger one."""
    for own, column in zip(table, grown, strict=True):
        column[: len(own)] = own


@inner
def put_row(rows: Float, row: int, values: Float) -> None:
    """Copy values (k,) into a row of rows (n, k).

    An assignment takes a second to compile, because it also checks shapes and writes messages.
    """
    for k in range(len(values)):
        rows[row, k] = values[k]


class Rule(NamedTuple):
    """What one wall is.

    The largest gap [m] along the line between two segments of it; how far two views of it may lie
    apart, and how far it may bend where it is continued, beside what noise explains; and the
    largest offset that noise may explain.
    """

    length: float
    distance: float
    bend: float
    most_explained: float

    @classmethod
    def of(cls, length: float, distance: float) -> "Rule":
        """The rule of a mapper's settings [m]."""
        return cls(length, distance, BEND * distance, MOST_EXPLAINED)


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
    """Make a row free; the grid holds it no more."""
    wall, counters = walls.rows[row], walls.counters[0]
    wall.points, wall.shown = 0, False
    wall.version += 1
    walls.placed[row] = UNLINKED
    walls.free[counters.free] = row
    counters.free += 1


@compiled
def merge_walls(
    walls: Walls,
    grid: Grid,
    new: tuple[Float, Records, Int],
    place: tuple[float, float],
    waiting: Int,
    cells: Cells,
    rule: Rule,
) -> tuple[Int, Int]:
    """Add the walls of a scan (ends, moments and points around its place [m]), merge what fits.

    Walls that have changed (n,) may fit others now, too. Returns the rows of the walls that are new
    or were merged, rising, and of those that became a part of them, which are not free yet.
    """
    ends, moments, points = new
    queue = np.empty(len(waiting) + 2 * len(points) + walls.counters[0].taken + 1, np.int64)
    marks = np.zeros(len(walls.rows), np.bool_)
    gone = np.empty(len(queue), np.int64)
    top = lost = 0
    for k in range(len(waiting)):
        if walls.rows[waiting[k]].points > 0:
            queue[top] = waiting[k]
            top += 1
    known = top
    for k in range(len(points)):
        row = take_row(walls)
        for side in range(4):
            walls.ends[row, side] = ends[k, side] + place[side % 2]
        walls.moments[row] = moments[k]
        walls.moments[row].x += place[0]
        walls.moments[row].y += place[1]
        walls.rows[row].points = points[k]
        if _is_covered(walls, grid, row, rule):
            give_back(walls, row)
        else:
            queue[top] = row
            top += 1
    for k in range(known, top):
        marks[queue[k]] = True
        insert(grid, queue[k], walls.ends[queue[k]])
    turn = 0
    while turn < top:
        row = queue[turn]
        turn += 1
        if walls.rows[row].points == 0:
            continue
        other = _partner(walls, grid, row, cells, rule)
        if other < 0:
            continue
        kept, taken = min(row, other), max(row, other)
        remove(grid, kept, walls.ends[kept])
        remove(grid, taken, walls.ends[taken])
        merge(walls, kept, taken)
        # Its hits are free for what it has become.
        walls.rows[taken].version += 1
        insert(grid, kept, walls.ends[kept])
        marks[kept] = True
        gone[lost] = taken
        lost += 1
        queue[top] = kept
        top += 1
    dirty, count = np.empty(len(queue), np.int64), 0
    for row in range(walls.counters[0].taken):
        if marks[row] and walls.rows[row].points > 0:
            dirty[count] = row
            count += 1
    return dirty[:count], gone[:lost]


@inner
def _is_covered(walls: Walls, grid: Grid, row: int, rule: Rule) -> bool:
    """Whether walls that are known as well, or better, cover all but a little of one of a scan."""
    own = walls.ends[row]
    ux, uy, length = unit_of(own)
    x, y = end_of(own, 0)
    steps = min(int(length / GROWN) + 1, 1000)
    covered = np.zeros(steps, np.bool_)
    for k in range(near(grid, own, rule.distance + rule.most_explained)):
        other = grid.found[k]
        if walls.rows[other].points < walls.rows[row].points:
            continue
        ends = walls.ends[other]
        first, last = along_of(ends, x, y, ux, uy)
        first, last = first / length, last / length
        if last <= 0.0 or first >= 1.0:
            continue
        if misfit(own, walls.moments[row], ends, walls.moments[other], rule) < 1.0:
            covered[int(max(first, 0.0) * steps + 0.5) : int(min(last, 1.0) * steps + 0.5)] = True
    return bool((steps - covered.sum()) * length <= GROWN * steps)


@inner
def _partner(walls: Walls, grid: Grid, row: int, cells: Cells, rule: Rule) -> int:
    """The wall that a row is one with: that which it fits best, or that goes on nearest; −1."""
    # As straight as a wall is continued, and no farther off than two views of it: nothing overlaps
    # that could tell where the two lead.
    straight = Rule(LONGEST_GAP, rule.bend, rule.bend, rule.distance)
    best, least, second, narrowest = -1, 1.0, -1, LONGEST_GAP
    line = np.empty(4)
    for k in range(near(grid, walls.ends[row], LONGEST_GAP)):
        other = grid.found[k]
        if other == row or walls.rows[other].points == 0:
            continue
        one, two = walls.ends[row], walls.ends[other]
        moments, others = walls.moments[row], walls.moments[other]
        value = misfit(one, moments, two, others, rule)
        if value < least or (value == least and other < best):
            if _span(one, two, line) <= 0.0 or not is_crossed(
                line, cells, FREE_DEPTH, SPARE_BEAMS, WALL_SINE
            ):
                best, least = other, value
        elif best < 0 and walls.rows[row].shown and walls.rows[other].shown:
            if misfit(one, moments, two, others, straight) < 1.0:
                gap = _span(one, two, line)
                if gap < narrowest and not is_crossed(line, cells, FREE_DEPTH, 0, WALL_SINE):
                    second, narrowest = other, gap
    return best if best >= 0 else second


@borrower
def _span(one: Float, other: Float, line: Float) -> float:
    """Fill in the line (4,) from the end of one wall to where the next begins: its length [m]."""
    ux, uy = vector_of(one)
    size = np.hypot(ux, uy)
    (x, y), (u, v) = end_of(one, 1), end_of(other, 1)
    ahead = along_of(other, x, y, ux, uy)[0] / size
    back = along_of(one, u, v, ux, uy)[0] / size
    if ahead > back:
        put_line(line, x, y, *end_of(other, 0))
    else:
        put_line(line, u, v, *end_of(one, 0))
    gap: float = max(ahead, back, 0.0)
    return gap


@compiled
def misfit(ends: Float, moments: Any, other_ends: Float, other: Any, rule: Rule) -> float:
    """How far the shorter of two segments lies off the longer one's line; 1 is the most allowed."""
    (x, y), (u, v) = vector_of(ends), vector_of(other_ends)
    size, length = np.sqrt(x * x + y * y), np.sqrt(u * u + v * v)
    # Ends run so that the laser stood on the left: opposite ways are two faces of a wall.
    if x * u + y * v <= SAME_DIRECTION * size * length:
        return np.inf
    if size > length:
        ends, other_ends = other_ends, ends
        moments, other = other, moments
        x, y, size, u, v, length = u, v, length, x, y, size
    x, y, u, v = x / size, y / size, u / length, v / length
    low, high = along_of(other_ends, other.x, other.y, u, v)
    first, last = along_of(ends, other.x, other.y, u, v)
    if max(first - high, low - last) > rule.length:
        return np.inf
    shared = min(last, high) - max(first, low)
    apart = rule.distance if shared > 0.5 * (last - first) else rule.bend
    own_spread = moments.xx * x * x + 2.0 * moments.xy * x * y + moments.yy * y * y
    spread = other.xx * u * u + 2.0 * other.xy * u * v + other.yy * v * v
    worst = 0.0
    for k in range(0, 4, 2):
        dx, dy = ends[k] - other.x, ends[k + 1] - other.y
        along = dx * u + dy * v
        own = (ends[k] - moments.x) * x + (ends[k + 1] - moments.y) * y
        variance = 1.0 / moments.weight + own * own / own_spread
        variance += 1.0 / other.weight + along * along / spread
        allowed = apart + min(MERGE_DEVIATIONS * np.sqrt(variance), rule.most_explained)
        worst = max(worst, abs(u * dy - v * dx) / allowed)
    return worst


@compiled
def merge(walls: Walls, kept: int, gone: int) -> None:
    """Make the first row the exact fit to the points of both, as long as both reach."""
    ends, own, its = walls.ends, walls.moments[kept], walls.moments[gone]
    total = own.weight + its.weight
    share = its.weight / total
    dx, dy = its.x - own.x, its.y - own.y
    spread = own.weight * share
    own.weight = total
    own.x += share * dx
    own.y += share * dy
    own.xx += its.xx + spread * dx * dx
    own.xy += its.xy + spread * dx * dy
    own.yy += its.yy + spread * dy * dy
    angle = 0.5 * np.arctan2(2.0 * own.xy, own.xx - own.yy)
    u, v = np.cos(angle), np.sin(angle)
    dx, dy = vector_of(ends[kept])
    if u * dx + v * dy < 0.0:
        u, v = -u, -v
    x, y = own.x, own.y
    low, high = np.inf, -np.inf
    for row in (kept, gone):
        first, last = along_of(ends[row], x, y, u, v)
        low, high = min(low, first, last), max(high, first, last)
    put_line(ends[kept], x + low * u, y + low * v, x + high * u, y + high * v)
    walls.rows[kept].points += walls.rows[gone].points
    walls.rows[gone].points = 0
