"""A glTF document in the making: arrays become accessors, and all of them one block of bytes.

The classes of the format and the packing of the file are pygltflib's.
"""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
import pygltflib
from numpy.typing import NDArray
from PIL import Image
from pygltflib import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER

from lrf3d.geometry import Float

VERTICES, INDICES, KEYS = ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, 0
"""What an array is for: the format wants each kind in buffer views of its own."""

_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_COMPONENTS = {
    "float32": pygltflib.FLOAT,
    "uint8": pygltflib.UNSIGNED_BYTE,
    "uint16": pygltflib.UNSIGNED_SHORT,
    "uint32": pygltflib.UNSIGNED_INT,
}

_ALIGNMENT = 4
"""Bytes that the start of every accessor is a multiple of."""


class Document:
    """Collects nodes, meshes and one animation, in a frame with z up, in metres.

    All materials keep their colours in any light. The root node has the name of the document, and
    extras for programs.
    """

    def __init__(self, name: str, extras: Mapping[str, Any]) -> None:
        asset = pygltflib.Asset(version="2.0", generator="lrf3d")
        unlit = ["KHR_materials_unlit"]
        self.gltf = pygltflib.GLTF2(asset=asset, scene=0, extensionsUsed=unlit)
        self._streams: dict[tuple[int, str, int], bytearray] = {}
        self._accessors: list[tuple[tuple[int, str, int], pygltflib.Accessor]] = []
        self._pictures: list[tuple[pygltflib.Image, bytes]] = []
        self._animation = pygltflib.Animation(name="drive", samplers=[], channels=[])
        # A quarter turn about x: glTF has y up.
        half = float(np.sqrt(0.5))
        self.root = self.node(name, rotation=[-half, 0.0, 0.0, half], extras=dict(extras))
        self.gltf.scenes = [pygltflib.Scene(nodes=[self.root], name=name)]

    def array(self, values: NDArray[Any], use: int, *, bounded: bool = False) -> int:
        """Add an array (n,) or (n, k) and give its accessor; whole numbers of vertices are 0…1.

        The format wants the bounds of positions and of times noted.
        """
        columns = 1 if values.ndim == 1 else values.shape[1]
        key = (use, values.dtype.name, columns)
        stream = self._streams.setdefault(key, bytearray())
        accessor = pygltflib.Accessor(
            byteOffset=len(stream),
            componentType=_COMPONENTS[values.dtype.name],
            count=len(values),
            type=_KINDS[columns],
            normalized=use == VERTICES and values.dtype.kind == "u",
        )
        if bounded:
            rows = values.reshape(-1, columns)
            accessor.min, accessor.max = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        stream += np.ascontiguousarray(values).tobytes()
        stream += bytes(-len(stream) % _ALIGNMENT)
        self._accessors.append((key, accessor))
        return len(self._accessors) - 1

    def material(self, name: str, *, texture: int | None = None, translucent: bool = False) -> int:
        """Add a material and give its number; vertices carry its colours, if it has no texture."""
        factors: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        if texture is not None:
            factors["baseColorTexture"] = {"index": texture}
        self.gltf.materials.append(
            pygltflib.Material(
                name=name,
                pbrMetallicRoughness=factors,
                extensions={"KHR_materials_unlit": {}},
                alphaMode="BLEND" if translucent else "OPAQUE",
                doubleSided=True,
            )
        )
        return len(self.gltf.materials) - 1

    def texture(self, name: str, picture: Image.Image, kind: str, *, repeat: bool = False) -> int:
        """Add a picture as a ``PNG`` or ``JPEG`` and give the number of its texture."""
        file = io.BytesIO()
        picture.save(file, kind, quality=88, optimize=True)
        wrap = pygltflib.REPEAT if repeat else pygltflib.CLAMP_TO_EDGE
        sampler = pygltflib.Sampler(
            magFilter=pygltflib.LINEAR,
            minFilter=pygltflib.LINEAR_MIPMAP_LINEAR,
            wrapS=wrap,
            wrapT=wrap,
        )
        image = pygltflib.Image(name=name, mimeType=f"image/{kind.lower()}")
        self._pictures.append((image, file.getvalue()))
        self.gltf.samplers.append(sampler)
        self.gltf.images.append(image)
        number = len(self.gltf.images) - 1
        self.gltf.textures.append(pygltflib.Texture(source=number, sampler=number))
        return number

    def part(
        self,
        material: int,
        corners: NDArray[Any],
        colours: NDArray[Any] | None = None,
        *,
        kind: type = np.uint8,
        texture: NDArray[Any] | None = None,
        mode: int = pygltflib.TRIANGLES,
    ) -> pygltflib.Primitive:
        """A part of a mesh: corners (…, 3), screen colours (…, 3 or 4), places (…, 2) in a texture.

        Colours are kept as whole numbers of a kind.
        """
        columns = {"POSITION": corners.reshape(-1, 3).astype(np.float32)}
        if colours is not None:
            rows = np.ones((len(columns["POSITION"]), 4))
            rows[:, : colours.shape[-1]] = colours.reshape(len(rows), -1)
            rows[:, :3] = linear(rows[:, :3])
            columns["COLOR_0"] = np.round(np.iinfo(kind).max * rows).astype(kind)
        if texture is not None:
            columns["TEXCOORD_0"] = texture.reshape(-1, 2).astype(np.float32)
        # Corners that are the same in all are kept once.
        rows = np.concatenate([column.view(np.uint8) for column in columns.values()], axis=1)
        _, first, numbers = np.unique(
            rows.view(f"V{rows.shape[1]}")[:, 0], return_index=True, return_inverse=True
        )
        small = np.uint16 if len(first) < 65535 else np.uint32
        attributes = {
            name: self.array(column[first], VERTICES, bounded=name == "POSITION")
            for name, column in columns.items()
        }
        return pygltflib.Primitive(
            attributes=pygltflib.Attributes(**attributes),
            indices=self.array(numbers.astype(small), INDICES),
            material=material,
            mode=mode,
        )

    def mesh(self, name: str, *parts: pygltflib.Primitive) -> int:
        """Add a mesh and give its number."""
        self.gltf.meshes.append(pygltflib.Mesh(name=name, primitives=list(parts)))
        return len(self.gltf.meshes) - 1

    def node(self, name: str, parent: int | None = None, **properties: Any) -> int:
        """Add a node and give its number."""
        self.gltf.nodes.append(pygltflib.Node(name=name, **properties))
        number = len(self.gltf.nodes) - 1
        if parent is not None:
            self.gltf.nodes[parent].children.append(number)
        return number

    def animate(
        self, node: int, path: str, times: Float, values: Float, *, step: bool = False
    ) -> None:
        """Move a node: key times (k,) [s] and values (k, n), straight or stepping between."""
        kind = pygltflib.ANIM_STEP if step else pygltflib.ANIM_LINEAR
        keys = self.array(times.astype(np.float32), KEYS, bounded=True)
        output = self.array(values.astype(np.float32), KEYS)
        sampler = pygltflib.AnimationSampler(input=keys, output=output, interpolation=kind)
        self._animation.samplers.append(sampler)
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        number = len(self._animation.samplers) - 1
        self._animation.channels.append(pygltflib.AnimationChannel(sampler=number, target=target))

    def drive(self, node: int, times: Float, poses: Float) -> None:
        """Move a node over level ground: key times (k,) [s], poses (k, 3) with even headings."""
        places = np.column_stack([poses[:, :2], np.zeros(len(poses))])
        turns = turned(poses[:, 2])
        moved = self.gltf.nodes[node]
        moved.translation, moved.rotation = places[0].tolist(), turns[0].tolist()
        if len(times) > 1:
            self.animate(node, "translation", times, places)
            self.animate(node, "rotation", times, turns)

    def show(self, node: int, begin: float, end: float, whole: float) -> None:
        """Give a node its size only from one time to another [s] of a whole animation."""
        sizes, times = [1.0], [0.0]
        if begin > 0.0:
            # Programs that play nothing show the start.
            self.gltf.nodes[node].scale = [0.0, 0.0, 0.0]
            sizes, times = [0.0, 1.0], [0.0, begin]
        if end < whole:
            sizes, times = [*sizes, 0.0], [*times, end]
        if len(times) > 1:
            values = np.repeat(np.array(sizes)[:, None], 3, axis=1)
            self.animate(node, "scale", np.array(times), values, step=True)

    def glb(self) -> bytes:
        """The finished file."""
        gltf = self.gltf
        blob = bytearray()
        views: dict[tuple[int, str, int], int] = {}
        for (use, kind, columns), stream in self._streams.items():
            view = pygltflib.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(stream))
            if use != KEYS:
                view.target = use
            if use == VERTICES:
                view.byteStride = np.dtype(kind).itemsize * columns
            views[use, kind, columns] = len(gltf.bufferViews)
            gltf.bufferViews.append(view)
            blob += stream
        for key, accessor in self._accessors:
            accessor.bufferView = views[key]
            gltf.accessors.append(accessor)
        for image, picture in self._pictures:
            image.bufferView = len(gltf.bufferViews)
            view = pygltflib.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(picture))
            gltf.bufferViews.append(view)
            blob += picture + bytes(-len(picture) % _ALIGNMENT)
        if self._animation.channels:
            gltf.animations = [self._animation]
        gltf.buffers = [pygltflib.Buffer(byteLength=len(blob))]
        gltf.set_binary_blob(bytes(blob))
        return b"".join(gltf.save_to_bytes())


def linear(colours: Float) -> NDArray[np.float32]:
    """Screen colours in 0…1 as the linear ones that glTF counts with."""
    low = colours / 12.92
    high = ((colours + 0.055) / 1.055) ** 2.4
    return np.asarray(np.where(colours <= 0.04045, low, high), np.float32)


def turned(angles: Float) -> Float:
    """Turns (n, 4) about the vertical by angles (n,) [rad], as quaternions."""
    turns = np.zeros((len(angles), 4))
    turns[:, 2], turns[:, 3] = np.sin(0.5 * angles), np.cos(0.5 * angles)
    return turns
