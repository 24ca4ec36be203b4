"""RawEmbreeCaster: the ranges of trimesh and Embree, without a proof.

Ranges and walls are those of ``mesh.ray.intersects_location``: the triangle is found in float32,
the distance is that of its plane in float64. It serves only for comparison.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.casting.batch_caster import limited
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import as_pose, as_poses
from lrf3d.world import World
from lrf3d.world.extrude import extrude

POSES_TRACED = 256
"""Poses whose rays are passed to trimesh at a time: with 181 beams its arrays take 20 MB."""


class RawEmbreeCaster:
    """Casts scans at the extruded walls with trimesh's ray intersector."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.mesh = extrude(world)

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The scan of trimesh from a pose."""
        ranges, walls = self.scan_batch(lrf, as_poses([pose]))
        return LaserScan.unchecked(lrf, as_pose(pose), ranges[0], walls[0])

    def scan_batch(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int]:
        """Ranges and walls (k, beams) from poses (k, 3)."""
        poses = as_poses(poses)
        ranges = np.empty((len(poses), lrf.beams))
        walls = np.empty((len(poses), lrf.beams), np.int64)
        for start in range(0, len(poses), POSES_TRACED):
            part = slice(start, start + POSES_TRACED)
            ranges[part], walls[part] = limited(lrf, *self._cast(lrf, poses[part]))
        return ranges, walls

    def _cast(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int]:
        """Distances and walls (k beams,) from poses (k, 3)."""
        origins, directions = rays(lrf, poses, self.world.origin)
        distances = np.full(len(origins), np.inf)
        walls = np.full(len(origins), -1)
        if len(self.world.segments):
            places, ray, triangle = self.mesh.ray.intersects_location(
                origins, directions, multiple_hits=False
            )
            distances[ray] = np.einsum("ij,ij->i", places - origins[ray], directions[ray])
            walls[ray] = triangle // 2
        return distances, walls


def rays(lrf: LaserRangeFinder, poses: Float, centre: Float) -> tuple[Float, Float]:
    """Origins and directions (k beams, 3) of the beams from poses (k, 3), counted from a centre."""
    origins = np.empty((len(poses), lrf.beams, 3))
    directions = np.zeros((len(poses), lrf.beams, 3))
    origins[..., :2] = (poses[:, :2] - centre)[:, None]
    origins[..., 2] = lrf.height
    for k, pose in enumerate(poses):
        directions[k, :, :2] = lrf.directions(pose)
    return origins.reshape(-1, 3), directions.reshape(-1, 3)
