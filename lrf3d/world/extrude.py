"""Extrusion: the walls of a world as a mesh of triangles."""

from typing import TYPE_CHECKING

import numpy as np

from lrf3d.world.model import World

if TYPE_CHECKING:
    import trimesh


def extrude(world: World) -> "trimesh.Trimesh":
    """Raise every wall from the ground, z = 0, to its height.

    Triangles 2i and 2i + 1 are wall i, so ``triangle // 2`` is the wall. The mesh is in the local
    frame: ``world.origin`` is subtracted from x and y, so that float32 casters lose no digits far
    from the origin.
    """
    import trimesh

    count = len(world.segments)
    ends = world.segments.reshape(count, 2, 2) - world.origin
    vertices = np.zeros((count, 4, 3))
    vertices[:, :2, :2] = ends
    vertices[:, 2:, :2] = ends[:, ::-1]
    vertices[:, 2:, 2] = world.heights[:, None]
    first = 4 * np.arange(count)[:, None]
    faces = (first[:, :, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    # Processing would merge vertices and drop faces, and so break the numbering of the faces.
    return trimesh.Trimesh(vertices.reshape(-1, 3), faces, process=False)
