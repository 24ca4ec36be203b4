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
from lrf3d.render.packing import land_of, mesh, rectangle
from lrf3d.render.parts import Parts
from lrf3d.scene.facades import layers
from lrf3d.scene.shapes import Faces, Lines, Mark
from lrf3d.scene.stage import Stage

_PROGRAMS = (
    "walls", "walls:PLAIN", "walls:FADED", "walls:PLAIN:FADED", "faces", "ground", "sky", "soft",
    "lines", "lines:DASHED", "points", "points:GLOW_ROUND",
)  # fmt: skip
"""The shaders that the page draws with."""

_ALIGNMENT = 4
"""Bytes that the start of every array is a multiple of."""


class Rows(NamedTuple):
    """An array that the page puts into one buffer as it is."""

    kind: str
    rows: NDArray[Any]
    shape: tuple[int, ...] = ()


class Sender:
    """Packs what has changed since the message before."""

    def __init__(self) -> None:
        self._sent: dict[str, Any] = {}
        self._arrays: dict[str, dict[str, NDArray[Any]]] = {}

    def message(
        self, marks: Mapping[str, Mark | Faces | Rows], values: Mapping[str, Any]
    ) -> bytes | None:
        """A message of marks by name, and of values for JSON; None if nothing has changed."""
        header = {name: value for name, value in values.items() if self._is_new(name, value)}
        drawn: dict[str, dict[str, Any]] = {}
        block = bytearray()
        packed: dict[tuple[int, str], tuple[int, int]] = {}
        for name, mark in marks.items():
            fields = mark._asdict()
            arrays = {key: each for key, each in fields.items() if isinstance(each, np.ndarray)}
            style = {key: each for key, each in fields.items() if key not in arrays}
            if self._is_new(f"style of {name}", style):
                drawn[name] = {"kind": type(mark).__name__.lower(), **style}
            # An array that is the same object as before has not changed.
            before = self._arrays.get(name, {})
            changed: dict[str, Any] = {
                key: each for key, each in arrays.items() if each is not before.get(key)
            }
            self._arrays[name] = arrays
            if changed and isinstance(mark, Lines):
                changed = {"rows": mark}
            for key, each in changed.items():
                columns = drawn.setdefault(name, {}).setdefault("columns", {})
                # What two marks share, such as the trail and that of the plan, is sent once.
                if (id(each), key) not in packed:
                    data = _bytes(each, colours=key == "colours")
                    packed[id(each), key] = len(block), len(data)
                    block += data
                columns[key] = packed[id(each), key]
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
    parts, ground = Parts(stage.faces), stage.ground
    chosen = parts.choose(np.arange(parts.count))
    land = land_of(ground).reshape(-1, 3, 9)
    marks: dict[str, Faces | Rows] = {
        "walls": Rows("walls", stage.faces.rows().reshape(-1, 16)),
        "indices": Rows("indices", chosen.indices, (chosen.textured,)),
        "ground": Rows("ground", rectangle(ground.corner, ground.corner + ground.size)),
        "sky": Rows("sky", mesh(10, 10)),
        "land": Faces(land[..., :3], land[..., 3:6], land[..., 6:]),
    }
    indoor = stage.structures.indoor
    for level, texels in enumerate(layers(indoor)):
        marks[f"level {level}"] = Rows("level", texels, texels.shape[2::-1])
    programs = {
        name: [shader_source(name, vertex=v, constants=air(indoor=indoor)) for v in (True, False)]
        for name in _PROGRAMS
    }
    area = [*ground.corner.tolist(), *(1.0 / ground.size).tolist()]
    bodies = {"land": np.eye(4).ravel().tolist()}
    message = Sender().message(marks, {"programs": programs, "area": area, "bodies": bodies})
    assert message is not None
    return message


def _rows(lines: Lines) -> NDArray[np.uint8]:
    """Both ends of lines, their colours there, and the sides of walls: rows (n, 40) of bytes."""
    tints = [_tints(np.column_stack([lines.colours, opacity])) for opacity in lines.opacities.T]
    places = [
        np.ascontiguousarray(each, np.float32).view(np.uint8)
        for each in (lines.starts, lines.ends, lines.sides)
    ]
    return np.concatenate([*places[:2], *tints, places[2]], axis=1)


def _bytes(values: NDArray[Any] | Lines, *, colours: bool) -> bytes:
    """An array as the page takes it: places in float32, colours and opacities in bytes."""
    if isinstance(values, Lines):
        return _rows(values).tobytes()
    if colours:
        values = _tints(values)
    return values.astype(np.float32).tobytes() if values.dtype == np.float64 else values.tobytes()


def _tints(shares: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (…, 3 or 4) in 0…1 as four bytes each."""
    tints = np.full((*shares.shape[:-1], 4), 255, np.uint8)
    tints[..., : shares.shape[-1]] = np.round(255.0 * np.clip(shares, 0.0, 1.0))
    return tints
