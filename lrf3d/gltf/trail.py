"""A robot's trail as glTF: straight pieces on the ground, each a node that grows while driven."""

import numpy as np

from lrf3d.geometry import quad_indices
from lrf3d.gltf.document import INDICES, KEYS, VERTICES, Document, linear
from lrf3d.scene.timeline import DriveKeys
from lrf3d.scene.trail_and_map import straight_pieces


def add_trail(
    document: Document,
    keys: DriveKeys,
    name: str,
    colour: tuple[float, float, float],
    width: float,
    height: float,
) -> None:
    """Add the way that was driven, as straight pieces that grow with the robot.

    Args:
        document: The document.
        keys: The way.
        name: What its nodes are called.
        colour: Red, green, blue in 0…1, as a screen shows them.
        width: Width of the trail [m].
        height: Height over the ground [m].
    """
    material = document.glowing(name, colour=linear(np.array(colour)).astype(np.float64))
    half = 0.5 * width
    strip = np.array([[0, -half, 0], [1, -half, 0], [1, half, 0], [0, half, 0]], np.float32)
    attributes = {"POSITION": document.array(strip, VERTICES, bounded=True)}
    part = document.part(material, attributes, document.array(quad_indices(1), INDICES))
    mesh = document.mesh(name, [part])
    group = document.node(name, document.root)
    for begin, end, start, way in straight_pieces(keys):
        half_turn = 0.5 * float(np.arctan2(way[1], way[0]))
        node = document.node(
            f"{name} from {begin:.1f} s",
            group,
            mesh=mesh,
            translation=[*start.tolist(), height],
            rotation=[0.0, 0.0, float(np.sin(half_turn)), float(np.cos(half_turn))],
            scale=[0.0, 0.0, 0.0],
        )
        times = document.array(np.array([begin, end], np.float32), KEYS, bounded=True)
        # Its width is there at once: a strip that widens as it grows would be a wedge.
        grown = np.array([[0, 1, 1], [np.hypot(*way), 1, 1]], np.float32)
        document.animate(node, "scale", times, document.array(grown, KEYS))
