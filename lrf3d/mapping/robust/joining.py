"""Joining: which stretches are of one wall, by the same rule as walls of scans and across gaps.

Enter the real stretches of walls; leave the walls that they make. Stretches on one line become one
wall also where a gap was never looked into, so that no beam has crossed it.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, Search, near, order_of
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import FREE_DEPTH, LONGEST_GAP, MERGE_CELL, PIECE, WALL_SINE
from lrf3d.mapping.robust.crossing import is_crossed
from lrf3d.mapping.robust.refitting import Refit, refit_walls
from lrf3d.mapping.robust.segment_pool import NewSegments, Pool, drop_rows, rows_of
from lrf3d.mapping.robust.walls import Rule, Walls, may_fit, merge, misfit, partner


class Joints(NamedTuple):
    """The walls that stretches are joined to, each named by one of its stretches.

    Args:
        names: (rows,) the wall that each stretch is of.
        rings: (rows,) the next stretch of the same wall, in a ring.
        marks: (rows,) False; is written, and restored.
        stamps: (rows,) the stamp of each wall; see `Cells`.
        lost: (rows,) what each wall lost to others; is written.
    """

    names: Int
    rings: Int
    marks: NDArray[np.bool_]
    stamps: NDArray[np.int32]
    lost: Float

    @classmethod
    def of_size(cls, rows: int) -> "Joints":
        """No walls yet."""
        return cls(
            np.zeros(rows, np.int64), np.arange(rows), np.zeros(rows, np.bool_),
            np.zeros(rows, np.int32), np.zeros(rows),
        )  # fmt: skip

    def doubled(self) -> "Joints":
        """The same with room for twice as many stretches."""
        columns: tuple[NDArray[Any], ...] = self
        grown: tuple[NDArray[Any], ...] = Joints.of_size(2 * len(self.names))
        for own, column in zip(columns, grown, strict=True):
            column[: len(own)] = own
        return Joints(*grown)


@compiled
def loosen_walls(walls: Int, pool: Pool, grid: Grid, joints: Joints) -> tuple[Int, Int]:
    """Take the stretches of some walls (n,) out.

    Returns:
        The other stretches of what they were joined to, and the names of that.
    """
    parts = parts_of(rows_of(pool, walls), joints.rings, joints.marks)
    names = np.empty(len(parts), np.int64)
    count = 0
    for k in range(len(parts)):
        count = _add_name(joints, parts[k], names, count)
    for k in range(count):
        joints.marks[names[k]] = False
    drop_rows(pool, grid, walls)
    left = 0
    for k in range(len(parts)):
        if pool.walls.points[parts[k]] > 0:
            parts[left] = parts[k]
            left += 1
    return parts[:left], names[:count]


@inner
def _add_name(joints: Joints, row: int, names: Int, count: int) -> int:
    """Add the name of the wall of a stretch to a list, once, and mark it; returns its length."""
    name = joints.names[row]
    if joints.marks[name]:
        return count
    joints.marks[name] = True
    names[count] = name
    return count + 1


@compiled
def rejoin_stretches(
    loose: Int,
    broken: Int,
    pool: Pool,
    grid: Grid,
    search: Search,
    joints: Joints,
    rule: Rule,
    cells: Cells,
    least: int,
) -> tuple[Int, NewSegments]:
    """Join loose stretches (n,) with each other or with others, and refit what they make.

    Args:
        loose: Their rows.
        broken: The names of walls that some of them were of.
        pool: The stretches.
        grid: Where they are, in cells of MERGE_CELL.
        search: Is written by searches of the grid.
        joints: The walls that they are joined to; is written.
        rule: What one wall is.
        cells: The cells.
        least: Walls with fewer hits than this are left out.

    Returns:
        The names of all walls that are no more as they were, and the real parts of those that
        there are now.
    """
    loose = loose[order_of(loose)]
    others = neighbours_of(loose, pool.walls, grid, search, joints.rings, joints.marks, rule)
    count = len(loose) + len(others)
    rows, names = np.empty(count, np.int64), np.empty(count, np.int64)
    walls = Walls(np.empty((count, 4)), np.empty((count, 6)), np.empty(count, np.int64))
    for k in range(count):
        row = rows[k] = loose[k] if k < len(loose) else others[k - len(loose)]
        names[k], walls.points[k] = joints.names[row], pool.walls.points[row]
        for side in range(4):
            walls.ends[k, side] = pool.walls.ends[row, side]
        for place in range(6):
            walls.moments[k, place] = pool.walls.moments[row, place]
    roots, changed = join_stretches(walls, len(loose), names, rule, cells)
    old, touched = np.empty(len(broken) + count, np.int64), np.empty(count, np.int64)
    kept = moved = 0
    for k in range(len(broken)):
        old[k] = broken[k]
        joints.marks[broken[k]] = True
    number = len(broken)
    for k in range(count):
        if changed[k]:
            if k >= len(loose):
                number = _add_name(joints, rows[k], old, number)
            # Walls that stayed as they were keep their names.
            joints.names[rows[k]] = rows[roots[k]]
            if walls.points[k] > 0:
                names[kept] = rows[k]
                for side in range(4):
                    walls.ends[kept, side] = walls.ends[k, side]
                kept += 1
            touched[moved] = rows[k]
            moved += 1
    for k in range(number):
        joints.marks[old[k]] = False
        joints.stamps[old[k]] += 1
    tie_rings(touched[:moved], joints.names, joints.rings)
    refit = Refit(
        # They end at hits, which a little less would miss.
        1, names[:kept], walls.ends[:kept], 0.1 * PIECE, 0.0, rule.distance, least,
        joints.stamps, joints.lost,
    )  # fmt: skip
    found, _ = refit_walls(refit, cells)
    return old[:number], found


@inner
def _straight(rule: Rule) -> Rule:
    """When two stretches are on one line.

    As straight as a wall is continued, and no farther off than two views of it: stretches are
    short, and nothing overlaps that could tell where they lead.
    """
    return Rule(LONGEST_GAP, rule.bend, rule.bend, rule.distance)


@inner
def parts_of(rows: Int, rings: Int, marks: NDArray[np.bool_]) -> Int:
    """All stretches (m,) of the walls that some stretches (n,) are of, each once.

    Args:
        rows: The rows of the stretches.
        rings: (all rows,) the next stretch of the same wall, in a ring.
        marks: (all rows,) False; is written, and restored.
    """
    parts = np.empty(len(rings), np.int64)
    count = 0
    for k in range(len(rows)):
        row = rows[k]
        while not marks[row]:
            marks[row] = True
            parts[count] = row
            count += 1
            row = rings[row]
    for k in range(count):
        marks[parts[k]] = False
    return parts[:count]


@inner
def neighbours_of(
    rows: Int,
    walls: Walls,
    grid: Grid,
    search: Search,
    rings: Int,
    marks: NDArray[np.bool_],
    rule: Rule,
) -> Int:
    """All stretches of the other walls that some stretches may be of, wall by wall.

    Args:
        rows: (n,) the rows of the stretches, with all of their walls that are left.
        walls: All stretches.
        grid: Where they are, in cells of MERGE_CELL.
        search: Is written by searches of the grid.
        rings: (all rows,) the next stretch of the same wall, in a ring.
        marks: (all rows,) False; is written, and restored.
        rule: What one wall is.
    """
    straight = _straight(rule)
    parts, points = np.empty(len(rings), np.int64), walls.points
    ends, moments, found = walls.ends, walls.moments, search.found
    count = len(rows)
    for k in range(count):
        parts[k] = rows[k]
        marks[rows[k]] = True
    for turn in range(len(rows)):
        row = rows[turn]
        search.number[0] += 1
        number = search.number[0]
        size = near(grid, ends[row], LONGEST_GAP, MERGE_CELL, search.stamps, number, found)
        for k in range(size):
            other = found[k]
            # What fits at all lies within the reach of the longest gap.
            if marks[other] or points[other] == 0 or not may_fit(ends, row, other, straight):
                continue
            one, two, other_moments = ends[row], ends[other], moments[other]
            if (
                misfit(one, moments[row], two, other_moments, straight) < 1.0
                or misfit(one, moments[row], two, other_moments, rule) < 1.0
            ):
                while not marks[other]:
                    marks[other] = True
                    parts[count] = other
                    count += 1
                    other = rings[other]
    for k in range(count):
        marks[parts[k]] = False
    return parts[len(rows) : count]


@compiled
def tie_rings(rows: Int, joints: Int, rings: Int) -> None:
    """Tie the stretches of each wall into a ring.

    Args:
        rows: (n,) their rows.
        joints: (all rows,) the wall that each is of, named by one of its stretches.
        rings: (all rows,) is written.
    """
    for k in range(len(rows)):
        rings[rows[k]] = rows[k]
    for k in range(len(rows)):
        row, first = rows[k], joints[rows[k]]
        if row != first:
            rings[row], rings[first] = rings[first], row


@compiled
def join_stretches(
    walls: Walls, loose: int, joints: Int, rule: Rule, cells: Cells
) -> tuple[Int, NDArray[np.bool_]]:
    """Merge stretches that are of one wall.

    Walls that were joined before stay whole, so that what an update changes is what it touches, and
    not all that hangs together with it from stretch to stretch.

    Args:
        walls: The stretches; are written, and those gone have no points.
        loose: How many of them, the first, are of no wall yet.
        joints: (n,) the wall that each of the others is of, wall by wall.
        rule: What one wall is.
        cells: The cells.

    Returns:
        (n,) the stretch that each has become a part of; (n,) whether it is of a wall that changed.
    """
    count = len(walls.ends)
    parents, everyone = np.arange(count), np.arange(count)
    waiting = np.empty(loose + count + 1, np.int64)
    for row in range(loose):
        waiting[row] = row
    for row in range(loose + 1, count):
        if joints[row] == joints[row - 1]:
            parents[row] = parents[row - 1]
            merge(walls, parents[row], row)
    changed, alive = everyone < loose, 0
    for row in range(count):
        if walls.points[row] > 0:
            everyone[alive] = row
            alive += 1
    turn, top = 0, loose
    while turn < top:
        row = waiting[turn]
        turn += 1
        if walls.points[row] > 0:
            other = partner(walls, row, everyone[:alive], rule)
            if other >= 0:
                kept, gone = min(row, other), max(row, other)
                merge(walls, kept, gone)
                parents[gone] = kept
                changed[kept] = True
                waiting[top] = kept
                top += 1
    _bridge(walls, rule, cells, parents, changed)
    for row in range(count):
        while parents[parents[row]] != parents[row]:
            parents[row] = parents[parents[row]]
        changed[row] = changed[parents[row]]
    return parents, changed


@inner
def _bridge(
    walls: Walls, rule: Rule, cells: Cells, parents: Int, changed: NDArray[np.bool_]
) -> None:
    """Merge stretches on one line where no beam has crossed the gap, the narrowest gap first."""
    count = len(walls.ends)
    straight = _straight(rule)
    # In each pair at least one has changed, and few have.
    fresh, size, most = np.empty(count, np.int64), 0, 0
    for row in range(count):
        most += walls.points[row] > 0
        if walls.points[row] > 0 and changed[row]:
            fresh[size] = row
            size += 1
    most *= size
    pairs, lines, gaps = np.empty((most, 2), np.int64), np.empty((most, 4)), np.empty(most)
    found = 0
    for one in range(count):
        if walls.points[one] == 0:
            continue
        # Walls that have changed are the first ones, so that all of them are before the others.
        for place in range(one if changed[one] else size):
            other = place if changed[one] else fresh[place]
            if walls.points[other] > 0 and _fits(walls, one, other, straight):
                gaps[found] = _span(walls.ends[one], walls.ends[other], lines[found])
                pairs[found, 0], pairs[found, 1] = one, other
                found += 1
    order = order_of(gaps[:found])
    for place in range(found):
        k = order[place]
        one, other = pairs[k, 0], pairs[k, 1]
        while parents[one] != one:
            one = parents[one]
        while parents[other] != other:
            other = parents[other]
        if one == other or not _fits(walls, one, other, straight):
            continue
        if gaps[k] > 0.0 and is_crossed(lines[k], cells, FREE_DEPTH, 0, WALL_SINE):
            continue
        kept, gone = min(one, other), max(one, other)
        merge(walls, kept, gone)
        parents[gone] = kept
        changed[kept] = True


@inner
def _fits(walls: Walls, one: int, other: int, rule: Rule) -> bool:
    ends, moments = walls.ends, walls.moments
    if not may_fit(ends, one, other, rule):
        return False
    misses: float = misfit(ends[one], moments[one], ends[other], moments[other], rule)
    return misses < 1.0


@inner
def _span(one: Float, other: Float, line: Float) -> float:
    """Fill in the line (4,) from the end of one wall to where the next begins: its length [m]."""
    ux, uy = one[2] - one[0], one[3] - one[1]
    size = np.hypot(ux, uy)
    ahead = ((other[0] - one[2]) * ux + (other[1] - one[3]) * uy) / size
    back = ((one[0] - other[2]) * ux + (one[1] - other[3]) * uy) / size
    if ahead > back:
        line[0], line[1], line[2], line[3] = one[2], one[3], other[0], other[1]
    else:
        line[0], line[1], line[2], line[3] = other[2], other[3], one[0], one[1]
    gap: float = max(ahead, back, 0.0)
    return gap
