"""What stands still: ground, houses, walls and the sun, as glTF.

All stands in a local frame, whose origin the root node keeps as ``origin``: glTF
counts in float32, which knows no centimetres far away.
"""

import io

import numpy as np
import pygltflib
from numpy.typing import NDArray
from PIL import Image

from lrf3d.gltf import facades
from lrf3d.gltf.document import INDICES, VERTICES, Document, linear
from lrf3d.render.arrays import Single, quad_indices
from lrf3d.render.ground import SUN, paint_ground
from lrf3d.render.structures import Structures
from lrf3d.render.walls import CAP, FACADE, PLAIN, wall_faces

_HORIZON = 800.0
"""How far the ground goes past its picture [m]."""

_FADE = 0.08
"""Share of the ground's picture, at its edges, in which it goes over into the land around."""

_FOOT = 0.80
"""Light that is left at the foot of walls."""

_SUNLIGHT = 3.0
"""Strength of the sun [lux]: such as bring viewers that map no tones to full white."""

_DULL = {"metallicFactor": 0.0, "roughnessFactor": 0.95}


def new_document(name: str, structures: Structures) -> Document:
    """An empty document for a world: its root keeps the frame's origin and the world's name."""
    return Document(name or "world", {"origin": structures.origin.tolist(), "world": name})


def add_stage(document: Document, structures: Structures) -> None:
    """Add ground, walls and sun to a document."""
    _add_ground(document, structures)
    _add_walls(document, structures)
    _add_sun(document)


def _add_ground(document: Document, structures: Structures) -> None:
    """The painted ground, and a plain one round it as far as one sees."""
    ground = paint_ground(structures)
    file = io.BytesIO()
    # In glTF the first row of a picture lies at v = 0, here at the smallest y.
    # Sides that are powers of two spare old graphics cards a copy.
    height, width = (2 ** round(np.log2(side)) for side in ground.picture.shape[:2])
    picture = Image.fromarray(ground.picture).resize((width, height), Image.Resampling.LANCZOS)
    land = Image.new(
        "RGB", picture.size, tuple(np.round(255 * np.array(ground.beyond)).astype(int))
    )
    picture = Image.composite(picture.convert("RGB"), land, _fading(width, height))
    picture.save(file, "JPEG", quality=88)
    texture = document.texture("ground", file.getvalue(), "image/jpeg")
    painted = document.material(
        "ground", pbrMetallicRoughness={"baseColorTexture": {"index": texture}, **_DULL}
    )
    beyond = [*linear(np.array(ground.beyond)).tolist(), 1.0]
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


def _fading(width: int, height: int) -> Image.Image:
    """How much of the ground is seen: all of it but at the edges, where it fades."""
    along, up = (
        np.clip(np.minimum(places, 1.0 - places) / _FADE, 0.0, 1.0)
        for places in ((np.arange(side) + 0.5) / side for side in (width, height))
    )
    share = np.outer(up, along)
    smooth = share * share * (3.0 - 2.0 * share)
    return Image.fromarray(np.round(255.0 * smooth).astype(np.uint8))


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> Single:
    return np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]], np.float32)


def _add_walls(document: Document, structures: Structures) -> None:
    """Houses with windows, free walls without, and roofs."""
    faces = wall_faces(structures)
    quads, roofs = faces.quads, faces.roofs.reshape(-1, 14)
    windows = (quads[:, 0, 13] < PLAIN) & (quads[:, 0, 8] > facades.NARROWEST)
    floors, bands = _storeys(quads[windows])
    bare = np.concatenate([_level(quads[~windows]), bands])
    ground, upper = floors
    parts = []
    if len(ground):
        parts.append(_faces(document, "ground floors", facades.ground_floor(), ground, rows=False))
    if len(upper):
        parts.append(_faces(document, "upper floors", facades.upper_floors(), upper, rows=True))
    plain = document.material("plaster", pbrMetallicRoughness=_DULL)
    if len(bare):
        parts.append(_coloured(document, plain, bare.reshape(-1, 14), quad_indices(len(bare))))
    if len(roofs):
        grey = np.array([0.52, 0.52, 0.53])
        mix = 0.0 if structures.indoor else 0.75
        roofs = roofs.copy()
        roofs[:, 10:13] = (1.0 - mix) * roofs[:, 10:13] + mix * grey
        numbers = np.arange(len(roofs), dtype=np.uint32)
        parts.append(_coloured(document, plain, roofs, numbers))
    if parts:
        document.node("walls", document.root, mesh=document.mesh("walls", parts))


def _storeys(quads: Single) -> tuple[tuple[Single, Single], Single]:
    """Faces (n, 4, 14) with windows as ground floors, upper floors and the bands above them.

    The place along and up the face becomes that in the texture.
    """
    length, height = quads[:, 0, 8], quads[:, 0, 9]
    bays = np.maximum(1.0, np.floor(length / facades.BAY))
    storeys = np.maximum(1.0, np.floor((height - facades.CORNICE) / facades.STOREY))
    storey = (height - facades.CORNICE) / storeys
    seed = (quads[:, 0, 13] - FACADE) / 0.9
    first = np.floor(seed * 997.0 + np.arange(len(quads)) * 3.0)
    top = height - facades.CORNICE
    ground, upper, band = quads.copy(), quads.copy(), quads.copy()
    for piece, low, high in (
        (ground, np.zeros_like(top), storey),
        (upper, storey, top),
        (band, top, height),
    ):
        piece[:, :2, 2], piece[:, 2:, 2] = low[:, None], high[:, None]
    for piece, rows, tiles in (
        (ground, np.ones_like(top), 1),
        (upper, storeys - 1.0, facades.STOREYS),
    ):
        along = (first % facades.BAYS)[:, None] + bays[:, None] * [0.0, 1.0, 1.0, 0.0]
        piece[:, :, 6] = along / facades.BAYS
        # The first row of a picture is its upper one.
        piece[:, :2, 7] = 1.0
        piece[:, 2:, 7] = (1.0 - rows / tiles)[:, None]
        piece[:, :, 10:13] /= facades.PALE
    ground[:, :2, 10:13] *= _FOOT
    band[:, :, 10:13] *= 1.08
    return (ground, upper[storeys > 1.5]), band


def _level(quads: Single) -> Single:
    """Faces without windows, darker at their feet; the tops of walls darker all over."""
    quads = quads.copy()
    top = np.floor(quads[:, 0, 13]) == CAP
    quads[~top, :2, 10:13] *= _FOOT
    quads[top, :, 10:13] *= 0.7
    return quads


def _faces(
    document: Document, name: str, picture: bytes, faces: Single, *, rows: bool
) -> pygltflib.Primitive:
    """A part of a mesh with windows, whose rows repeat or not."""
    # Where rows do not repeat, the foot of a door must not show over the next storey's edge.
    texture = document.texture(name, picture, "image/png", repeat=(True, rows))
    material = document.material(
        name, pbrMetallicRoughness={"baseColorTexture": {"index": texture}, **_DULL}
    )
    flat = faces.reshape(-1, 14)
    return _coloured(document, material, flat, quad_indices(len(faces)), textured=True)


def _coloured(
    document: Document,
    material: int,
    vertices: Single,
    indices: NDArray[np.uint32],
    *,
    textured: bool = False,
) -> pygltflib.Primitive:
    """A part of a mesh from vertices (v, 14) that carry their colours."""
    colours = linear(np.clip(vertices[:, 10:13], 0.0, 1.0).astype(np.float64))
    attributes = {
        "POSITION": document.array(vertices[:, 0:3], VERTICES, bounded=True),
        "NORMAL": document.array(vertices[:, 3:6], VERTICES),
        "COLOR_0": document.array(colours, VERTICES),
    }
    if textured:
        attributes["TEXCOORD_0"] = document.array(vertices[:, 6:8], VERTICES)
    return document.part(material, attributes, document.array(indices, INDICES))


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
