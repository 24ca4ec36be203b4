"""Refinement: walls are checked against what all beams have shown, and corrected by it.

Enter the walls whose evidence has changed; their real parts take their places in the pool: cut
where beams went through them, split where the points bend, without second copies. A part that
hardly differs from where a wall was keeps that wall's row and links, and waits for no merge; so a
wall that is merged and cut again and again settles.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.grid import Grid, insert, near, remove
from lrf3d.mapping.robust.cells import HIT_DEVIATIONS, Cells, NewEvidence
from lrf3d.mapping.robust.crossing import end_of, put_line, vector_of
from lrf3d.mapping.robust.evidence import FOLLOWED
from lrf3d.mapping.robust.judging import count_evidence
from lrf3d.mapping.robust.refitting import Parts
from lrf3d.mapping.robust.walls import Walls, give_back, put_row, take_row

FRESH_SHARE = 0.1
"""[share] A wall is refined again when this part of what it was refit by is new. Less
takes time, more leaves walls behind what is known of them."""

UNCHANGED = 0.15
"""[m] A part that lies no farther than this from where a wall was linked with others keeps its row
and its links. Its ends move by whole pieces of 0.1 m. Less takes time."""


@compiled
def choose_walls(
    walls: Walls, grid: Grid, cells: Cells, fresh: NewEvidence, dirty: Int, near_by: float
) -> Bool:
    """Which of the walls (rows,) are to be refit.

    They are those that are new or merged (m,), those with much new evidence, and one more: what a
    wall lost to its neighbours, it has not noticed, so all walls have their turn.
    """
    _count_unowned_hits(walls, grid, cells, fresh, near_by)
    chosen = np.zeros(len(walls.rows), np.bool_)
    for k in range(len(dirty)):
        chosen[dirty[k]] = True
    for k in range(fresh.counters[0].changed):
        wall = fresh.changed[k]
        if walls.rows[wall].fresh >= FRESH_SHARE * walls.rows[wall].evidence:
            chosen[wall] = True
    counters = walls.counters[0]
    for _ in range(counters.taken):
        counters.turn = (counters.turn + 1) % counters.taken
        if walls.rows[counters.turn].points > 0:
            chosen[counters.turn] = True
            break
    return chosen


@inner
def _count_unowned_hits(
    walls: Walls, grid: Grid, cells: Cells, fresh: NewEvidence, near_by: float
) -> None:
    """Count clusters that are hits of no wall as new evidence of all walls that may reach them."""
    point = np.empty(4)
    for k in range(fresh.counters[0].unowned):
        cluster = cells.clusters[fresh.unowned[k]]
        if cluster.hits == 0.0:
            # It was an image in a mirror.
            continue
        x, y = cluster.x, cluster.y
        put_line(point, x, y, x, y)
        off = near_by + HIT_DEVIATIONS * np.sqrt(cluster.hits / cluster.weight)
        for i in range(near(grid, point, FOLLOWED)):
            wall = grid.found[i]
            if walls.rows[wall].points == 0:
                continue
            ends = walls.ends[wall]
            (ux, uy), (x1, y1) = vector_of(ends), end_of(ends, 0)
            size = np.hypot(ux, uy)
            along = ((x - x1) * ux + (y - y1) * uy) / size
            aside = ((y - y1) * ux - (x - x1) * uy) / size
            if abs(aside) <= off and -FOLLOWED <= along <= size + FOLLOWED:
                count_evidence(fresh, wall, 1.0)


@compiled
def replace_walls(
    walls: Walls,
    grid: Grid,
    cells: Cells,
    rows: Int,
    gone: Int,
    parts: Parts,
) -> Int:
    """Put the parts of some walls (n,) in their places, and of those (m,) that became part of them.

    Returns the rows that are new in their places: they are to be linked, and may fit others.
    """
    ends, moments, points, real, evidence, clusters = parts
    old = np.concatenate((rows, gone))
    taken, places = np.zeros(len(old), np.bool_), np.full(len(ends), -1)
    for part in range(len(ends)):
        if real[part]:
            place = _unmoved(walls, old, taken, ends[part])
            if place >= 0:
                taken[place], places[part] = True, old[place]
    for k in range(len(rows)):
        remove(grid, rows[k], walls.ends[rows[k]])
    for k in range(len(old)):
        if not taken[k]:
            give_back(walls, old[k])
    fresh, added = np.empty(len(ends), np.int64), 0
    for part in range(len(ends)):
        moved = places[part] < 0
        row = places[part] = take_row(walls) if moved else places[part]
        put_row(walls.ends, row, ends[part])
        walls.moments[row] = moments[part]
        wall = walls.rows[row]
        wall.points, wall.shown = points[part], real[part]
        wall.evidence, wall.fresh = evidence[part], 0.0
        insert(grid, row, walls.ends[row])
        if moved and real[part]:
            fresh[added] = row
            added += 1
            put_row(walls.placed, row, ends[part])
    for k in range(len(clusters)):
        cluster, part = clusters[k]
        if part < 0:
            cells.clusters[cluster].owner_version = 0
        else:
            cells.clusters[cluster].owner = places[part]
            cells.clusters[cluster].owner_version = walls.rows[places[part]].version
    return fresh[:added]


@borrower
def _unmoved(walls: Walls, old: Int, taken: Bool, ends: Float) -> int:
    """The place among old rows, not taken yet, of the wall that a part hardly differs from; −1."""
    best, least = -1, UNCHANGED
    for place in range(len(old)):
        apart = 0.0
        for side in range(4):
            apart = max(apart, abs(ends[side] - walls.placed[old[place], side]))
        if apart < least and not taken[place]:
            best, least = place, apart
    return best
