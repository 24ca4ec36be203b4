"""Scans among the walls, compiled: from a pose to ranges and walls, every decision exact."""

import math
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import expect
from lrf3d.casting.kernels.beams import BLOCK, cast_block, fill_block, new_block, within
from lrf3d.casting.kernels.fan import NARROW, Fan, trace
from lrf3d.casting.kernels.predicates import Beam, length, lengths, wall_at
from lrf3d.casting.kernels.tree import ROOM, Plain, Tree
from lrf3d.compiling import LANES, compiled, inner
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.laser import LaserRangeFinder, range_finder

turn = inner(range_finder.turn)

# [beams] Largest scans that are cast beam by beam: as fans they would take longer.
FEW = 30

# How many numbers beyond the last beam `lengths` may read and write.
PADDING = LANES - 1


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
    plain = lrf.plain
    return plain if range_min is None else (*plain[:-2], float(range_min), plain[-1])


@compiled
def cast_scans(
    plain_tree: Plain, plain_laser: Plain, poses: Float, ranges: Float, hits: Int
) -> None:
    """Cast a scan at each of the poses (k, 3); fill ranges (k · beams,), and hits unless empty.

    Where there are fewer ranges, it is one scan with a pose for each beam.
    """
    tree = Tree(*plain_tree)
    laser = Laser(*plain_laser)
    beams = laser.fan.shape[1]
    if beams <= FEW or len(ranges) < len(poses) * beams:
        _cast_singly(tree, laser, poses, ranges, hits)
        return
    own = np.empty(0 if len(hits) > 0 else beams, np.int64)
    dx = np.empty(beams + PADDING)
    dy = np.empty(beams + PADDING)
    for k in range(len(poses)):
        part = slice(k * beams, (k + 1) * beams)
        hit = hits[part] if len(hits) > 0 else own
        fan = aim(laser, poses[k], dx, dy)
        trace(tree, fan, laser.range_max, hit)
        measure(tree, fan, laser, ranges[part], hit)


@inner
def _cast_singly(tree: Tree, laser: Laser, poses: Float, ranges: Float, hits: Int) -> None:
    """Cast scans beam by beam: see `cast_scans`."""
    cosines, sines = laser.fan
    beams = len(cosines)
    rolling = len(ranges) < len(poses) * beams
    block = new_block(len(ranges))
    done = 0
    count = 0
    for k in range(len(poses)):
        x, y, theta = poses[k]
        cos = math.cos(theta)
        sin = math.sin(theta)
        for i in range(k if rolling else 0, k + 1 if rolling else beams):
            dx, dy = turn(cosines[i], sines[i], cos, sin)
            fill_block(block, count, Beam(x, y, dx, dy), -1)
            count += 1
            if count == BLOCK or done + count == len(ranges):
                cast_block(tree, block, (done, done + count), laser[-2:], ranges, hits)
                done += count
                count = 0


@compiled
def rays_from(plain: Plain, poses: Float, times: Float, rays: Records) -> None:
    """Fill the rays (k, beams) of scans from poses (k, 3), or of one from poses (beams, 3).

    Times [s] go with the poses.
    """
    cosines, sines = Laser(*plain).fan
    scans, beams = rays.shape
    rolling = scans < len(poses)
    for k in range(len(poses)):
        x, y, theta = poses[k]
        cos = math.cos(theta)
        sin = math.sin(theta)
        for i in range(k if rolling else 0, k + 1 if rolling else beams):
            ray = rays[0 if rolling else k, i]
            ray.dx, ray.dy = turn(cosines[i], sines[i], cos, sin)
            ray.x = x
            ray.y = y
            ray.time = times[k]


@inner
def aim(laser: Laser, pose: Float, dx: Float, dy: Float) -> Fan:
    """The fan at a pose (3,); dx and dy are filled with its directions."""
    x, y, theta = pose
    cosines, sines = laser.fan
    cos = math.cos(theta)
    sin = math.sin(theta)
    beams = len(cosines)
    for i in range(beams):
        dx[i], dy[i] = turn(cosines[i], sines[i], cos, sin)
    ahead_x, ahead_y = turn(math.cos(laser.middle), math.sin(laser.middle), cos, sin)
    per_step = 0.0 if laser.half <= NARROW else 0.5 * (beams - 1) / laser.half
    return Fan(x, y, dx, dy, ahead_x, ahead_y, laser.half, per_step)


@inner
def measure(tree: Tree, fan: Fan, laser: Laser, ranges: Float, hit: Int) -> None:
    """Turn the rows that the beams hit into ranges and indices of walls.

    The fan's directions are followed by PADDING numbers of any value.
    """
    range_min = laser.range_min
    range_max = laser.range_max
    # Taken out of their tuples once: each time counts a reference.
    ox = fan.x
    oy = fan.y
    dx = fan.dx
    dy = fan.dy
    walls = tree.walls
    rows = tree.rows
    beams = len(ranges)
    values = np.empty(beams + PADDING)
    stop = 0
    while stop < beams:
        # Neighbouring beams on one wall share its area, and the loop over them is vectorised.
        start = stop
        row = hit[stop]
        while stop < beams and hit[stop] == row:
            stop += 1
        if row < 0:
            for i in range(start, stop):
                ranges[i] = np.inf
            continue
        wall = wall_at(walls, row)
        lengths((ox, oy), dx, dy, wall, (start, stop), values)
        for i in range(start, stop):
            # Near a limit t is compared exactly, as its rounding error must not decide.
            t = values[i]
            ranges[i] = t
            hit[i] = rows[row]
            if range_min * ROOM < t < range_max / ROOM:
                continue
            beam = Beam(ox, oy, dx[i], dy[i])
            if not t >= 0.0:
                t = length(beam, wall)
            ranges[i] = within(t, range_min, range_max, beam, wall)
            if not math.isfinite(ranges[i]):
                hit[i] = -1
