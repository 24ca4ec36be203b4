"""MeshScene: any triangles in 3D; Embree finds the nearest in float32, float64 measures it."""

from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.world import World


class MeshScene:
    """Triangles, moved near the origin so that float32 holds them well, with float64 planes.

    Args:
        triangles: (n, 3, 3) corners [m], seen from the origin.
        owners: (n,) what each triangle belongs to: a wall, or itself.
        origin: (3,) where the origin of the triangles lies [m].
    """

    def __init__(self, triangles: Float, owners: Int, origin: Float) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._origin = origin
        self._points = triangles[:, 0]
        self._normals = np.cross(
            triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        )
        self._owners = owners
        self._embree = EmbreeScene()
        self._kept = None
        if len(triangles):
            faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
            vertices = triangles.reshape(-1, 3).astype(np.float32)
            self._kept = TriangleMesh(self._embree, vertices, faces)

    @classmethod
    def of_world(cls, world: World) -> "MeshScene":
        """The walls of a world, each a rectangle from the ground to its height."""
        from lrf3d.world.extrude import extrude

        triangles = np.asarray(extrude(world).triangles, dtype=np.float64).reshape(-1, 3, 3)
        return cls(triangles, np.arange(len(triangles)) // 2, np.append(world.origin, 0.0))

    @classmethod
    def of_mesh(cls, mesh: Any) -> "MeshScene":
        """The triangles of a ``trimesh.Trimesh``."""
        triangles = np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3, 3)
        corners = triangles.reshape(-1, 3) if len(triangles) else np.zeros((1, 3))
        origin = np.round(0.5 * (corners.min(axis=0) + corners.max(axis=0)))
        return cls(triangles - origin, np.arange(len(triangles)), origin)

    def cast(self, origin: Float, directions: Float, reach: float) -> tuple[Float, Int]:
        """Cast rays (n, 3) from one origin (3,), no farther than about a reach [m].

        Returns:
            Distances (n,) [m], +inf for a miss, and what was hit (n,), −1 for a miss.
        """
        distances = np.full(len(directions), np.inf)
        owners = np.full(len(directions), -1)
        if self._kept is None:
            return distances, owners
        local = origin - self._origin
        origins = np.tile(local.astype(np.float32), (len(directions), 1))
        found = self._embree.run(origins, directions.astype(np.float32), reach)
        hit = found >= 0
        faces = found[hit]
        gap = np.einsum("ij,ij->i", self._points[faces] - local, self._normals[faces])
        slope = np.einsum("ij,ij->i", directions[hit], self._normals[faces])
        with np.errstate(divide="ignore", invalid="ignore"):
            measured = gap / slope
        # A ray along a triangle has no distance to its plane: such a ray has no hit here.
        distances[hit] = np.where(np.isfinite(measured), np.maximum(measured, 0.0), np.inf)
        owners[hit] = np.where(np.isfinite(measured), self._owners[faces], -1)
        return distances, owners
