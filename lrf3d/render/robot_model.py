"""The robot of the films, from ``assets/robot.glb``."""

from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from lrf3d.geometry import Float
from lrf3d.render.arrays import Single
from lrf3d.resources import assets_folder

if TYPE_CHECKING:
    from lrf3d.render.primitives import Primitive

_LASER_HEIGHT = 0.495
"""Height [m] of the laser's ring in the file."""

_DECK = 0.31
"""Height [m] of what carries the laser's column; above, the column is stretched."""


def robot_primitive(laser_height: float) -> "Primitive":
    """Load the robot as a primitive, with its laser at a height [m]."""
    # The mesh alone serves where there is no OpenGL.
    from lrf3d.render.primitives import Primitive

    rows, indices = robot_mesh(laser_height)
    return Primitive("robot", (3, 3, 3), rows, indices=indices, cull=True)


def robot_mesh(laser_height: float) -> tuple[Single, NDArray[np.uint32]]:
    """Load the robot, with its laser at a height [m], which the column is stretched to.

    Returns:
        Vertices (v, 9), position, normal and colour, and indices (3 · t,) of triangles.
    """
    mesh = trimesh.load_mesh(assets_folder() / "robot.glb", process=False)
    visual: Any = mesh.visual
    # glTF has y up, films have z up.
    vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    normals = np.asarray(mesh.vertex_normals)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    colours = np.asarray(visual.vertex_colors)[:, :3] / 255.0
    column = vertices[:, 2] > _DECK
    stretch = max(0.3, (laser_height - _DECK) / (_LASER_HEIGHT - _DECK))
    vertices[column, 2] = _DECK + (vertices[column, 2] - _DECK) * stretch
    rows = np.column_stack([vertices, normals, colours]).astype(np.float32)
    return rows, np.asarray(mesh.faces).astype(np.uint32).ravel()


def world_from_robot(pose: Float) -> Float:
    """The matrix (4, 4) of a pose x, y [m], theta [rad]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    matrix = np.eye(4)
    matrix[:2, :2] = [[cos, -sin], [sin, cos]]
    matrix[:2, 3] = pose[:2]
    return matrix
