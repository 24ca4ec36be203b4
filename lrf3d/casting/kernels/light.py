"""Light of beams, compiled: followed in float64 behind mirrors and glass, to their echoes.

Walls are upright, so all beams are followed in plan, and an inclined one keeps its slope: mirrors
turn it in plan alone. A ray that a wall mirrors or lets through goes on from the rounded place
where it met it. There it meets another wall, at a corner or where two walls are drawn over each
other, if it would cross to that wall's other side: so a beam into a corner of two mirrors is
turned by both, and one onto a mirror on a wall by the mirror alone.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM
from lrf3d.casting.kernels.echoes import MOST_WALLS, Lit, Receiver, clear, receive
from lrf3d.casting.kernels.movers import Movers, anywhere, place, side_at
from lrf3d.casting.kernels.predicates import Wall, wall_at
from lrf3d.casting.kernels.solid import near_box
from lrf3d.casting.kernels.tree import STACK, Plain, Tree
from lrf3d.compiling import borrower, compiled, record
from lrf3d.geometry import Float, Int, Records
from lrf3d.laser import light
from lrf3d.laser.light import CLOSEST, LEAST_SHARE

shares = borrower(light.shares)
brightness = borrower(light.brightness)
intensity = borrower(light.intensity)

MOST_TURNS = 8
"""How often mirrors turn a beam; at the next one it ends."""

NEAR, NEAR_SHARE = 1e-9, 2.0**-50
"""Walls so near [m] to the place from which a ray goes on, or so near in parts of its coordinates,
count as holding it: more than rounding, less than any gap."""

NUMBERS = ("x", "y", "z", "dx", "dy", "dz", "came_x", "came_y", "way", "gain")
COUNTS = ("turns", "count", "here", "passed")
LEFT = record(**dict.fromkeys(NUMBERS, float), **dict.fromkeys(COUNTS, int))
"""A ray that goes on: its place, in plan seen from the laser so that no digits are lost far away,
and its direction; the direction in plan with which it arrived there, the way so far [m], its share
of the light, its turns, its walls, how many of these it met at this very place, and as bits which
it passed through."""


Vector = tuple[float, float]


class Optics(NamedTuple):
    """The walls (n,) of the world and their materials (m,).

    A row of the table (m, 7) is diffuse, specular, lobe [rad], transmission, index, retro, and
    whether beams go on mirrored, 0 or 1; the last is that of obstacles. Dull vectors (n, 2) lie
    along the walls that only scatter light, as long as these are bright [m]; they are NaN for all
    others.
    """

    segments: Float
    heights: Float
    kinds: Int
    table: Float
    dull: Float


class Room(NamedTuple):
    """Room to work in: rays that wait, with their walls; boxes that wait."""

    rays: Records
    ways: Int
    chain: Int
    stack: Int
    nears: Float


class Scene(NamedTuple):
    """What rays meet: walls in their tree, with their materials, and obstacles.

    A side of an obstacle is named by its row, counted on from the walls. The robot's own is left
    out, and so are obstacles that are lower than the laser.
    """

    tree: Tree
    optics: Optics
    among: Movers
    own: int
    height: float


@compiled
def light_rays(
    plain: Plain, plain_receiver: Plain, range_max: float, rays: Records, inclined: Float,
    plain_lit: Plain,
) -> None:  # fmt: skip
    """Light rays (n,); the arrays to fill have n rows.

    Of level ones ranges and walls come in as those among the walls and obstacles. Others are of
    unit length, and have a height [m] and a rise (n, 2).
    """
    (plain_tree, plain_optics, plain_movers), (own, height) = plain
    scene = Scene(Tree(*plain_tree), Optics(*plain_optics), anywhere(plain_movers), own, height)
    receiver, lit = Receiver(*plain_receiver), Lit(*plain_lit)
    # A ray that is taken makes room for one of the two that it leaves, so no more ever wait.
    room = Room(
        np.empty(MOST_WALLS + 1, LEFT),
        np.empty((MOST_WALLS + 1, MOST_WALLS), np.int64),
        np.empty(MOST_WALLS, np.int64),
        np.empty(STACK, np.int64),
        np.empty(STACK),
    )
    level, moment = len(inclined) == 0, np.nan
    for i in range(len(rays)):
        ray, first = rays[i], room.rays[0]
        if ray.time != moment:
            moment = ray.time
            for j in range(len(scene.among.movers)):
                place(scene.among, j, moment)
        if level and (lit.walls[i] < 0 or _is_dull(scene.optics, receiver, ray, i, lit)):
            continue
        first.z, first.dz = (0.0, 0.0) if level else (inclined[i, 0], inclined[i, 1])
        first.dx, first.dy = ray.dx, ray.dy
        start = lit.ranges[i], lit.walls[i] if level else -1
        _follow(scene, receiver, range_max, (ray.x, ray.y), start, room, i, lit)


@borrower
def _is_dull(optics: Optics, receiver: Receiver, ray: Any, i: int, lit: Lit) -> bool:
    """Whether a beam needs no more than the intensity of its wall, which is filled in."""
    short = receiver.near_field == 0.0 and lit.echoes.shape[1] == 0 == lit.chains.shape[1]
    wall, way, dull = lit.walls[i], lit.ranges[i], optics.dull
    if not short or wall >= len(dull):
        return False
    away = way if way > CLOSEST else CLOSEST
    back = abs(ray.dx * dull[wall, 1] - ray.dy * dull[wall, 0]) / (away * away)
    if not (back > 0.0 and back >= receiver.threshold and way >= receiver.range_min):
        return False
    lit.intensities[i] = back
    return True


@borrower
def _follow(
    scene: Scene, receiver: Receiver, range_max: float, place: Vector, start: tuple[float, int],
    room: Room, i: int, lit: Lit,
) -> None:  # fmt: skip
    """Follow beam i, the first of the rays, from a place, and all that it leaves, to its echoes.

    The way to its first wall [m] and this wall are known, unless the wall is −1.
    """
    clear(i, lit)
    optics = scene.optics
    rays, ways, chain, threshold = room.rays, room.ways, room.chain, receiver.threshold
    first = rays[0]
    first.x, first.y, first.way, first.gain = 0.0, 0.0, 0.0, 1.0
    first.turns, first.count, first.here, first.passed = 0, 0, 0, 0
    way, name = start
    waiting, known = 1, name >= 0
    while waiting > 0:
        waiting -= 1
        ray = rays[waiting]
        x, y, dx, dy, dz, gain = ray.x, ray.y, ray.dx, ray.dy, ray.dz, ray.gain
        came_x, came_y, passed = ray.came_x, ray.came_y, ray.passed
        turns, count, here = ray.turns, ray.count, ray.here
        for k in range(count):
            chain[k] = ways[waiting, k]
        t = way
        if not known:
            t, name = _next_wall(scene, place, ray, range_max - ray.way, room)
            way = ray.way + t
        known = False
        if name < 0 or way > range_max:
            continue
        chain[count] = name
        count += 1
        wall = _wall_of(scene, name)
        ex, ey = wall.qx - wall.px, wall.qy - wall.py
        square, slope = ex * ex + ey * ey, dx * ey - dy * ex
        size = math.sqrt(square)
        along = math.sqrt(((dx * ex + dy * ey) / size) ** 2 + dz * dz)
        kind = optics.kinds[name] if name < len(optics.kinds) else len(optics.table) - 1
        bright, mirrored, through = _surface_light(optics.table, kind, abs(slope) / size, along)
        back = intensity(gain * bright, way, receiver.near_field)
        if back > 0.0 and back >= threshold:
            receive(way, back, chain, count, receiver, i, lit)
        if count == MOST_WALLS:
            continue
        still = here > 0 and t == 0.0
        if not still:
            came_x, came_y, here = dx, dy, 0
        z = ray.z + t * dz
        for k in range(2):
            share = gain * (through * through if k == 0 else mirrored * mirrored)
            if share < LEAST_SHARE or (k == 1 and turns == MOST_TURNS):
                continue
            twice = 0.0 if k == 0 else 2.0 * slope / square
            left = rays[waiting]
            left.x, left.y, left.z = x + t * dx, y + t * dy, z
            left.dx, left.dy, left.dz = dx - twice * ey, dy + twice * ex, dz
            left.came_x, left.came_y, left.way, left.gain = came_x, came_y, way, share
            left.turns, left.count, left.here = turns + k, count, here + 1
            left.passed = passed + (1 - k) * (1 << (count - 1))
            for j in range(count):
                ways[waiting, j] = chain[j]
            waiting += 1


@borrower
def _wall_of(scene: Scene, name: int) -> Wall:
    """A wall, or a side of an obstacle, by its name."""
    walls = scene.optics.segments
    return (
        wall_at(walls, name) if name < len(walls) else side_at(scene.among.sides, name - len(walls))
    )


@borrower
def _next_wall(
    scene: Scene, place: Vector, ray: Any, reach: float, room: Room
) -> tuple[float, int]:
    """How far away a ray meets its next wall [m], and the wall; infinity and −1 for none."""
    boxes, links, walls, rows = scene.tree
    stack, nears, heights = room.stack, room.nears, scene.optics.heights
    x, y, dx, dy = ray.x, ray.y, ray.dx, ray.dy
    ox, oy = place
    near_by = NEAR + NEAR_SHARE * (abs(x) + abs(y))
    best, hit, limit = np.inf, -1, reach * ROOM
    stack[0], nears[0] = 0, 0.0
    top = 1 if len(walls) > 0 else 0
    while top > 0:
        top -= 1
        if nears[top] > limit:
            continue
        first, many = links[stack[top], 0], links[stack[top], 1]
        for k in range(first, first - many):
            near = near_box(boxes[k], ox, oy, x, y, dx, dy)
            if near <= limit:
                stack[top], nears[top] = k, near
                top += 1
        for k in range(first, first + many):
            name = rows[k]
            t = _met_at(wall_at(walls, k), name, heights[name], place, ray, room.chain, near_by)
            # Of walls that are drawn over each other the first is met, however t is rounded.
            if t < best - near_by or (t <= best + near_by and name < hit):
                best, hit, limit = t, name, min(limit, t * ROOM + near_by)
    movers, count = scene.among.movers, len(heights)
    for j in range(len(movers)):
        height = movers[j].height
        if j == scene.own or height < scene.height:
            continue
        for row in range(movers[j].first, movers[j].stop):
            side = side_at(scene.among.sides, row)
            t = _met_at(side, count + row, height, place, ray, room.chain, near_by)
            if t < best - near_by:
                best, hit = t, count + row
    return best, hit


@borrower
def _met_at(
    wall: Wall, name: int, height: float, place: Vector, ray: Any, chain: Int, near_by: float
) -> float:
    """How far away [m] a ray meets a wall of some height, infinite where it does not.

    Inclined beams pass over a wall that is lower, and end at the ground.
    """
    holds, sense = False, 1.0
    for j in range(ray.count - ray.here, ray.count):
        if chain[j] == name:
            holds = True
            # It stands on the other side of what it passed through.
            sense = -sense if ray.passed >> j & 1 else sense
    t = _meet(wall, place, ray, holds, sense, near_by if ray.here > 0 else -1.0)
    z = ray.z + t * ray.dz
    return t if ray.dz == 0.0 or 0.0 <= z <= height else np.inf


@borrower
def _meet(wall: Wall, place: Vector, ray: Any, holds: bool, sense: float, near_by: float) -> float:
    """How far away [m] a ray meets a wall in plan, infinite where it does not.

    Which side of an end it passes is one number for all walls that have the end, so no ray passes
    between two. A wall that holds the start, or lies within `near_by` [m] of it, is met there if
    the ray crosses it in the sense in which it arrived.
    """
    x, y, dx, dy = ray.x, ray.y, ray.dx, ray.dy
    (ox, oy), (px, py, qx, qy) = place, wall
    ax, ay, bx, by = px - ox - x, py - oy - y, qx - ox - x, qy - oy - y
    ex, ey = qx - px, qy - py
    area, slope = ax * ey - ay * ex, dx * ey - dy * ex
    size, twice = math.sqrt(ex * ex + ey * ey), (ax + bx) * ex + (ay + by) * ey
    if holds or (abs(area) <= near_by * size and abs(twice) <= size * (size + 2.0 * near_by)):
        came = ray.came_x * ey - ray.came_y * ex
        return 0.0 if sense * came * slope > 0.0 else np.inf
    side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
    if (side_a > 0.0 and side_b > 0.0) or (side_a < 0.0 and side_b < 0.0):
        return np.inf
    square = dx * dx + dy * dy
    at_a, at_b = (dx * ax + dy * ay) / square, (dx * bx + dy * by) / square
    near, far = min(at_a, at_b), max(at_a, at_b)
    if slope == 0.0:
        # Along the wall its nearest point counts; inclined beams meet what stands there across.
        return max(near, 0.0) if ray.dz == 0.0 and far >= 0.0 else np.inf
    # What is met lies between the ends, however flat.
    t = min(max(area / slope, near), far)
    return t if t >= 0.0 else np.inf


@borrower
def _surface_light(
    table: Float, kind: int, across: float, along: float
) -> tuple[float, float, float]:
    """Brightness of a material, and the shares of light that go on mirrored and pass.

    `across` is the part of the ray's direction along the normal, `along` the rest of it.
    """
    size = math.sqrt(across * across + along * along)
    cos, sin = across / size, along / size
    diffuse = table[kind, 0]
    mirrored, passed = shares(cos, diffuse, table[kind, 1], table[kind, 3], table[kind, 4])
    bright = brightness(cos, sin, diffuse, table[kind, 5], mirrored, table[kind, 2])
    return bright, mirrored * table[kind, 6], passed
