"""What the page is sent: the scene as arrays, without those that the page has already.

A message is the length of its header in four bytes, the header in JSON, and a block of arrays. The
header's `marks` name all that is seen, in the order in which it is drawn; the names of the plan's
begin with "plan ". Each has its kind, its style, and `columns`: where its new arrays lie. The page
puts these into buffers of its graphics card, draws them with the film's shaders, and works nothing
out.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.studio.render.glsl import columns_of, ground_of, mesh, shader_source
from lrf3d.studio.scene.look import LEAST_SCALE, PLAN_BACK, WHITE
from lrf3d.studio.scene.shapes import Faces, Mark
from lrf3d.studio.scene.stage.stage import Stage

# The shaders that the page draws with, which it compiles when they are first used.
_PROGRAMS = (
    "walls", "walls:MIRRORED", "faces", "faces:MIRRORED", "ground",
    "ground:PLAN", "ground:MIRRORED", "sky", "soft", "lines", "points",
    "points:GLOW_ROUND",
)  # fmt: skip

# How something is drawn, and its arrays by name, in the order of the shader's locations.
Part = tuple[dict[str, Any], dict[str, NDArray[Any]]]


def part_of(mark: Mark | Faces) -> Part:
    """A mark of a scene as a part of a message."""
    columns = columns_of(mark)
    style = {name: each for name, each in mark._asdict().items() if name not in columns}
    return {"kind": type(mark).__name__.lower(), **style}, columns


class Sender:
    """Packs the arrays that have changed since the message before."""

    def __init__(self) -> None:
        self._columns: dict[tuple[str, str], tuple[NDArray[Any], NDArray[np.uint8]]] = {}

    def message(self, parts: Mapping[str, Part], values: Mapping[str, Any]) -> bytes:
        """A message of parts by name, and of values for JSON."""
        marks = dict[str, Any]()
        block = bytearray()
        starts = dict[tuple[int, int], int]()
        for name, (style, columns) in parts.items():
            sent = []
            for place, (key, array) in enumerate(columns.items()):
                new = self._new_rows(name, key, array)
                if new is None:
                    continue
                rows, first = new
                # What two marks share, such as the trail and that of the inset, is sent once.
                shared = id(array), first
                if shared not in starts:
                    starts[shared] = len(block)
                    block += rows[first:].tobytes()
                # The shader's location, where the array starts in the block, numbers a row (0 for
                # colours, which are bytes), the first row that is new, and the number of rows.
                size = 0 if key == "colours" else array.shape[-1]
                sent.append([place, starts[shared], size, first, len(rows)])
            marks[name] = {**style, "columns": sent}
        text = json.dumps({**values, "marks": marks}, separators=(",", ":")).encode()
        return len(text).to_bytes(4, "little") + text + bytes(block)

    def _new_rows(
        self, name: str, key: str, array: NDArray[Any]
    ) -> tuple[NDArray[np.uint8], int] | None:
        """The rows of an array as bytes, and the first that is new; None if the page has all."""
        before, known = self._columns.get((name, key), (None, None))
        # An array that is the same object as before has not changed.
        if array is before:
            return None
        rows = array.reshape(-1, array.shape[-1])
        # Colours and opacities are sent as four bytes.
        rows = as_bytes(rows) if key == "colours" else np.ascontiguousarray(rows).view(np.uint8)
        self._columns[name, key] = array, rows
        # A picture of times is a part of the whole one, another one each time.
        if known is None or name == "times":
            return rows, 0
        # The rows at the beginning that the page has already.
        count = min(len(rows), len(known))
        first = int(np.append((rows[:count] != known[:count]).any(axis=1), True).argmax())
        return None if first == len(rows) == len(known) else (rows, first)


def stage_message(stage: Stage, *, times: bool = True) -> bytes:
    """What never changes: shaders, walls, roofs and ground, whose picture goes apart.

    The picture of times can be left out.
    """
    ground = stage.ground
    seen = stage.exposure.texels
    setting = stage.structures.setting
    # The corners of two triangles for each quad.
    parts = {
        "walls": _part("walls", *(each[:, [0, 1, 2, 0, 2, 3]] for each in stage.faces[:4])),
        "ground": _part("ground", ground_of(ground, 6)),
        "sky": _part("sky", mesh(*[np.linspace(-1.0, 1.0, 11)] * 2)),
    }
    if times:
        parts["times"] = times_part(seen)
    programs = {
        name: [shader_source(name, setting, vertex=vertex) for vertex in (True, False)]
        for name in _PROGRAMS
    }
    values = {
        "programs": programs,
        "area": [*ground.corner.tolist(), *(1.0 / ground.size).tolist()],
        "grid": stage.exposure.area,
        "cells": seen.shape[1::-1],
        "back": [share / WHITE for share in PLAN_BACK],
        "mirrors": stage.mirrors.tolist(),
        "leastScale": LEAST_SCALE,
    }
    return Sender().message(parts, values)


def times_part(times: NDArray[np.float32], place: Sequence[int] = (0, 0)) -> Part:
    """A part (h, w, 4) of the picture of times, in half floats, whose first cell is at a place."""
    rows, columns, _ = times.shape
    halves = np.ascontiguousarray(times, np.float16).reshape(-1, 4)
    return {"box": [*place, columns, rows]}, {"0": halves.view(np.float32)}


def _part(kind: str, *columns: NDArray[Any]) -> Part:
    return {"kind": kind}, {str(place): each for place, each in enumerate(columns)}


def as_bytes(rows: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) or colours and opacities (n, 4) in four bytes each."""
    tints = np.full((len(rows), 4), 255, np.uint8)
    tints[:, : rows.shape[1]] = np.round(WHITE * np.clip(rows, 0.0, 1.0))
    return tints
