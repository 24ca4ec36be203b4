"""The walls and roofs of a scene as Embree has them, and what is known of each triangle."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float
from lrf3d.render.traced.facades import ALONG, COLUMNS, EXTENT, NORMAL, OFFSET, UNDER, UP

Ids = NDArray[np.int32]


class Surfaces:
    """Triangles that rays are cast at.

    Args:
        triangles: (t, 3, 15) their corners, in the rows that ``walls.py`` makes.

    Attributes:
        faces: The table of them, see :func:`face_table`.
    """

    def __init__(self, triangles: NDArray[np.float32]) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.faces = face_table(triangles)
        self._scene = EmbreeScene()
        self._kept = None
        if len(triangles):
            corners = np.ascontiguousarray(triangles[:, :, :3].reshape(-1, 3), np.float32)
            numbers = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
            self._kept = TriangleMesh(self._scene, corners, numbers)

    def nearest(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Ids:
        """The triangle (n,) that each ray meets first, or −1."""
        if self._kept is None:
            return np.full(len(origins), -1, np.int32)
        return np.asarray(self._scene.run(origins, directions), np.int32)


def face_table(triangles: NDArray[np.float32]) -> Float:
    """The table (t, COLUMNS) of triangles (t, 3, 15).

    Of each triangle: its plane, where along and up the face a point is as linear functions of the
    point, the face's length and height, its colour and kind, and how far under the edge of its
    shadow a point is, again as a linear function.
    """
    corners = triangles[:, :, :3].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-30)[:, None]
    table = np.zeros((len(triangles), COLUMNS))
    facing = triangles[:, 0, 3:6].astype(np.float64)
    table[:, NORMAL:OFFSET] = facing
    table[:, OFFSET] = np.einsum("ij,ij->i", facing, corners[:, 0])
    for column, value in ((ALONG, 6), (UP, 7), (UNDER, 14)):
        values = triangles[:, :, value].astype(np.float64)
        to_first, to_second = (values[:, k] - values[:, 0] for k in (1, 2))
        slope: Any = to_first[:, None] * np.cross(second, normal)
        slope = (slope + to_second[:, None] * np.cross(normal, first)) / square
        table[:, column : column + 3] = slope
        table[:, column + 3] = values[:, 0] - np.einsum("ij,ij->i", slope, corners[:, 0])
    table[:, EXTENT:UNDER] = triangles[:, 0, 8:14]
    return table
