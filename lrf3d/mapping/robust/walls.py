"""Walls of a growing map: the arrays that they are kept in, and how two of them become one.

Two segments stand for one wall where the shorter one's ends lie on the longer one's line within
what noise explains and a wall may bend, where they overlap or nearly so, and where the laser
stood on the same side of both. The merged wall is the exact fit to all points of both. Each merge
takes one segment away, so the loop ends. The arrays are named tuples, which compiled code takes
as they are; a grid finds the partners of each new wall.
"""

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, insert, near, remove
from lrf3d.mapping.robust.constants import MERGE_DEVIATIONS, SAME_DIRECTION

Number = TypeVar("Number", np.float64, np.int64, np.int32)


class Walls(NamedTuple):
    """The walls of a map, a row each; arrays have room for more.

    Args:
        ends: (rows, 4) x1 y1 x2 y2 [m]; the laser saw the wall from its left.
        moments: (rows, 6) weight, mean and scatter of its points.
        points: (rows,) number of its points; 0 where the row is free.
    """

    ends: Float
    moments: Float
    points: Int

    @classmethod
    def of_size(cls, rows: int) -> "Walls":
        """Free rows."""
        return cls(np.zeros((rows, 4)), np.zeros((rows, 6)), np.zeros(rows, np.int64))

    def take(self, rows: Int | slice) -> "Walls":
        """Copies of some rows."""
        return Walls(self.ends[rows].copy(), self.moments[rows].copy(), self.points[rows].copy())

    def doubled(self) -> "Walls":
        """The walls with as many free rows behind them."""
        return Walls(longer(self.ends), longer(self.moments), longer(self.points))


class Touched(NamedTuple):
    """Which rows an update changed, in the order in which it first did, and which a search met.

    Args:
        number: (2,) counts of changed rows and of searches.
        rows: (rows,) the changed rows.
        stamps: (rows,) the last update that changed each row.
        searched: (rows,) the last search that met each row.
    """

    number: Int
    rows: Int
    stamps: Int
    searched: Int

    @classmethod
    def of_size(cls, rows: int) -> "Touched":
        """No changes yet."""
        return cls(
            np.zeros(2, np.int64),
            np.empty(rows, np.int64),
            np.zeros(rows, np.int64),
            np.zeros(rows, np.int64),
        )

    def doubled(self) -> "Touched":
        """The same with room for twice as many rows."""
        return self._replace(
            rows=longer(self.rows), stamps=longer(self.stamps), searched=longer(self.searched)
        )


def longer(column: NDArray[Number]) -> NDArray[Number]:
    """An array with as many zeros behind it as it has rows."""
    return np.concatenate([column, np.zeros_like(column)])


class Rule(NamedTuple):
    """What one wall is.

    Args:
        length: Largest gap [m] along the line between two segments of one wall.
        distance: How far [m] two views of a wall may lie apart, beside what noise explains.
        bend: How far [m] a wall may bend where it is continued, beside what noise explains.
        most_explained: Largest offset [m] that noise may explain.
    """

    length: float
    distance: float
    bend: float
    most_explained: float


@compiled
def unite_walls(
    walls: Walls,
    touched: Touched,
    grid: Grid,
    new: tuple[Walls, tuple[float, float]],
    waiting: Int,
    turn: Int,
    update: int,
    rule: Rule,
    cell: float,
) -> bool:
    """Add walls, and merge them with whatever they fit, until no two are left that the rule merges.

    Only fresh and merged walls are compared anew: the others were compared before.

    Args:
        walls: All walls.
        touched: Which rows change; is written.
        grid: Where all walls are; the waiting ones may be missing.
        new: The (n,) walls of a scan around the laser, and where the laser is [m].
        waiting: (n + 1,) a ring of rows that wait, first the free ones for these; is written.
        turn: (2,) how many have had their turn, and how many ever waited, first 0; is written.
        update: Number of this update.
        rule: What one wall is.
        cell: Size of a cell of the grid [m].

    Returns:
        Whether all is done; if not, this is to be called again with a larger grid.
    """
    if turn[1] == 0:
        turn[1] = len(new[0].points)
        _add_walls(walls, touched, waiting, *new, update)
    found = np.empty(len(walls.points), np.int64)
    # The farthest that two segments of one wall may lie apart.
    reach = rule.length + rule.distance + rule.most_explained
    for place in range(turn[0], turn[1]):
        row = waiting[place % len(waiting)]
        if walls.points[row] > 0 and not insert(grid, row, walls.ends[row], cell):
            return False
    while turn[0] < turn[1]:
        row = waiting[turn[0] % len(waiting)]
        turn[0] += 1
        if walls.points[row] > 0:
            touched.number[1] += 1
            search = touched.number[1]
            segment = walls.ends[row]
            count = near(grid, segment, reach, cell, touched.searched, search, found)
            other = partner(walls, row, found[:count], rule)
            if other >= 0:
                kept, gone = min(row, other), max(row, other)
                _touch(touched, kept, update)
                _touch(touched, gone, update)
                remove(grid, gone, walls.ends[gone], cell)
                merge(walls, kept, gone)
                waiting[turn[1] % len(waiting)] = kept
                turn[1] += 1
                # It may have grown into further cells, where the next in turn look for partners.
                if not insert(grid, kept, walls.ends[kept], cell):
                    return False
    return True


@inner
def _touch(touched: Touched, row: int, update: int) -> None:
    """Note that this update changes a row, once."""
    if touched.stamps[row] != update:
        touched.stamps[row] = update
        touched.rows[touched.number[0]] = row
        touched.number[0] += 1


@inner
def _add_walls(
    walls: Walls,
    touched: Touched,
    free: Int,
    new: Walls,
    place: tuple[float, float],
    update: int,
) -> None:
    """Write local walls into free rows, moved by a place [m]."""
    x, y = place
    for i in range(len(new.ends)):
        row = free[i]
        _touch(touched, row, update)
        for k in range(0, 4, 2):
            walls.ends[row, k] = new.ends[i, k] + x
            walls.ends[row, k + 1] = new.ends[i, k + 1] + y
        for k in range(6):
            walls.moments[row, k] = new.moments[i, k]
        walls.moments[row, 1] += x
        walls.moments[row, 2] += y
        walls.points[row] = new.points[i]


@compiled
def partner(walls: Walls, row: int, candidates: Int, rule: Rule) -> int:
    """The candidate that fits a row best, or −1; of equals the lowest row."""
    best, least = -1, 1.0
    for k in range(len(candidates)):
        other = candidates[k]
        if other != row and walls.points[other] > 0 and may_fit(walls.ends, row, other, rule):
            value = misfit(
                walls.ends[row], walls.moments[row], walls.ends[other], walls.moments[other], rule
            )
            if value < least or (value == least and best >= 0 and other < best):
                best, least = other, value
    return best


@inner
def may_fit(ends: Float, one: int, other: int, rule: Rule) -> bool:
    """Whether two of some segments (rows, 4) run one way and lie near each other.

    It is what `misfit` would find as well, but most pairs need no more.
    """
    x, y = ends[one, 2] - ends[one, 0], ends[one, 3] - ends[one, 1]
    u, v = ends[other, 2] - ends[other, 0], ends[other, 3] - ends[other, 1]
    along = x * u + y * v
    if along <= 0.0:
        return False
    if along * along < SAME_DIRECTION * SAME_DIRECTION * (x * x + y * y) * (u * u + v * v):
        return False
    reach = rule.length + max(rule.distance, rule.bend) + rule.most_explained
    for k in range(2):
        low, high = min(ends[one, k], ends[one, k + 2]), max(ends[one, k], ends[one, k + 2])
        if min(ends[other, k], ends[other, k + 2]) - high > reach:
            return False
        if low - max(ends[other, k], ends[other, k + 2]) > reach:
            return False
    return True


@compiled
def misfit(ends: Float, moments: Float, other_ends: Float, other: Float, rule: Rule) -> float:
    """How far the shorter of two segments lies off the longer one's line; 1 is the most allowed."""
    x, y = ends[2] - ends[0], ends[3] - ends[1]
    u, v = other_ends[2] - other_ends[0], other_ends[3] - other_ends[1]
    size, length = np.sqrt(x * x + y * y), np.sqrt(u * u + v * v)
    # Ends run so that the laser stood on the left: opposite ways are two faces of a wall.
    if x * u + y * v <= SAME_DIRECTION * size * length:
        return np.inf
    if size > length:
        ends, other_ends = other_ends, ends
        moments, other = other, moments
        x, y, size, u, v, length = u, v, length, x, y, size
    x, y, u, v = x / size, y / size, u / length, v / length
    low = (other_ends[0] - other[1]) * u + (other_ends[1] - other[2]) * v
    high = (other_ends[2] - other[1]) * u + (other_ends[3] - other[2]) * v
    first = (ends[0] - other[1]) * u + (ends[1] - other[2]) * v
    last = (ends[2] - other[1]) * u + (ends[3] - other[2]) * v
    if max(first - high, low - last) > rule.length:
        return np.inf
    shared = min(last, high) - max(first, low)
    apart = rule.distance if shared > 0.5 * (last - first) else rule.bend
    own_spread = moments[3] * x * x + 2.0 * moments[4] * x * y + moments[5] * y * y
    spread = other[3] * u * u + 2.0 * other[4] * u * v + other[5] * v * v
    worst = 0.0
    for k in range(0, 4, 2):
        dx, dy = ends[k] - other[1], ends[k + 1] - other[2]
        along = dx * u + dy * v
        own = (ends[k] - moments[1]) * x + (ends[k + 1] - moments[2]) * y
        variance = 1.0 / moments[0] + own * own / own_spread
        variance += 1.0 / other[0] + along * along / spread
        allowed = apart + min(MERGE_DEVIATIONS * np.sqrt(variance), rule.most_explained)
        worst = max(worst, abs(u * dy - v * dx) / allowed)
    return worst


@compiled
def merge(walls: Walls, kept: int, gone: int) -> None:
    """Make the first row the exact fit to the points of both, as long as both reach."""
    ends, moments = walls.ends, walls.moments
    total = moments[kept, 0] + moments[gone, 0]
    share = moments[gone, 0] / total
    dx, dy = moments[gone, 1] - moments[kept, 1], moments[gone, 2] - moments[kept, 2]
    spread = moments[kept, 0] * share
    moments[kept, 0] = total
    moments[kept, 1] += share * dx
    moments[kept, 2] += share * dy
    moments[kept, 3] += moments[gone, 3] + spread * dx * dx
    moments[kept, 4] += moments[gone, 4] + spread * dx * dy
    moments[kept, 5] += moments[gone, 5] + spread * dy * dy
    angle = 0.5 * np.arctan2(2.0 * moments[kept, 4], moments[kept, 3] - moments[kept, 5])
    u, v = np.cos(angle), np.sin(angle)
    if u * (ends[kept, 2] - ends[kept, 0]) + v * (ends[kept, 3] - ends[kept, 1]) < 0.0:
        u, v = -u, -v
    x, y = moments[kept, 1], moments[kept, 2]
    low, high = np.inf, -np.inf
    for row in (kept, gone):
        for k in range(0, 4, 2):
            along = (ends[row, k] - x) * u + (ends[row, k + 1] - y) * v
            low, high = min(low, along), max(high, along)
    ends[kept, 0], ends[kept, 1] = x + low * u, y + low * v
    ends[kept, 2], ends[kept, 3] = x + high * u, y + high * v
    walls.points[kept] += walls.points[gone]
    walls.points[gone] = 0
