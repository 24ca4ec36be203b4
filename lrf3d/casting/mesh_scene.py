"""MeshScene: casting at triangles in 3D, in float64, and cutting them by a level plane."""

import numpy as np

from lrf3d.casting.kernels.solid import cast_solid
from lrf3d.casting.kernels.tree import build_tree
from lrf3d.geometry import Float, Int
from lrf3d.world import World
from lrf3d.world.mesh import upright


class MeshScene:
    """Triangles (n, 3, 3) [m], each of an owner (n,), in a tree of boxes over the plan."""

    def __init__(self, triangles: Float, owners: Int) -> None:
        plan = triangles[:, :, :2]
        tree = build_tree(np.hstack([plan.min(axis=1), plan.max(axis=1)]))
        self.owners, self.tree = np.append(owners, -1), tree
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
        distances, hits = np.empty(len(directions)), np.empty(len(directions), np.int64)
        starts = np.atleast_2d(origins)
        cast_solid(self.tree[:], self.corners, starts, directions, reach, distances, hits)
        return distances, self.owners[hits]
