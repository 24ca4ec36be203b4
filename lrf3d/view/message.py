"""What the page is sent: the scene as arrays, without what the page has already.

A message is a header in JSON, after its length in four bytes, and then the arrays, one after the
other. The page puts them into the buffers of its graphics card, draws them with the shaders of the
film, and works nothing out.
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.render.glsl import air, shader_source
from lrf3d.render.packing import columns_of, land_of, mesh, rectangle, walls_of
from lrf3d.render.parts import Parts
from lrf3d.scene.facades import layers
from lrf3d.scene.shapes import Faces, Mark
from lrf3d.scene.stage import Stage

_PROGRAMS = (
    "walls", "walls:PLAIN", "walls:FADED", "walls:PLAIN:FADED", "faces", "ground", "sky", "soft",
    "lines", "lines:DASHED", "points", "points:GLOW_ROUND",
)  # fmt: skip
"""The shaders that the page draws with."""

_ALIGNMENT = 4
"""Bytes that the start of every array is a multiple of."""


class Rows(NamedTuple):
    """Arrays that are no mark of a scene."""

    kind: str
    columns: tuple[NDArray[Any], ...]
    shape: tuple[int, ...] = ()


class Sender:
    """Packs what has changed since the message before."""

    def __init__(self) -> None:
        self._sent: dict[str, Any] = {}
        self._columns: dict[tuple[str, str], tuple[NDArray[Any], NDArray[np.uint8]]] = {}

    def message(
        self, marks: Mapping[str, Mark | Faces | Rows], values: Mapping[str, Any]
    ) -> bytes | None:
        """A message of marks by name, and of values for JSON; None if nothing has changed."""
        header = {name: value for name, value in values.items() if self._is_new(name, value)}
        drawn: dict[str, dict[str, Any]] = {}
        block = bytearray()
        packed: dict[tuple[int, int], int] = {}
        for name, mark in marks.items():
            if isinstance(mark, Rows):
                style: dict[str, Any] = {"kind": mark.kind, "shape": mark.shape}
                columns = {str(place): each for place, each in enumerate(mark.columns)}
            else:
                columns = columns_of(mark)
                fields = mark._asdict().items()
                style = {"kind": type(mark).__name__.lower()}
                style |= {key: each for key, each in fields if key not in columns}
            if self._is_new(f"style of {name}", style):
                drawn[name] = {**style, "columns": []}
            for place, (key, values_) in enumerate(columns.items()):
                before, known = self._columns.get((name, key), (None, None))
                # An array that is the same object as before has not changed.
                if values_ is before:
                    continue
                rows = _bytes(values_, colours=key == "colours")
                first = 0 if known is None else _same(rows, known)
                self._columns[name, key] = values_, rows
                if known is not None and first == len(rows) == len(known):
                    continue
                # What two marks share, such as the trail and that of the plan, is sent once.
                if (id(values_), first) not in packed:
                    packed[id(values_), first] = len(block)
                    block += rows[first:].tobytes()
                size = 0 if key == "colours" else values_.shape[-1]
                where = [place, packed[id(values_), first], size, first, len(rows)]
                drawn.setdefault(name, {"columns": []})["columns"].append(where)
        if drawn:
            header["marks"] = drawn
        if not header:
            return None
        text = json.dumps(header, separators=(",", ":")).encode()
        text += b" " * (-len(text) % _ALIGNMENT)
        return len(text).to_bytes(4, "little") + text + bytes(block)

    def _is_new(self, name: str, value: Any) -> bool:
        new = name not in self._sent or self._sent[name] != value
        self._sent[name] = value
        return bool(new)


def stage_message(stage: Stage) -> bytes:
    """What never changes: shaders, walls, roofs and ground, whose picture goes apart."""
    parts, ground, indoor = Parts(stage.faces), stage.ground, stage.structures.indoor
    chosen = parts.choose(np.arange(parts.count))
    corners = rectangle(ground.corner, ground.corner + ground.size)
    marks: dict[str, Faces | Rows] = {
        "walls": Rows("walls", walls_of(stage.faces)),
        "indices": Rows("indices", (chosen.indices[:, None],), (chosen.textured,)),
        "ground": Rows("ground", (corners,)),
        "sky": Rows("sky", (mesh(10, 10),)),
        "land": land_of(ground),
    }
    for level, texels in enumerate(layers(indoor)):
        marks[f"level {level}"] = Rows("level", (texels,), texels.shape[2::-1])
    programs = {
        name: [shader_source(name, vertex=v, constants=air(indoor=indoor)) for v in (True, False)]
        for name in _PROGRAMS
    }
    area = [*ground.corner.tolist(), *(1.0 / ground.size).tolist()]
    bodies = {"land": np.eye(4).ravel().tolist()}
    message = Sender().message(marks, {"programs": programs, "area": area, "bodies": bodies})
    assert message is not None
    return message


def _bytes(values: NDArray[Any], *, colours: bool) -> NDArray[np.uint8]:
    """Rows (n, bytes) of an array as the page takes it: colours and opacities in four bytes."""
    rows = values.reshape(-1, values.shape[-1])
    if colours:
        tints = np.full((len(rows), 4), 255, np.uint8)
        tints[:, : rows.shape[1]] = np.round(255.0 * np.clip(rows, 0.0, 1.0))
        return tints
    return np.ascontiguousarray(rows).view(np.uint8)


def _same(rows: NDArray[np.uint8], known: NDArray[np.uint8]) -> int:
    """How many rows at the beginning are those that the page has."""
    count = min(len(rows), len(known))
    differ = np.flatnonzero((rows[:count] != known[:count]).any(axis=1))
    return int(differ[0]) if len(differ) else count
