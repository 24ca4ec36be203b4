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


def level_cut(triangles: Float, height: float) -> tuple[Float, Int]:
    """Where triangles (n, 3, 3) meet the level plane at a height [m].

    A cut ends on edges of its triangle. Its ends are rounded to float64, to the same bits for both
    triangles at an edge, so that no beam passes between them. On vertical edges, such as those of
    houses, nothing is rounded. Triangles within the plane have no cut: their neighbours bound them.

    Returns:
        The cuts (m, 4) as segments x1 y1 x2 y2 [m], and which triangle (m,) each is of.
    """
    near = (triangles[:, :, 2].min(axis=1) <= height) & (triangles[:, :, 2].max(axis=1) >= height)
    faces = np.flatnonzero(near)
    corners = triangles[faces]
    side = np.sign(corners[:, :, 2] - height)
    # The lower end of an edge is the same for both of its triangles.
    one, other = corners, np.roll(corners, -1, axis=1)
    swap = (one[:, :, 2] > other[:, :, 2])[:, :, None]
    low, high = np.where(swap, other, one), np.where(swap, one, other)
    crosses = side * np.roll(side, -1, axis=1) < 0.0
    rise = np.where(crosses, high[:, :, 2] - low[:, :, 2], 1.0)
    share = ((height - low[:, :, 2]) / rise)[:, :, None]
    middle = low[:, :, :2] + share * (high[:, :, :2] - low[:, :, :2])
    # A triangle has two of these six points, unless it lies in the plane or touches it in a corner.
    points = np.concatenate([middle, corners[:, :, :2]], axis=1)
    meets = np.concatenate([crosses, side == 0.0], axis=1)
    cut = meets.sum(axis=1) == 2
    segments = points[cut][meets[cut]].reshape(-1, 4)
    long = (segments[:, :2] != segments[:, 2:]).any(axis=1)
    return segments[long], faces[cut][long]
