"""Dynamic obstacles as glTF."""

from typing import TYPE_CHECKING

import numpy as np

from lrf3d.gltf.document import INDICES, KEYS, VERTICES, Document, linear
from lrf3d.gltf.keys import mover_keys
from lrf3d.render.movers import mover_bodies
from lrf3d.render.timeline import Timeline

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover


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
        times, poses = mover_keys(mover, timeline)
        poses -= [*timeline.origin, 0.0]
        places = np.column_stack([poses[:, :2], np.zeros(len(poses))]).astype(np.float32)
        turns = np.zeros((len(poses), 4), np.float32)
        turns[:, 2], turns[:, 3] = np.sin(0.5 * poses[:, 2]), np.cos(0.5 * poses[:, 2])
        node = document.gltf.nodes[number]
        node.translation, node.rotation = places[0].tolist(), turns[0].tolist()
        if len(times) > 1:
            keys = document.array((times - timeline.start).astype(np.float32), KEYS, bounded=True)
            document.animate(number, "translation", keys, document.array(places, KEYS))
            document.animate(number, "rotation", keys, document.array(turns, KEYS))
