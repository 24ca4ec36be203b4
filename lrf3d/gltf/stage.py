"""What stands in a scene, as glTF: ground, walls and roofs in the light that is baked for films.

All stands in a local frame, whose origin the root node keeps as ``origin``: glTF counts in
float32, which knows no centimetres far away.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.geometry import Single
from lrf3d.gltf.document import Document
from lrf3d.render.packing import land_of, lit, rectangle
from lrf3d.scene.facades import BAYS, BLANK, ROWS, layers
from lrf3d.scene.look import CLAY
from lrf3d.scene.shapes import Faces, GroundPicture
from lrf3d.scene.stage import Stage

_HORIZON = 800.0
"""How far the ground goes past its picture [m]."""

_LARGEST = 2048
"""Largest side of the ground's picture [pixels]: old graphics cards take no larger ones."""

_PALE = 0.86
"""How bright a bare wall is in textures: what is whiter, such as frames, still stands out."""


def add_stage(document: Document, stage: Stage) -> None:
    """Add ground, walls and roofs."""
    _add_ground(document, stage.ground)
    # Place, texture, colour, light in the sun, in its shadow, and how far under.
    rows = stage.faces.rows()[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 16)
    whole = (rows[:, 1, :3] != rows[:, 2, :3]).any(axis=1)
    triangles = _cut_at_shadows(rows[whole])
    if len(triangles):
        _add_walls(document, triangles, layers(stage.structures.indoor)[0])


def _add_ground(document: Document, ground: GroundPicture) -> None:
    """The painted ground, and a plain one round it as far as one sees."""
    picture = Image.fromarray(ground.picture)
    picture.thumbnail((_LARGEST, _LARGEST), Image.Resampling.LANCZOS)
    texture = document.texture("ground", picture, "JPEG")
    # The first row of a picture lies at v = 0, here at the smallest y.
    places, land = rectangle((0.0, 0.0), (1.0, 1.0)), land_of(ground, _HORIZON)
    corners = np.column_stack([ground.corner + places * ground.size, np.zeros(len(places))])
    parts = [
        document.part(document.material("ground", texture=texture), corners, texture=places),
        document.part(document.material("land"), land.corners, land.colours),
    ]
    document.node("ground", document.root, *parts)


def _cut_at_shadows(rows: Single) -> Single:
    """Triangles (t, 3, 16), cut where shadows end: each is in the sun or in the shadow as a whole.

    The last column of the corners is positive in the shadow.
    """
    crossed = (rows[..., 15].min(axis=1) < 0.0) & (rows[..., 15].max(axis=1) > 0.0)
    mixed = rows[crossed]
    shadow = mixed[..., 15] > 0.0
    # The corner that is alone on its side comes first.
    alone = np.where(shadow.sum(axis=1) == 1, shadow.argmax(axis=1), shadow.argmin(axis=1))
    turn = (alone[:, None] + [0, 1, 2]) % 3
    a, b, c = np.moveaxis(np.take_along_axis(mixed, turn[..., None], axis=1), 1, 0)
    ab, ac = (a + (a[:, 15:] / (a[:, 15:] - other[:, 15:])) * (other - a) for other in (b, c))
    pieces = [np.stack(corners, axis=1) for corners in ((a, ab, ac), (ab, b, c), (ab, c, ac))]
    return np.concatenate([rows[~crossed], *pieces])


def _add_walls(document: Document, rows: Single, picture: NDArray[np.uint8]) -> None:
    """Walls and roofs: of each layer of the texture that is used, one part of the mesh."""
    in_shadow = rows[..., 15].mean(axis=1) > 0.0
    colours = rows[..., 6:9] * np.where(in_shadow[:, None, None], rows[..., 12:15], rows[..., 9:12])
    layer_of = rows[:, 0, 5].astype(int)
    parts = []
    for layer in np.unique(layer_of).tolist():
        chosen = layer_of == layer
        texture, places, shares = None, None, np.clip(colours[chosen], 0.0, 1.0)
        if layer != BLANK:
            texture = _layer(document, layer, picture[layer])
            shares = np.clip(colours[chosen] / _PALE, 0.0, 1.0)
            # The first row of a picture is its upper one.
            places = [0.0, 1.0] + rows[chosen][..., 3:5] / [BAYS, -ROWS]
        material = document.material(f"walls {layer}", texture=texture)
        corners = rows[chosen][..., :3]
        parts.append(document.part(material, corners, shares, kind=np.uint16, texture=places))
    document.node("walls", document.root, *parts)


def _layer(document: Document, layer: int, picture: NDArray[np.uint8]) -> int:
    """A layer of the texture, over a pale wall: a colour laid over it gives a house its own."""
    texels = picture.astype(np.float64)
    # That colour also dims what is painted, such as windows, which is brighter here for it.
    painted = texels[:, :, :3] * _PALE / CLAY
    seen = np.clip(np.round(painted + _PALE * texels[:, :, 3:]), 0.0, 255.0).astype(np.uint8)
    upright = Image.fromarray(np.ascontiguousarray(seen[::-1]))
    return document.texture(f"walls {layer}", upright, "PNG", tiles=True)


def add_body(document: Document, name: str, faces: Faces) -> int:
    """Add a body at the origin, lit by its normals; gives its node."""
    part = document.part(document.material(name), faces.corners, lit(faces), kind=np.uint16)
    return document.node(name, document.root, part)
