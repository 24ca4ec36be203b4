"""What scenes are made of where there is no OpenGL to import pyrender with: their data alone."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from lrf3d.geometry import Float

GL = SimpleNamespace(GL_POINTS=0, GL_LINES=1, GL_TRIANGLES=4)
"""The constants that say what vertices make up, as OpenGL numbers them."""


class Primitive:
    """Vertices with a mode."""

    def __init__(self, positions: Any, mode: int) -> None:
        self.positions = positions
        self.mode = mode

    @property
    def bounds(self) -> Float:
        """Corners (2, 3) of the box around the positions [m]."""
        return np.array([self.positions.min(axis=0), self.positions.max(axis=0)])

    def _in_context(self) -> bool:
        return False


class Mesh:
    """Primitives that belong together."""

    def __init__(self, primitives: list[Any]) -> None:
        self.primitives = primitives


class PerspectiveCamera:
    """A camera's lens, looking along −z."""

    def __init__(self, yfov: float, znear: float, zfar: float) -> None:
        self.yfov, self.znear, self.zfar = yfov, znear, zfar

    def get_projection_matrix(self, width: int, height: int) -> Float:
        """The matrix (4, 4) from the camera's frame to the picture's −1…1."""
        tall = 1.0 / np.tan(0.5 * self.yfov)
        near, far = self.znear, self.zfar
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = tall * height / width, tall
        matrix[2, 2], matrix[2, 3] = (far + near) / (near - far), 2.0 * far * near / (near - far)
        matrix[3, 2] = -1.0
        return matrix


class Node:
    """A thing in a scene, and where it stands."""

    def __init__(self, thing: Any) -> None:
        self.camera = self.mesh = thing
        self.pose = np.eye(4)


class Scene:
    """Meshes and a camera."""

    def __init__(self) -> None:
        self.meshes: set[Mesh] = set()
        self.main_camera_node: Node | None = None

    def add(self, thing: Any) -> Node:
        """Put a mesh or the camera into the scene."""
        node = Node(thing)
        if isinstance(thing, PerspectiveCamera):
            self.main_camera_node = node
        else:
            self.meshes.add(thing)
        return node

    def remove_node(self, node: Node) -> None:
        """Take a mesh out of the scene."""
        self.meshes.discard(node.mesh)

    def set_pose(self, node: Node, pose: Float) -> None:
        """Put a thing to a pose (4, 4)."""
        node.pose = pose

    def get_pose(self, node: Node) -> Float:
        """The pose (4, 4) of a thing."""
        return node.pose


pyrender = SimpleNamespace(
    Mesh=Mesh, PerspectiveCamera=PerspectiveCamera, Primitive=Primitive, Scene=Scene
)
"""The part of pyrender that scenes need."""
