"""What rays see, as tables for compiled code: walls and roofs, which Embree has, and the ground."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.casting.triangle_rays import TriangleRays
from lrf3d.geometry import Float, Int
from lrf3d.render.primitives import Primitive
from lrf3d.render.traced.shading import (
    ALONG,
    COLOUR,
    COLUMNS,
    LAYER,
    LIGHT,
    NORMAL,
    OFFSET,
    SHADE,
    UNDER,
    UP,
)
from lrf3d.scene.facades import TILE

Ids = NDArray[np.int32]


_PAST = 1e-3
"""How far past a face a ray goes on, in lengths of its direction."""

_MOST_PASSED = 4
"""Faces that a ray goes through at most: one that grazes them might go on for ever."""


class Surfaces:
    """Triangles that rays are cast at.

    Args:
        triangles: (t, 3, 16) their corners, in the rows that :mod:`lrf3d.render.parts` makes.
        painted: The levels of the texture that they are painted with.

    Attributes:
        faces: The table of them, see :func:`face_table`.
        painted: All texels of the texture, level after level.
        painted_levels: (n, 3) where each level starts, its width and its height.
    """

    def __init__(
        self, triangles: NDArray[np.float32], painted: tuple[NDArray[np.uint8], ...]
    ) -> None:
        self.faces = face_table(triangles)
        self.painted = np.concatenate([level.ravel() for level in painted])
        sizes = np.array([level.size for level in painted])
        sides = np.array([level.shape[2:0:-1] for level in painted])
        self.painted_levels = np.column_stack([np.cumsum(sizes) - sizes, sides])
        self._level = self.faces[:, NORMAL + 2] > 0.5
        self._rays = TriangleRays(triangles[:, :, :3])

    def nearest(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Ids:
        """The triangle (n,) that each ray meets first, or −1."""
        hits = self._rays.first(origins, directions)
        # Level faces, on tops of walls, have no underside: rays go on through it.
        rising = np.flatnonzero((hits >= 0) & (directions[:, 2] > 0.0))
        for _ in range(_MOST_PASSED):
            rising = rising[(hits[rising] >= 0) & self._level[hits[rising]]]
            if not len(rising):
                break
            way, start = directions[rising], origins[rising]
            depth = (self.faces[hits[rising], OFFSET] - start[:, 2]) / way[:, 2] + _PAST
            through = np.ascontiguousarray(start + way * depth[:, None], np.float32)
            hits[rising] = self._rays.first(through, way)
        return hits


def face_table(triangles: NDArray[np.float32]) -> Float:
    """The table (t, COLUMNS) of triangles (t, 3, 16).

    Of each triangle: its plane; where along and up the texture a point is [texels], how far under
    the edge of its shadow, and the light on it in the sun and where the sun is hidden, as linear
    functions of the point; its colour and its layer of the texture.
    """
    corners = triangles[:, :, :3].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-30)[:, None]
    facing = normal / np.sqrt(square)
    table = np.zeros((len(triangles), COLUMNS))
    table[:, NORMAL:OFFSET] = facing
    table[:, OFFSET] = np.einsum("ij,ij->i", facing, corners[:, 0])
    lights = [(LIGHT + 4 * k, 9 + k, 1.0) for k in range(3)]
    lights += [(SHADE + 4 * k, 13 + k, 1.0) for k in range(3)]
    for column, value, scale in ((ALONG, 3, TILE), (UP, 4, TILE), (UNDER, 12, 1.0), *lights):
        values = scale * triangles[:, :, value].astype(np.float64)
        to_first, to_second = (values[:, k] - values[:, 0] for k in (1, 2))
        slope: Any = to_first[:, None] * np.cross(second, normal)
        slope = (slope + to_second[:, None] * np.cross(normal, first)) / square
        table[:, column : column + 3] = slope
        table[:, column + 3] = values[:, 0] - np.einsum("ij,ij->i", slope, corners[:, 0])
    table[:, COLOUR:LIGHT] = triangles[:, 0, 6:9]
    table[:, LAYER] = triangles[:, 0, 5]
    return table


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
            np.full(4, 128, np.uint8), np.array([[0, 1, 1]]), np.array([_FAR_AWAY])
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
            low, high = piece.vertices[:, :2].min(axis=0), piece.vertices[:, :2].max(axis=0)
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
    """A picture (h, w, 4) and copies of it, each half as wide and high as the one before."""
    # The channels are numbers, of which none is the opacity of the others.
    bands = [Image.fromarray(np.ascontiguousarray(picture[:, :, k])) for k in range(4)]
    copies = [np.ascontiguousarray(picture)]
    while bands[0].size != (1, 1):
        width, height = bands[0].size
        size = max(1, width // 2), max(1, height // 2)
        bands = [band.resize(size, Image.Resampling.BOX) for band in bands]
        copies.append(np.stack([np.asarray(band) for band in bands], axis=-1))
    return copies
