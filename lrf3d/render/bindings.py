"""The modules ``GL`` and ``pyrender`` for all that draws: importing this prepares both.

Where there is no OpenGL, they are stand-ins that hold what scenes are made of and draw nothing.

pyrender's scene, nodes, camera and EGL platform are used as they are. What of its own is overridden
or reached into, and why, is this:

- ``Primitive._add_to_context`` (in :mod:`lrf3d.render.primitives`), with the ``_vaid`` and
  ``_buffers`` that its ``_in_context`` and ``delete`` go by: one interleaved buffer that can be
  rewritten, for programs of our own.
- ``Mesh.bounds`` (there): it needs ``np.infty``, which NumPy 2 took away.
- ``Renderer._configure_main_framebuffer``, ``_delete_main_framebuffer``, with ``_main_fb``,
  ``_main_fb_ms`` and ``_main_fb_dims`` (in :mod:`lrf3d.render.renderer`): framebuffers whose depth
  can be read by a shader; ``_meshes``, what is to be freed; ``_get_camera_matrices``, read.
- ``OffscreenRenderer._platform`` (there): the one context of a process, to make it current.
"""

import ctypes
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import Float
from lrf3d.render.gl import import_libraries

_GL = SimpleNamespace(GL_POINTS=0, GL_LINES=1, GL_TRIANGLES=4)
"""The constants that say what vertices make up, as OpenGL numbers them."""


class StandInPrimitive:
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


class StandInMesh:
    """Primitives that belong together."""

    def __init__(self, primitives: list[Any]) -> None:
        self.primitives = primitives


class StandInPerspectiveCamera:
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


class StandInNode:
    """A thing in a scene, and where it stands."""

    def __init__(self, thing: Any) -> None:
        self.camera = self.mesh = thing
        self.pose = np.eye(4)


class StandInScene:
    """Meshes and a camera."""

    def __init__(self) -> None:
        self.meshes: set[StandInMesh] = set()
        self.main_camera_node: StandInNode | None = None

    def add(self, thing: Any) -> StandInNode:
        """Put a mesh or the camera into the scene."""
        node = StandInNode(thing)
        if isinstance(thing, StandInPerspectiveCamera):
            self.main_camera_node = node
        else:
            self.meshes.add(thing)
        return node

    def remove_node(self, node: StandInNode) -> None:
        """Take a mesh out of the scene."""
        self.meshes.discard(node.mesh)

    def set_pose(self, node: StandInNode, pose: Float) -> None:
        """Put a thing to a pose (4, 4)."""
        node.pose = pose

    def get_pose(self, node: StandInNode) -> Float:
        """The pose (4, 4) of a thing."""
        return node.pose


_PYRENDER = SimpleNamespace(
    Mesh=StandInMesh,
    PerspectiveCamera=StandInPerspectiveCamera,
    Primitive=StandInPrimitive,
    Scene=StandInScene,
)
"""The part of pyrender that scenes need."""

GL: Any
pyrender: Any

try:
    GL, pyrender = import_libraries()
except MissingLibraryError:
    GL, pyrender = _GL, _PYRENDER


def rewrite(kind: int, values: NDArray[Any]) -> None:
    """Write a contiguous array to the beginning of the buffer that is bound.

    PyOpenGL's own wrapper of this takes several times as long as the writing.
    """
    from OpenGL.raw.GL.VERSION.GL_1_5 import glBufferSubData

    glBufferSubData(kind, 0, values.nbytes, ctypes.c_void_p(values.ctypes.data))


__all__ = ["GL", "pyrender", "rewrite"]
