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

from lrf3d.casting.kernels.echoes import (
    CLOSEST,
    LEAST_SHARE,
    MOST_WALLS,
    Lit,
    Receiver,
    brightness,
    clear,
    intensity,
    receive,
    shares,
)
from lrf3d.casting.kernels.movers import Movers, anywhere, locate, side_at, turn_sides
from lrf3d.casting.kernels.predicates import Vector, Wall, wall_at
from lrf3d.casting.kernels.tree import (
    ROOM,
    Plain,
    Stack,
    Tree,
    enter,
    new_stack,
    next_leaf,
    way_of,
)
from lrf3d.compiling import borrower, compiled, record
from lrf3d.geometry.lines import Float, Int, Records

# [turns] Mirrors that turn a beam; at the next one it ends.
MOST_TURNS = 8

# [m] Distance up to which a wall counts as holding the place from which a ray goes on: more than
# rounding, less than any gap.
NEAR = 1e-9

# [share] The part of that distance that grows with the coordinates of the place.
NEAR_SHARE = 2.0**-50

# A ray that goes on.
LEFT = record(
    x=float, y=float, z=float,  # [m] its place; in plan from the laser, to lose no digits far away
    dx=float, dy=float, dz=float,  # its direction
    came_x=float, came_y=float,  # the direction in plan with which it arrived at the place
    way=float,  # [m] the distance so far
    gain=float,  # its share of the light
    turns=int,  # how often mirrors turned it
    count=int, here=int,  # the number of its walls, and of those that it met at this very place
    passed=int,  # which of these it passed through, as bits
)  # fmt: skip


class WallMaterials(NamedTuple):
    """The walls (n,) of the world and their materials, of which the last is that of obstacles.

    Dull vectors (n, 2) lie along the walls that only scatter light, as long as these are bright
    [m]; they are NaN for all others.
    """

    segments: Float
    heights: Float
    kinds: Int
    surfaces: Records
    dull: Float


class Surroundings(NamedTuple):
    """What rays can hit up to a reach [m]: walls in their tree, their materials, and obstacles.

    The sides of obstacles are numbered on from the walls. The robot's own and those of obstacles
    lower than the laser are left out.
    """

    tree: Tree
    optics: WallMaterials
    among: Movers
    own: int
    height: float
    reach: float


class Room(NamedTuple):
    """Room to work in: rays that wait, the last the one that is followed, and boxes that wait."""

    rays: Records
    chains: Int  # The walls of each.
    stack: Stack


@compiled
def light_rays(
    plain: Plain, plain_receiver: Plain, rays: Records, inclined: Float, plain_lit: Plain
) -> None:
    """Light rays (n,); the arrays to fill have n rows.

    Of level ones ranges and walls come in as those among the walls and obstacles. Others are of
    unit length, and have a height [m] and a rise (n, 2).
    """
    (plain_tree, plain_optics, plain_movers), (own, height, reach) = plain
    optics = WallMaterials(*plain_optics)
    among = anywhere(plain_movers)
    scene = Surroundings(Tree(*plain_tree), optics, among, own, height, reach)
    receiver = Receiver(*plain_receiver)
    lit = Lit(*plain_lit)
    # A ray that is taken makes room for one of the two that it leaves, so no more ever wait.
    room = Room(
        np.empty(MOST_WALLS + 2, LEFT),
        np.empty((MOST_WALLS + 2, MOST_WALLS), np.int64),
        new_stack(),
    )
    level = len(inclined) == 0
    moment = np.nan
    for i in range(len(rays)):
        ray = rays[i]
        first = room.rays[0]
        if ray.time != moment:
            moment = ray.time
            for j in range(len(among.movers)):
                turn_sides(among, j, locate(among, j, moment))
        if level and (lit.walls[i] < 0 or _is_dull(optics, receiver, ray, i, lit)):
            continue
        first.z, first.dz = (0.0, 0.0) if level else (inclined[i, 0], inclined[i, 1])
        first.dx = ray.dx
        first.dy = ray.dy
        start = lit.ranges[i], lit.walls[i] if level else -1
        _follow(scene, receiver, (ray.x, ray.y), start, room, i, lit)


@borrower
def _is_dull(optics: WallMaterials, receiver: Receiver, ray: Any, i: int, lit: Lit) -> bool:
    """Whether a beam needs no more than the intensity of its wall, which is filled in."""
    short = receiver.near_field == 0.0 and lit.echoes.shape[1] == 0 == lit.chains.shape[1]
    wall = lit.walls[i]
    way = lit.ranges[i]
    dull = optics.dull
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
    scene: Surroundings, receiver: Receiver, start: Vector, first: tuple[float, int], room: Room,
    i: int, lit: Lit,
) -> None:  # fmt: skip
    """Follow beam i, the first of the rays, from a place, and all that it leaves, to its echoes.

    The distance to its first wall [m] and this wall are known, unless the wall is −1.
    """
    clear(i, lit)
    optics = scene.optics
    rays, chains, _ = room
    ray = rays[-1]
    chain = chains[-1]
    one = rays[0]
    one.x = one.y = one.way = 0.0
    one.gain = 1.0
    one.turns = one.count = one.here = one.passed = 0
    way, name = first
    waiting = 1
    known = name >= 0
    while waiting > 0:
        waiting -= 1
        rays[-1] = rays[waiting]
        for k in range(ray.count):
            chain[k] = chains[waiting, k]
        t = way
        if not known:
            t, name = _next_wall(scene, start, ray, chain, room.stack)
            way = ray.way + t
        known = False
        if name < 0 or way > scene.reach:
            continue
        chain[ray.count] = name
        ray.count += 1
        wall = _wall_of(scene, name)
        ex = wall.qx - wall.px
        ey = wall.qy - wall.py
        square = ex * ex + ey * ey
        slope = ray.dx * ey - ray.dy * ex
        size = math.sqrt(square)
        along = math.sqrt(((ray.dx * ex + ray.dy * ey) / size) ** 2 + ray.dz * ray.dz)
        across = abs(slope) / size
        whole = math.sqrt(across * across + along * along)
        cos = across / whole
        sin = along / whole
        surface = optics.surfaces[optics.kinds[name] if name < len(optics.kinds) else -1]
        mirrored, through = shares(cos, surface)
        back = intensity(
            ray.gain * brightness(cos, sin, surface, mirrored), way, receiver.near_field
        )
        if back > 0.0 and back >= receiver.threshold:
            receive(way, back, chain, ray.count, receiver, i, lit)
        if ray.count == MOST_WALLS:
            continue
        if ray.here == 0 or t != 0.0:
            ray.came_x, ray.came_y, ray.here = ray.dx, ray.dy, 0
        ray.x, ray.y, ray.z = ray.x + t * ray.dx, ray.y + t * ray.dy, ray.z + t * ray.dz
        ray.here = ray.here + 1
        ray.way = way
        mirrored *= surface.mirrors
        for k in range(2):
            share = ray.gain * (through * through if k == 0 else mirrored * mirrored)
            if share < LEAST_SHARE or (k == 1 and ray.turns == MOST_TURNS):
                continue
            twice = 0.0 if k == 0 else 2.0 * slope / square
            rays[waiting] = rays[-1]
            left = rays[waiting]
            left.dx = ray.dx - twice * ey
            left.dy = ray.dy + twice * ex
            left.gain = share
            left.turns = ray.turns + k
            left.passed = ray.passed + (1 - k) * (1 << (ray.count - 1))
            for j in range(ray.count):
                chains[waiting, j] = chain[j]
            waiting += 1


@borrower
def _wall_of(scene: Surroundings, name: int) -> Wall:
    """A wall, or a side of an obstacle, by its name."""
    walls = scene.optics.segments
    return (
        wall_at(walls, name) if name < len(walls) else side_at(scene.among.sides, name - len(walls))
    )


@borrower
def _next_wall(
    scene: Surroundings, start: Vector, ray: Any, chain: Int, stack: Stack
) -> tuple[float, int]:
    """How far away a ray meets its next wall [m], and the wall; infinity and −1 for none."""
    tree = scene.tree
    heights = scene.optics.heights
    movers = scene.among.movers
    way = way_of(start[0], start[1], ray.x, ray.y, ray.dx, ray.dy)
    near_by = NEAR + NEAR_SHARE * (abs(ray.x) + abs(ray.y))
    best = np.inf
    hit = -1
    limit = (scene.reach - ray.way) * ROOM
    top = enter(tree, stack)
    while top > 0:
        first, stop, top = next_leaf(tree, way, limit, stack, top)
        for k in range(first, stop):
            name = tree.rows[k]
            t = _met_at(wall_at(tree.walls, k), (name, heights[name]), start, ray, chain, near_by)
            # Of walls that are drawn over each other the first is met, however t is rounded.
            if t < best - near_by or (t <= best + near_by and name < hit):
                best = t
                hit = name
                limit = min(limit, t * ROOM + near_by)
    for j in range(len(movers)):
        height = movers[j].height
        if j == scene.own or height < scene.height:
            continue
        for row in range(movers[j].first, movers[j].stop):
            wall = side_at(scene.among.sides, row)
            name = len(heights) + row
            t = _met_at(wall, (name, height), start, ray, chain, near_by)
            if t < best - near_by:
                best = t
                hit = name
    return best, hit


@borrower
def _met_at(
    wall: Wall, named: tuple[int, float], start: Vector, ray: Any, chain: Int, near_by: float
) -> float:
    """How far away [m] a ray meets a wall of some height, infinite where it does not.

    Inclined beams pass over a wall that is lower, and end at the ground.
    """
    name, height = named
    holds = False
    sense = 1.0
    for j in range(ray.count - ray.here, ray.count):
        if chain[j] == name:
            holds = True
            # It stands on the other side of what it passed through.
            sense = -sense if ray.passed >> j & 1 else sense
    t = _meet(wall, start, ray, holds, sense, near_by if ray.here > 0 else -1.0)
    z = ray.z + t * ray.dz
    return t if ray.dz == 0.0 or 0.0 <= z <= height else np.inf


@borrower
def _meet(wall: Wall, start: Vector, ray: Any, holds: bool, sense: float, near_by: float) -> float:
    """How far away [m] a ray meets a wall in plan, infinite where it does not.

    Which side of an end it passes is one number for all walls that have the end, so no ray passes
    between two. A wall that holds the start, or lies within `near_by` [m] of it, is met there if
    the ray crosses it in the sense in which it arrived.
    """
    x = ray.x
    y = ray.y
    dx = ray.dx
    dy = ray.dy
    ox, oy = start
    px, py, qx, qy = wall
    ax = px - ox - x
    ay = py - oy - y
    bx = qx - ox - x
    by = qy - oy - y
    ex = qx - px
    ey = qy - py
    area = ax * ey - ay * ex
    slope = dx * ey - dy * ex
    size = math.sqrt(ex * ex + ey * ey)
    twice = (ax + bx) * ex + (ay + by) * ey
    if holds or (abs(area) <= near_by * size and abs(twice) <= size * (size + 2.0 * near_by)):
        came = ray.came_x * ey - ray.came_y * ex
        return 0.0 if sense * came * slope > 0.0 else np.inf
    side_a = dx * ay - dy * ax
    side_b = dx * by - dy * bx
    if (side_a > 0.0 and side_b > 0.0) or (side_a < 0.0 and side_b < 0.0):
        return np.inf
    square = dx * dx + dy * dy
    at_a = (dx * ax + dy * ay) / square
    at_b = (dx * bx + dy * by) / square
    near = min(at_a, at_b)
    far = max(at_a, at_b)
    if slope == 0.0:
        # Along the wall its nearest point counts; inclined beams meet what stands there across.
        return max(near, 0.0) if ray.dz == 0.0 and far >= 0.0 else np.inf
    # What is met lies between the ends, however flat.
    t = min(max(area / slope, near), far)
    return t if t >= 0.0 else np.inf
