"""Before and after Embree, compiled: the rays of a scan, and the proof of what Embree found.

`embree_walls` says when a wall that Embree names is the right one. Beams for which that does not
hold are cast again among the float64 walls.
"""

import math

import numpy as np

from lrf3d.casting.kernels.compiling import compiled, inner
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.measure import PADDING, measure
from lrf3d.casting.kernels.tree import STACK

LEAST_SINE = 0.03
"""Beams that meet a wall under a smaller angle [rad] are cast again."""


@compiled
def send(fan, x, y, theta, centre_x, centre_y):
    """Rays (beams, 3) for Embree: origins and directions."""
    beams = fan.shape[1]
    origins, directions = np.empty((beams, 3), np.float32), np.empty((beams, 3), np.float32)
    _aim(fan, x - centre_x, y - centre_y, theta, origins, directions)
    return origins, directions


@compiled
def send_many(fan, poses, centre_x, centre_y):
    """Rays (k beams, 3) for Embree of scans at poses (k, 3)."""
    beams = fan.shape[1]
    count = len(poses) * beams
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    for k in range(len(poses)):
        part = slice(k * beams, (k + 1) * beams)
        _aim(
            fan, poses[k, 0] - centre_x, poses[k, 1] - centre_y, poses[k, 2], origins[part],
            directions[part],
        )  # fmt: skip
    return origins, directions


@inner
def _aim(fan, x, y, theta, origins, directions):
    """Fill in the rays of a scan."""
    cos, sin = math.cos(theta), math.sin(theta)
    for i in range(fan.shape[1]):
        origins[i, 0], origins[i, 1], origins[i, 2] = x, y, 0.0
        directions[i, 0] = cos * fan[0, i] - sin * fan[1, i]
        directions[i, 1] = sin * fan[0, i] + cos * fan[1, i]
        directions[i, 2] = 0.0


@compiled
def prove(
    boxes, links, walls, index, clear, local, found, fan, x, y, theta, middle, half, range_min,
    range_max,
):  # fmt: skip
    """The ranges and walls of the scan at a pose for which Embree found these faces."""
    ranges = np.empty(fan.shape[1])
    hit = np.empty(fan.shape[1], np.int64)
    dx, dy = np.zeros(fan.shape[1] + PADDING), np.zeros(fan.shape[1] + PADDING)
    _prove_into(
        boxes, links, walls, index, clear, local, found, fan, x, y, theta, middle, half,
        range_min, range_max, dx, dy, ranges, hit,
    )  # fmt: skip
    return ranges, hit


@compiled
def prove_many(
    boxes, links, walls, index, clear, local, found, fan, poses, middle, half, range_min,
    range_max, ranges, hits,
):  # fmt: skip
    """Fill the ranges (k, beams) of scans at poses (k, 3), and hits unless empty."""
    beams = fan.shape[1]
    own = np.empty(beams, np.int64)
    dx, dy = np.zeros(beams + PADDING), np.zeros(beams + PADDING)
    for k in range(len(poses)):
        hit = hits[k] if len(hits) > 0 else own
        _prove_into(
            boxes, links, walls, index, clear, local, found[k * beams : (k + 1) * beams], fan,
            poses[k, 0], poses[k, 1], poses[k, 2], middle, half, range_min, range_max, dx, dy,
            ranges[k], hit,
        )  # fmt: skip


@inner
def _prove_into(
    boxes, links, walls, index, clear, local, found, fan, x, y, theta, middle, half, range_min,
    range_max, dx, dy, ranges, hit,
):  # fmt: skip
    """Prove the walls that Embree found, cast the other beams again, and fill ranges and hit."""
    beams = len(ranges)
    cos, sin = math.cos(theta), math.sin(theta)
    for i in range(beams):
        dx[i] = cos * fan[0, i] - sin * fan[1, i]
        dy[i] = sin * fan[0, i] + cos * fan[1, i]
    centre_x, centre_y, radius, margin = local
    # Where the laser stands by a wall, or too far out for the bound on Embree's error.
    lost = max(abs(x - centre_x), abs(y - centre_y)) > radius or len(found) == 0
    if lost or _touches(boxes, links, walls, x, y, margin):
        turn_x, turn_y = math.cos(middle), math.sin(middle)
        trace(
            boxes, links, walls, index, x, y, dx, dy, cos * turn_x - sin * turn_y,
            sin * turn_x + cos * turn_y, half, range_max, hit,
        )  # fmt: skip
        measure(walls, index, x, y, dx, dy, range_min, range_max, ranges, hit)
        return
    for i in range(beams):
        if found[i] < 0:
            hit[i] = -1
            continue
        row = found[i] // 3
        ax, ay = walls[row, 0] - x, walls[row, 1] - y
        ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
        slope = dx[i] * ey - dy[i] * ex
        # Where on the wall, times slope, and how far away, times slope.
        place = (dy[i] * ax - dx[i] * ay) * slope
        away = (ax * ey - ay * ex) * slope
        square = slope * slope
        if (
            clear[row, 0] * square < place < clear[row, 1] * square
            and away > 0.0
            and square > LEAST_SINE * LEAST_SINE * (ex * ex + ey * ey)
        ):
            hit[i] = row
        else:
            trace(
                boxes, links, walls, index, x, y, dx[i : i + 1], dy[i : i + 1], dx[i], dy[i], 0.0,
                range_max, hit[i : i + 1],
            )  # fmt: skip
    measure(walls, index, x, y, dx, dy, range_min, range_max, ranges, hit)


@inner
def _touches(boxes, links, walls, x, y, margin):
    """Whether the strip around a wall, of this margin, holds the point; never too rarely."""
    stack = np.empty(STACK, np.int64)
    stack[0] = 0
    top = 1 if len(walls) > 0 else 0
    while top > 0:
        top -= 1
        node = stack[top]
        if (
            x < boxes[node, 0] - margin or x > boxes[node, 2] + margin
            or y < boxes[node, 1] - margin or y > boxes[node, 3] + margin
        ):  # fmt: skip
            continue
        first, count = links[node, 0], links[node, 1]
        for k in range(first, first - count):
            stack[top] = k
            top += 1
        for row in range(first, first + count):
            ax, ay = x - walls[row, 0], y - walls[row, 1]
            ex, ey = walls[row, 2] - walls[row, 0], walls[row, 3] - walls[row, 1]
            square = ex * ex + ey * ey
            along, across = ax * ex + ay * ey, abs(ax * ey - ay * ex)
            room = margin * math.sqrt(square)
            if across <= room and -room <= along <= square + room:
                return True
    return False
