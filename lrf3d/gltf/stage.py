"""What stands in a scene, as glTF: ground, houses, walls and the sun, the robot and what moves.

All stands in a local frame, whose origin the root node keeps as ``origin``: glTF
counts in float32, which knows no centimetres far away.
"""

import io
from typing import TYPE_CHECKING, Any

import numpy as np
import pygltflib
from numpy.typing import NDArray
from PIL import Image

from lrf3d.geometry import Single, quad_indices
from lrf3d.gltf.document import INDICES, VERTICES, Document, linear
from lrf3d.scene.bodies import obstacle_bodies, robot_mesh
from lrf3d.scene.camera import Look
from lrf3d.scene.facades import BAYS, BLANK, ROWS, layers
from lrf3d.scene.light import open_light, screen
from lrf3d.scene.look import CLAY, SUN
from lrf3d.scene.shapes import GroundPicture, Painted
from lrf3d.scene.stage import paint_stage
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline, obstacle_keys

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle


_HORIZON = 800.0
"""How far the ground goes past its picture [m]."""

_PALE = 0.86
"""How bright a bare wall is in textures: what is whiter, such as frames, still stands out."""

_FINER = 2
"""Pixels of a texture to both sides of a texel."""

_SUNLIGHT = 3.0
"""Strength of the sun [lux]: such as bring viewers that map no tones to full white."""

_HIDDEN = 0.6
"""How much of the sky's light counts in the colours of walls: the other part is the sun's."""

_DULL = {"metallicFactor": 0.0, "roughnessFactor": 0.95}


def new_document(name: str, structures: Structures) -> Document:
    """An empty document for a world: its root keeps the frame's origin and the world's name."""
    return Document(name or "world", {"origin": structures.origin.tolist(), "world": name})


def add_stage(document: Document, structures: Structures) -> None:
    """Add ground, walls and sun to a document."""
    stage = paint_stage(structures)
    _add_ground(document, stage.ground)
    _add_walls(document, structures, stage.walls, stage.roofs)
    _add_sun(document)


def _add_ground(document: Document, ground: GroundPicture) -> None:
    """The painted ground, and a plain one round it as far as one sees."""
    file = io.BytesIO()
    # In glTF the first row of a picture lies at v = 0, here at the smallest y.
    # Sides that are powers of two spare old graphics cards a copy.
    size = [2 ** round(np.log2(min(side, 2048))) for side in ground.picture.shape[1::-1]]
    picture = Image.fromarray(ground.picture).resize((size[0], size[1]), Image.Resampling.LANCZOS)
    picture.save(file, "JPEG", quality=88)
    texture = document.texture("ground", file.getvalue(), "image/jpeg")
    painted = document.material(
        "ground", pbrMetallicRoughness={"baseColorTexture": {"index": texture}, **_DULL}
    )
    beyond = [*linear(ground.land).tolist(), 1.0]
    plain = document.material("land", pbrMetallicRoughness={"baseColorFactor": beyond, **_DULL})
    low, high = ground.corner, ground.corner + ground.size
    (x0, y0), (x1, y1) = low - _HORIZON, high + _HORIZON
    middle = _rectangle(*low, *high)
    around = np.concatenate(
        [
            _rectangle(x0, y0, x1, low[1]),
            _rectangle(x0, high[1], x1, y1),
            _rectangle(x0, low[1], low[0], high[1]),
            _rectangle(high[0], low[1], x1, high[1]),
        ]
    )
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    parts = []
    for material, quads, uv in ((painted, middle, corners), (plain, around, None)):
        up = np.tile(np.array([[0, 0, 1]], np.float32), (len(quads), 1))
        attributes = {
            "POSITION": document.array(quads, VERTICES, bounded=True),
            "NORMAL": document.array(up, VERTICES),
        }
        if uv is not None:
            attributes["TEXCOORD_0"] = document.array(uv, VERTICES)
        indices = document.array(quad_indices(len(quads) // 4), INDICES)
        parts.append(document.part(material, attributes, indices))
    document.node("ground", document.root, mesh=document.mesh("ground", parts))


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> Single:
    return np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]], np.float32)


def _add_walls(document: Document, structures: Structures, walls: Painted, roofs: Painted) -> None:
    """Walls and roofs: of each layer of the texture that is used, one part of the mesh."""
    quads = walls._replace(
        **{
            name: getattr(walls, name)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)
            for name in ("places", "normals", "texture", "colours", "shaded")
        }
    )
    # Players have a sky that shines on all alike; what of it is hidden darkens the colours.
    full = screen(open_light(indoor=structures.indoor))
    corners = np.concatenate(
        [
            np.concatenate(
                [
                    *(each.places, each.normals, each.texture),
                    each.colours * np.minimum(each.shaded / full, 1.0) ** _HIDDEN,
                ],
                axis=2,
            )
            for each in (quads, roofs)
        ]
    ).astype(np.float32)
    picture = layers(structures.indoor)[0]
    parts = []
    for layer in np.unique(corners[:, 0, 8]).astype(int).tolist():
        rows = corners[corners[:, 0, 8] == layer].reshape(-1, 12)
        look: dict[str, Any] = {}
        if layer != BLANK:
            look["baseColorTexture"] = {"index": _layer(document, layer, picture[layer])}
            rows[:, 9:12] /= _PALE
            # The first row of a picture is its upper one.
            rows[:, 6:8] = [0.0, 1.0] + rows[:, 6:8] / [BAYS, -ROWS]
        material = document.material(f"walls {layer}", pbrMetallicRoughness={**look, **_DULL})
        colours = linear(np.clip(rows[:, 9:12], 0.0, 1.0).astype(np.float64))
        rows, indices = np.unique(
            np.concatenate([rows[:, :8], colours], axis=1), axis=0, return_inverse=True
        )
        attributes = {
            "POSITION": document.array(rows[:, 0:3], VERTICES, bounded=True),
            "NORMAL": document.array(rows[:, 3:6], VERTICES),
            "COLOR_0": document.array(rows[:, 8:11], VERTICES),
        }
        if look:
            attributes["TEXCOORD_0"] = document.array(rows[:, 6:8], VERTICES)
        numbers = document.array(indices.ravel().astype(np.uint32), INDICES)
        parts.append(document.part(material, attributes, numbers))
    if parts:
        document.node("walls", document.root, mesh=document.mesh("walls", parts))


def _layer(document: Document, layer: int, picture: NDArray[np.uint8]) -> int:
    """A layer of the texture, over a pale wall: a colour laid over it gives a house its own."""
    texels = picture.astype(np.float64)
    # That colour also dims what is painted, such as windows, which is brighter here for it.
    painted = texels[:, :, :3] * _PALE / CLAY
    seen = np.clip(np.round(painted + _PALE * texels[:, :, 3:]), 0.0, 255.0).astype(np.uint8)
    # Players blur what they magnify: of texels twice as many, only the half.
    file = io.BytesIO()
    finer = np.repeat(np.repeat(seen[::-1], _FINER, axis=0), _FINER, axis=1)
    Image.fromarray(finer).save(file, "PNG", optimize=True)
    return document.texture(f"walls {layer}", file.getvalue(), "image/png", repeat=(True, True))


def _add_sun(document: Document) -> None:
    """A sun where the painted shadows have it."""
    document.extension("KHR_lights_punctual")
    sun = {"type": "directional", "color": [1.0, 0.96, 0.9], "intensity": _SUNLIGHT, "name": "sun"}
    document.gltf.extensions = {"KHR_lights_punctual": {"lights": [sun]}}
    # A light shines along −z of its node, which is turned from straight down to the sun's way.
    axis = np.cross([0.0, 0.0, 1.0], SUN)
    half = 0.5 * np.arccos(SUN[2] / np.linalg.norm(SUN))
    turn = np.sin(half) * axis / np.linalg.norm(axis)
    document.node(
        "sun",
        document.root,
        rotation=[*turn.tolist(), float(np.cos(half))],
        extensions={"KHR_lights_punctual": {"light": 0}},
    )


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


def add_obstacles(document: Document, obstacles: "tuple[DynamicObstacle, ...]") -> list[int]:
    """Add bodies at the origin that face along x; returns the numbers of their nodes."""
    nodes = []
    material = (
        document.material(
            "obstacle", pbrMetallicRoughness={"metallicFactor": 0.0, "roughnessFactor": 0.7}
        )
        if obstacles
        else 0
    )
    for number, rows in enumerate(obstacle_bodies(obstacles)):
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


def drive_obstacles(document: Document, timeline: Timeline) -> None:
    """Add the dynamic obstacles of a run, each on its path."""
    run = timeline.run
    for number, obstacle in zip(add_obstacles(document, run.obstacles), run.obstacles, strict=True):
        document.drive(number, *obstacle_keys(obstacle, timeline))
