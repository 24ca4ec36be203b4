"""MeshScene: casting at triangles in 3D, in float64, and cutting them by a level plane."""

import numpy as np

from lrf3d.casting.kernels.solid import cast_solid
from lrf3d.casting.kernels.tree import build_tree
from lrf3d.geometry import Float, Int
from lrf3d.world import World


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
        ends = world.segments.reshape(-1, 2, 2)
        foot, head = np.zeros((len(ends), 2, 3)), np.empty((len(ends), 2, 3))
        foot[:, :, :2] = head[:, :, :2] = ends
        head[:, :, 2] = world.heights[:, None]
        p, q, above_q, above_p = foot[:, 0], foot[:, 1], head[:, 1], head[:, 0]
        halves = np.stack([p, q, above_q, p, above_q, above_p], axis=1)
        return cls(halves.reshape(-1, 3, 3), np.arange(2 * len(ends)) // 2)

    def cast(self, origins: Float, directions: Float, reach: float) -> tuple[Float, Int]:
        """Cast rays (n, 3) from origins (n, 3) or from one (3,), no farther than about a reach [m].

        Returns:
            Distances (n,) [m], +inf for a miss, and what was hit (n,), −1 for a miss.
        """
        distances, hits = np.empty(len(directions)), np.empty(len(directions), np.int64)
        starts = np.atleast_2d(origins)
        cast_solid(self.tree[:], self.corners, starts, directions, reach, distances, hits)
        return distances, self.owners[hits]
