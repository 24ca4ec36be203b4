"""The pictures of the ground as compiled code takes them: with smaller copies, in one row."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.geometry import Float, Int
from lrf3d.render.primitives import Primitive

Texels = NDArray[np.uint8]


class GroundTable(NamedTuple):
    """All pictures of the ground; :mod:`lrf3d.render.traced.shading` says what rows hold."""

    texels: Texels
    levels: Int
    grounds: Float


class Grounds:
    """Keeps the table of the pictures that are drawn, and makes it anew when one has changed."""

    def __init__(self) -> None:
        self._drawn: list[tuple[Primitive, Mapping[str, Any]]] = []
        self._pictures: list[Texels] = []
        self._rectangles: list[bytes] = []
        self._copies: dict[int, tuple[Texels, list[Texels]]] = {}
        self._table = GroundTable(
            np.full(3, 128, np.uint8), np.array([[0, 1, 1]]), np.array([_FAR_AWAY])
        )

    def add(self, primitive: Primitive, uniforms: Mapping[str, Any]) -> None:
        """Take a piece of the ground into the picture, finer ones first."""
        self._drawn.append((primitive, uniforms))

    def table(self) -> GroundTable:
        """The table of all that was added since the last time."""
        drawn, self._drawn = self._drawn, []
        pictures = [piece.texture.picture for piece, _ in drawn if piece.texture is not None]
        rectangles = [piece.vertices.tobytes() for piece, _ in drawn]
        same = len(pictures) == len(self._pictures) and rectangles == self._rectangles
        if same and all(a is b for a, b in zip(pictures, self._pictures, strict=True)):
            return self._table
        self._pictures, self._rectangles = pictures, rectangles
        # A picture is kept beside its copies, so that no other gets its number.
        kept, self._copies = self._copies, {}
        texels: list[Texels] = []
        levels: list[tuple[int, int, int]] = []
        rows, start = [], 0
        for (piece, uniforms), picture in zip(drawn, pictures, strict=True):
            low, high = piece.vertices.min(axis=0), piece.vertices.max(axis=0)
            first = len(levels)
            copies = kept.get(id(picture)) or (picture, _smaller_copies(picture))
            self._copies[id(picture)] = copies
            for copy in copies[1]:
                levels.append((start, copy.shape[1], copy.shape[0]))
                texels.append(copy.ravel())
                start += copy.size
            rows.append([*low, *high, *uniforms["area"], first, len(levels) - first])
        self._table = GroundTable(
            np.concatenate(texels), np.array(levels, np.int64), np.array(rows, np.float64)
        )
        return self._table


_FAR_AWAY = [np.inf, np.inf, -np.inf, -np.inf, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0]
"""A ground that is drawn nowhere."""


def _smaller_copies(picture: Texels) -> list[Texels]:
    """A picture (h, w, 3) and copies of it, each half as wide and high as the one before."""
    copy = Image.fromarray(np.ascontiguousarray(picture[:, :, :3]))
    copies = [np.asarray(copy)]
    while copy.size != (1, 1):
        width, height = copy.size
        copy = copy.resize((max(1, width // 2), max(1, height // 2)), Image.Resampling.BOX)
        copies.append(np.asarray(copy))
    return copies
