"""Scans with Embree, compiled: from poses to ranges and walls.

Either all in one go, with Embree called from here; or in two, around a call of embreex.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.embree_proof import (
    Local,
    PlainKnown,
    ProvedWalls,
    cast_again,
    known_of,
    near_a_wall,
    prove,
)
from lrf3d.casting.kernels.fan import trace
from lrf3d.casting.kernels.packets import COHERENT, SCATTERED, Packets, component, packets_for
from lrf3d.casting.kernels.scans import PADDING, Laser, PlainLaser, aim, measure
from lrf3d.casting.kernels.sparing import Room, find_all, room_for, stride_for
from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int


@compiled
def cast_scan(
    intersect: int,
    scene: int,
    plain_known: PlainKnown,
    plain_laser: PlainLaser,
    x: float,
    y: float,
    theta: float,
) -> tuple[Float, Int]:
    """Cast one scan; the ranges and walls, one of each for a beam."""
    known, laser = known_of(plain_known), Laser(*plain_laser)
    beams = laser.fan.shape[1]
    ranges, hit = np.empty(beams), np.empty(beams, np.int64)
    stride = stride_for(beams, laser.half, laser.range_max, known.local.width)
    packets = packets_for(intersect, scene, COHERENT if stride == 1 else SCATTERED)
    _cast_into(packets, known, laser, (x, y, theta), stride, room_for(beams), ranges, hit)
    return ranges, hit


@compiled
def cast_scans(
    intersect: int,
    scene: int,
    plain_known: PlainKnown,
    plain_laser: PlainLaser,
    poses: Float,
    ranges: Float,
    hits: Int,
) -> None:
    """Cast a scan at each of the poses (k, 3); fill ranges (k, beams), and hits unless empty."""
    known, laser = known_of(plain_known), Laser(*plain_laser)
    beams = laser.fan.shape[1]
    own = np.empty(beams, np.int64)
    stride = stride_for(beams, laser.half, laser.range_max, known.local.width)
    packets = packets_for(intersect, scene, COHERENT if stride == 1 else SCATTERED)
    room = room_for(beams)
    for k in range(len(poses)):
        hit = hits[k] if len(hits) > 0 else own
        pose = (poses[k, 0], poses[k, 1], poses[k, 2])
        _cast_into(packets, known, laser, pose, stride, room, ranges[k], hit)


@inner
def _cast_into(
    packets: Packets,
    known: ProvedWalls,
    laser: Laser,
    pose: tuple[float, float, float],
    stride: int,
    room: Room,
    ranges: Float,
    hit: Int,
) -> None:
    """Cast a scan with Embree called from here."""
    x, y, theta = pose
    fan = aim(laser, x, y, theta, room.dx, room.dy)
    if near_a_wall(known.tree, known.local, x, y):
        trace(known.tree, fan, laser.range_max, hit)
    elif find_all(packets, known, fan, laser.range_max, stride, room, hit) > 0:
        cast_again(known.tree, laser, fan, theta, hit)
    measure(known.tree, fan, laser, ranges, hit)


@compiled
def send_rays(
    plain_laser: PlainLaser, poses: Float, local: Local
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rays (k beams, 3) for embreex of scans at poses (k, 3): origins and directions."""
    laser = Laser(*plain_laser)
    beams = laser.fan.shape[1]
    count = len(poses) * beams
    origins, directions = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
    dx, dy = np.empty(beams), np.empty(beams)
    for k in range(len(poses)):
        aim(laser, poses[k, 0], poses[k, 1], poses[k, 2], dx, dy)
        for i in range(beams):
            row = k * beams + i
            origins[row, 0] = (poses[k, 0] - local.x) * local.unit
            origins[row, 1] = (poses[k, 1] - local.y) * local.unit
            directions[row, 0], directions[row, 1] = component(dx[i]), component(dy[i])
    return origins, directions


@compiled
def prove_scans(
    known: ProvedWalls,
    found: NDArray[np.int32],
    plain_laser: PlainLaser,
    poses: Float,
    ranges: Float,
    hits: Int,
) -> None:
    """Fill ranges (k, beams), and hits unless empty, where embreex found these faces (k beams)."""
    laser = Laser(*plain_laser)
    beams = laser.fan.shape[1]
    own = np.empty(beams, np.int64)
    dx, dy = np.zeros(beams + PADDING), np.zeros(beams + PADDING)
    for k in range(len(poses)):
        x, y, theta = poses[k, 0], poses[k, 1], poses[k, 2]
        hit = hits[k] if len(hits) > 0 else own
        fan = aim(laser, x, y, theta, dx, dy)
        if near_a_wall(known.tree, known.local, x, y):
            trace(known.tree, fan, laser.range_max, hit)
        else:
            faces = found[k * beams : (k + 1) * beams]
            if prove(known, faces, x, y, dx, dy, laser.range_max, hit) > 0:
                cast_again(known.tree, laser, fan, theta, hit)
        measure(known.tree, fan, laser, ranges[k], hit)
