"""Scans among the walls, compiled: from a pose to ranges and walls, every decision exact."""

import math
from typing import NamedTuple

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM, Fan, per_step_of
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.predicates import (
    LANES,
    Beam,
    Wall,
    compare_limit,
    length,
    lengths,
    wall_at,
)
from lrf3d.casting.kernels.tree import PlainTree, Tree
from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, range_finder

turn = inner(range_finder.turn)

PADDING = LANES - 1
"""How many numbers beyond the last beam `lengths` may read and write."""


class Laser(NamedTuple):
    """A range finder as kernels take it.

    Attributes:
        fan: (2, beams) cosines and sines of the beams' angles.
        middle: The angle in the middle of the fan [rad].
        half: The angle from there to the last beam [rad].
        range_min: Nearest distance that is measured [m].
        range_max: Farthest distance that is measured [m].
    """

    fan: Float
    middle: float
    half: float
    range_min: float
    range_max: float


PlainLaser = tuple[Float, float, float, float, float]
"""A laser as Python passes it: numba needs ten times as long to find the type of a named tuple."""


def laser_of(lrf: LaserRangeFinder, *, range_min: float | None = None) -> PlainLaser:
    """A range finder for kernels, perhaps with another range_min."""
    near = lrf.range_min if range_min is None else range_min
    return lrf.fan, *lrf.spread, float(near), float(lrf.range_max)


UNSURE, ALL_UNSURE = -2, -3
"""Mark a beam in doubt, in place of the row of its wall; and in that of the first beam, all."""


@compiled
def cast_scans(
    plain_tree: PlainTree, plain_laser: PlainLaser, poses: Float, ranges: Float, hits: Int,
    known: bool,
) -> None:  # fmt: skip
    """Cast a scan at each of the poses (k, 3); fill ranges (k, beams), and hits unless empty.

    Where much is `known`, hits hold the rows that beams meet, −1 for none, and marks of doubt.
    """
    tree, laser = Tree(*plain_tree), Laser(*plain_laser)
    beams = laser.fan.shape[1]
    own = np.empty(beams, np.int64)
    dx, dy = np.zeros(beams + PADDING), np.zeros(beams + PADDING)
    for k in range(len(poses)):
        hit = hits[k] if len(hits) > 0 else own
        fan = aim(laser, poses[k, 0], poses[k, 1], poses[k, 2], dx, dy)
        whole = not known or hit[0] == ALL_UNSURE
        # A beam in doubt is a fan of one.
        for i in range(1 if whole else beams):
            if whole:
                trace(tree, fan, laser.range_max, hit)
            elif hit[i] == UNSURE:
                part = dx[i : i + 1], dy[i : i + 1], dx[i], dy[i]
                trace(tree, Fan(fan.x, fan.y, *part, 0.0, 0.0), laser.range_max, hit[i : i + 1])
        measure(tree, fan, laser, ranges[k], hit)


@inner
def aim(laser: Laser, x: float, y: float, theta: float, dx: Float, dy: Float) -> Fan:
    """The fan at a pose; dx and dy are filled with its directions."""
    cos, sin = math.cos(theta), math.sin(theta)
    fan, beams = laser.fan, laser.fan.shape[1]
    for i in range(beams):
        dx[i], dy[i] = turn(fan[0, i], fan[1, i], cos, sin)
    ahead_x, ahead_y = turn(math.cos(laser.middle), math.sin(laser.middle), cos, sin)
    return Fan(x, y, dx, dy, ahead_x, ahead_y, laser.half, per_step_of(beams, laser.half))


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
        lengths(ox, oy, dx, dy, wall, start, stop, values)
        for i in range(start, stop):
            # Near a limit t is compared exactly, as its rounding error must not decide.
            t = values[i]
            ranges[i], hit[i] = t, name
            if range_min * ROOM < t < range_max / ROOM:
                continue
            beam = Beam(ox, oy, dx[i], dy[i])
            if not t >= 0.0:
                t = length(beam, wall)
            ranges[i] = _limited(t, range_min, range_max, beam, wall)
            if not math.isfinite(ranges[i]):
                hit[i] = -1


@inner
def _limited(t: float, range_min: float, range_max: float, beam: Beam, wall: Wall) -> float:
    """The rounded t within the limits, +inf above them and −inf below, decided exactly."""
    if t >= range_max / ROOM:
        if compare_limit(range_max, beam, wall) > 0:
            return np.inf
        return min(t, range_max)
    if t <= range_min * ROOM:
        if compare_limit(range_min, beam, wall) < 0:
            return -np.inf
        return max(t, range_min)
    return t
