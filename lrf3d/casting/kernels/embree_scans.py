"""Scans with Embree, compiled: from poses to ranges and walls.

Either all in one go, with Embree called from here; or in two, around a call of embreex.
"""

import math

import numpy as np

from lrf3d.casting.kernels.compiling import compiled, inner
from lrf3d.casting.kernels.embree_proof import cast_again, near_a_wall, prove
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.measure import PADDING, measure
from lrf3d.casting.kernels.packets import COHERENT, SCATTERED, WIDTH, component, find, new_packet
from lrf3d.casting.kernels.sparing import find_sparing, stride_for

ROOM = max(PADDING, WIDTH - 1)
"""How many numbers beyond the last beam those may touch that work on several at once."""


@compiled
def cast_scan(
    intersect, scene, boxes, links, walls, index, clear, owners, local, fan, x, y, theta, middle,
    half, range_min, range_max,
):  # fmt: skip
    """Cast one scan; the ranges and walls, one of each for a beam."""
    beams = fan.shape[1]
    ranges = np.empty(beams)
    hit = np.empty(beams, np.int64)
    room, faces, rows = _new_room(beams)
    stride = stride_for(beams, half, range_max, local[6])
    packet = new_packet(COHERENT if stride == 1 else SCATTERED)
    _cast_into(
        intersect, scene, boxes, links, walls, index, clear, owners, local, fan, x, y, theta,
        middle, half, range_min, range_max, stride, packet, room, faces, rows, ranges, hit,
    )  # fmt: skip
    return ranges, hit


@compiled
def cast_scans(
    intersect, scene, boxes, links, walls, index, clear, owners, local, fan, poses, middle, half,
    range_min, range_max, ranges, hits,
):  # fmt: skip
    """Cast a scan at each of the poses (k, 3); fill ranges (k, beams), and hits unless empty."""
    beams = fan.shape[1]
    own = np.empty(beams, np.int64)
    room, faces, rows = _new_room(beams)
    stride = stride_for(beams, half, range_max, local[6])
    packet = new_packet(COHERENT if stride == 1 else SCATTERED)
    for k in range(len(poses)):
        hit = hits[k] if len(hits) > 0 else own
        _cast_into(
            intersect, scene, boxes, links, walls, index, clear, owners, local, fan, poses[k, 0],
            poses[k, 1], poses[k, 2], middle, half, range_min, range_max, stride, packet, room,
            faces, rows, ranges[k], hit,
        )  # fmt: skip


@inner
def _new_room(beams):
    """Room for directions (x, y of all beams and of those cast), for faces, and for two rows."""
    directions = np.zeros((4, beams + ROOM))
    return directions, np.empty(beams + ROOM, np.int32), np.empty((2, beams), np.int64)


@inner
def _cast_into(
    intersect, scene, boxes, links, walls, index, clear, owners, local, fan, x, y, theta, middle,
    half, range_min, range_max, stride, packet, room, faces, rows, ranges, hit,
):  # fmt: skip
    """Cast a scan with Embree called from here."""
    dx, dy = room[0], room[1]
    _aim(fan, theta, dx, dy)
    if near_a_wall(boxes, links, walls, local, x, y):
        _cast_without_embree(
            boxes, links, walls, index, x, y, theta, middle, half, range_max, dx, dy, hit
        )
    else:
        scene_x, scene_y = (x - local[0]) * local[2], (y - local[1]) * local[2]
        reach = (range_max + local[5]) * local[2]
        if stride > 1:
            unsure = find_sparing(
                intersect, scene, packet, walls, clear, owners, local[6], stride, x, y, scene_x,
                scene_y, reach, half, range_max, dx, dy, room[2:], faces, rows[0], rows[1], hit,
            )  # fmt: skip
        else:
            find(intersect, scene, packet, scene_x, scene_y, dx, dy, reach, len(hit), faces)
            unsure = prove(walls, clear, owners, faces, x, y, range_max, dx, dy, hit)
        if unsure > 0:
            cast_again(
                boxes, links, walls, index, x, y, theta, middle, half, range_max, dx, dy, hit
            )
    measure(walls, index, x, y, dx, dy, range_min, range_max, ranges, hit)


@compiled
def send_rays(fan, poses, local):
    """Rays (k beams, 3) for embreex of scans at poses (k, 3): origins and directions."""
    beams = fan.shape[1]
    count = len(poses) * beams
    origins, directions = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
    dx, dy = np.empty(beams), np.empty(beams)
    for k in range(len(poses)):
        _aim(fan, poses[k, 2], dx, dy)
        for i in range(beams):
            row = k * beams + i
            origins[row, 0] = (poses[k, 0] - local[0]) * local[2]
            origins[row, 1] = (poses[k, 1] - local[1]) * local[2]
            directions[row, 0], directions[row, 1] = component(dx[i]), component(dy[i])
    return origins, directions


@compiled
def prove_scans(
    boxes, links, walls, index, clear, owners, local, found, fan, poses, middle, half, range_min,
    range_max, ranges, hits,
):  # fmt: skip
    """Fill ranges (k, beams), and hits unless empty, where embreex found these faces (k beams)."""
    beams = fan.shape[1]
    own = np.empty(beams, np.int64)
    dx, dy = np.zeros(beams + ROOM), np.zeros(beams + ROOM)
    for k in range(len(poses)):
        x, y, theta = poses[k, 0], poses[k, 1], poses[k, 2]
        hit = hits[k] if len(hits) > 0 else own
        _aim(fan, theta, dx, dy)
        if near_a_wall(boxes, links, walls, local, x, y):
            _cast_without_embree(
                boxes, links, walls, index, x, y, theta, middle, half, range_max, dx, dy, hit
            )
        else:
            faces = found[k * beams : (k + 1) * beams]
            if prove(walls, clear, owners, faces, x, y, range_max, dx, dy, hit) > 0:
                cast_again(
                    boxes, links, walls, index, x, y, theta, middle, half, range_max, dx, dy, hit
                )
        measure(walls, index, x, y, dx, dy, range_min, range_max, ranges[k], hit)


@inner
def _aim(fan, theta, dx, dy):
    """Turn the fan to the heading, in the very steps of `beam_directions`."""
    cos, sin = math.cos(theta), math.sin(theta)
    for i in range(fan.shape[1]):
        dx[i] = cos * fan[0, i] - sin * fan[1, i]
        dy[i] = sin * fan[0, i] + cos * fan[1, i]


@inner
def _cast_without_embree(
    boxes, links, walls, index, x, y, theta, middle, half, range_max, dx, dy, hit
):
    """Cast a whole scan among the float64 walls."""
    cos, sin = math.cos(theta), math.sin(theta)
    turn_x, turn_y = math.cos(middle), math.sin(middle)
    trace(
        boxes, links, walls, index, x, y, dx, dy, cos * turn_x - sin * turn_y,
        sin * turn_x + cos * turn_y, half, range_max, hit,
    )  # fmt: skip
