"""Rays among triangles in 3D: exact in float64, and by Embree for pictures."""

import multiprocessing
import warnings
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import Lrf3dWarning, MissingLibraryError
from lrf3d.casting.kernels.solid import cast_solid
from lrf3d.casting.kernels.tree import build_tree
from lrf3d.geometry.lines import Float, Int, Single
from lrf3d.world import World
from lrf3d.world.mesh import upright


class MeshScene:
    """Triangles (n, 3, 3) [m], each of an owner (n,), to cast at in float64."""

    def __init__(self, triangles: Float, owners: Int) -> None:
        plan = triangles[:, :, :2]
        tree = build_tree(np.hstack([plan.min(axis=1), plan.max(axis=1)]))
        self.owners = np.append(owners, -1)
        self.tree = tree
        self.corners = np.ascontiguousarray(triangles[tree.rows])

    @classmethod
    def of(cls, world: World, triangles: Float | None = None) -> "MeshScene":
        """Triangles; or the walls of a world, each of two from the ground to its height."""
        if triangles is not None:
            return cls(triangles, np.arange(len(triangles)))
        halves = upright(world)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)
        return cls(halves, np.arange(len(halves)) // 2)

    def cast(self, origins: Float, directions: Float, reach: float) -> tuple[Float, Int]:
        """Cast rays (n, 3) from origins (n, 3) or from one (3,), no farther than about a reach [m].

        Distances (n,) [m] are +inf for a miss; what was hit (n,) is −1 for it.
        """
        distances = np.empty(len(directions))
        hits = np.empty(len(directions), np.int64)
        rays = np.atleast_2d(origins), directions
        cast_solid(self.tree[:], self.corners, *rays, reach, distances, hits)
        return distances, self.owners[hits]


@cache
def embreex_installed() -> bool:
    """Whether embreex is installed; if not, warns once, and beams are cast without it."""
    try:
        require_embreex("Embree")
    except MissingLibraryError:
        # The processes that a program starts would each repeat the warning.
        if multiprocessing.parent_process() is None:
            warnings.warn(
                "embreex is not installed: beams are cast without Embree, to the same ranges",
                Lrf3dWarning,
                stacklevel=2,
            )
        return False
    return True


def require_embreex(task: str) -> None:
    """Raise a MissingLibraryError if embreex, which a task needs, is not installed."""
    try:
        import embreex.rtcore_scene  # noqa: F401
    except ImportError:
        raise MissingLibraryError(
            f"{task} needs Embree: pip install embreex (for Linux on ARM it has no wheel)"
        ) from None


class TriangleRays:
    """Triangles (t, 3, 3) [m] where float32 is enough; without embreex cast by `MeshScene`."""

    def __init__(self, triangles: Single) -> None:
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
        # Its own tree is built at the first ray; threads that cast share it.
        self._embree.run(corners[:1], corners[:1])

    def __reduce__(self) -> tuple[type["TriangleRays"], tuple[Single]]:
        # Embree's own structures stay in their process; they are built again within milliseconds.
        return TriangleRays, (self._triangles,)

    def first(self, origins: Single, directions: Single) -> NDArray[np.int32]:
        """The triangle (n,) that each ray meets first, or −1, for rays (n, 3) from (n, 3)."""
        if self._embree is not None:
            return np.asarray(self._embree.run(origins, directions), np.int32)
        if self._mesh is None:
            return np.full(len(origins), -1, np.int32)
        # The mesh takes beams, which are unit vectors; rays of pictures are not.
        ways = directions.astype(np.float64)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        return self._mesh.cast(origins.astype(np.float64), ways, np.inf)[1].astype(np.int32)
