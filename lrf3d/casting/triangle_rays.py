"""TriangleRays: which triangle a ray meets first; for pictures, float32 is enough."""

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.embree_library import embreex_installed
from lrf3d.casting.mesh_scene import MeshScene


class TriangleRays:
    """Triangles that rays are sent at: by Embree, or where it is missing by `MeshScene`.

    Args:
        triangles: (t, 3, 3) their corners [m].
    """

    def __init__(self, triangles: NDArray[np.float32]) -> None:
        self._triangles = triangles
        self._embree = self._mesh = None
        if not len(triangles):
            return
        if not embreex_installed():
            self._mesh = MeshScene(triangles.astype(np.float64), np.arange(len(triangles)))
            return
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        corners = np.ascontiguousarray(triangles.reshape(-1, 3), np.float32)
        numbers = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        self._embree = EmbreeScene()
        # Embree reads the corners from it for as long as the scene is used.
        self._kept = TriangleMesh(self._embree, corners, numbers)

    def __reduce__(self) -> tuple[type["TriangleRays"], tuple[NDArray[np.float32]]]:
        # Embree's own structures stay in their process; they are built again within milliseconds.
        return TriangleRays, (self._triangles,)

    def first(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> NDArray[np.int32]:
        """The triangle (n,) that each ray meets first, or −1, for rays (n, 3) from (n, 3)."""
        if self._embree is not None:
            return np.asarray(self._embree.run(origins, directions), np.int32)
        if self._mesh is None:
            return np.full(len(origins), -1, np.int32)
        rays = origins.astype(np.float64), directions.astype(np.float64)
        return self._mesh.cast(*rays, np.inf)[1].astype(np.int32)
