"""Scans, compiled: from poses to ranges and walls."""

import math

import numpy as np

from lrf3d.casting.kernels.compiling import compiled, inner
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.measure import PADDING, measure


@compiled
def cast_scan(
    boxes, links, walls, index, fan, x, y, theta, middle, half, range_min, range_max
):  # fmt: skip
    """Cast one scan; the ranges and walls, one of each for a beam."""
    ranges = np.empty(fan.shape[1])
    hit = np.empty(fan.shape[1], np.int64)
    _turn_and_cast(
        boxes, links, walls, index, fan, x, y, theta, middle, half, range_min, range_max,
        ranges, hit,
    )  # fmt: skip
    return ranges, hit


@compiled
def cast_scans(
    boxes, links, walls, index, fan, poses, middle, half, range_min, range_max, ranges, hits
):  # fmt: skip
    """Cast a scan at each of the poses (k, 3); fill ranges (k, beams), and hits unless empty."""
    own = np.empty(fan.shape[1], np.int64)
    for k in range(len(poses)):
        hit = hits[k] if len(hits) > 0 else own
        _turn_and_cast(
            boxes, links, walls, index, fan, poses[k, 0], poses[k, 1], poses[k, 2], middle, half,
            range_min, range_max, ranges[k], hit,
        )  # fmt: skip


@inner
def _turn_and_cast(
    boxes, links, walls, index, fan, x, y, theta, middle, half, range_min, range_max, ranges, hit
):  # fmt: skip
    """Turn the fan to the heading, in the very steps of `beam_directions`; cast it."""
    beams = fan.shape[1]
    cos, sin = math.cos(theta), math.sin(theta)
    dx = np.zeros(beams + PADDING)
    dy = np.zeros(beams + PADDING)
    for i in range(beams):
        dx[i] = cos * fan[0, i] - sin * fan[1, i]
        dy[i] = sin * fan[0, i] + cos * fan[1, i]
    turn_x, turn_y = math.cos(middle), math.sin(middle)
    trace(
        boxes, links, walls, index, x, y, dx, dy, cos * turn_x - sin * turn_y,
        sin * turn_x + cos * turn_y, half, range_max, hit,
    )  # fmt: skip
    measure(walls, index, x, y, dx, dy, range_min, range_max, ranges, hit)
