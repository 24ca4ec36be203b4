"""Light of scans, compiled: beams behind mirrors and glass, their echoes and intensities.

A scan among the walls comes in, as `scans` casts it. Beams that end on an opaque wall keep their
range, and get an intensity. The others are followed: at each wall the light that goes on is
mirrored, passes straight through, or both. What float64 cannot decide is marked as open.
"""

import math
from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.predicates import wall_at
from lrf3d.casting.kernels.rays import (
    CERTAIN,
    NONE,
    OPEN,
    RAY,
    Ray,
    arrive,
    next_wall,
    ray_of,
    turned_by,
)
from lrf3d.casting.kernels.scans import PADDING, Laser, PlainLaser, aim
from lrf3d.casting.kernels.tree import STACK, PlainTree, Tree
from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import light
from lrf3d.laser.light import LEAST_SHARE

shares = inner(light.shares)
brightness = inner(light.brightness)
intensity = inner(light.intensity)

MOST_TURNS = 8
"""How often mirrors turn a beam; at the next one it ends."""

MOST_WALLS = 16
"""Number of walls on the way of a beam, those that it passes through included."""

MOST_RAYS = 64
"""Rays of one beam that may wait to be followed."""

MOST_ECHOES = 16
"""Echoes of one beam that are kept, the strongest ones."""

NEAR_LIMIT = 1.0 + 1e-12
"""Ranges of opaque walls within this factor of range_min are decided by rationals."""

FIRST, LAST, STRONGEST = 0, 1, 2
"""Which echo is the range of a beam."""


class Optics(NamedTuple):
    """The materials of the walls.

    Attributes:
        segments: (n, 4) ends of the walls of the world [m].
        kinds: (n,) row of each wall's material.
        table: (m, 8) diffuse, specular, lobe [rad], transmission, index, retro, and whether beams
            go on mirrored and straight on, 0 or 1.
        places: (n,) row of each wall in the tree, or −1.
    """

    segments: Float
    kinds: Int
    table: Float
    places: Int


PlainOptics = tuple[Float, Int, Float, Int]


class Receiver(NamedTuple):
    """What the laser makes of the light.

    Attributes:
        threshold: Least intensity of an echo.
        near_field: Length of the near field [m].
        choice: FIRST, LAST or STRONGEST.
        range_min: Nearest distance that is measured [m].
    """

    threshold: float
    near_field: float
    choice: int
    range_min: float


PlainReceiver = tuple[float, float, int, float]


class Lit(NamedTuple):
    """Arrays that the light of a scan fills.

    Attributes:
        ranges: (beams,) ranges [m] of the chosen echoes; they come in as those among the walls.
        walls: (beams,) their walls; they come in likewise.
        intensities: (beams,) their intensities.
        echo_ranges: (beams, k) ranges [m] of the strongest echoes, the nearest first; k is 0 where
            one echo is reported.
        echo_intensities: (beams, k) their intensities.
        chains: (beams, MOST_WALLS) the walls on the way to the chosen echo, then −1; or (0, 0).
        undecided: (beams,) which beams are left to rationals.
    """

    ranges: Float
    walls: Int
    intensities: Float
    echo_ranges: Float
    echo_intensities: Float
    chains: Int
    undecided: Bool


PlainLit = tuple[Float, Int, Float, Float, Float, Int, Bool]


class Room(NamedTuple):
    """Room to work in: rays that wait with their walls, and the echoes of a beam with theirs."""

    stack: Int
    nears: Float
    rays: Float
    ways: Int
    echoes: Float
    echo_ways: Int


GAIN, TURNS, COUNT, MIRRORED = RAY, RAY + 1, RAY + 2, RAY + 3
"""Columns after those of a ray: its share of the light, its turns, its walls, and whether the last
one mirrored it."""

WAY, LIGHT, LENGTH = 0, 1, 2
"""Columns of an echo: its range [m], its intensity, and the number of walls on its way."""


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
    room = Room(
        np.empty(STACK, np.int64),
        np.empty(STACK),
        np.empty((MOST_RAYS, RAY + 4)),
        np.empty((MOST_RAYS, MOST_WALLS), np.int64),
        np.empty((MOST_ECHOES, 3)),
        np.empty((MOST_ECHOES, MOST_WALLS), np.int64),
    )
    segments, kinds, table = optics.segments, optics.kinds, optics.table
    near, far = receiver.range_min, laser.range_max
    slots, chained = echo_ranges.shape[2], chains.shape[1] > 0
    for k in range(len(poses)):
        aim(laser, poses[k, 0], poses[k, 1], poses[k, 2], dx, dy)
        one = Lit(
            ranges[k], walls[k], intensities[k], echo_ranges[k], echo_intensities[k],
            chains[k], undecided[k],
        )  # fmt: skip
        for i in range(beams):
            wall = walls[k, i]
            if wall < 0:
                continue
            kind = kinds[wall]
            if table[kind, 6] == 0.0 and table[kind, 7] == 0.0:
                # The range among the walls stands, to the last bit.
                distance = ranges[k, i]
                bright = _surface(segments, table, wall, kind, dx[i], dy[i])[0]
                back = intensity(bright, distance, receiver.near_field)
                if back > 0.0 and back >= receiver.threshold and distance > near * NEAR_LIMIT:
                    intensities[k, i] = back
                    if slots > 0:
                        echo_ranges[k, i, 0], echo_intensities[k, i, 0] = distance, back
                    if chained:
                        chains[k, i, 0] = wall
                    continue
                room.echoes[0, WAY], room.echoes[0, LIGHT], room.echoes[0, LENGTH] = (
                    distance, back, 1
                )  # fmt: skip
                room.echo_ways[0, 0] = wall
                count = 1 if back > 0.0 and back >= receiver.threshold else 0
            else:
                ray = ray_of(poses[k, 0], poses[k, 1], dx[i], dy[i])
                count = _follow(tree, optics, receiver, far, ray, wall, room)
            if count == OPEN or _at_limit(room.echoes, count, near):
                undecided[k, i] = True
                continue
            report(room.echoes, room.echo_ways, count, receiver, i, one)


@inner
def _at_limit(echoes: Float, count: int, near: float) -> bool:
    """Whether an echo is so close to range_min [m] that rounding might decide."""
    if near > 0.0:
        for k in range(count):
            if near / NEAR_LIMIT <= echoes[k, WAY] <= near * NEAR_LIMIT:
                return True
    return False


@inner
def report(echoes: Float, ways: Int, count: int, receiver: Receiver, i: int, lit: Lit) -> None:
    """Report the echoes of a beam: one as its range, and the strongest ones in order."""
    for k in range(1, count):
        # Sorted by their ranges, and at equal ranges the stronger first; there are few.
        j = k
        while j > 0 and (
            echoes[j - 1, WAY] > echoes[j, WAY]
            or (echoes[j - 1, WAY] == echoes[j, WAY] and echoes[j - 1, LIGHT] < echoes[j, LIGHT])
        ):
            for column in range(3):
                held = echoes[j, column]
                echoes[j, column] = echoes[j - 1, column]
                echoes[j - 1, column] = held
            for column in range(MOST_WALLS):
                name = ways[j, column]
                ways[j, column] = ways[j - 1, column]
                ways[j - 1, column] = name
            j -= 1
    ranges, walls, intensities, echo_ranges, echo_intensities, chains, _ = lit
    first = 0
    while first < count and echoes[first, WAY] < receiver.range_min:
        first += 1
    ranges[i] = -np.inf if first > 0 else np.inf
    walls[i], intensities[i] = -1, 0.0
    if len(chains) > 0:
        for k in range(MOST_WALLS):
            chains[i, k] = -1
    slots = echo_ranges.shape[1]
    for slot in range(slots):
        echo_ranges[i, slot], echo_intensities[i, slot] = np.inf, 0.0
    if first == count:
        return
    chosen = count - 1 if receiver.choice == LAST else first
    if receiver.choice == STRONGEST:
        for k in range(first, count):
            if echoes[k, LIGHT] > echoes[chosen, LIGHT]:
                chosen = k
    length = int(echoes[chosen, LENGTH])
    ranges[i], intensities[i] = echoes[chosen, WAY], echoes[chosen, LIGHT]
    walls[i] = ways[chosen, length - 1]
    if len(chains) > 0:
        for k in range(length):
            chains[i, k] = ways[chosen, k]
    slot = 0
    for k in range(first, count):
        stronger = 0
        for other in range(first, count):
            if echoes[other, LIGHT] > echoes[k, LIGHT] or (
                echoes[other, LIGHT] == echoes[k, LIGHT] and other < k
            ):
                stronger += 1
        if stronger < slots:
            echo_ranges[i, slot] = echoes[k, WAY]
            echo_intensities[i, slot] = echoes[k, LIGHT]
            slot += 1


@inner
def _follow(
    tree: Tree,
    optics: Optics,
    receiver: Receiver,
    range_max: float,
    ray: Ray,
    wall: int,
    room: Room,
) -> int:
    """Follow a beam from the first wall that it meets; the number of its echoes, or OPEN."""
    # Taken out of their tuples once: each time costs as much as a test of a wall.
    segments, kinds, table, places = optics
    walls, rows = tree.walls, tree.rows
    rays, ways, stack, nears = room.rays, room.ways, room.stack, room.nears
    echoes, waiting, slot = 0, 0, 0
    gain, turns, count, row = 1.0, 0, 0, places[wall]
    while True:
        there = arrive(ray, wall_at(walls, row))
        if not there.way_error <= CERTAIN * there.way:
            return OPEN
        beyond = (there.way - range_max) + there.way_low
        if abs(beyond) <= there.way_error + CERTAIN * there.way:
            return OPEN
        if beyond < 0.0:
            name = rows[row]
            # The ray's own slot is the first that rays from here on may take.
            ways[slot, count] = name
            count += 1
            kind = kinds[name]
            bright, mirrored, passed = _surface(segments, table, name, kind, ray.dx, ray.dy)
            light_back = intensity(gain * bright, there.way, receiver.near_field)
            if light_back > 0.0 and light_back >= receiver.threshold:
                echoes = _keep(room, echoes, there.way, light_back, slot, count)
            for straight in range(2):
                share = passed if straight == 1 else mirrored
                left = gain * share * share
                turned = turns if straight == 1 else turns + 1
                if left < LEAST_SHARE or count == MOST_WALLS or turned > MOST_TURNS:
                    continue
                if waiting == MOST_RAYS:
                    return OPEN
                on = there if straight == 1 else turned_by(there, wall_at(walls, row))
                if waiting != slot:
                    for k in range(count):
                        ways[waiting, k] = ways[slot, k]
                _put(rays, waiting, on)
                rays[waiting, GAIN], rays[waiting, TURNS] = left, turned
                rays[waiting, COUNT], rays[waiting, MIRRORED] = count, 1 - straight
                waiting += 1
        while True:
            if waiting == 0:
                return echoes
            waiting -= 1
            slot = waiting
            ray = _taken(rays, slot)
            gain, turns, count = rays[slot, GAIN], int(rays[slot, TURNS]), int(rays[slot, COUNT])
            last, mirrors = places[ways[slot, count - 1]], rays[slot, MIRRORED] > 0.0
            row = next_wall(tree, ray, last, mirrors, range_max - ray.way, stack, nears)
            if row == OPEN:
                return OPEN
            if row != NONE:
                break


@inner
def _surface(
    segments: Float, table: Float, name: int, kind: int, dx: float, dy: float
) -> tuple[float, float, float]:
    """Brightness of a wall for a ray, and the shares of its light that go on mirrored and pass."""
    ex = segments[name, 2] - segments[name, 0]
    ey = segments[name, 3] - segments[name, 1]
    across, along = abs(dx * ey - dy * ex), abs(dx * ex + dy * ey)
    size = math.sqrt(across * across + along * along)
    cos, sin = across / size, along / size
    diffuse = table[kind, 0]
    mirrored, passed = shares(cos, diffuse, table[kind, 1], table[kind, 3], table[kind, 4])
    bright = brightness(cos, sin, diffuse, table[kind, 5], mirrored, table[kind, 2])
    return bright, mirrored * table[kind, 6], passed


@inner
def _keep(room: Room, echoes: int, way: float, light_back: float, slot: int, count: int) -> int:
    """Keep an echo, in place of the weakest where there is no room; the number of echoes."""
    held, ways, echo_ways = room.echoes, room.ways, room.echo_ways
    place = echoes
    if echoes == MOST_ECHOES:
        place = 0
        for k in range(echoes):
            if held[k, LIGHT] < held[place, LIGHT]:
                place = k
        if held[place, LIGHT] >= light_back:
            return echoes
    held[place, WAY], held[place, LIGHT], held[place, LENGTH] = way, light_back, count
    for k in range(count):
        echo_ways[place, k] = ways[slot, k]
    return max(echoes, place + 1)


@inner
def _put(rows: Float, row: int, ray: Ray) -> None:
    """Write a ray into a row."""
    rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3] = ray.x, ray.x_low, ray.y, ray.y_low
    rows[row, 4], rows[row, 5], rows[row, 6] = ray.dx, ray.dx_low, ray.dy
    rows[row, 7], rows[row, 8], rows[row, 9] = ray.dy_low, ray.way, ray.way_low
    rows[row, 10], rows[row, 11], rows[row, 12] = ray.place_error, ray.turn_error, ray.way_error


@inner
def _taken(rows: Float, row: int) -> Ray:
    """The ray of a row."""
    return Ray(
        rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3], rows[row, 4], rows[row, 5],
        rows[row, 6], rows[row, 7], rows[row, 8], rows[row, 9], rows[row, 10], rows[row, 11],
        rows[row, 12],
    )  # fmt: skip
