"""Bodies as glTF: the robot, a camera that looks over its shoulder, and dynamic obstacles."""

from typing import TYPE_CHECKING

import numpy as np
import pygltflib

from lrf3d.gltf.document import INDICES, VERTICES, Document, linear
from lrf3d.scene.bodies import mover_bodies, robot_mesh
from lrf3d.scene.camera import Look
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline, mover_keys

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover


_FIELD = float(np.radians(50.0))
"""Angle of view of the camera from the bottom to the top [rad]."""

_BEHIND, _ABOVE = 4.2, 2.2
"""How far behind the robot and over the ground the camera stands among houses [m]."""


def add_robot(document: Document, laser_height: float) -> int:
    """Add the robot, looking along x in the origin, with its laser at a height [m]."""
    rows, indices = robot_mesh(laser_height)
    material = document.material(
        "robot", pbrMetallicRoughness={"metallicFactor": 0.1, "roughnessFactor": 0.5}
    )
    normals = rows[:, 3:6] / np.linalg.norm(rows[:, 3:6], axis=1, keepdims=True)
    attributes = {
        "POSITION": document.array(rows[:, 0:3], VERTICES, bounded=True),
        "NORMAL": document.array(normals, VERTICES),
        "COLOR_0": document.array(linear(rows[:, 6:9].astype(np.float64)), VERTICES),
    }
    part = document.part(material, attributes, document.array(indices, INDICES))
    return document.node("robot", document.root, mesh=document.mesh("robot", [part]))


def add_chase_camera(document: Document, robot: int, structures: Structures) -> None:
    """Add a camera that the robot carries behind it; in rooms it looks over the walls."""
    eye, target = np.array([-_BEHIND, 0.0, _ABOVE]), np.array([2.0, 0.0, 0.4])
    if structures.indoor:
        over = float(structures.heights.max(initial=0.0))
        eye, target = np.array([-0.8 * _BEHIND, 0.0, over + _BEHIND]), np.array([0.8, 0.0, 0.3])
    look = Look(eye, target, _FIELD)
    lens = pygltflib.Perspective(yfov=look.field, znear=0.1, zfar=2000.0, aspectRatio=16 / 9)
    document.gltf.cameras.append(
        pygltflib.Camera(type="perspective", perspective=lens, name="chase")
    )
    document.node("chase camera", robot, camera=0, matrix=look.pose.T.ravel().tolist())


def add_movers(document: Document, movers: "tuple[Mover, ...]") -> list[int]:
    """Add bodies at the origin that face along x; returns the numbers of their nodes."""
    nodes = []
    material = (
        document.material(
            "mover", pbrMetallicRoughness={"metallicFactor": 0.0, "roughnessFactor": 0.7}
        )
        if movers
        else 0
    )
    for number, rows in enumerate(mover_bodies(movers)):
        normals = rows[:, 3:6] / np.linalg.norm(rows[:, 3:6], axis=1, keepdims=True)
        attributes = {
            "POSITION": document.array(rows[:, 0:3], VERTICES, bounded=True),
            "NORMAL": document.array(normals, VERTICES),
            "COLOR_0": document.array(linear(rows[:, 6:9].astype(np.float64)), VERTICES),
        }
        corners = document.array(np.arange(len(rows), dtype=np.uint32), INDICES)
        name = f"mover-{number}"
        mesh = document.mesh(name, [document.part(material, attributes, corners)])
        nodes.append(document.node(name, document.root, mesh=mesh))
    return nodes


def drive_movers(document: Document, timeline: Timeline) -> None:
    """Add the dynamic obstacles of a run, each on its path."""
    run = timeline.run
    for number, mover in zip(add_movers(document, run.movers), run.movers, strict=True):
        document.drive(number, *mover_keys(mover, timeline))
