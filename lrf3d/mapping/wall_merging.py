"""Merging of walls, compiled: each new wall of a map finds its partners by a grid (section 3.1).

Two segments stand for one wall where the shorter one's ends lie on the longer one's line within
what noise explains and a wall may bend, where they overlap or nearly so, and where the laser
stood on the same side of both. The merged wall is the exact fit to all points of both. Each merge
takes one segment away, so the loop ends.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, insert, near, remove
from lrf3d.mapping.wall_rows import Changes, Walls

SAME_WAY = 0.5
"""Cosine of the largest angle between two segments that may be one wall."""

SIGMAS = 3.0
"""How many deviations of its place a segment may lie beside a wall."""


class Rule(NamedTuple):
    """What one wall is.

    Args:
        length: Largest gap [m] along the line between two segments of one wall.
        distance: How far [m] two views of a wall may lie apart, beside what noise explains.
        bend: How far [m] a wall may bend where it is continued, beside what noise explains.
        parted: Largest uncertainty [m] that noise may explain.
    """

    length: float
    distance: float
    bend: float
    parted: float

    @property
    def reach(self) -> float:
        """The farthest [m] that two segments of one wall may lie apart."""
        return self.length + self.distance + self.parted


@njit(cache=True, nogil=True)
def unite_walls(
    walls: Walls,
    changes: Changes,
    grid: Grid,
    waiting: Int,
    turn: Int,
    update: int,
    rule: Rule,
    reach: float,
    cell: float,
) -> bool:  # pragma: no cover
    """Merge the waiting rows with whatever they fit, until no two are left that the rule merges.

    Only fresh and merged walls are compared anew: the others were compared before.

    Args:
        walls: All walls, the waiting ones among them.
        changes: Is told what changes.
        grid: Where all walls are; the waiting ones may be missing.
        waiting: (n,) a ring of rows that wait, with room for all; is written.
        turn: (2,) how many have had their turn, and how many ever waited; is written.
        update: Number of this update.
        rule: What one wall is.
        reach: The rule's reach [m].
        cell: Size of a cell of the grid [m].

    Returns:
        Whether all is done; if not, this is to be called again with a larger grid.
    """
    found = np.empty(len(walls.points), np.int64)
    for place in range(turn[0], turn[1]):
        row = waiting[place % len(waiting)]
        if walls.points[row] > 0 and not insert(grid, row, walls.ends[row], cell):
            return False
    while turn[0] < turn[1]:
        row = waiting[turn[0] % len(waiting)]
        if walls.points[row] > 0:
            # A merged wall may have grown into further cells.
            if not insert(grid, row, walls.ends[row], cell):
                return False
            changes.number[2] += 1
            search = changes.number[2]
            segment = walls.ends[row]
            count = near(grid, segment, reach, cell, changes.searched, search, found)
            other = partner(walls, row, found[:count], rule)
            if other >= 0:
                kept, gone = min(row, other), max(row, other)
                _remember(walls, changes, kept, update)
                _remember(walls, changes, gone, update)
                remove(grid, gone, walls.ends[gone], cell)
                merge(walls, kept, gone)
                if walls.unions[kept] != walls.unions[gone]:
                    bond = changes.number[1]
                    changes.bonds[bond, 0] = walls.unions[kept]
                    changes.bonds[bond, 1] = walls.unions[gone]
                    changes.number[1] += 1
                waiting[turn[1] % len(waiting)] = kept
                turn[1] += 1
        turn[0] += 1
    return True


@njit(cache=True, nogil=True)
def _remember(walls: Walls, changes: Changes, row: int, update: int) -> None:  # pragma: no cover
    """Note what stands in a row before this update first changes it."""
    if changes.stamps[row] == update:
        return
    changes.stamps[row] = update
    place = changes.number[0]
    changes.number[0] += 1
    changes.rows[place] = row
    before = changes.before
    before.ends[place] = walls.ends[row]
    before.moments[place] = walls.moments[row]
    before.points[place] = walls.points[row]
    before.unions[place] = walls.unions[row]


@njit(cache=True, nogil=True)
def add_walls(
    walls: Walls,
    changes: Changes,
    free: Int,
    ends: Float,
    moments: Float,
    labels: Int,
    x: float,
    y: float,
    union: int,
    update: int,
) -> None:  # pragma: no cover
    """Write local walls into free rows, moved by (x, y) [m]; their unions follow a number."""
    for i in range(len(ends)):
        row = free[i]
        _remember(walls, changes, row, update)
        for k in range(0, 4, 2):
            walls.ends[row, k] = ends[i, k] + x
            walls.ends[row, k + 1] = ends[i, k + 1] + y
        walls.moments[row] = moments[i]
        walls.moments[row, 1] += x
        walls.moments[row, 2] += y
        walls.points[row] = labels[i, 0]
        walls.unions[row] = union + labels[i, 1]


@njit(cache=True, nogil=True)
def partner(walls: Walls, row: int, candidates: Int, rule: Rule) -> int:  # pragma: no cover
    """The candidate that fits a row best, or −1; of equals the lowest row."""
    best, least = -1, 1.0
    for other in candidates:
        if other != row and walls.points[other] > 0:
            value = misfit(
                walls.ends[row], walls.moments[row], walls.ends[other], walls.moments[other], rule
            )
            if value < least or (value == least and best >= 0 and other < best):
                best, least = other, value
    return best


@njit(cache=True, nogil=True)
def misfit(
    ends: Float, moments: Float, other_ends: Float, other: Float, rule: Rule
) -> float:  # pragma: no cover
    """How far the shorter of two segments lies off the longer one's line; 1 is the most allowed."""
    x, y = ends[2] - ends[0], ends[3] - ends[1]
    u, v = other_ends[2] - other_ends[0], other_ends[3] - other_ends[1]
    size, length = np.sqrt(x * x + y * y), np.sqrt(u * u + v * v)
    # Ends run so that the laser stood on the left: opposite ways are two faces of a wall.
    if x * u + y * v <= SAME_WAY * size * length:
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
        allowed = apart + min(SIGMAS * np.sqrt(variance), rule.parted)
        worst = max(worst, abs(u * dy - v * dx) / allowed)
    return worst


@njit(cache=True, nogil=True)
def merge(walls: Walls, kept: int, gone: int) -> None:  # pragma: no cover
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
