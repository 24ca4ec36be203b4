"""Choice of walls: those of which a scan has changed so much that they are refined again."""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, near, order_of
from lrf3d.mapping.robust.cells import Cells, NewEvidence, count_evidence
from lrf3d.mapping.robust.constants import (
    FEW_WALLS,
    FOLLOWED,
    FRESH_SHARE,
    GROWN,
    HIT_DEVIATIONS,
    MERGE_CELL,
    MOVED,
    STALE_SHARE,
)
from lrf3d.mapping.robust.walls import Touched, Walls


class KnownWalls(NamedTuple):
    """The walls of a store, and how they were when they were refit last.

    Args:
        walls: The walls.
        touched: Which rows the last scan changed; is written by searches.
        grid: Where the walls are.
        refit: (rows, 4) where each was when it was refit last [m]; infinite where it never was.
        evidence: (rows,) hits and violations that it had then.
        following: (1,) the wall from which on the next is looked for whose turn it is.
    """

    walls: Walls
    touched: Touched
    grid: Grid
    refit: Float
    evidence: Float
    following: Int


@inner
def _count_unowned_hits(
    fresh: NewEvidence, cells: Cells, walls: Walls, touched: Touched, grid: Grid, distance: float
) -> None:
    """Note clusters that are hits of no wall at all walls whose hits they may be.

    Args:
        fresh: Is written.
        cells: The cells.
        walls: The walls of the store.
        touched: Is written by searches.
        grid: Where the walls are.
        distance: How far from a wall [m] a return may lie, beside what noise explains.
    """
    found = np.empty(len(walls.points), np.int64)
    point = np.empty(4)
    for k in range(fresh.numbers[1]):
        moments = cells.moments[fresh.unowned[k]]
        point[0] = point[2] = moments[2]
        point[1] = point[3] = moments[3]
        off = distance + HIT_DEVIATIONS * np.sqrt(moments[0] / moments[1])
        touched.number[1] += 1
        count = near(grid, point, FOLLOWED, MERGE_CELL, touched.searched, touched.number[1], found)
        for i in range(count):
            wall = found[i]
            if walls.points[wall] > 0 and _reaches(walls.ends[wall], point[0], point[1], off):
                count_evidence(fresh, wall, 1.0)


@inner
def _reaches(ends: Float, x: float, y: float, off: float) -> bool:
    """Whether a wall (4,), followed beyond its ends, comes so near [m] to a point."""
    ux, uy = ends[2] - ends[0], ends[3] - ends[1]
    size = np.hypot(ux, uy)
    along = ((x - ends[0]) * ux + (y - ends[1]) * uy) / size
    aside = ((y - ends[1]) * ux - (x - ends[0]) * uy) / size
    return bool(abs(aside) <= off and -FOLLOWED <= along <= size + FOLLOWED)


@inner
def choose_walls(
    fresh: NewEvidence, cells: Cells, known: KnownWalls, distance: float
) -> tuple[Int, Int]:
    """Choose the walls that are to be refined again.

    Args:
        fresh: What is new of the walls; is written.
        cells: The cells.
        known: The walls; is written.
        distance: How far from a wall [m] a return may lie, beside what noise explains.

    Returns:
        The rows (m,) of these walls and (k,) of those that are no walls any more, rising.
    """
    walls, touched, refit, evidence = known.walls, known.touched, known.refit, known.evidence
    following, chosen = known.following, np.empty(len(known.walls.points), np.int64)
    _count_unowned_hits(fresh, cells, walls, touched, known.grid, distance)
    changed = touched.rows[: touched.number[0]]
    for k in range(len(changed)):
        if fresh.last_scans[changed[k]] != fresh.numbers[2]:
            count_evidence(fresh, changed[k], 0.0)
    count, stale, most = 0, -1, STALE_SHARE
    for k in range(fresh.numbers[0]):
        wall = fresh.walls[k]
        if walls.points[wall] == 0:
            fresh.counts[wall] = 0.0
            if not np.isinf(refit[wall, 0]):
                refit[wall, 0] = np.inf
                chosen[count] = wall
                count += 1
        elif (
            np.isinf(refit[wall, 0])
            or fresh.counts[wall] >= FRESH_SHARE * evidence[wall]
            or _moved(refit[wall], walls.ends[wall])
        ):
            fresh.counts[wall] = 0.0
            for side in range(4):
                refit[wall, side] = walls.ends[wall, side]
            chosen[count] = wall
            count += 1
        elif fresh.counts[wall] > most * evidence[wall]:
            stale, most = wall, fresh.counts[wall] / evidence[wall]
    if stale >= 0 and count < FEW_WALLS:
        # An update with little to do catches up with the wall that has waited longest.
        fresh.counts[stale] = 0.0
        for side in range(4):
            refit[stale, side] = walls.ends[stale, side]
        chosen[count] = stale
        count += 1
    # What a wall lost to its neighbours, it has not noticed: all walls have their turn.
    for _ in range(len(refit)):
        wall = following[0]
        following[0] = (wall + 1) % len(refit)
        if walls.points[wall] > 0 and not np.isinf(refit[wall, 0]):
            if not _contains(chosen, count, wall):
                fresh.counts[wall] = 0.0
                for side in range(4):
                    refit[wall, side] = walls.ends[wall, side]
                chosen[count] = wall
                count += 1
            break
    chosen = chosen[order_of(chosen[:count])]
    gone, alive, lost = np.empty(count, np.int64), 0, 0
    for k in range(count):
        if walls.points[chosen[k]] > 0:
            chosen[alive] = chosen[k]
            alive += 1
        else:
            gone[lost] = chosen[k]
            lost += 1
    return chosen[:alive], gone[:lost]


@inner
def _contains(chosen: Int, count: int, wall: int) -> bool:
    """Whether a wall is among the first of those chosen."""
    for k in range(count):
        if chosen[k] == wall:
            return True
    return False


@inner
def _moved(before: Float, ends: Float) -> bool:
    """Whether a wall (4,) has grown, or moved sideways, since before."""
    ux, uy = before[2] - before[0], before[3] - before[1]
    size = np.hypot(ux, uy)
    ux, uy = ux / size, uy / size
    for k in range(0, 4, 2):
        dx, dy = ends[k] - before[0], ends[k + 1] - before[1]
        along = dx * ux + dy * uy
        if abs(dy * ux - dx * uy) > MOVED or along < -GROWN or along > size + GROWN:
            return True
    return False
