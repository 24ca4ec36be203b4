"""Map refinement: walls are checked against the beams of all scans and corrected by them.

Enter the walls that merging left, and the beams; leave walls cut where beams went through them,
split where the points bend, without second copies, continued across gaps that no beam crossed,
grouped into objects, with closed corners.
"""

from dataclasses import replace

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.constants import (
    CORNER_REACH,
    CORNER_SINE,
    CORNER_TRIM,
    FOLLOWED,
    FREE_DEPTH,
    LONGEST_GAP,
    PIECE,
    ROUNDS,
    SHORT_WALL,
    VIOLATION_WEIGHT,
)
from lrf3d.mapping.robust.evidence import gather_evidence, is_crossed
from lrf3d.mapping.robust.grid import order_of, pairs_within, with_more_room
from lrf3d.mapping.robust.object_association import associate_objects
from lrf3d.mapping.robust.refitting import refit_segments
from lrf3d.mapping.robust.wall_store import WallStore
from lrf3d.mapping.robust.walls import Rule, Walls, merge, misfit
from lrf3d.mapping.segment_table import SegmentTable


def refine_map(
    table: SegmentTable, beams: Beams, noise: RangeNoise, rule: Rule, least: int
) -> SegmentTable:
    """The walls of a table, corrected by the beams that saw them.

    Args:
        table: Walls.
        beams: The beams of all scans.
        noise: Their noise.
        rule: What one wall is.
        least: Walls with fewer hits than this are left out.
    """
    for turn in range(ROUNDS):
        # Scans show parts of walls; what single beams hit beyond them counts in the first round.
        reach = 0.0 if turn else FOLLOWED
        if turn:
            table = _bridged(_merged(table, rule), rule, beams, noise)
        if not len(table):
            return table
        units = directions(table.ends)
        table = replace(table, ends=table.ends + np.hstack([-reach * units, reach * units]))
        pieces = np.maximum(np.ceil(lengths(table.ends) / PIECE).astype(np.int64), 1)
        first = np.concatenate([[0], np.cumsum(pieces)])
        counts, sums = gather_evidence(table.ends, first, beams, rule.distance, noise, reach)
        ends, moments, labels = refit_segments(table.ends, first, counts, sums)
        hits, violations = labels[:, 1], labels[:, 2]
        needed = np.where(lengths(ends) < SHORT_WALL, 2 * least, least)
        real = (hits >= needed) & (VIOLATION_WEIGHT * violations <= hits)
        table = SegmentTable(ends, moments, hits, np.arange(len(ends))).take(np.flatnonzero(real))
    table = replace(table, unions=associate_objects(table.ends, beams, noise))
    close_corners(table.ends, table.unions)
    return table


def _merged(table: SegmentTable, rule: Rule) -> SegmentTable:
    """The walls of a table, merged once more."""
    store = WallStore(rule)
    store.add(table.ends, table.moments, table.points, (0.0, 0.0))
    return store.table()


def _bridged(table: SegmentTable, rule: Rule, beams: Beams, noise: RangeNoise) -> SegmentTable:
    """The walls of a table, with stretches of one wall made one."""
    walls = Walls(table.ends, table.moments, table.points.copy())
    bridge_walls(walls, rule, beams, noise)
    return SegmentTable(*walls, table.unions).take(np.flatnonzero(walls.points))


@compiled
def bridge_walls(
    walls: Walls, rule: Rule, beams: Beams, noise: RangeNoise
) -> None:  # pragma: no cover
    """Merge walls on one line where no beam has crossed the gap; those gone have no points.

    Args:
        walls: The walls; are written.
        rule: What one wall is.
        beams: The beams.
        noise: The noise of their ranges.
    """
    pairs = pairs_within(walls.ends, LONGEST_GAP)
    # As straight as a wall is continued, and no farther off than two views of it: stretches are
    # short, and nothing overlaps that could tell where they lead.
    straight = Rule(LONGEST_GAP, rule.bend, rule.bend, rule.distance)
    lines = np.empty((len(pairs), 4))
    gaps = np.full(len(pairs), np.inf)
    for k in range(len(pairs)):
        one, other = pairs[k, 0], pairs[k, 1]
        if _fits(walls, one, other, straight):
            gaps[k] = _span(walls.ends[one], walls.ends[other], lines[k])
    parents = np.arange(len(walls.ends))
    order = order_of(gaps)
    for place in range(len(order)):
        k = order[place]
        if gaps[k] == np.inf:
            break
        one, other = pairs[k, 0], pairs[k, 1]
        while parents[one] != one:
            one = parents[one]
        while parents[other] != other:
            other = parents[other]
        if one == other or not _fits(walls, one, other, straight):
            continue
        if gaps[k] > 0.0 and is_crossed(lines[k], beams, noise, FREE_DEPTH, 0):
            continue
        kept, gone = min(one, other), max(one, other)
        merge(walls, kept, gone)
        parents[gone] = kept


@inner
def _fits(walls: Walls, one: int, other: int, rule: Rule) -> bool:  # pragma: no cover
    ends, moments = walls.ends, walls.moments
    misses: float = misfit(ends[one], moments[one], ends[other], moments[other], rule)
    return misses < 1.0


@inner
def _span(one: Float, other: Float, line: Float) -> float:  # pragma: no cover
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


@compiled
def close_corners(ends: Float, objects: Int) -> None:  # pragma: no cover
    """Move the ends of walls (m, 4) of one object that meet to the crossing of their lines."""
    count = len(ends)
    # First the one end of all walls, then the other.
    xs, ys = np.empty(2 * count), np.empty(2 * count)
    for place in range(2 * count):
        wall, side = place % count, place // count
        xs[place], ys[place] = ends[wall, 2 * side], ends[wall, 2 * side + 1]
    order = order_of(xs)
    pairs = np.empty((64, 2), np.int64)
    found = 0
    for place in range(2 * count):
        one = order[place]
        after = place + 1
        while after < 2 * count:
            other = order[after]
            after += 1
            if xs[other] - xs[one] > 2.0 * CORNER_REACH:
                break
            if objects[one % count] != objects[other % count]:
                continue
            if one % count == other % count or abs(ys[other] - ys[one]) > 2.0 * CORNER_REACH:
                continue
            if found == len(pairs):
                pairs = with_more_room(pairs)
            pairs[found, 0], pairs[found, 1] = one, other
            found += 1
    steps = np.empty(found)
    for k in range(found):
        one, other = pairs[k, 0], pairs[k, 1]
        steps[k] = (xs[other] - xs[one]) ** 2 + (ys[other] - ys[one]) ** 2
    taken = np.zeros(2 * count, np.bool_)
    # The nearest ends go first, and each meets but one other.
    order = order_of(steps)
    for place in range(found):
        one, other = pairs[order[place], 0], pairs[order[place], 1]
        if not (taken[one] or taken[other]) and _close(
            ends, one % count, one // count, other % count, other // count
        ):
            taken[one] = taken[other] = True


@inner
def _close(ends: Float, one: int, side: int, other: int, turned: int) -> bool:  # pragma: no cover
    """Move an end of each of two walls to where their lines cross, if that is near to both."""
    ux, uy = ends[one, 2] - ends[one, 0], ends[one, 3] - ends[one, 1]
    vx, vy = ends[other, 2] - ends[other, 0], ends[other, 3] - ends[other, 1]
    own, across = np.hypot(ux, uy), np.hypot(vx, vy)
    turn = ux * vy - uy * vx
    if abs(turn) < CORNER_SINE * own * across:
        return False
    dx = ends[other, 2 * turned] - ends[one, 2 * side]
    dy = ends[other, 2 * turned + 1] - ends[one, 2 * side + 1]
    ahead, back = (dx * vy - dy * vx) / turn, (dx * uy - dy * ux) / turn
    if abs(ahead) * own > CORNER_REACH or abs(back) * across > CORNER_REACH:
        return False
    x, y = ends[one, 2 * side] + ahead * ux, ends[one, 2 * side + 1] + ahead * uy
    # The first end (side 0) is taken back when it moves ahead, the second when it moves back.
    if (1.0 - 2.0 * side) * ahead * own > min(CORNER_TRIM, 0.5 * own):
        return False
    if (1.0 - 2.0 * turned) * back * across > min(CORNER_TRIM, 0.5 * across):
        return False
    ends[one, 2 * side], ends[one, 2 * side + 1] = x, y
    ends[other, 2 * turned], ends[other, 2 * turned + 1] = x, y
    return True
