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
    Tree,
    column_at,
    enter,
    new_stack,
    next_leaf,
    way_of,
    whole,
)
from lrf3d.compiling import borrower, compiled, inner, record
from lrf3d.geometry.lines import TINY, Float, Int, Records

# A beam with its own origin [m], direction, and time [s].
RAY = record(**dict.fromkeys(("x", "y", "dx", "dy", "time"), float))

# Least size of an area or a slope, as a share of its terms, at which float64 is good to 6e-13.
CLEAR = 2.0**-10

# Room for the rounding error of a length of such an area and slope: less than 1.2e-12 of it.
NEARLY = 1.0 + 2.0**-38

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


class Nearest(NamedTuple):
    """The wall that a beam meets first so far: its row, or −1, and bounds of its distance [m]."""

    row: int
    low: float
    high: float


class Block(NamedTuple):
    """Buffers for BLOCK rays, whose lengths are computed in vectors."""

    rows: Int  # The wall that each probably meets, or −1; then the one that it meets, or UNDECIDED.
    beams: Float  # (4, BLOCK) columns of the beams.
    walls: Float  # (4, BLOCK) columns of those walls.
    lengths: Float  # t, not a number where float64 falls short.
    sifted: Float  # (2 SIFTED,) bounds of the walls of a leaf.
    stack: Records


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
    block = new_block(len(rays))
    for start in range(0, len(rays), BLOCK):
        stop = min(start + BLOCK, len(rays))
        for i in range(start, stop):
            fill_block(block, i - start, beam_of(rays, i), guesses[i] if len(guesses) > 0 else -1)
        cast_block(tree, block, (start, stop), limits, ranges, hits)


@inner
def new_block(rays: int) -> Block:
    """A block for a number of rays, or for the first of them."""
    room = whole(min(rays, BLOCK))
    columns = np.zeros((2, 4, room))
    return Block(
        np.empty(room, np.int64), columns[0], columns[1], np.empty(room), np.empty(2 * SIFTED),
        new_stack(),
    )  # fmt: skip


@borrower
def fill_block(block: Block, k: int, beam: Beam, guess: int) -> None:
    """Put a beam into a block, with the row of the wall that it probably meets, or −1."""
    block.rows[k] = guess
    block.beams[0, k], block.beams[1, k], block.beams[2, k], block.beams[3, k] = beam


@inner
def cast_block(
    tree: Tree, block: Block, part: tuple[int, int], limits: tuple[float, float], ranges: Float,
    hits: Int,
) -> None:  # fmt: skip
    """Fill a part of the ranges, and of the hits unless empty, of the rays in a block."""
    start, stop = part
    range_min, range_max = limits
    # Walls a little beyond the range may be met.
    reach = range_max * ROOM * ROOM
    rows = block.rows
    lengths = block.lengths
    _follow(tree, block, stop - start, reach)
    for k in range(stop - start):
        row = rows[k]
        t = lengths[k]
        beam = Beam(*column_at(block.beams, k))
        if row == UNDECIDED:
            row = first_wall(tree, beam, Nearest(-1, np.inf, reach), block.stack)
        if row >= 0 and not (rows[k] >= 0 and range_min * ROOM < t < range_max / ROOM):
            wall = wall_at(tree.walls, row)
            t = within(length_of(beam, wall), range_min, range_max, beam, wall)
        ranges[start + k] = t if row >= 0 else np.inf
        if len(hits) > 0:
            hits[start + k] = tree.rows[row] if row >= 0 and math.isfinite(t) else -1


@borrower
def _follow(tree: Tree, block: Block, count: int, reach: float) -> None:
    """Find the rows of the walls that rays meet, and their lengths, where float64 shows them."""
    for k in range(count):
        beam = Beam(*column_at(block.beams, k))
        row = block.rows[k] = clear_wall(tree, beam, block.rows[k], reach, block)
        for axis in range(4 if row >= 0 else 0):
            block.walls[axis, k] = tree.columns[axis, row]
    for k in range(whole(count)):
        t, good = plain_length(Beam(*column_at(block.beams, k)), column_at(block.walls, k))
        block.lengths[k] = t[0] if good else np.nan


@borrower
def beam_of(rays: Records, i: int) -> Beam:
    """The beam of a ray, in which what counts as 0 is 0."""
    ray = rays[i]
    return Beam(counted(ray.x), counted(ray.y), counted(ray.dx), counted(ray.dy))


@borrower
def counted(value: float) -> float:
    """A number, or 0 if it counts as 0."""
    return value if abs(value) >= TINY else 0.0


@borrower
def clear_wall(tree: Tree, beam: Beam, guess: int, reach: float, block: Block) -> int:
    """The row of the wall that a beam meets first up to a reach, or −1; or UNDECIDED."""
    way = way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    nearest = Nearest(-1, np.inf, reach)
    if guess >= 0:
        low, high = bounds(wall_at(tree.walls, guess), beam)
        nearest = Nearest(guess, low, high) if low <= reach and high < np.inf else nearest
    top = enter(tree, block.stack)
    while top > 0:
        first, stop, top = next_leaf(tree, way, nearest.high, block.stack, top)
        sift(tree.columns, first, stop, beam, block.sifted)
        for row in range(first, stop):
            if block.sifted[row - first] > nearest.high:
                continue
            high = block.sifted[SIFTED + row - first]
            if high < nearest.low:
                nearest = Nearest(row, block.sifted[row - first], high)
            elif row != nearest.row:
                return UNDECIDED
    return nearest.row


@borrower
def sift(columns: Float, first: int, stop: int, beam: Beam, sifted: Float) -> None:
    """Bounds of the distances at which a beam meets the walls of a leaf: low ones, then high ones.

    One loop without branches.
    """
    for k in range(whole(stop - first)):
        low, high = bounds(column_at(columns, index_of(first) + k), beam)
        sifted[k] = low
        sifted[index_of(SIFTED) + k] = high


@borrower
def bounds(wall: Wall, beam: Beam) -> tuple[float, float]:
    """Bounds of the distance at which a beam meets a wall, as float64 shows them.

    The low one is infinite where it misses the wall; the high one where that is left open.
    """
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
    least, most = (p, q) if p < q else (q, p)
    aside = least if least > -most else -most
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
    # Above zero where most digits of the area or of the slope cancel.
    unclear = max(CLEAR * size - abs(area), CLEAR * steep - abs(slope))
    t = area / slope
    low = t * (2.0 - NEARLY) if unclear < 0.0 else 0.0
    low = low if low >= 0.0 else np.inf
    low = low if aside <= doubt else np.inf
    return low, t * NEARLY if max(unclear, aside + doubt) < 0.0 else np.inf


@inner
def first_wall(tree: Tree, beam: Beam, nearest: Nearest, stack: Records) -> int:
    """The row of the wall that a beam meets first, or −1, decided exactly."""
    way = way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
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
    low, high = bounds(wall, beam)
    if low == np.inf or low > nearest.high:
        return MISSED, low, high
    return (TAKEN if high < nearest.low else OPEN), low, high


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
