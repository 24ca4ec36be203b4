"""Light of scans, compiled: beams behind mirrors and glass, their echoes and intensities.

A scan among the walls comes in, as `scans` casts it. Beams that end on an opaque wall keep their
range, and get an intensity. The others are followed leg by leg: along a leg the light passes panes
up to the first wall that lets nothing through, and each wall that mirrors begins another leg. What
float64 cannot decide is marked as open.
"""

import math
from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.echoes import (
    MOST_ECHOES,
    MOST_WALLS,
    NEAR_LIMIT,
    Lit,
    PlainLit,
    PlainReceiver,
    Receiver,
    at_limit,
    keep,
    report,
)
from lrf3d.casting.kernels.predicates import wall_at
from lrf3d.casting.kernels.rays import (
    CERTAIN,
    MOST_MET,
    OPEN,
    RAY,
    Met,
    Ray,
    arrive,
    distance_to,
    met_at,
    plus,
    ray_of,
    turned_by,
    walls_along,
)
from lrf3d.casting.kernels.scans import PADDING, Laser, PlainLaser, aim
from lrf3d.casting.kernels.tree import STACK, PlainTree, Tree
from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import light
from lrf3d.laser.light import CLOSEST, LEAST_SHARE

shares = borrower(light.shares)
brightness = borrower(light.brightness)
intensity = borrower(light.intensity)

MOST_TURNS = 8
"""How often mirrors turn a beam; at the next one it ends."""

MOST_RAYS = 64
"""Rays of one beam that may wait to be followed."""


class Optics(NamedTuple):
    """The materials of the walls.

    Attributes:
        segments: (n, 4) ends of the walls of the world [m].
        kinds: (n,) row of each wall's material.
        table: (m, 8) diffuse, specular, lobe [rad], transmission, index, retro, and whether beams
            go on mirrored and straight on, 0 or 1.
        dull: (n, 2) along each wall that only scatters light, as long as that is bright [m]; NaN
            for all others.
        places: (n,) row of each wall in the tree, or −1.
        solid: Which walls of the tree, row by row, let nothing pass.
    """

    segments: Float
    kinds: Int
    table: Float
    dull: Float
    places: Int
    solid: Bool


PlainOptics = tuple[Float, Int, Float, Float, Int, Bool]


class Room(NamedTuple):
    """Room to work in: beams of a scan, rays that wait and echoes of a beam, with their walls."""

    rest: Int
    met: Met
    rays: Float
    ways: Int
    chain: Int
    echoes: Float
    echo_ways: Int


GAIN, TURNS, COUNT = RAY, RAY + 1, RAY + 2
"""Columns after those of a ray: its share of the light, its turns, and its walls."""


@compiled
def light_scans(
    plain_tree: PlainTree,
    plain_optics: PlainOptics,
    plain_receiver: PlainReceiver,
    plain_laser: PlainLaser,
    poses: Float,
    lit: PlainLit,
) -> None:
    """Light scans at poses (k, 3); each of the arrays to fill has k rows."""
    tree, optics = Tree(*plain_tree), Optics(*plain_optics)
    receiver, laser = Receiver(*plain_receiver), Laser(*plain_laser)
    ranges, walls, intensities, echo_ranges, echo_intensities, chains, undecided = lit
    beams = laser.fan.shape[1]
    dx, dy = np.zeros(beams + PADDING), np.zeros(beams + PADDING)
    met = Met(
        np.empty(MOST_MET, np.int64), np.empty((MOST_MET, 2)),
        np.empty(STACK, np.int64), np.empty(STACK),
    )  # fmt: skip
    room = Room(
        np.empty(beams, np.int64),
        met,
        np.empty((MOST_RAYS, RAY + 3)),
        np.empty((MOST_RAYS, MOST_WALLS), np.int64),
        np.empty(MOST_WALLS, np.int64),
        np.empty((MOST_ECHOES, 3)),
        np.empty((MOST_ECHOES, MOST_WALLS), np.int64),
    )
    for k in range(len(poses)):
        x, y = poses[k, 0], poses[k, 1]
        aim(laser, x, y, poses[k, 2], dx, dy)
        one = Lit(
            ranges[k], walls[k], intensities[k], echo_ranges[k], echo_intensities[k],
            chains[k], undecided[k],
        )  # fmt: skip
        _light_scan(tree, optics, receiver, laser.range_max, x, y, dx, dy, one, room)


@borrower
def _light_scan(
    tree: Tree,
    optics: Optics,
    receiver: Receiver,
    range_max: float,
    x: float,
    y: float,
    dx: Float,
    dy: Float,
    lit: Lit,
    room: Room,
) -> None:
    """Light one scan from x, y [m] in the directions dx, dy."""
    ranges, walls, undecided = lit.ranges, lit.walls, lit.undecided
    segments, kinds, table = optics.segments, optics.kinds, optics.table
    for k in range(_light_dull(optics, receiver, dx, dy, lit, room.rest)):
        i = room.rest[k]
        wall = walls[i]
        kind = kinds[wall]
        if table[kind, 6] == 0.0 and table[kind, 7] == 0.0:
            # The range among the walls stands, to the last bit.
            bright = _surface(segments, table, wall, kind, dx[i], dy[i])[0]
            back = intensity(bright, ranges[i], receiver.near_field)
            count = 0
            if back > 0.0 and back >= receiver.threshold:
                room.chain[0] = wall
                count = keep(room.echoes, room.echo_ways, 0, ranges[i], back, room.chain, 1)
        else:
            ray = ray_of(x, y, dx[i], dy[i])
            count = _follow(tree, optics, receiver, range_max, ray, ranges[i], wall, room)
        if count == OPEN or at_limit(room.echoes, count, receiver.range_min):
            undecided[i] = True
        else:
            report(room.echoes, room.echo_ways, count, receiver, i, lit)


@borrower
def _light_dull(
    optics: Optics, receiver: Receiver, dx: Float, dy: Float, lit: Lit, rest: Int
) -> int:
    """Intensities of the beams that need no more; the others fill `rest`. The number of those."""
    ranges, walls, intensities, dull = lit.ranges, lit.walls, lit.intensities, optics.dull
    threshold, near = receiver.threshold, receiver.range_min * NEAR_LIMIT
    short = receiver.near_field == 0.0 and lit.echo_ranges.shape[1] == 0 and len(lit.chains) == 0
    left = 0
    for i in range(len(ranges)):
        wall = walls[i]
        if wall < 0:
            continue
        away = ranges[i] if ranges[i] > CLOSEST else CLOSEST
        back = abs(dx[i] * dull[wall, 1] - dy[i] * dull[wall, 0]) / (away * away)
        if short and back > 0.0 and back >= threshold and ranges[i] > near:
            intensities[i] = back
        else:
            rest[left] = i
            left += 1
    return left


@borrower
def _follow(
    tree: Tree,
    optics: Optics,
    receiver: Receiver,
    range_max: float,
    leg: Ray,
    way: float,
    wall: int,
    room: Room,
) -> int:
    """Follow a beam from the first wall that it meets, at a way; the number of its echoes, or OPEN.

    A wall is met at `way`; `met` holds those that come after it on the leg, once these were looked
    for, and `at` is which of them is the next.
    """
    segments, kinds, table, _, places, solid = optics
    walls, rows, met, chain = tree.walls, tree.rows, room.met, room.chain
    rays, ways, threshold = room.rays, room.ways, receiver.threshold
    echoes, waiting, gain, turns, count = 0, 0, 1.0, 0, 0
    row, searched, at, found, doubt, reach = places[wall], False, 0, 0, np.inf, range_max
    while True:
        name = rows[row]
        chain[count] = name
        count += 1
        bright, mirrored, passed = _surface(segments, table, name, kinds[name], leg.dx, leg.dy)
        light_back = intensity(gain * bright, way, receiver.near_field)
        if light_back > 0.0 and light_back >= threshold:
            echoes = keep(room.echoes, room.echo_ways, echoes, way, light_back, chain, count)
        left = gain * mirrored * mirrored
        if left >= LEAST_SHARE and count < MOST_WALLS and turns < MOST_TURNS:
            there = arrive(leg, wall_at(walls, row))
            if waiting == MOST_RAYS or not there.way_error <= CERTAIN * there.way:
                return OPEN
            _put(rays, waiting, turned_by(there, wall_at(walls, row)))
            rays[waiting, GAIN], rays[waiting, TURNS] = left, turns + 1
            rays[waiting, COUNT] = count
            for k in range(count):
                ways[waiting, k] = chain[k]
            waiting += 1
        gain *= passed * passed
        ends = gain < LEAST_SHARE or count == MOST_WALLS
        last, since = row, way
        while True:
            if ends:
                if waiting == 0:
                    return echoes
                waiting -= 1
                leg = _taken(rays, waiting)
                gain, turns = rays[waiting, GAIN], int(rays[waiting, TURNS])
                count = int(rays[waiting, COUNT])
                for k in range(count):
                    chain[k] = ways[waiting, k]
                last, since, searched = places[chain[count - 1]], 0.0, False
            if not searched:
                reach = range_max - leg.way
                found, doubt = walls_along(tree, solid, leg, last, since, reach, met)
                searched, at = True, 0
            row = met_at(tree, solid, met, at, found, doubt, reach)
            at += 1
            if row == OPEN:
                return OPEN
            if row >= 0:
                t, t_low, error = distance_to(leg, wall_at(walls, row))
                way, way_low = plus(leg.way, leg.way_low, t, t_low)
                error += leg.way_error
                beyond = (way - range_max) + way_low
                if not error <= CERTAIN * way or abs(beyond) <= error + CERTAIN * way:
                    return OPEN
                if beyond < 0.0:
                    break
            ends = True


@borrower
def _surface(
    segments: Float, table: Float, name: int, kind: int, dx: float, dy: float
) -> tuple[float, float, float]:
    """Brightness of a wall for a ray, and the shares of its light that go on mirrored and pass."""
    ex = segments[name, 2] - segments[name, 0]
    ey = segments[name, 3] - segments[name, 1]
    return surface_light(table, kind, abs(dx * ey - dy * ex), abs(dx * ex + dy * ey))


@borrower
def surface_light(
    table: Float, kind: int, across: float, along: float
) -> tuple[float, float, float]:
    """Brightness of a material, and the shares of light that go on mirrored and pass.

    Args:
        table: The materials, as `Optics` has them.
        kind: Row of the material.
        across: Part of the ray's direction along the normal, not negative.
        along: The rest of it, across the normal, in the same unit.
    """
    size = math.sqrt(across * across + along * along)
    cos, sin = across / size, along / size
    diffuse = table[kind, 0]
    mirrored, passed = shares(cos, diffuse, table[kind, 1], table[kind, 3], table[kind, 4])
    bright = brightness(cos, sin, diffuse, table[kind, 5], mirrored, table[kind, 2])
    return bright, mirrored * table[kind, 6], passed


@borrower
def _put(rows: Float, row: int, ray: Ray) -> None:
    """Write a ray into a row."""
    rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3] = ray.x, ray.x_low, ray.y, ray.y_low
    rows[row, 4], rows[row, 5], rows[row, 6] = ray.dx, ray.dx_low, ray.dy
    rows[row, 7], rows[row, 8], rows[row, 9] = ray.dy_low, ray.way, ray.way_low
    rows[row, 10], rows[row, 11], rows[row, 12] = ray.place_error, ray.turn_error, ray.way_error


@borrower
def _taken(rows: Float, row: int) -> Ray:
    """The ray of a row."""
    return Ray(
        rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3], rows[row, 4], rows[row, 5],
        rows[row, 6], rows[row, 7], rows[row, 8], rows[row, 9], rows[row, 10], rows[row, 11],
        rows[row, 12],
    )  # fmt: skip
