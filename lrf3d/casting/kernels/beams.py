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
    Beam,
    Wall,
    area_sign,
    between,
    compare,
    compare_limit,
    length,
    meets_in_line,
    meets_seen,
    plain_length,
    wall_at,
)
from lrf3d.casting.kernels.tree import BOX, ROOM, STACK, Plain, Tree, Way, enter, next_leaf
from lrf3d.compiling import borrower, compiled, inner, record
from lrf3d.geometry import Float, Int, Records

RAY = record(**dict.fromkeys(("x", "y", "dx", "dy", "time"), float))
"""A beam with its own origin [m], direction, and time [s]."""

LENGTH_SLACK = 16.0 * 2.0**-53
"""Bound on the relative rounding error of a length, in addition to cancellation."""

CLEAR_LENGTH = 1e-6
"""Relative error of a length up to which the sign of its float64 value is trusted."""

MISSED, TAKEN, OPEN = 0, 1, 2
"""Verdicts about a wall: not met before the nearest so far, met, or left open by float64."""


class Nearest(NamedTuple):
    """The wall that a beam meets first so far: its row, or −1, and bounds of its distance [m]."""

    row: int
    low: float
    high: float


class Place(NamedTuple):
    """A place on the way through a tree: the boxes that wait, and the rest of a leaf."""

    top: int
    row: int
    stop: int


NO_GUESSES = np.empty(0, np.int32)
"""In place of guesses, where there are none."""


@compiled
def cast_rays(
    plain_tree: Plain, limits: tuple[float, float], rays: Records, guesses: NDArray[np.int32],
    ranges: Float, hits: Int,
) -> None:  # fmt: skip
    """Fill the ranges (n,) of rays within limits, and hits (n,) unless empty, among walls.

    Guesses (n,), unless empty, are the rows of the walls that rays probably meet, or −1. A wall
    that is guessed counts if the ray meets it, and then only nearer ones are looked for.
    """
    tree, (range_min, range_max) = Tree(*plain_tree), limits
    waiting, row = np.empty(STACK, BOX), -1
    for i in range(len(rays)):
        beam = beam_of(rays, i)
        # Walls a little beyond the range may be met.
        nearest = Nearest(-1, np.inf, range_max * ROOM * ROOM)
        # Without a guess the wall of the beam before is often the one.
        row = guesses[i] if len(guesses) > 0 and guesses[i] >= 0 else row
        nearest = proposed(tree, beam, row, nearest) if row >= 0 else nearest
        row = first_wall(tree, beam, nearest, waiting).row
        ranges[i] = np.inf
        if row >= 0:
            wall = wall_at(tree.walls, row)
            ranges[i] = within(length_of(beam, wall), range_min, range_max, beam, wall)
        if len(hits) > 0:
            hits[i] = tree.rows[row] if math.isfinite(ranges[i]) else -1


@inner
def beam_of(rays: Records, i: int) -> Beam:
    """The beam of a ray."""
    ray = rays[i]
    return Beam(ray.x, ray.y, ray.dx, ray.dy)


@inner
def first_wall(tree: Tree, beam: Beam, nearest: Nearest, waiting: Records) -> Nearest:
    """The wall that a beam meets first, if it is not the nearest one so far."""
    place = Place(enter(tree, waiting), 0, 0)
    while True:
        place, nearest = search(tree, beam, nearest, waiting, place)
        if place.row >= place.stop:
            return nearest
        # Of walls met at equal t the first in the world stays.
        first = nearest.row < 0 or tree.rows[place.row] < tree.rows[nearest.row]
        wall, other = wall_at(tree.walls, place.row), wall_at(tree.walls, max(nearest.row, 0))
        nearest = settled(beam, nearest, place.row, wall, other, first)
        place = Place(place.top, place.row + 1, place.stop)


@borrower
def search(
    tree: Tree, beam: Beam, nearest: Nearest, waiting: Records, place: Place
) -> tuple[Place, Nearest]:
    """Search on from a place in the tree up to the next wall that float64 leaves open.

    Without one the row comes back as that behind a leaf.
    """
    walls, way = tree.walls, Way(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
    top, row, stop = place
    while True:
        while row < stop:
            verdict, least, most = judged(wall_at(walls, row), beam, nearest)
            if verdict == TAKEN:
                nearest = Nearest(row, least, most)
            elif verdict == OPEN and row != nearest.row:
                return Place(top, row, stop), nearest
            row += 1
        if top == 0:
            return Place(0, row, row), nearest
        row, stop, top = next_leaf(tree, way, nearest.high, waiting, top)


@inner
def proposed(tree: Tree, beam: Beam, row: int, nearest: Nearest) -> Nearest:
    """The nearest wall, of that in a row and the nearest so far."""
    wall = wall_at(tree.walls, row)
    verdict, low, high = judged(wall, beam, nearest)
    if verdict == TAKEN:
        return Nearest(row, low, high)
    return settled(beam, nearest, row, wall, wall, True) if verdict == OPEN else nearest


@borrower
def judged(wall: Wall, beam: Beam, nearest: Nearest) -> tuple[int, float, float]:
    """Whether a wall is met before the nearest so far, as float64 tells, and at which distances."""
    ax, ay = wall.px - beam.ox, wall.py - beam.oy
    bx, by = wall.qx - beam.ox, wall.qy - beam.oy
    left, right = beam.dx * ay, beam.dy * ax
    other_left, other_right = beam.dx * by, beam.dy * bx
    p, q = left - right, other_left - other_right
    doubt = FILTER * (abs(left) + abs(right) + abs(other_left) + abs(other_right))
    if min(p, q) > doubt or max(p, q) < -doubt:
        return MISSED, 0.0, 0.0
    ex, ey = wall.qx - wall.px, wall.qy - wall.py
    left, right = ax * ey, ay * ex
    other_left, other_right = beam.dx * ey, beam.dy * ex
    area, slope = left - right, other_left - other_right
    size, steep = abs(left) + abs(right), abs(other_left) + abs(other_right)
    t = area / slope
    slack = LENGTH_SLACK + 2.0 * FILTER * (size / abs(area) + steep / abs(slope))
    # Not a number where the area or the slope is zero.
    if not slack < CLEAR_LENGTH:
        return OPEN, 0.0, 0.0
    low, high = t * (1.0 - slack), t * (1.0 + slack)
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
