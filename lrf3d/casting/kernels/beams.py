"""Cast beams one by one, each from its own origin, compiled; every decision exact.

Walls are sorted out in float64 with bounds on its error; where these
leave a question open, the exact predicates decide.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.predicates import (
    FILTER,
    LANES,
    Beam,
    Wall,
    area_sign,
    between,
    compare,
    compare_limit,
    index_of,
    length,
    meets_in_line,
    meets_seen,
    plain_length,
    wall_at,
)
from lrf3d.casting.kernels.tree import (
    ROOM,
    SMALL,
    Plain,
    Stack,
    Tree,
    Way,
    column_at,
    enter,
    new_stack,
    next_leaf,
    whole,
)
from lrf3d.compiling import borrower, compiled, inner, record
from lrf3d.geometry.lines import Float, Int, Records

# A beam with its own origin [m], direction, and time [s].
RAY = record(**dict.fromkeys(("x", "y", "dx", "dy", "time"), float))

# Bound on the relative rounding error of a length, in addition to cancellation.
LENGTH_SLACK = 16.0 * 2.0**-53

# Relative error of a length up to which the sign of its float64 value is trusted.
CLEAR_LENGTH = 1e-6

# Verdicts about a wall: not met before the nearest so far, met, or left open by float64.
MISSED = 0
TAKEN = 1
OPEN = 2

# In place of the row of a wall where float64 leaves open which one it is.
UNDECIDED = -2

# Rays that are followed before their lengths are computed.
BLOCK = 64

# Walls of a leaf that are sifted together, in whole vectors.
SIFTED = (SMALL + LANES - 1) // LANES * LANES

# Limit [m] in place of infinity, which times a slope of zero were no number.
FARTHEST = 1e100


class Nearest(NamedTuple):
    """The wall that a beam meets first so far: its row, or −1, and bounds of its distance [m]."""

    row: int
    low: float
    high: float


class Block(NamedTuple):
    """Buffers for BLOCK rays, whose lengths are computed in vectors."""

    rows: Int  # The wall that each meets, −1 for none, or UNDECIDED.
    beams: Float  # (4, BLOCK) columns of the beams.
    walls: Float  # (4, BLOCK) columns of those walls.
    lengths: Float  # t, not a number where float64 falls short.
    sifted: Float  # (SIFTED,) room for the walls of a leaf.


# Stands for guesses where nothing guesses.
NO_GUESSES = np.empty(0, np.int32)


@compiled
def cast_rays(
    plain_tree: Plain, limits: tuple[float, float], rays: Records, guesses: NDArray[np.int32],
    ranges: Float, hits: Int,
) -> None:  # fmt: skip
    """Fill the ranges (n,) of rays within limits, and hits (n,) unless empty, among walls.

    Guesses (n,), unless empty, are the rows of the walls that rays probably meet, or −1. A wall
    that is guessed counts if the ray meets it, and then only nearer ones are looked for.
    """
    tree = Tree(*plain_tree)
    range_min, range_max = limits
    stack = new_stack()
    # Walls a little beyond the range may be met.
    reach = range_max * ROOM * ROOM
    names = tree.rows
    rows = np.empty(BLOCK, np.int64)
    lengths = np.empty(BLOCK)
    columns = np.zeros((2, 4, BLOCK))
    block = Block(rows, columns[0], columns[1], lengths, np.empty(SIFTED))
    for start in range(0, len(rays), BLOCK):
        count = min(BLOCK, len(rays) - start)
        part = slice(start, start + count)
        _follow(tree, rays[part], guesses[part], reach, block, stack)
        for k in range(count):
            i = start + k
            row = rows[k]
            t = lengths[k]
            if row == UNDECIDED:
                row = first_wall(tree, beam_of(rays, i), Nearest(-1, np.inf, reach), stack)
            if row >= 0 and not (rows[k] >= 0 and range_min * ROOM < t < range_max / ROOM):
                beam = beam_of(rays, i)
                wall = wall_at(tree.walls, row)
                t = within(length_of(beam, wall), range_min, range_max, beam, wall)
            ranges[i] = t if row >= 0 else np.inf
            if len(hits) > 0:
                hits[i] = names[row] if math.isfinite(ranges[i]) else -1


@borrower
def _follow(
    tree: Tree, rays: Records, guesses: NDArray[np.int32], reach: float, block: Block, stack: Stack
) -> None:
    """Find the rows of the walls that rays meet, and their lengths, where float64 shows them."""
    beams = block.beams
    walls = block.walls
    before = -1
    row = -1
    for i in range(len(rays)):
        beam = beam_of(rays, i)
        # Without guesses the wall of the two beams before is often the one.
        guess = guesses[i] if len(guesses) > 0 else row if row == before else -1
        before = row
        row = block.rows[i] = clear_wall(tree, beam, guess, reach, block.sifted, stack)
        if row >= 0:
            beams[0, i], beams[1, i], beams[2, i], beams[3, i] = beam
            walls[0, i], walls[1, i], walls[2, i], walls[3, i] = wall_at(tree.walls, row)
    for k in range(whole(len(rays))):
        ox, oy, dx, dy = column_at(beams, k)
        t, good = plain_length(Beam(ox, oy, dx, dy), column_at(walls, k))
        block.lengths[k] = t[0] if good else np.nan


@borrower
def beam_of(rays: Records, i: int) -> Beam:
    """The beam of a ray."""
    ray = rays[i]
    return Beam(ray.x, ray.y, ray.dx, ray.dy)


@borrower
def clear_wall(
    tree: Tree, beam: Beam, guess: int, reach: float, sifted: Float, stack: Stack
) -> int:
    """The row of the wall that a beam meets first up to a reach, or −1; or UNDECIDED."""
    way = Way(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    nearest = Nearest(-1, np.inf, reach)
    if guess >= 0:
        verdict, low, high = judged(wall_at(tree.walls, guess), beam, nearest)
        if verdict == OPEN:
            return UNDECIDED
        nearest = Nearest(guess, low, high) if verdict == TAKEN else nearest
    top = enter(tree, stack)
    while top > 0:
        first, stop, top = next_leaf(tree, way, nearest.high, stack, top)
        sift(tree.columns, first, stop, beam, nearest.high, sifted)
        for row in range(first, stop):
            if sifted[row - first] > 0.0:
                continue
            verdict, low, high = judged(wall_at(tree.walls, row), beam, nearest)
            if verdict == TAKEN:
                nearest = Nearest(row, low, high)
            elif verdict == OPEN and row != nearest.row:
                return UNDECIDED
    return nearest.row


@borrower
def sift(columns: Float, first: int, stop: int, beam: Beam, limit: float, sifted: Float) -> None:
    """Sift the walls of a leaf: what is above zero shows that one is not met up to a limit [m].

    One loop without branches, with the bounds of `judged`.
    """
    ox, oy, dx, dy = beam
    limit = min(limit, FARTHEST)
    for k in range(whole(stop - first)):
        px, py, qx, qy = column_at(columns, index_of(first) + k)
        ax = px - ox
        ay = py - oy
        bx = qx - ox
        by = qy - oy
        ex = qx - px
        ey = qy - py
        left = dx * ay
        right = dy * ax
        other_left = dx * by
        other_right = dy * bx
        p = left - right
        q = other_left - other_right
        doubt = FILTER * (abs(left) + abs(right) + abs(other_left) + abs(other_right))
        low, high = (p, q) if p < q else (q, p)
        aside = (low if low > -high else -high) - doubt
        left = ax * ey
        right = ay * ex
        other_left = dx * ey
        other_right = dy * ex
        area = left - right
        slope = other_left - other_right
        size = abs(left) + abs(right)
        steep = abs(other_left) + abs(other_right)
        ahead = area if slope > 0.0 else -area
        beyond = ahead - limit * abs(slope)
        away = (beyond if beyond > -ahead else -ahead) - 2.0 * FILTER * (size + limit * steep)
        sifted[k] = aside if aside > away else away


@inner
def first_wall(tree: Tree, beam: Beam, nearest: Nearest, stack: Stack) -> int:
    """The row of the wall that a beam meets first, or −1, decided exactly."""
    way = Way(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    top = enter(tree, stack)
    while top > 0:
        start, stop, top = next_leaf(tree, way, nearest.high, stack, top)
        for row in range(start, stop):
            wall = wall_at(tree.walls, row)
            other = wall_at(tree.walls, max(nearest.row, 0))
            verdict, low, high = judged(wall, beam, nearest)
            if verdict == TAKEN:
                nearest = Nearest(row, low, high)
            elif verdict == OPEN:
                # Of walls met at equal t the first in the world stays.
                first = nearest.row < 0 or tree.rows[row] < tree.rows[nearest.row]
                nearest = settled(beam, nearest, row, wall, other, first)
    return nearest.row


@borrower
def judged(wall: Wall, beam: Beam, nearest: Nearest) -> tuple[int, float, float]:
    """Whether a wall is met before the nearest so far, in float64, and at which distances."""
    ax = wall.px - beam.ox
    ay = wall.py - beam.oy
    bx = wall.qx - beam.ox
    by = wall.qy - beam.oy
    left = beam.dx * ay
    right = beam.dy * ax
    other_left = beam.dx * by
    other_right = beam.dy * bx
    p = left - right
    q = other_left - other_right
    doubt = FILTER * (abs(left) + abs(right) + abs(other_left) + abs(other_right))
    if min(p, q) > doubt or max(p, q) < -doubt:
        return MISSED, 0.0, 0.0
    ex = wall.qx - wall.px
    ey = wall.qy - wall.py
    left = ax * ey
    right = ay * ex
    other_left = beam.dx * ey
    other_right = beam.dy * ex
    area = left - right
    slope = other_left - other_right
    size = abs(left) + abs(right)
    steep = abs(other_left) + abs(other_right)
    t = area / slope
    slack = LENGTH_SLACK + 2.0 * FILTER * (size / abs(area) + steep / abs(slope))
    # Not a number where the area or the slope is zero.
    if not slack < CLEAR_LENGTH:
        return OPEN, 0.0, 0.0
    low = t * (1.0 - slack)
    high = t * (1.0 + slack)
    if t < 0.0 or low > nearest.high:
        return MISSED, low, high
    sure = min(abs(p), abs(q)) > doubt and high < nearest.low
    return (TAKEN if sure else OPEN), low, high


@inner
def settled(
    beam: Beam, nearest: Nearest, row: int, wall: Wall, other: Wall, first: bool
) -> Nearest:
    """The nearest, of a wall that float64 leaves open and the other, nearest so far; exactly.

    Of walls met at equal t the new one is taken if it comes first.
    """
    area = area_sign(beam.ox, beam.oy, wall)
    if area != 0:
        met = meets_seen(area, beam, wall)
    else:
        met = between(beam.ox, beam.oy, wall) or meets_in_line(beam, wall)
    if not met:
        return nearest
    if nearest.row >= 0:
        order = compare(beam, wall, other)
        if order > 0 or (order == 0 and not first):
            return nearest
    t = length_of(beam, wall)
    return Nearest(row, t / ROOM, t * ROOM) if t <= nearest.high else nearest


@inner
def within(t: float, range_min: float, range_max: float, beam: Beam, wall: Wall) -> float:
    """The rounded t of a wall within the limits, +inf above and −inf below, decided exactly."""
    if range_min * ROOM < t < range_max / ROOM:
        return t
    if t >= range_max / ROOM:
        if compare_limit(range_max, beam, wall) > 0:
            return np.inf
        return min(t, range_max)
    if compare_limit(range_min, beam, wall) < 0:
        return -np.inf
    return max(t, range_min)


@inner
def length_of(beam: Beam, wall: Wall) -> float:
    """The t of a wall that the beam meets, to within half a unit in its last place."""
    t, good = plain_length(beam, wall)
    return t[0] if good else length(beam, wall)
