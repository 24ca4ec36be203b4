"""Light of beams in 3D, compiled: beams that may be inclined, among upright walls, in float64.

It follows the rules of `light`. Rays keep their slope, because upright mirrors turn them in plan
alone. Nothing is proved here: a leg starts at the rounded place where the one before ended and does
not meet the wall that it leaves. It meets the right wall where it passes edges by more than
rounding moves it.
"""

import math

import numpy as np

from lrf3d.casting.kernels.echoes import (
    MOST_ECHOES,
    MOST_WALLS,
    Lit,
    PlainLit,
    PlainReceiver,
    Receiver,
    keep,
    report,
)
from lrf3d.casting.kernels.light import MOST_TURNS, intensity, surface_light
from lrf3d.casting.kernels.solid import first_met
from lrf3d.casting.kernels.tree import STACK, PlainTree, Tree
from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int
from lrf3d.laser.light import LEAST_SHARE

PLACE, TURN, WAY, GAIN, TURNS, COUNT, SIZE = 0, 3, 6, 7, 8, 9, 10
"""Columns of a ray that waits: its place and its direction in 3D, the way so far [m], its share of
the light, its turns and its walls; and the number of columns."""


@compiled
def light_solid(
    plain_tree: PlainTree,
    triangles: tuple[Float, Int],
    optics: tuple[Float, Int, Float],
    plain_receiver: PlainReceiver,
    range_max: float,
    origin: Float,
    beams: Float,
    plain_lit: PlainLit,
) -> None:
    """Light beams (n, 3) of unit length from an origin (3,).

    Args:
        plain_tree: The tree over the triangles.
        triangles: Their corners (m, 3, 3) in its order, and the wall (m,) of each by its number.
        optics: Ends (w, 4) of the walls, the row (w,) of each one's material, and the materials.
        plain_receiver: What the laser makes of the light.
        range_max: Longest way [m].
        origin: Where the laser is.
        beams: The beams.
        plain_lit: What is filled, n of each.
    """
    tree, receiver, lit = Tree(*plain_tree), Receiver(*plain_receiver), Lit(*plain_lit)
    corners, owners = triangles
    segments, kinds, table = optics
    stack, nears = np.empty(STACK, np.int64), np.empty(STACK)
    rays, ways = np.empty((MOST_WALLS + 1, SIZE)), np.empty((MOST_WALLS + 1, MOST_WALLS), np.int64)
    echoes, echo_ways = np.empty((MOST_ECHOES, 3)), np.empty((MOST_ECHOES, MOST_WALLS), np.int64)
    place, chain = np.empty(3), np.empty(MOST_WALLS, np.int64)
    for i in range(len(beams)):
        for axis in range(3):
            rays[0, PLACE + axis], rays[0, TURN + axis] = origin[axis], beams[i, axis]
        rays[0, WAY], rays[0, GAIN], rays[0, TURNS], rays[0, COUNT] = 0.0, 1.0, 0.0, 0.0
        waiting, found = 1, 0
        while waiting > 0:
            waiting -= 1
            count, turns = int(rays[waiting, COUNT]), int(rays[waiting, TURNS])
            way, gain = rays[waiting, WAY], rays[waiting, GAIN]
            dx, dy, dz = rays[waiting, TURN], rays[waiting, TURN + 1], rays[waiting, TURN + 2]
            for axis in range(3):
                place[axis] = rays[waiting, PLACE + axis]
            for k in range(count):
                chain[k] = ways[waiting, k]
            left = chain[count - 1] if count > 0 else -1
            t, hit = first_met(
                tree, corners, owners, left, place, (dx, dy, dz), range_max - way, stack, nears
            )
            way += t
            if hit < 0 or way > range_max:
                continue
            name = owners[hit]
            chain[count] = name
            count += 1
            ex = segments[name, 2] - segments[name, 0]
            ey = segments[name, 3] - segments[name, 1]
            square, slope = ex * ex + ey * ey, dx * ey - dy * ex
            size = math.sqrt(square)
            along = math.hypot((dx * ex + dy * ey) / size, dz)
            bright, mirrored, passed = surface_light(table, kinds[name], abs(slope) / size, along)
            back = intensity(gain * bright, way, receiver.near_field)
            if back > 0.0 and back >= receiver.threshold:
                found = keep(echoes, echo_ways, found, way, back, chain, count)
            if count == MOST_WALLS:
                continue
            # What passes, and what is mirrored. A ray that is taken makes room for one of the two,
            # so no more than MOST_WALLS + 1 wait.
            for k in range(2):
                share = gain * (passed * passed if k == 0 else mirrored * mirrored)
                if share < LEAST_SHARE or (k == 1 and turns == MOST_TURNS):
                    continue
                twice = 0.0 if k == 0 else 2.0 * slope / square
                rays[waiting, PLACE] = place[0] + t * dx
                rays[waiting, PLACE + 1] = place[1] + t * dy
                rays[waiting, PLACE + 2] = place[2] + t * dz
                rays[waiting, TURN], rays[waiting, TURN + 1] = dx - twice * ey, dy + twice * ex
                rays[waiting, TURN + 2], rays[waiting, WAY] = dz, way
                rays[waiting, GAIN], rays[waiting, TURNS] = share, turns + k
                rays[waiting, COUNT] = count
                for j in range(count):
                    ways[waiting, j] = chain[j]
                waiting += 1
        report(echoes, echo_ways, found, receiver, i, lit)
