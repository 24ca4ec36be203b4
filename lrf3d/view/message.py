"""What the page is sent: the scene at a moment as arrays, without what the page has already.

A message is a header in JSON, after its length in four bytes, and then the arrays, one after the
other. The page puts them into the buffers of its graphics card and works nothing out.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.gltf.stage import lit
from lrf3d.scene.shapes import Faces, Lines, Mark, Points, Soft

_ALIGNMENT = 4
"""Bytes that the start of every array is a multiple of."""


class Sender:
    """Packs what has changed since the message before."""

    def __init__(self) -> None:
        self._sent: dict[str, Any] = {}

    def message(self, marks: Mapping[str, Mark | Faces], others: Mapping[str, Any]) -> bytes | None:
        """A message of marks by name, and of other values for JSON; None if nothing has changed."""
        header: dict[str, Any] = {
            name: value for name, value in others.items() if self._is_new(f"its {name}", value)
        }
        block = bytearray()
        drawn: dict[str, Any] = {}
        names = {id(mark[0]): name for name, mark in reversed(list(marks.items()))}
        for name, mark in marks.items():
            like = names[id(mark[0])]
            if self._is_new(f"{name} as", like):
                drawn.setdefault(name, {})["as"] = like
            if self._is_new(f"{name} how", how := _style(mark)):
                drawn.setdefault(name, {}).update(how)
            if like != name:
                continue
            for column, sources in _columns(mark).items():
                if self._same_arrays(f"{name} {column}", sources):
                    continue
                values = _packed(mark, column)
                place = (values.dtype.str[1:], len(block), values.size, values.shape[-1])
                drawn.setdefault(name, {}).setdefault("columns", {})[column] = place
                block += values.tobytes()
                block += bytes(-len(block) % _ALIGNMENT)
        for name in [key for key in self._sent.get("marks", ()) if key not in marks]:
            drawn[name] = None
            for key in [key for key in self._sent if key.startswith(f"{name} ")]:
                del self._sent[key]
        self._sent["marks"] = tuple(marks)
        if drawn:
            header["marks"] = drawn
        if not header:
            return None
        text = json.dumps(header, separators=(",", ":")).encode()
        text += b" " * (-len(text) % _ALIGNMENT)
        return len(text).to_bytes(4, "little") + text + bytes(block)

    def _is_new(self, key: str, value: Any) -> bool:
        new = key not in self._sent or self._sent[key] != value
        self._sent[key] = value
        return bool(new)

    def _same_arrays(self, key: str, arrays: tuple[Any, ...]) -> bool:
        """Whether these very arrays have been sent; they are kept: none takes their place."""
        before = self._sent.get(key, ())
        self._sent[key] = arrays
        return len(before) == len(arrays) and all(map(lambda a, b: a is b, before, arrays))


def _style(mark: Mark | Faces) -> dict[str, Any]:
    """The kind of a mark, and what is the same in all of it."""
    if isinstance(mark, Lines):
        return {"kind": "lines", "width": mark.width, "hidden": mark.hidden}
    if isinstance(mark, Points):
        sizes = [mark.size, *mark.pixels]
        return {"kind": "points", "sizes": sizes, "glows": mark.glows}
    return {"kind": "soft" if isinstance(mark, Soft) else "faces"}


def _columns(mark: Mark | Faces) -> dict[str, tuple[Any, ...]]:
    """The columns of a mark, and the arrays that each is made of."""
    if isinstance(mark, Lines):
        return {
            "start": (mark.starts,),
            "end": (mark.ends,),
            "first": (mark.colours, mark.opacities),
            "last": (mark.colours, mark.opacities),
            "side": (mark.sides,),
        }
    if isinstance(mark, Points):
        return {"position": (mark.places,), "tint": (mark.colours,), "side": (mark.sides,)}
    return {"position": (mark.corners,), "tint": (mark.colours,)}


def _packed(mark: Mark | Faces, column: str) -> NDArray[Any]:
    """A column as the page takes it: places in float32, colours and opacities in bytes."""
    if isinstance(mark, Lines) and column in ("first", "last"):
        opacity = mark.opacities[:, :1] if column == "first" else mark.opacities[:, 1:]
        return _bytes(np.concatenate([mark.colours, opacity], axis=1))
    if column == "tint":
        colours = lit(mark) if isinstance(mark, Faces) else mark.colours
        colours = colours.reshape(-1, colours.shape[-1])
        opaque = np.ones((len(colours), 4 - colours.shape[1]))
        return _bytes(np.concatenate([colours, opaque], axis=1))
    values = _columns(mark)[column][0]
    return np.ascontiguousarray(values.reshape(-1, values.shape[-1]), np.float32)


def _bytes(shares: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(np.round(255.0 * np.clip(shares, 0.0, 1.0)), np.uint8)
