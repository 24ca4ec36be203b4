"""EmbreeCaster: beams against triangles, with Embree through trimesh's intersector.

Embree finds the triangle in float32; the distance is then computed anew in float64 from the
wall, or the triangle's plane, that was hit.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lrf3d.casting.scans import limit_ranges, make_scan
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import as_poses
from lrf3d.world import World


class EmbreeCaster:
    """Casts beams in the horizontal plane of the laser against walls or any triangle mesh.

    Args:
        world: A world, whose walls are extruded to their heights, or a ``trimesh.Trimesh``,
            whose triangles then stand where a world has its walls.
    """

    def __init__(self, world: Any) -> None:
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        if isinstance(world, World):
            from lrf3d.world.extrude import extrude

            self._origin = np.append(world.origin, 0.0)
            mesh = extrude(world)
            self._triangles_per_wall = 2
            ends = world.segments.reshape(-1, 2, 2) - world.origin
            # A wall's plane, by a point on it and its normal, straight from the segment: the
            # triangles of the mesh have been through float32 only inside Embree, but three
            # corners of a flat wall give a worse normal than its two ends.
            span = ends[:, 1] - ends[:, 0]
            flat = np.zeros(len(span))
            self._points = np.column_stack([ends[:, 0], flat])
            self._normals = np.column_stack([span[:, 1], -span[:, 0], flat])
        else:
            self._origin = np.append(np.round(world.bounds.mean(axis=0))[:2], 0.0)
            mesh = world.copy()
            mesh.apply_translation(-self._origin)
            self._triangles_per_wall = 1
            corners = mesh.triangles
            self._points = corners[:, 0]
            self._normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.world = world
        self._intersector = RayMeshIntersector(mesh) if len(mesh.faces) else None

    def cast(self, lrf: LaserRangeFinder, pose: Sequence[float] | Float) -> LaserScan:
        """The true scan from a pose; ``walls`` holds triangles where a mesh was given."""
        distances, walls = self._cast(lrf, np.array([pose], dtype=np.float64))
        return make_scan(lrf, pose, distances[0], walls[0])

    def cast_batch(self, lrf: LaserRangeFinder, poses: Float) -> Float:
        """Ranges (k, beams) from poses (k, 3)."""
        return limit_ranges(self._cast(lrf, as_poses(poses))[0], lrf)

    def _cast(self, lrf: LaserRangeFinder, poses: Float) -> tuple[Float, Int]:
        """Distances (k, beams) and walls (k, beams) that the beams from poses (k, 3) meet."""
        flat = [lrf.directions(pose) for pose in poses]
        beams = np.zeros((len(poses) * lrf.beams, 3))
        beams[:, :2] = np.reshape(flat, (-1, 2))
        places = np.full((len(poses), 3), lrf.height)
        places[:, :2] = poses[:, :2]
        origins = np.repeat(places - self._origin, lrf.beams, axis=0)
        walls = np.full(len(beams), -1)
        distances = np.full(len(beams), np.inf)
        if self._intersector is not None and len(beams):
            triangles = self._intersector.intersects_first(origins, beams)
            hit = triangles >= 0
            walls[hit] = triangles[hit] // self._triangles_per_wall
            distances[hit] = self._distances(origins[hit], beams[hit], walls[hit])
        shape = (len(poses), lrf.beams)
        return distances.reshape(shape), walls.reshape(shape)

    def _distances(self, origins: Float, beams: Float, walls: Int) -> Float:
        """Distances (n,) along beams to the planes of walls, in float64."""
        normals = self._normals[walls]
        gap = np.einsum("ij,ij->i", self._points[walls] - origins, normals)
        slope = np.einsum("ij,ij->i", beams, normals)
        with np.errstate(divide="ignore", invalid="ignore"):
            distances = gap / slope
        # A beam along its wall has no distance to the plane: such a beam has no hit here.
        return np.where(np.isfinite(distances), np.maximum(distances, 0.0), np.inf)
