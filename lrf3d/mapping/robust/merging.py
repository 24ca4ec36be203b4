"""Merging: which segments are one wall, and the wall that they become.

Two segments are one wall if the ends of the shorter one lie on the line of the longer one within
noise and a slight bend, if they overlap or nearly so, and if the laser saw both from the same side.
The merged wall is the exact fit to all points of both. A gap is bridged only if no beam crossed it.

The walls of a scan enter. Those that known walls cover are dropped: their returns are in the cells.
The others are merged with what they fit, and are to be refit.
"""

from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import Float, Int
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import (
    FREE_DEPTH,
    HIT_DEVIATIONS,
    WALL_SINE,
    Cells,
    is_crossed,
)
from lrf3d.mapping.robust.extraction import LocalWalls
from lrf3d.mapping.robust.walls import (
    Walls,
    along_of,
    end_of,
    give_back,
    marked_rows,
    near,
    put_line,
    take_row,
    unit_of,
    vector_of,
    widen_box,
)

# [share of merge_distance] Largest bend where a wall is continued: two views of a wall differ by
# the error of poses, but adjacent views share it. More merges slightly bent walls.
BEND = 0.4


class MergeRule(NamedTuple):
    """Limits [m] within which two segments are one wall."""

    length: float  # The largest gap between them along the line.
    distance: float  # The largest offset of two views of a wall, in addition to noise.
    bend: float  # The largest offset where a wall is continued, in addition to noise.
    most_explained: float  # The largest offset that noise may explain.


@compiled
def merge_walls(
    walls: Walls, new: LocalWalls, place: tuple[float, float], waiting: Int, cells: Cells,
    rule: MergeRule,
) -> tuple[Int, Int]:  # fmt: skip
    """Add the walls of a scan around its place [m], and merge those that are one.

    Waiting walls (n,), which have changed, may now merge with others, too. Returns the rows,
    rising, of walls that are new or merged, and those that were merged into them, not free yet.
    """
    queue = np.empty(len(waiting) + 2 * len(new.ends) + walls.counters[0].taken + 1, np.int64)
    marks = np.zeros(len(walls.rows), np.bool_)
    gone = np.empty(len(queue), np.int64)
    top = lost = 0
    for k in range(len(waiting)):
        if walls.fits[waiting[k]].points > 0:
            queue[top] = waiting[k]
            top += 1
    known = top
    top = _add_walls(walls, new, place, rule, queue, known)
    for k in range(known, top):
        marks[queue[k]] = True
    turn = 0
    while turn < top:
        row = queue[turn]
        turn += 1
        if walls.fits[row].points == 0:
            continue
        other = _partner(walls, row, cells, rule)
        if other < 0:
            continue
        kept = min(row, other)
        taken = max(row, other)
        merge(walls, kept, taken)
        # A new version releases its hits, so that the merged wall can claim them.
        walls.rows[taken].version += 1
        marks[kept] = True
        gone[lost] = taken
        lost += 1
        queue[top] = kept
        top += 1
    return marked_rows(walls, marks), gone[:lost]


@inner
def _add_walls(
    walls: Walls, new: LocalWalls, place: tuple[float, float], rule: MergeRule, queue: Int, top: int
) -> int:
    """Add the walls of a scan that no known walls cover, and queue their rows; returns the top."""
    known = top
    for k in range(len(new.ends)):
        row = take_row(walls)
        for side in range(4):
            walls.ends[row, side] = new.ends[k, side] + place[side % 2]
        walls.fits[row] = new.fits[k]
        walls.fits[row].x += place[0]
        walls.fits[row].y += place[1]
        # Hide it from searches until all are compared: walls of one scan do not cover each other.
        walls.fits[row].points *= -1
        if _is_covered(walls, row, rule):
            give_back(walls, row)
        else:
            queue[top] = row
            top += 1
    for k in range(known, top):
        walls.fits[queue[k]].points *= -1
        widen_box(walls, queue[k])
    return top


@inner
def _is_covered(walls: Walls, row: int, rule: MergeRule) -> bool:
    """Whether walls with at least as many points cover a wall of a scan, but for a cell.

    The number of points of a wall that is not in the map yet is negative.
    """
    own = walls.ends[row]
    ux, uy, length = unit_of(own)
    x, y = end_of(own, 0)
    steps = min(int(length / CELL) + 1, 1000)
    covered = np.zeros(steps, np.bool_)
    for k in range(near(walls, own, rule.distance + rule.most_explained)):
        other = walls.found[k]
        if walls.fits[other].points < -walls.fits[row].points:
            continue
        ends = walls.ends[other]
        first, last = along_of(ends, x, y, ux, uy)
        first = first / length
        last = last / length
        if last <= 0.0 or first >= 1.0:
            continue
        if misfit(own, walls.fits[row], ends, walls.fits[other], rule) < 1.0:
            covered[int(max(first, 0.0) * steps + 0.5) : int(min(last, 1.0) * steps + 0.5)] = True
    return bool((steps - covered.sum()) * length <= CELL * steps)


@inner
def _partner(walls: Walls, row: int, cells: Cells, rule: MergeRule) -> int:
    """The wall to merge a row with: the best fit, or the nearest continuation; −1 if none."""
    # [m] Longest gap that is bridged if no beam crossed it: a longer one may hide a recess.
    longest_gap = 3.0
    # Without an overlap nothing shows where two walls lead, so a continuation must be straight and
    # no farther off than two views of one wall.
    straight = MergeRule(longest_gap, rule.bend, rule.bend, rule.distance)
    best = -1
    least = 1.0
    second = -1
    narrowest = longest_gap
    line = np.empty(4)
    # [beams] Beams that may cross a gap of at most merge_length: a refit needs more to cut a wall
    # there, so that merging and cutting agree.
    spare_beams = 20
    for k in range(near(walls, walls.ends[row], longest_gap + rule.distance)):
        other = walls.found[k]
        if other == row:
            continue
        one = walls.ends[row]
        two = walls.ends[other]
        fit = walls.fits[row]
        its = walls.fits[other]
        value = misfit(one, fit, two, its, rule)
        if value < least or (value == least and other < best):
            if _span(one, two, line) <= 0.0 or not is_crossed(
                line, cells, FREE_DEPTH, spare_beams, WALL_SINE
            ):
                best = other
                least = value
        elif best < 0 and fit.shown and its.shown and misfit(one, fit, two, its, straight) < 1.0:
            gap = _span(one, two, line)
            if gap < narrowest and not is_crossed(line, cells, FREE_DEPTH, 0, WALL_SINE):
                second = other
                narrowest = gap
    return best if best >= 0 else second


@borrower
def _span(one: Float, other: Float, line: Float) -> float:
    """Fill in the line (4,) from the end of one wall to the start of the next; its length [m]."""
    ux, uy = vector_of(one)
    size = np.hypot(ux, uy)
    x, y = end_of(one, 1)
    u, v = end_of(other, 1)
    ahead = along_of(other, x, y, ux, uy)[0] / size
    back = along_of(one, u, v, ux, uy)[0] / size
    if ahead > back:
        put_line(line, x, y, *end_of(other, 0))
    else:
        put_line(line, u, v, *end_of(one, 0))
    gap: float = max(ahead, back, 0.0)
    return gap


@compiled
def misfit(ends: Float, moments: Any, other_ends: Float, other: Any, rule: MergeRule) -> float:
    """Offset of the shorter of two segments from the line of the longer; up to 1 is allowed."""
    x, y = vector_of(ends)
    u, v = vector_of(other_ends)
    size = np.sqrt(x * x + y * y)
    length = np.sqrt(u * u + v * v)
    # [cosine] Largest angle between two segments of one wall: far more than noise, the offsets of
    # the ends decide.
    same_direction = 0.5
    # Walls run with the laser on their left: opposite directions are the two faces of a wall.
    if x * u + y * v <= same_direction * size * length:
        return np.inf
    if size > length:
        ends, other_ends = other_ends, ends
        moments, other = other, moments
        x, y, size, u, v, length = u, v, length, x, y, size
    x = x / size
    y = y / size
    u = u / length
    v = v / length
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
        dx = ends[k] - other.x
        dy = ends[k + 1] - other.y
        along = dx * u + dy * v
        own = (ends[k] - moments.x) * x + (ends[k + 1] - moments.y) * y
        variance = 1.0 / moments.weight + own * own / own_spread
        variance += 1.0 / other.weight + along * along / spread
        allowed = apart + min(HIT_DEVIATIONS * np.sqrt(variance), rule.most_explained)
        worst = max(worst, abs(u * dy - v * dx) / allowed)
    return worst


@compiled
def merge(walls: Walls, kept: int, gone: int) -> None:
    """Make the first row the exact fit to the points of both, over the extent of both."""
    ends = walls.ends
    own = walls.fits[kept]
    its = walls.fits[gone]
    total = own.weight + its.weight
    share = its.weight / total
    dx = its.x - own.x
    dy = its.y - own.y
    spread = own.weight * share
    own.weight = total
    own.x += share * dx
    own.y += share * dy
    own.xx += its.xx + spread * dx * dx
    own.xy += its.xy + spread * dx * dy
    own.yy += its.yy + spread * dy * dy
    angle = 0.5 * np.arctan2(2.0 * own.xy, own.xx - own.yy)
    u = np.cos(angle)
    v = np.sin(angle)
    dx, dy = vector_of(ends[kept])
    if u * dx + v * dy < 0.0:
        u = -u
        v = -v
    x = own.x
    y = own.y
    low = np.inf
    high = -np.inf
    for row in (kept, gone):
        first, last = along_of(ends[row], x, y, u, v)
        low = min(low, first, last)
        high = max(high, first, last)
    put_line(ends[kept], x + low * u, y + low * v, x + high * u, y + high * v)
    own.points += its.points
    its.points = 0
    widen_box(walls, kept)
