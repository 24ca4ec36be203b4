"""WallScene: walls as a trimesh in which Embree misses none, and the proof of what it found.

``mesh.ray.intersects_first`` works in float32: each position may be off by an error ε. Around each
wall lies its `strip`, all within δ = 2ε of it, squared off. A wall gets three upright triangles:

- its own plane, longer by 3δ at both ends;
- across each end, δ before it, a cap that reaches 2δ to both sides.

A beam that truly meets the wall, and starts outside its strip, crosses the strip from long side to
long side, and then float32 has it cross the plane; or it passes a short side, and then float32 has
it cross a cap. So Embree finds something of the wall, at some place of the beam's way through the
strip, give or take 5δ. In particular, a beam for which Embree finds nothing meets nothing.

Where Embree names the plane of a wall w, and the beam meets w at a point h under an angle whose
sine is at least s, Embree's place is within 5δ / s of h. A wall that the beam meets before h would
then have its strip end no more than (5 + 5 / s) δ before h, and come within (7 + 5 / s) δ of h.
Where no other wall is that near, w is the one: this part of w is `clear`, for beams of that sine.
All other beams are in doubt. The planar kernels cast these, and they measure all ranges.
"""

import numpy as np
import shapely
import trimesh

from lrf3d.casting.kernels.scans import TRUST, cast_scans, rays_of
from lrf3d.casting.kernels.tree import Plain, Tree
from lrf3d.geometry import Float, Int

FLAT, STEEP = 0.03, 0.25
"""Sines of the angles between beam and wall for which the clear part of a wall is known: flatter
than FLAT a beam is in doubt, and from STEEP on more of a wall is clear."""

LONGER, CAP, APEX = 3.0, 2.0, 4.0
"""In δ: how much longer a plane is, and half a cap. A triangle is APEX times as high above the
beams as below, where a cap ends at δ."""


class WallScene:
    """Walls in a tree, at least one, to be cast at for ranges up to a distance [m]."""

    def __init__(self, tree: Tree, distance: float) -> None:
        box = tree.boxes[0]
        # Coordinates are counted from the middle before trimesh rounds them.
        centre = np.round(0.5 * (box[:2] + box[2:]))
        # Half as far again: the laser may stand beside the world.
        radius = 1.5 * float(np.abs(box.reshape(2, 2) - centre).max()) + 1e-30
        # Both ends of a short wall may round to one point, or to a wall of another direction.
        walls, along = tree.walls - np.tile(centre, 2), tree.walls[:, 2:] - tree.walls[:, :2]
        longest = float(np.hypot(along[:, 0], along[:, 1]).max(initial=0.0))
        delta = 2.0 * float32_error(radius, min(distance + 2.0 * longest, 4.0 * radius))
        beyond = 8.0 / FLAT * float32_error(radius, 4.0 * radius)
        self._middle = centre.tolist()
        trust = [(*self._middle, radius, 1.5 * delta, beyond, FLAT, STEEP)]
        parts = [clear_parts(walls, along, (7.0 + 5.0 / sine) * delta) for sine in (FLAT, STEEP)]
        self._tree, self._clear, self._trust = tree[:], np.hstack(parts), np.array(trust, TRUST)
        vertices = triangles(walls, along, delta)
        faces = np.arange(len(vertices)).reshape(-1, 3)
        self.mesh = trimesh.Trimesh(vertices, faces, process=False, validate=False)
        # Embree's scene is built at its first ray; threads that cast share it.
        self.mesh.ray.intersects_first(np.zeros((1, 3)), np.ones((1, 3)))

    def cast(self, laser: Plain, poses: Float, ranges: Float, walls: Int) -> None:
        """Fill ranges (k, beams) of scans from poses (k, 3), and walls unless empty."""
        # The rays of 64 scans of 181 beams are 600 kB.
        for k in range(0, len(poses), 64):
            part = slice(k, k + 64)
            rays = rays_of(laser, poses[part], *self._middle)
            found = self.mesh.ray.intersects_first(*rays)
            asked = self._clear, self._trust, found
            cast_scans(self._tree, laser, asked, poses[part], ranges[part], walls[part])


def float32_error(radius: float, distance: float) -> float:
    """Bound on ε [m], at coordinates up to a radius from the middle."""
    # Ends and the laser are rounded, the laser twice: seen from the middle, and from a corner of
    # the mesh. In proportion to the distance so are the direction, twice, and each step of the
    # intersection.
    return 2.0**-24 * (6.0 * radius + 18.0 * distance)


def triangles(walls: Float, along: Float, delta: float) -> Float:
    """Vertices (9 n, 3) of the plane and the two caps of each of the walls (n, 4).

    Each is about as high as wide, as suits float32, and wide enough at z = 0, where the beams are.
    """
    length = np.hypot(along[:, 0], along[:, 1])[:, None]
    along = along / length
    across = np.column_stack([-along[:, 1], along[:, 0]])
    start, end = walls[:, :2], walls[:, 2:]
    middles = np.stack([0.5 * (start + end), start - delta * along, end + delta * along], axis=1)
    halves = np.full((len(walls), 3, 1), CAP * delta)
    halves[:, 0] = 0.5 * length + LONGER * delta
    sides = np.stack([along, across, across], axis=1) * halves
    # At z = 0 a triangle is APEX / (APEX + 1) as wide as its base.
    wide = sides * (1.0 + 1.0 / APEX)
    vertices = np.empty((len(walls), 3, 3, 3))
    vertices[..., :2] = np.stack([middles - wide, middles + wide, middles], axis=2)
    vertices[..., 2] = halves * [-2.0 / APEX, -2.0 / APEX, 2.0]
    return vertices.reshape(-1, 3)


def clear_parts(walls: Float, along: Float, reach: float) -> Float:
    """The longest part (n, 2) of each wall, from 0 to 1, with no other wall within reach [m].

    Where there is none, the first number is above the second.
    """
    length = np.hypot(along[:, 0], along[:, 1])
    lines = shapely.linestrings(walls.reshape(-1, 2, 2))
    long = np.flatnonzero(length > 2.0 * reach)
    one, other = shapely.STRtree(lines).query(lines[long], "dwithin", 1.01 * reach)
    one, other = long[one][long[one] != other], other[long[one] != other]
    # A part of a wall is near another one if it lies in the rectangle around that one.
    begin, end = np.zeros(len(one)), np.ones(len(one))
    unit = along[other] / length[other, None]
    offset = walls[one, :2] - walls[other, :2]
    for x, y, size in ((unit[:, 0], unit[:, 1], length[other]), (-unit[:, 1], unit[:, 0], 0.0)):
        at = offset[:, 0] * x + offset[:, 1] * y + 1.01 * reach
        step = along[one, 0] * x + along[one, 1] * y
        step = np.where(abs(step) < 1e-6 * reach, 1e-6 * reach, step)
        first, second = -at / step, (size + 2.02 * reach - at) / step
        begin = np.maximum(begin, np.minimum(first, second))
        end = np.minimum(end, np.maximum(first, second))
    met, edge, last = begin <= end, reach / length[long], np.full(len(long), 2.0)
    # Its own ends are left out, too.
    one = np.concatenate([one[met], long, long])
    begin = np.concatenate([begin[met], -last, 1.0 - edge])
    end = np.concatenate([end[met], edge, last])
    order = np.lexsort([begin, one])
    one, begin, end = one[order], begin[order], end[order]
    # The gaps between what is near, wall by wall: from the largest end so far to the next begin.
    low, high = (np.maximum.accumulate(end + 4.0 * one) - 4.0 * one)[:-1], begin[1:]
    gap = np.where(one[1:] == one[:-1], high - low, 0.0)
    rising = np.argsort(gap, kind="stable")
    rising = rising[gap[rising] > 0.0]
    clear = np.tile([1.0, 0.0], (len(walls), 1))
    # Of the gaps of a wall the last, which is the longest, stays.
    clear[one[rising]] = np.column_stack([low[rising], high[rising]])
    return clear
