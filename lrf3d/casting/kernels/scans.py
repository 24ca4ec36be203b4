"""Scans among the walls, compiled: from a pose to ranges and walls, every decision exact.

Of the faces that Embree found those are used that are proved; `wall_scene` has the argument.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.beams import within
from lrf3d.casting.kernels.fan import NARROW, Fan, trace
from lrf3d.casting.kernels.predicates import FILTER, LANES, Beam, length, lengths, wall_at
from lrf3d.casting.kernels.tree import ROOM, STACK, Plain, Tree
from lrf3d.compiling import compiled, inner, record
from lrf3d.errors import expect
from lrf3d.geometry import Float, Int, Records, Single
from lrf3d.laser import LaserRangeFinder, range_finder

turn = inner(range_finder.turn)

UNSURE = -2
"""Marks a beam in doubt, in place of the row of its wall."""

NAMES = ("x", "y", "radius", "margin", "beyond", "level", "steep")
TRUST = record(**dict.fromkeys(NAMES, float))
"""How far Embree is trusted [m]: the middle of the walls; how far from x and from y the laser may
stand, but not so near to a wall; what seems this much beyond the range is out of it; and the least
sines of the angle between a beam and a wall whose first clear part counts, and its second one."""

PADDING = LANES - 1
"""How many numbers beyond the last beam `lengths` may read and write."""


class Laser(NamedTuple):
    """A range finder as kernels take it."""

    fan: Float  # (2, beams) cosines and sines of the beams' angles.
    middle: float  # The angle in the middle of the fan [rad],
    half: float  # and from there to the last beam.
    range_min: float
    range_max: float


def laser_of(lrf: LaserRangeFinder, *, range_min: float | None = None) -> Plain:
    """A range finder, checked to be one, for kernels, perhaps with another range_min."""
    expect(lrf, LaserRangeFinder, "range finder")
    near = lrf.range_min if range_min is None else range_min
    return lrf.fan, *lrf.spread, float(near), float(lrf.range_max)


NOT_ASKED = np.empty((0, 4)), np.empty(1, TRUST), np.empty(0, np.int32)
"""In place of what Embree found, where it was not asked."""


@compiled
def cast_scans(
    plain_tree: Plain, plain_laser: Plain, asked: Plain, poses: Float, ranges: Float, hits: Int
) -> None:
    """Cast a scan at each of the poses (k, 3); fill ranges (k, beams), and hits unless empty.

    Where Embree was asked, this is the parts of the walls (n, 4) where it is right, in the first of
    some records how far, and the faces (k beams,) that it met.
    """
    (clear, _, found), trust = asked, asked[1][0]
    tree, laser = Tree(*plain_tree), Laser(*plain_laser)
    beams = laser.fan.shape[1]
    own = np.empty(0 if len(hits) > 0 else beams, np.int64)
    dx, dy = np.empty(beams + PADDING), np.empty(beams + PADDING)
    for k in range(len(poses)):
        hit = hits[k] if len(hits) > 0 else own
        fan = aim(laser, poses[k], dx, dy)
        whole = len(found) == 0 or near_a_wall(tree, trust, fan.x, fan.y)
        if not whole:
            faces = found[k * beams : (k + 1) * beams]
            prove(tree, clear, trust, faces, fan, laser.range_max, hit)
        # A beam in doubt is a fan of one.
        for i in range(1 if whole else beams):
            if whole:
                trace(tree, fan, laser.range_max, hit)
            elif hit[i] == UNSURE:
                part = dx[i : i + 1], dy[i : i + 1], dx[i], dy[i]
                trace(tree, Fan(fan.x, fan.y, *part, 0.0, 0.0), laser.range_max, hit[i : i + 1])
        measure(tree, fan, laser, ranges[k], hit)


@compiled
def rays_of(plain: Plain, poses: Float, x: float, y: float) -> tuple[Single, Single]:
    """Origins and directions (k beams, 3) of the scans at poses (k, 3), seen from (x, y)."""
    cosines, sines = Laser(*plain).fan
    count = len(poses) * len(cosines)
    starts, ways, row = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32), 0
    for k in range(len(poses)):
        at_x, at_y, theta = poses[k]
        cos, sin = math.cos(theta), math.sin(theta)
        for i in range(len(cosines)):
            way = turn(cosines[i], sines[i], cos, sin)
            for axis, place in enumerate((at_x - x, at_y - y)):
                starts[row, axis], ways[row, axis] = place, way[axis]
            row += 1
    return starts, ways


@compiled
def rays_from(plain: Plain, poses: Float, times: Float, rays: Records) -> None:
    """Fill the rays (k, beams) of scans from poses (k, 3), or of one from poses (beams, 3).

    Times [s] go with the poses.
    """
    (cosines, sines), (scans, beams) = Laser(*plain).fan, rays.shape
    rolling, cos, sin, x, y = scans < len(poses), 1.0, 0.0, 0.0, 0.0
    for k in range(scans):
        for i in range(beams):
            at, ray = i if rolling else k, rays[k, i]
            if rolling or i == 0:
                x, y, theta = poses[at]
                cos, sin = math.cos(theta), math.sin(theta)
            ray.dx, ray.dy = turn(cosines[i], sines[i], cos, sin)
            ray.x, ray.y, ray.time = x, y, times[at]


@inner
def aim(laser: Laser, pose: Float, dx: Float, dy: Float) -> Fan:
    """The fan at a pose (3,); dx and dy are filled with its directions."""
    (x, y, theta), (cosines, sines) = pose, laser.fan
    cos, sin, beams = math.cos(theta), math.sin(theta), len(cosines)
    for i in range(beams):
        dx[i], dy[i] = turn(cosines[i], sines[i], cos, sin)
    ahead_x, ahead_y = turn(math.cos(laser.middle), math.sin(laser.middle), cos, sin)
    per_step = 0.0 if laser.half <= NARROW else 0.5 * (beams - 1) / laser.half
    return Fan(x, y, dx, dy, ahead_x, ahead_y, laser.half, per_step)


@inner
def prove(
    tree: Tree, clear: Float, trust: Any, found: NDArray[np.int32], fan: Fan, range_max: float,
    hit: Int,
) -> None:  # fmt: skip
    """From the faces (beams,) that Embree found to the rows of the walls, −1, or doubt."""
    x, y, dx, dy, walls, beams = fan.x, fan.y, fan.dx, fan.dy, tree.walls, len(hit)
    stop = 0
    while stop < beams:
        # Neighbouring beams on one face share its numbers, and the loop over them is vectorised.
        start, face = stop, found[stop]
        while stop < beams and found[stop] == face:
            stop += 1
        if face < 0 or face % 3 != 0:
            for i in range(start, stop):
                hit[i] = -1 if face < 0 else UNSURE
            continue
        row = face // 3
        px, py, qx, qy = wall_at(walls, row)
        ax, ay, ex, ey = px - x, py - y, qx - px, qy - py
        left, right = ax * ey, ay * ex
        # Slopes are taken with the sign that the beam ahead of the wall gives them.
        sense, length = 1.0 if left > right else -1.0, math.sqrt(ex * ex + ey * ey)
        flat, steep = trust.level * length, trust.steep * length
        low, high, steep_low, steep_high = wall_at(clear, row)
        # How far away the beam meets the wall at least, times its slope.
        away = abs(left - right) - FILTER * (abs(left) + abs(right))
        for i in range(start, stop):
            slope = sense * (dx[i] * ey - dy[i] * ex)
            place = sense * (dy[i] * ax - dx[i] * ay)  # Where on the wall, times its slope.
            sure = (slope > flat) & (low * slope < place) & (place < high * slope)
            sure |= (slope > steep) & (steep_low * slope < place) & (place < steep_high * slope)
            near = away <= range_max * ROOM * slope
            far = away > (range_max + trust.beyond) * slope
            hit[i] = (row if near else -1) if sure & (near | far) else UNSURE


@inner
def near_a_wall(tree: Tree, trust: Any, x: float, y: float) -> bool:
    """Whether Embree is not to be trusted here: by a wall, or too far out; never too rarely."""
    boxes, links, walls, _ = tree
    stack, top = np.empty(STACK, np.int64), 1
    stack[0] = 0
    while top > 0:
        top -= 1
        node = stack[top]
        x0, y0, x1, y1 = wall_at(boxes, node)
        if max(x0 - x, x - x1, y0 - y, y - y1) > trust.margin:
            continue
        first, count = links[node, 0], links[node, 1]
        for child in range(first, first - count):
            stack[top] = child
            top += 1
        for row in range(first, first + count):
            px, py, qx, qy = wall_at(walls, row)
            ax, ay, ex, ey = x - px, y - py, qx - px, qy - py
            square, along = ex * ex + ey * ey, ax * ex + ay * ey
            room = trust.margin * math.sqrt(square)
            if abs(ax * ey - ay * ex) <= room and -room <= along <= square + room:
                return True
    return bool(max(abs(x - trust.x), abs(y - trust.y)) > trust.radius)


@inner
def measure(tree: Tree, fan: Fan, laser: Laser, ranges: Float, hit: Int) -> None:
    """Turn the rows that the beams hit into ranges and indices of walls.

    The fan's directions are followed by PADDING numbers of any value.
    """
    range_min, range_max = laser.range_min, laser.range_max
    # Taken out of their tuples once: each time counts a reference.
    ox, oy, dx, dy, walls, rows = fan.x, fan.y, fan.dx, fan.dy, tree.walls, tree.rows
    beams = len(ranges)
    values = np.empty(beams + PADDING)
    stop = 0
    while stop < beams:
        # Neighbouring beams on one wall share its area, and the loop over them is vectorised.
        start, row = stop, hit[stop]
        while stop < beams and hit[stop] == row:
            stop += 1
        if row < 0:
            for i in range(start, stop):
                ranges[i] = np.inf
            continue
        wall, name = wall_at(walls, row), rows[row]
        lengths((ox, oy), dx, dy, wall, (start, stop), values)
        for i in range(start, stop):
            # Near a limit t is compared exactly, as its rounding error must not decide.
            t = values[i]
            ranges[i], hit[i] = t, name
            if range_min * ROOM < t < range_max / ROOM:
                continue
            beam = Beam(ox, oy, dx[i], dy[i])
            if not t >= 0.0:
                t = length(beam, wall)
            ranges[i] = within(t, range_min, range_max, beam, wall)
            if not math.isfinite(ranges[i]):
                hit[i] = -1
