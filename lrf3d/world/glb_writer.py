"""Writing a world as GLB: walls raised to their heights, a part for each object.

glTF holds float32, so vertices stand about the world's origin, and the place of the origin is the
translation of each part; y is up.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.output import replacing
from lrf3d.world.extrude import extrude
from lrf3d.world.model import World

PLAIN = 0.78
"""Grey of walls without a colour."""


def write_glb(world: World, path: Path) -> None:
    """Write a world as GLB.

    Raises:
        OutputError: The file cannot be written.
    """
    with replacing(path) as unfinished:
        unfinished.write_bytes(glb_bytes(world))


def glb_bytes(world: World) -> bytes:
    """The bytes of a binary glTF file of a world."""
    import trimesh

    visual: Any = trimesh.visual
    whole = extrude(world)
    upright = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
    turned = np.asarray(whole.vertices) @ upright[:3, :3].T
    to_source = np.eye(4)
    to_source[:3, 3] = upright[:3, :3] @ [*world.origin, 0.0]
    scene: Any = trimesh.Scene()
    for number in np.unique(world.objects).tolist():
        own = np.flatnonzero(world.objects == number)
        corners = (4 * own[:, None] + np.arange(4)).reshape(-1)
        faces = (
            np.asarray(whole.faces)[:2].reshape(1, 2, 3) + 4 * np.arange(len(own))[:, None, None]
        )
        colour = world.colours[number]
        shade = np.append(colour if np.isfinite(colour).all() else np.full(3, PLAIN), 1.0)
        material = visual.material.PBRMaterial(
            baseColorFactor=shade, metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True
        )
        mesh = trimesh.Trimesh(
            turned[corners],
            faces.reshape(-1, 3),
            process=False,
            visual=visual.TextureVisuals(material=material),
        )
        given = world.object_names[number] if world.object_names else ""
        name = (
            given if given and given not in scene.graph.nodes else f"{given or 'object'} {number}"
        )
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=to_source)
    return bytes(scene.export(file_type="glb"))
