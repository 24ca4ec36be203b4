"""Refinement: which walls are refit, and how their new parts replace them.

Walls with enough new evidence enter. Their real parts take their rows: cut where beams passed
through, split where the points bend. A part that hardly differs from a former wall keeps its row
and links, and is not merged again, so that a wall that is merged and cut repeatedly settles.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.robust.cells import HIT_DEVIATIONS, Cells
from lrf3d.mapping.robust.pieces import FOLLOWED
from lrf3d.mapping.robust.refitting import Parts
from lrf3d.mapping.robust.walls import (
    Walls,
    count_evidence,
    end_of,
    give_back,
    near,
    put_line,
    put_row,
    take_row,
    vector_of,
    widen_box,
)


@compiled
def choose_walls(walls: Walls, cells: Cells, unowned: Int, dirty: Int, near_by: float) -> Int:
    """The walls (n,) to refit, rising.

    Those that are new or merged (m,), those with much new evidence, and one more in turn: a wall
    does not notice what it lost to its neighbours.
    """
    _count_unowned_hits(walls, cells, unowned, near_by)
    counters = walls.counters[0]
    rows, marks = np.empty(counters.taken, np.int64), np.zeros(counters.taken, np.bool_)
    for k in range(len(dirty)):
        marks[dirty[k]] = True
    # [share] New evidence after which a wall is refit, relative to that of its last fit. Less takes
    # time, more leaves walls outdated.
    fresh_share = 0.1
    for k in range(counters.changed):
        wall = walls.changed[k]
        if walls.rows[wall].fresh >= fresh_share * walls.fits[wall].evidence:
            marks[wall] = True
    for _ in range(counters.taken):
        counters.refit = (counters.refit + 1) % counters.taken
        if walls.fits[counters.refit].points > 0:
            marks[counters.refit] = True
            break
    count = 0
    for row in range(counters.taken):
        if marks[row] and walls.fits[row].points > 0:
            rows[count] = row
            count += 1
    return rows[:count]


@inner
def _count_unowned_hits(walls: Walls, cells: Cells, unowned: Int, near_by: float) -> None:
    """Count clusters that are hits of no wall as new evidence of the walls that may reach them."""
    point = np.empty(4)
    for k in range(walls.counters[0].unowned):
        cluster = cells.clusters[unowned[k]]
        if cluster.hits == 0.0:
            # It was an image in a mirror.
            continue
        x, y = cluster.x, cluster.y
        put_line(point, x, y, x, y)
        off = near_by + HIT_DEVIATIONS * np.sqrt(cluster.hits / cluster.weight)
        for i in range(near(walls, point, FOLLOWED + off)):
            ends = walls.ends[walls.found[i]]
            (ux, uy), (x1, y1) = vector_of(ends), end_of(ends, 0)
            size = np.hypot(ux, uy)
            along = ((x - x1) * ux + (y - y1) * uy) / size
            aside = ((y - y1) * ux - (x - x1) * uy) / size
            if abs(aside) <= off and -FOLLOWED <= along <= size + FOLLOWED:
                count_evidence(walls, walls.found[i], 1.0)


@compiled
def replace_walls(walls: Walls, cells: Cells, rows: Int, gone: Int, parts: Parts) -> Int:
    """Put the parts in place of walls (n,), and of those (m,) that became part of them.

    Returns the rows that are new in their places: they are to be linked, and may fit others.
    """
    ends, fits, clusters, owners = parts
    old = np.concatenate((rows, gone))
    taken, places = np.zeros(len(old), np.bool_), np.full(len(ends), -1)
    for part in range(len(ends)):
        if fits[part].shown:
            place = _unmoved(walls, old, taken, ends[part])
            if place >= 0:
                taken[place], places[part] = True, old[place]
    for k in range(len(old)):
        if not taken[k]:
            give_back(walls, old[k])
    fresh, added = np.empty(len(ends), np.int64), 0
    for part in range(len(ends)):
        moved = places[part] < 0
        row = places[part] = take_row(walls) if moved else places[part]
        put_row(walls.ends, row, ends[part])
        walls.fits[row], walls.rows[row].fresh = fits[part], 0.0
        widen_box(walls, row)
        if moved and fits[part].shown:
            fresh[added] = row
            added += 1
            put_row(walls.placed, row, ends[part])
    for k in range(len(clusters)):
        cluster, part = cells.clusters[clusters[k]], owners[k]
        cluster.owner_version = 0
        if part >= 0:
            cluster.owner, cluster.owner_version = places[part], walls.rows[places[part]].version
    return fresh[:added]


@borrower
def _unmoved(walls: Walls, old: Int, taken: Bool, ends: Float) -> int:
    """The index of the former wall, not taken yet, that a part hardly differs from; −1."""
    # [m] A part within this distance of a linked wall keeps its row and links. Ends move by pieces
    # of 0.1 m. Less takes time.
    unchanged = 0.15
    best, least = -1, unchanged
    for place in range(len(old)):
        apart = 0.0
        for side in range(4):
            apart = max(apart, abs(ends[side] - walls.placed[old[place], side]))
        if apart < least and not taken[place]:
            best, least = place, apart
    return best
