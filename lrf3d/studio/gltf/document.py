"""A glTF document in the making: arrays become accessors, and all of them one block of bytes."""

import io
import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.geometry.lines import Float
from lrf3d.mapping.tints import linear_light

# What an array is for, as the format numbers it: attributes of vertices.
VERTICES = 34962

# What numbers of vertices are for.
INDICES = 34963

# What keys of animations are for: the format has no number for them.
KEYS = None

# Mode of a part whose corners make up triangles.
TRIANGLES = 4

# Mode of a part whose corners make up lines.
LINES = 1

# Names of rows by their length.
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

# OpenGL's numbers for types.
_COMPONENTS = {"float32": 5126, "uint8": 5121, "uint16": 5123, "uint32": 5125}
# OpenGL's number for textures that end at their edges.
_CLAMP = 33071

# The extension of all materials.
_UNLIT = "KHR_materials_unlit"

# The start of every array is a multiple of this [bytes].
_ALIGNMENT = 4

# Number of vertices that two bytes can number; their largest number is not used.
_SMALL = 65535


class Document:
    """Collects nodes, meshes and one animation of a length [s], in a frame with z up, in metres.

    All materials keep their colours in any light. The root node has the name of the document, and
    extras for programs.
    """

    def __init__(self, name: str, extras: Mapping[str, Any], length: float) -> None:
        self._parts: dict[str, list[dict[str, Any]]] = {}
        # Nodes next to the root: a mesh that follows others does not follow those above it.
        self._tops: list[int] = []
        self._blob = bytearray()
        # The accessor of each array: its bytes, what they are for, and how they are read.
        self._arrays: dict[tuple[bytes, int | None, str], int] = {}
        self._name = name
        self._length = length
        self._samplers: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []
        # A quarter turn about x: glTF has y up.
        self.root = self.node(name, rotation=[-(0.5**0.5), 0.0, 0.0, 0.5**0.5], extras=dict(extras))

    def add(self, kind: str, **properties: Any) -> int:
        """Add an entry of a kind, such as ``cameras``, and give its number."""
        entries = self._parts.setdefault(kind, [])
        entries.append(properties)
        return len(entries) - 1

    def array(
        self,
        values: NDArray[Any],
        use: int | None,
        *,
        bounded: bool = False,
        normalized: bool = True,
    ) -> int:
        """Add an array (n,) or (n, k) and give its accessor; whole numbers of vertices are 0…1.

        The format wants the bounds of positions and of times noted. Equal arrays are kept once:
        what is dark and what is lit have the same corners.
        """
        columns = 1 if values.ndim == 1 else values.shape[1]
        accessor: dict[str, Any] = {
            "componentType": _COMPONENTS[values.dtype.name],
            "count": len(values),
            "type": _KINDS[columns],
        }
        if use == VERTICES and values.dtype.kind == "u" and normalized:
            accessor["normalized"] = True
        if bounded:
            rows = values.reshape(-1, columns)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        key = values.tobytes(), use, str(accessor)
        if key not in self._arrays:
            target = {} if use is None else {"target": use}
            view = self._view(key[0], **target)
            self._arrays[key] = self.add("accessors", bufferView=view, **accessor)
        return self._arrays[key]

    def _view(self, data: bytes, **properties: Any) -> int:
        self._blob += bytes(-len(self._blob) % _ALIGNMENT)
        place = {"buffer": 0, "byteOffset": len(self._blob), "byteLength": len(data)}
        self._blob += data
        return self.add("bufferViews", **place, **properties)

    def material(self, name: str, *, texture: int | None = None, translucent: bool = False) -> int:
        """Add a material and give its number; vertices carry its colours, if it has no texture."""
        factors: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        if texture is not None:
            factors["baseColorTexture"] = {"index": texture}
        return self.add(
            "materials",
            name=name,
            pbrMetallicRoughness=factors,
            extensions={_UNLIT: {}},
            alphaMode="BLEND" if translucent else "OPAQUE",
            doubleSided=True,
        )

    def texture(self, name: str, picture: Image.Image, kind: str) -> int:
        """Add a picture as a ``PNG`` or ``JPEG`` and give the number of its texture."""
        file = io.BytesIO()
        picture.save(file, kind, quality=88, optimize=True)
        # Players interpolate, and use smaller copies for what is far away, unless told otherwise.
        sampler = self.add("samplers", wrapS=_CLAMP, wrapT=_CLAMP)
        view = self._view(file.getvalue())
        source = self.add("images", name=name, mimeType=f"image/{kind.lower()}", bufferView=view)
        return self.add("textures", source=source, sampler=sampler)

    def part(
        self,
        material: int,
        corners: NDArray[Any],
        colours: NDArray[Any] | None = None,
        *,
        kind: type = np.uint8,
        texture: NDArray[Any] | None = None,
        joints: NDArray[Any] | None = None,
        mode: int = TRIANGLES,
    ) -> dict[str, Any]:
        """A part of a mesh: corners (…, 3), screen colours (…, 3 or 4), places (…, 2) in a texture.

        Colours are kept as whole numbers of a kind. Joints (…,) number the nodes that corners
        follow.
        """
        columns = {"POSITION": corners.reshape(-1, 3).astype(np.float32)}
        if colours is not None:
            rows = np.ones((len(columns["POSITION"]), 4))
            rows[:, : colours.shape[-1]] = colours.reshape(len(rows), -1)
            rows[:, :3] = linear_light(np.clip(rows[:, :3], 0.0, 1.0))
            columns["COLOR_0"] = np.round(np.iinfo(kind).max * rows).astype(kind)
        if texture is not None:
            # Beyond its edges a texture goes on as it is there.
            places = np.clip(texture.reshape(-1, 2), 0.0, 1.0)
            columns["TEXCOORD_0"] = np.round(np.iinfo(np.uint16).max * places).astype(np.uint16)
        if joints is not None:
            # A corner may follow four nodes; it follows one.
            own = joints.reshape(-1)
            several = np.zeros((len(own), 4), np.min_scalar_type(own.max()))
            several[:, 0] = own
            columns["JOINTS_0"] = several
            columns["WEIGHTS_0"] = np.tile(np.array([255, 0, 0, 0], np.uint8), (len(several), 1))
        # Corners that are the same in all are kept once.
        rows = np.concatenate([column.view(np.uint8) for column in columns.values()], axis=1)
        _, first, numbers = np.unique(
            rows.view(f"V{rows.shape[1]}")[:, 0], return_index=True, return_inverse=True
        )
        attributes = {
            name: self.array(
                column[first], VERTICES, bounded=name == "POSITION", normalized=name != "JOINTS_0"
            )
            for name, column in columns.items()
        }
        indices = self.array(
            numbers.astype(np.uint16 if len(first) < _SMALL else np.uint32), INDICES
        )
        return {"attributes": attributes, "indices": indices, "material": material, "mode": mode}

    def node(
        self, name: str, parent: int | None = None, *parts: Mapping[str, Any], **properties: Any
    ) -> int:
        """Add a node, with a mesh of parts if there are any, and give its number."""
        if parts:
            properties["mesh"] = self.add("meshes", name=name, primitives=parts)
        number = self.add("nodes", name=name, **properties)
        if parent is not None:
            self._parts["nodes"][parent].setdefault("children", []).append(number)
        return number

    def follow(
        self, name: str, material: int, moved: Sequence[tuple[int, NDArray[Any], NDArray[Any]]]
    ) -> None:
        """Add one mesh of triangles, whose parts each follow a node: its number, corners, colours.

        Players draw it at once: a mesh for each of many nodes would be slow.
        """
        moved = [each for each in moved if len(each[1])]
        if not moved:
            return
        nodes, corners, colours = zip(*moved, strict=True)
        corners = [each.reshape(-1, 3) for each in corners]
        colours = [each.reshape(len(own), -1) for own, each in zip(corners, colours, strict=True)]
        joints = np.repeat(np.arange(len(nodes)), [len(each) for each in corners])
        part = self.part(material, np.concatenate(corners), np.concatenate(colours), joints=joints)
        # The joints stand in the frame of the root, in which the corners are given, too.
        upright = np.eye(4, dtype=np.float32).reshape(1, 16)
        bind = self.array(np.repeat(upright, len(nodes), axis=0), KEYS)
        skin = self.add("skins", name=name, joints=list(nodes), inverseBindMatrices=bind)
        self.node(name, None, part, skin=skin)
        self._tops.append(len(self._parts["nodes"]) - 1)

    def animate(
        self, node: int, path: str, times: Float, values: Float, *, step: bool = False
    ) -> None:
        """Move a node: key times (k,) [s] and values (k, n), straight or stepping between.

        A viewer without animations shows the first.
        """
        self._parts["nodes"][node][path] = values[0].tolist()
        if len(times) < 2:
            return
        keys = self.array(times.astype(np.float32), KEYS, bounded=True)
        output = self.array(values.astype(np.float32), KEYS)
        self._samplers.append(
            {"input": keys, "output": output, "interpolation": ("STEP" if step else "LINEAR")}
        )
        self._channels.append(
            {"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}}
        )

    def show(
        self, node: int, begin: float, end: float | None = None, *, rests: bool | None = None
    ) -> None:
        """Give a node its size only from one time to another [s], or to the end.

        A viewer without animations shows it as at the start, or as `rests` says.
        """
        times, sizes = ([0.0, begin], [0.0, 1.0]) if begin > 0.0 else ([0.0], [1.0])
        if end is not None and end < self._length:
            times = [*times, end]
            sizes = [*sizes, 0.0]
        if len(times) > 1:
            self.animate(node, "scale", np.array(times), np.tile(sizes, (3, 1)).T, step=True)
        if rests is not None:
            self._parts["nodes"][node]["scale"] = [float(rests)] * 3

    def glb(self) -> bytes:
        """The finished file."""
        if self._channels:
            self.add("animations", name="drive", samplers=self._samplers, channels=self._channels)
        whole = {
            "asset": {"version": "2.0", "generator": "lrf3d"},
            "extensionsUsed": [_UNLIT],
            "scene": 0,
            "scenes": [{"nodes": [self.root, *self._tops], "name": self._name}],
            "buffers": [{"byteLength": len(self._blob)}],
            **self._parts,
        }
        chunks = b""
        text = json.dumps(whole, separators=(",", ":")).encode()
        for kind, data, fill in ((b"JSON", text, b" "), (b"BIN\0", bytes(self._blob), b"\0")):
            data += fill * (-len(data) % _ALIGNMENT)
            chunks += struct.pack("<I4s", len(data), kind) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def turned(angles: Float) -> Float:
    """Turns (n, 4) about the vertical by angles (n,) [rad], as quaternions."""
    turns = np.zeros((len(angles), 4))
    turns[:, 2] = np.sin(0.5 * angles)
    turns[:, 3] = np.cos(0.5 * angles)
    return turns
