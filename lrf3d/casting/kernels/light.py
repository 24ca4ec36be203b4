"""Light of beams, compiled: followed in float64 behind mirrors and glass, to their echoes.

Walls are upright, so all beams are followed in plan, and an inclined one keeps its slope: mirrors
turn it in plan alone. A ray that a wall mirrors or lets through goes on from the rounded place
where it met it. There it meets another wall, at a corner or where two walls are drawn over each
other, if it would cross to that wall's other side: so a beam into a corner of two mirrors is
turned by both, and one onto a mirror on a wall by the mirror alone.
"""

import math
from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM
from lrf3d.casting.kernels.echoes import MOST_WALLS, Lit, Receiver, clear, receive
from lrf3d.casting.kernels.scans import PADDING, Laser, aim
from lrf3d.casting.kernels.solid import near_box
from lrf3d.casting.kernels.tree import STACK, Plain, Tree
from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Float, Int
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

X, Y, Z, DX, DY, DZ, CAME_X, CAME_Y, WAY, GAIN, TURNS, COUNT, HERE, PASSED, SIZE = range(15)
"""Columns of a ray that waits: its place, in plan seen from the laser so that no digits are lost
far from the origin, and its direction; the direction in plan with which it arrived there, the way
so far [m], its share of the light, its turns, its walls, how many of these it met at this very
place, and as bits which it passed through; and the number of columns."""


class Optics(NamedTuple):
    """The walls (n,) of the world and their materials (m,).

    A row of the table (m, 7) is diffuse, specular, lobe [rad], transmission, index, retro, and
    whether beams go on mirrored, 0 or 1. Dull vectors (n, 2) lie along the walls that only scatter
    light, as long as these are bright [m]; they are NaN for all others.
    """

    segments: Float
    heights: Float
    kinds: Int
    table: Float
    dull: Float


Vector = tuple[float, float]


class Room(NamedTuple):
    """Room to work in: rays that wait, with their walls; boxes that wait."""

    rays: Float
    ways: Int
    chain: Int
    stack: Int
    nears: Float


@compiled
def light_scans(
    plain_tree: Plain, plain_optics: Plain, plain_receiver: Plain, plain_laser: Plain,
    poses: Float, lit: Plain,
) -> None:  # fmt: skip
    """Light level scans at poses (k, 3); the arrays to fill have k rows, with walls and ranges."""
    tree, optics = Tree(*plain_tree), Optics(*plain_optics)
    receiver, laser, room = Receiver(*plain_receiver), Laser(*plain_laser), _room()
    beams, rays = laser.fan.shape[1], room.rays
    dx, dy = np.zeros(beams + PADDING), np.zeros(beams + PADDING)
    rest = np.empty(beams, np.int64)
    for k in range(len(poses)):
        aim(laser, poses[k, 0], poses[k, 1], poses[k, 2], dx, dy)
        one = Lit(lit[0][k], lit[1][k], lit[2][k], lit[3][k], lit[4][k], lit[5][k])
        for j in range(_light_dull(optics, receiver, dx, dy, one, rest)):
            i = rest[j]
            rays[0, Z], rays[0, DX], rays[0, DY], rays[0, DZ] = 0.0, dx[i], dy[i], 0.0
            place, start = (poses[k, 0], poses[k, 1]), (one.ranges[i], one.walls[i])
            _follow(tree, optics, receiver, laser.range_max, place, start, room, i, one)


@compiled
def light_beams(
    plain_tree: Plain, plain_optics: Plain, plain_receiver: Plain, range_max: float,
    origin: tuple[float, float, float], beams: Float, plain_lit: Plain,
) -> None:  # fmt: skip
    """Light beams (n, 3) of unit length from an origin; the arrays to fill have n rows."""
    tree, optics, room = Tree(*plain_tree), Optics(*plain_optics), _room()
    receiver, lit, rays = Receiver(*plain_receiver), Lit(*plain_lit), room.rays
    for i in range(len(beams)):
        rays[0, Z], rays[0, DX], rays[0, DY] = origin[2], beams[i, 0], beams[i, 1]
        rays[0, DZ] = beams[i, 2]
        place = origin[0], origin[1]
        _follow(tree, optics, receiver, range_max, place, (0.0, -1), room, i, lit)


@inner
def _room() -> Room:
    # A ray that is taken makes room for one of the two that it leaves, so no more ever wait.
    return Room(
        np.empty((MOST_WALLS + 1, SIZE)),
        np.empty((MOST_WALLS + 1, MOST_WALLS), np.int64),
        np.empty(MOST_WALLS, np.int64),
        np.empty(STACK, np.int64),
        np.empty(STACK),
    )


@borrower
def _light_dull(
    optics: Optics, receiver: Receiver, dx: Float, dy: Float, lit: Lit, rest: Int
) -> int:
    """Intensities of the beams that need no more; the others fill `rest`. The number of those."""
    ranges, walls, intensities, dull = lit.ranges, lit.walls, lit.intensities, optics.dull
    threshold, near = receiver.threshold, receiver.range_min
    short = receiver.near_field == 0.0 and lit.echoes.shape[1] == 0 and len(lit.chains) == 0
    left = 0
    for i in range(len(ranges)):
        wall = walls[i]
        if wall < 0:
            continue
        away = ranges[i] if ranges[i] > CLOSEST else CLOSEST
        back = abs(dx[i] * dull[wall, 1] - dy[i] * dull[wall, 0]) / (away * away)
        if short and back > 0.0 and back >= threshold and ranges[i] >= near:
            intensities[i] = back
        else:
            rest[left] = i
            left += 1
    return left


@borrower
def _follow(
    tree: Tree, optics: Optics, receiver: Receiver, range_max: float, place: Vector,
    start: tuple[float, int], room: Room, i: int, lit: Lit,
) -> None:  # fmt: skip
    """Follow beam i, in row 0 of the rays, from a place, and all that it leaves, to its echoes.

    The way to its first wall [m] and this wall are known, unless the wall is −1.
    """
    clear(i, lit)
    segments, table = optics.segments, optics.table
    rays, ways, chain, threshold = room.rays, room.ways, room.chain, receiver.threshold
    rays[0, WAY], rays[0, GAIN], rays[0, TURNS], rays[0, COUNT] = 0.0, 1.0, 0.0, 0.0
    rays[0, X], rays[0, Y], rays[0, HERE], rays[0, PASSED] = 0.0, 0.0, 0.0, 0.0
    way, name = start
    waiting, known = 1, name >= 0
    while waiting > 0:
        waiting -= 1
        ray = rays[waiting]
        x, y, dx, dy, dz, gain = ray[X], ray[Y], ray[DX], ray[DY], ray[DZ], ray[GAIN]
        came_x, came_y = ray[CAME_X], ray[CAME_Y]
        turns, count, here = int(ray[TURNS]), int(ray[COUNT]), int(ray[HERE])
        passes = int(ray[PASSED])
        for k in range(count):
            chain[k] = ways[waiting, k]
        t = way
        if not known:
            t, name = _next_wall(tree, optics, place, ray, chain, range_max - ray[WAY], room)
            way = ray[WAY] + t
        known = False
        if name < 0 or way > range_max:
            continue
        chain[count] = name
        count += 1
        ex, ey = segments[name, 2] - segments[name, 0], segments[name, 3] - segments[name, 1]
        square, slope = ex * ex + ey * ey, dx * ey - dy * ex
        size = math.sqrt(square)
        along = math.sqrt(((dx * ex + dy * ey) / size) ** 2 + dz * dz)
        kind = optics.kinds[name]
        bright, mirrored, passed = _surface_light(table, kind, abs(slope) / size, along)
        back = intensity(gain * bright, way, receiver.near_field)
        if back > 0.0 and back >= threshold:
            receive(way, back, chain, count, receiver, i, lit)
        if count == MOST_WALLS:
            continue
        still = here > 0 and t == 0.0
        if not still:
            came_x, came_y, here = dx, dy, 0
        z = ray[Z] + t * dz
        for k in range(2):
            share = gain * (passed * passed if k == 0 else mirrored * mirrored)
            if share < LEAST_SHARE or (k == 1 and turns == MOST_TURNS):
                continue
            twice = 0.0 if k == 0 else 2.0 * slope / square
            left = rays[waiting]
            left[X], left[Y], left[Z] = x + t * dx, y + t * dy, z
            left[DX], left[DY], left[DZ] = dx - twice * ey, dy + twice * ex, dz
            left[CAME_X], left[CAME_Y], left[WAY], left[GAIN] = came_x, came_y, way, share
            left[TURNS], left[COUNT], left[HERE] = turns + k, count, here + 1
            left[PASSED] = passes + (1 - k) * (1 << (count - 1))
            for j in range(count):
                ways[waiting, j] = chain[j]
            waiting += 1


@borrower
def _next_wall(
    tree: Tree, optics: Optics, place: Vector, ray: Float, chain: Int, reach: float, room: Room
) -> tuple[float, int]:
    """How far away a ray meets its next wall [m], and the wall; infinity and −1 for none."""
    boxes, links, walls, rows = tree
    stack, nears = room.stack, room.nears
    x, y, dx, dy, passed = ray[X], ray[Y], ray[DX], ray[DY], int(ray[PASSED])
    count, here = int(ray[COUNT]), int(ray[HERE])
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
            holds, sense = False, 1.0
            for j in range(count - here, count):
                if chain[j] == name:
                    holds = True
                    # It stands on the other side of what it passed through.
                    sense = -sense if passed >> j & 1 else sense
            t = _meet(walls[k], place, ray, holds, sense, near_by if here > 0 else -1.0)
            # Of walls that are drawn over each other the first is met, however t is rounded.
            if not (t < best - near_by or (t <= best + near_by and name < hit)):
                continue
            # Inclined beams pass over a wall that is lower, and end at the ground.
            z = ray[Z] + t * ray[DZ]
            if ray[DZ] == 0.0 or 0.0 <= z <= optics.heights[name]:
                best, hit, limit = t, name, min(limit, t * ROOM + near_by)
    return best, hit


@borrower
def _meet(
    wall: Float, place: Vector, ray: Float, holds: bool, sense: float, near_by: float
) -> float:
    """How far away [m] a ray meets a wall in plan, infinite where it does not.

    Which side of an end it passes is one number for all walls that have the end, so no ray passes
    between two. A wall that holds the start, or lies within `near_by` [m] of it, is met there if
    the ray crosses it in the sense in which it arrived.
    """
    x, y, dx, dy = ray[X], ray[Y], ray[DX], ray[DY]
    (ox, oy), dz = place, ray[DZ]
    ax, ay, bx, by = wall[0] - ox - x, wall[1] - oy - y, wall[2] - ox - x, wall[3] - oy - y
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    area, slope = ax * ey - ay * ex, dx * ey - dy * ex
    size, twice = math.sqrt(ex * ex + ey * ey), (ax + bx) * ex + (ay + by) * ey
    if holds or (abs(area) <= near_by * size and abs(twice) <= size * (size + 2.0 * near_by)):
        came = ray[CAME_X] * ey - ray[CAME_Y] * ex
        return 0.0 if sense * came * slope > 0.0 else np.inf
    side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
    if (side_a > 0.0 and side_b > 0.0) or (side_a < 0.0 and side_b < 0.0):
        return np.inf
    square = dx * dx + dy * dy
    at_a, at_b = (dx * ax + dy * ay) / square, (dx * bx + dy * by) / square
    near, far = min(at_a, at_b), max(at_a, at_b)
    if slope == 0.0:
        # Along the wall its nearest point counts; inclined beams meet what stands there across.
        return max(near, 0.0) if dz == 0.0 and far >= 0.0 else np.inf
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
