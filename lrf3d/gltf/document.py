"""A glTF document in the making: arrays become accessors, and all of them one block of bytes.

The classes of the format and the packing of the file are pygltflib's.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pygltflib
from numpy.typing import NDArray
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
    """Collects nodes, meshes and animations of one scene, whose frame has z up, in metres.

    Args:
        name: Name of the root node.
        extras: What the root node keeps for programs.
    """

    def __init__(self, name: str, extras: Mapping[str, Any]) -> None:
        asset = pygltflib.Asset(version="2.0", generator="lrf3d")
        self.gltf = pygltflib.GLTF2(asset=asset, scene=0)
        self._streams: dict[tuple[int, str, int], bytearray] = {}
        self._accessors: list[tuple[tuple[int, str, int], pygltflib.Accessor]] = []
        self._pictures: list[tuple[pygltflib.Image, bytes]] = []
        self._animation = pygltflib.Animation(name="drive", samplers=[], channels=[])
        # A quarter turn about x: glTF has y up.
        half = float(np.sqrt(0.5))
        self.root = self.node(name, rotation=[-half, 0.0, 0.0, half], extras=dict(extras))
        self.gltf.scenes = [pygltflib.Scene(nodes=[self.root], name=name)]

    def array(
        self, values: NDArray[Any], use: int, *, normalised: bool = False, bounded: bool = False
    ) -> int:
        """Add an array (n,) or (n, k) and give its accessor.

        Args:
            values: float32, uint8, uint16 or uint32.
            use: VERTICES, INDICES or KEYS.
            normalised: Whether the whole numbers of a type stand for 0…1.
            bounded: Whether the least and greatest values are noted: the format wants that for
                positions and for times of keys.
        """
        columns = 1 if values.ndim == 1 else values.shape[1]
        key = (use, values.dtype.name, columns)
        stream = self._streams.setdefault(key, bytearray())
        accessor = pygltflib.Accessor(
            byteOffset=len(stream),
            componentType=_COMPONENTS[values.dtype.name],
            count=len(values),
            type=_KINDS[columns],
        )
        if normalised:
            accessor.normalized = True
        if bounded:
            rows = values.reshape(-1, columns)
            accessor.min, accessor.max = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        stream += np.ascontiguousarray(values).tobytes()
        stream += bytes(-len(stream) % _ALIGNMENT)
        self._accessors.append((key, accessor))
        return len(self._accessors) - 1

    def material(self, name: str, **properties: Any) -> int:
        """Add a material and give its number."""
        self.gltf.materials.append(pygltflib.Material(name=name, **properties))
        return len(self.gltf.materials) - 1

    def glowing(self, name: str, *, colour: Float | None = None, translucent: bool = False) -> int:
        """Add a material that keeps its colours in any light, and is seen from both sides.

        Args:
            name: Its name.
            colour: (3,) linear; if not given, vertices carry their colours.
            translucent: Whether what is behind shines through.
        """
        self.extension("KHR_materials_unlit")
        factors: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        if colour is not None:
            factors["baseColorFactor"] = [*colour.tolist(), 1.0]
        return self.material(
            name,
            pbrMetallicRoughness=factors,
            extensions={"KHR_materials_unlit": {}},
            alphaMode="BLEND" if translucent else "OPAQUE",
            doubleSided=True,
        )

    def texture(
        self, name: str, picture: bytes, kind: str, *, repeat: tuple[bool, bool] = (False, False)
    ) -> int:
        """Add a picture and give the number of its texture.

        Args:
            name: Its name.
            picture: The file of the picture.
            kind: ``image/png`` or ``image/jpeg``.
            repeat: Whether it repeats to the sides, and up and down.
        """
        wrap = [pygltflib.REPEAT if on else pygltflib.CLAMP_TO_EDGE for on in repeat]
        sampler = pygltflib.Sampler(
            magFilter=pygltflib.LINEAR,
            minFilter=pygltflib.LINEAR_MIPMAP_LINEAR,
            wrapS=wrap[0],
            wrapT=wrap[1],
        )
        image = pygltflib.Image(name=name, mimeType=kind)
        self._pictures.append((image, picture))
        self.gltf.samplers.append(sampler)
        self.gltf.images.append(image)
        number = len(self.gltf.images) - 1
        self.gltf.textures.append(pygltflib.Texture(source=number, sampler=number))
        return number

    def part(
        self, material: int, attributes: Mapping[str, int], indices: int, *, mode: int | None = None
    ) -> pygltflib.Primitive:
        """A part of a mesh: triangles where no mode is given."""
        return pygltflib.Primitive(
            attributes=pygltflib.Attributes(**attributes),
            indices=indices,
            material=material,
            mode=pygltflib.TRIANGLES if mode is None else mode,
        )

    def mesh(self, name: str, parts: list[pygltflib.Primitive]) -> int:
        """Add a mesh and give its number."""
        self.gltf.meshes.append(pygltflib.Mesh(name=name, primitives=parts))
        return len(self.gltf.meshes) - 1

    def node(self, name: str, parent: int | None = None, **properties: Any) -> int:
        """Add a node and give its number."""
        self.gltf.nodes.append(pygltflib.Node(name=name, **properties))
        number = len(self.gltf.nodes) - 1
        if parent is not None:
            self.gltf.nodes[parent].children.append(number)
        return number

    def extension(self, name: str) -> None:
        """Note that an extension of the format is used."""
        if name not in self.gltf.extensionsUsed:
            self.gltf.extensionsUsed.append(name)

    def animate(self, node: int, path: str, times: int, values: int, *, step: bool = False) -> None:
        """Move a node: accessors of key times [s] and of values, straight or stepping between."""
        kind = pygltflib.ANIM_STEP if step else pygltflib.ANIM_LINEAR
        sampler = pygltflib.AnimationSampler(input=times, output=values, interpolation=kind)
        self._animation.samplers.append(sampler)
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        number = len(self._animation.samplers) - 1
        self._animation.channels.append(pygltflib.AnimationChannel(sampler=number, target=target))

    def drive(self, node: int, times: Float, poses: Float) -> None:
        """Move a node over level ground: key times (k,) [s], poses (k, 3) with even headings."""
        places = np.column_stack([poses[:, :2], np.zeros(len(poses))]).astype(np.float32)
        turns = np.zeros((len(poses), 4), np.float32)
        turns[:, 2], turns[:, 3] = np.sin(0.5 * poses[:, 2]), np.cos(0.5 * poses[:, 2])
        moved = self.gltf.nodes[node]
        moved.translation, moved.rotation = places[0].tolist(), turns[0].tolist()
        if len(times) > 1:
            keys = self.array(times.astype(np.float32), KEYS, bounded=True)
            self.animate(node, "translation", keys, self.array(places, KEYS))
            self.animate(node, "rotation", keys, self.array(turns, KEYS))

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
