"""Cast beams one by one, each from its own origin, compiled; every decision exact.

Walls are sorted out in float64 with bounds on its error; where these
leave a question open, the exact predicates decide.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.predicates import (
    FILTER,
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
    LOWEST,
    ONE,
    ROOM,
    Plain,
    Stack,
    Tree,
    boxes_met,
    column_at,
    enter,
    first_lanes,
    new_stack,
    next_leaf,
    wait,
    way_of,
    whole,
)
from lrf3d.compiling import (
    LANES,
    borrower,
    by_lanes,
    choose,
    compiled,
    inner,
    record,
)
from lrf3d.geometry.lines import LARGEST_COORDINATE, TINY, Float, Int, Records

# A beam with its own origin [m], direction, and time [s].
RAY = record(**dict.fromkeys(("x", "y", "dx", "dy", "time"), float))

# Least size of an area or a slope, as a share of its terms, at which float64 is good to 6e-13.
CLEAR = 2.0**-10

# Room for the rounding error of a length of such an area and slope: less than 1.2e-12 of it.
NEARLY = 1.0 + 2.0**-38

# In place of the row of a wall where float64 leaves open which one it is.
UNDECIDED = -2

# Rays that are followed before their lengths are computed.
BLOCK = 64

# Room for the bounds of LANES walls: low ones, then high ones.
SIFTED = 2 * LANES


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
    sifted: Float  # (SIFTED,) bounds of walls of a leaf.
    stack: Stack
    met: NDArray[np.uint64]  # Which boxes below the root each meets, and
    entries: Float  # (BLOCK, LANES) how far away it enters them.


# Stands for guesses where nothing guesses.
NO_GUESSES = np.empty(0, np.int32)


@compiled
def cast_rays(
    plain_tree: Plain, limits: tuple[float, float], rays: Records, guesses: NDArray[np.int32],
    ranges: Float, hits: Int,
) -> int:  # fmt: skip
    """Fill the ranges (n,) of rays within limits, and hits (n,) unless empty, among walls.

    Guesses (n,), unless empty, are the rows of the walls that rays probably meet, or −1. A wall
    that is guessed counts if the ray meets it, and then only nearer ones are looked for. Returns
    the first ray that has too large numbers or no direction, or −1.
    """
    invalid = -1
    tree = Tree(*plain_tree)
    block = new_block(len(rays))
    for start in range(0, len(rays), BLOCK):
        stop = min(start + BLOCK, len(rays))
        for i in range(start, stop):
            fill_block(block, i - start, beam_of(rays, i), guesses[i] if len(guesses) > 0 else -1)
            invalid = i if invalid < 0 and not _is_valid(rays[i]) else invalid
        cast_block(tree, block, (start, stop), limits, ranges, hits)
    return invalid


@inner
def new_block(rays: int) -> Block:
    """A block for a number of rays, or for the first of them."""
    room = whole(min(rays, BLOCK))
    columns = np.zeros((2, 4, room))
    return Block(
        np.empty(room, np.int64), columns[0], columns[1], np.empty(room), np.empty(SIFTED),
        new_stack(), np.empty(room, np.uint64), np.empty((room, LANES)),
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
    first = tree.links[0, 0]
    children = first_lanes(max(-tree.links[0, 1], 0))
    for k in range(count):
        beam = Beam(*column_at(block.beams, k))
        way = way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
        block.met[k] = boxes_met(tree.boxes, first, way, reach, block.entries[k]) & children
    for k in range(count):
        beam = Beam(*column_at(block.beams, k))
        top = enter(tree, block.stack)
        if tree.links[0, 1] < 0:
            top = wait(first, block.met[k], block.entries[k], block.stack.waiting, 0)
        row = block.rows[k] = clear_wall(tree, beam, block.rows[k], reach, block, top)
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
def _is_valid(ray: Any) -> bool:
    """Whether a ray has a direction and no number that is too large, or is not one."""
    return bool(
        abs(ray.x) <= LARGEST_COORDINATE
        and abs(ray.y) <= LARGEST_COORDINATE
        and abs(ray.dx) <= LARGEST_COORDINATE
        and abs(ray.dy) <= LARGEST_COORDINATE
        and (abs(ray.dx) >= TINY or abs(ray.dy) >= TINY)
    )


@borrower
def counted(value: float) -> float:
    """A number, or 0 if it counts as 0."""
    return value if abs(value) >= TINY else 0.0


@borrower
def clear_wall(tree: Tree, beam: Beam, guess: int, reach: float, block: Block, top: int) -> int:
    """The row of the wall that a beam meets first up to a reach, or −1; or UNDECIDED."""
    way = way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    nearest = Nearest(-1, np.inf, reach)
    sifted = block.sifted
    if guess >= 0:
        meets, low, high = bounds(wall_at(tree.walls, guess), beam, reach)
        nearest = Nearest(guess, low, high) if meets and high < np.inf else nearest
    while top > 0:
        first, stop, top = next_leaf(tree, way, nearest.high, block.stack, top)
        for base in range(first, stop, LANES):
            met = sift(tree.columns, base, beam, nearest.high, sifted) & first_lanes(stop - base)
            left_open, nearest = _nearest_of(sifted, base, met, nearest)
            if left_open:
                return UNDECIDED
    return nearest.row


@borrower
def _nearest_of(sifted: Float, base: int, met: Any, nearest: Nearest) -> tuple[bool, Nearest]:
    """Whether float64 leaves open which wall is nearest; and the nearest of all so far.

    The walls lie from a base on; which of them count is given as bits.
    """
    left_open = False
    while met != 0:
        k = index_of(LOWEST[met])
        met &= met - ONE
        row = base + int(k)
        low = sifted[k]
        high = sifted[index_of(LANES) + k]
        taken = high < nearest.low
        left_open |= not taken and low <= nearest.high and row != nearest.row
        # Chosen without branches, which a processor could not foresee.
        nearest = Nearest(
            row if taken else nearest.row,
            low if taken else nearest.low,
            high if taken else nearest.high,
        )
    return left_open, nearest


def _bounds(wall: Wall, beam: Beam, limit: float) -> tuple[bool, float, float]:
    """Whether a beam may meet a wall up to a limit, and bounds of the distance, in float64.

    The high one is infinite where it is left open whether they meet.
    """
    px, py, qx, qy = wall
    ax = px - beam.ox
    ay = py - beam.oy
    bx = qx - beam.ox
    by = qy - beam.oy
    left = beam.dx * ay
    right = beam.dy * ax
    other_left = beam.dx * by
    other_right = beam.dy * bx
    p = left - right
    q = other_left - other_right
    doubt = (abs(left) + abs(right) + abs(other_left) + abs(other_right)) * FILTER
    least = choose(p < q, p, q)
    most = choose(p < q, q, p)
    aside = choose(least > -most, least, -most)
    ex = qx - px
    ey = qy - py
    left = ax * ey
    right = ay * ex
    other_left = beam.dx * ey
    other_right = beam.dy * ex
    area = left - right
    slope = other_left - other_right
    size = (abs(left) + abs(right)) * CLEAR - abs(area)
    steep = (abs(other_left) + abs(other_right)) * CLEAR - abs(slope)
    # Above zero where most digits of the area or of the slope cancel.
    unclear = choose(size > steep, size, steep)
    unsure = choose(unclear > aside + doubt, unclear, aside + doubt)
    t = area / slope
    low = choose(unclear < 0.0, t * (2.0 - NEARLY), 0.0)
    high = choose(unsure < 0.0, t * NEARLY, np.inf)
    return (aside <= doubt) & (low >= 0.0) & (low <= limit), low, high


bounds = inner(_bounds)
sift = by_lanes(_bounds)


@inner
def first_wall(tree: Tree, beam: Beam, nearest: Nearest, stack: Stack) -> int:
    """The row of the wall that a beam meets first, or −1, decided exactly."""
    way = way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    top = enter(tree, stack)
    while top > 0:
        start, stop, top = next_leaf(tree, way, nearest.high, stack, top)
        for row in range(start, stop):
            wall = wall_at(tree.walls, row)
            other = wall_at(tree.walls, max(nearest.row, 0))
            meets, low, high = bounds(wall, beam, nearest.high)
            if meets and high < nearest.low:
                nearest = Nearest(row, low, high)
            elif meets:
                # Of walls met at equal t the first in the world stays.
                first = nearest.row < 0 or tree.rows[row] < tree.rows[nearest.row]
                nearest = settled(beam, nearest, row, wall, other, first)
    return nearest.row


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
