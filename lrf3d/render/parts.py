"""Parts: which pieces of a large scene stand in the picture, near ones first.

In go the triangles of static primitives, each owned by a part such as a building; for a camera
the parts leave that it may see. What is left out is not on the graphics side's mind at all, and
what is drawn from near to far is painted once: the farther pixels fail their depth test.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, Single, quad_indices
from lrf3d.render.primitives import Primitive
from lrf3d.render.skyline import Skyline
from lrf3d.render.textures import Texture
from lrf3d.scene.facades import layers
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import paint_walls

TILE = 160.0
"""Side of a tile [m]: parts are checked one by one only in tiles that are in sight."""

_LONGEST = 60.0
"""Side of a square [m] that a part is cut to: a block of a mile is not drawn for its corner."""

_SIZES, _COLUMNS = (3, 3, 3, 3, 1), [0, 1, 2, *range(6, 16)]
"""What a corner has, position, place on the texture, colour, light and shadow, and where in the
rows of :func:`~lrf3d.scene.walls.paint_walls` that stands."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes around things.

    Args:
        low: (n, 3) least x, y, z [m].
        high: (n, 3) largest x, y, z [m].
    """

    low: Float
    high: Float

    @classmethod
    def around(cls, points: Float, owners: Int, count: int) -> "Boxes":
        """Boxes around the points (m, 3) of each owner; each of the owners has some."""
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, owners, points)
        np.maximum.at(high, owners, points)
        return cls(low, high)

    def inside(self, matrix: Float, chosen: Int) -> Int:
        """Those of the chosen boxes that a picture may show, by its matrix (4, 4)."""
        low, high = self.low[chosen], self.high[chosen]
        seen = np.ones(len(chosen), dtype=bool)
        for plane in (
            matrix[3], matrix[3] + matrix[0], matrix[3] - matrix[0], matrix[3] + matrix[1],
            matrix[3] - matrix[1],
        ):  # fmt: skip
            # The corner that lies farthest on the inner side of the plane.
            corner = np.where(plane[:3] > 0.0, high, low)
            seen &= corner @ plane[:3] + plane[3] > 0.0
        return np.asarray(chosen[seen])

    def nearest(self, eye: Float, chosen: Int) -> Float:
        """How far off the nearest point of each of the chosen boxes is, seen from above [m]."""
        gap = np.maximum(self.low[chosen, :2] - eye[:2], eye[:2] - self.high[chosen, :2])
        gap = np.maximum(gap, 0.0)
        return np.asarray(np.hypot(gap[:, 0], gap[:, 1]), dtype=np.float64)


class Parts:
    """The parts of a scene.

    Args:
        boxes: Where each part stands.
        skyline: What hides parts from low eyes.
    """

    def __init__(self, boxes: Boxes, skyline: Skyline) -> None:
        self.boxes = boxes
        self._skyline = skyline
        middles = 0.5 * (boxes.low + boxes.high)[:, :2]
        cells = np.floor(middles / TILE).astype(np.int64)
        _, tiles = np.unique(cells, axis=0, return_inverse=True)
        tiles = tiles.reshape(-1)
        count = int(tiles.max(initial=-1)) + 1
        both = np.concatenate([boxes.low, boxes.high])
        self._tiles = Boxes.around(both, np.concatenate([tiles, tiles]), count)
        self._by_tile = np.argsort(tiles, kind="stable")
        self._sizes = np.bincount(tiles, minlength=count)
        self._starts = np.cumsum(self._sizes) - self._sizes

    def seen(self, matrix: Float, eye: Float) -> Int:
        """Parts that a picture of a matrix (4, 4) from an eye (3,) may show, near ones first."""
        tiles = self._tiles.inside(matrix, np.arange(len(self._sizes)))
        inside = self.boxes.inside(matrix, self._by_tile[ranges(self._starts, self._sizes, tiles)])
        away = self.boxes.nearest(eye, inside)
        order = np.argsort(away, kind="stable")
        inside, away = inside[order], away[order]
        # Also where there are few: with several samples a pixel, software OpenGL gives hidden
        # pixels their colours before it finds out that they are hidden.
        # The row of the matrix that gives depth is the direction in which the eye looks.
        return self._skyline.unhidden(inside, away, self.boxes.low, self.boxes.high, eye, matrix[3])


class PartedPrimitive(Primitive):
    """A static primitive of which only chosen parts are drawn.

    Args:
        program: Name of the program.
        sizes: Number of floats of each vertex attribute.
        vertices: (n, sum of sizes) the vertices.
        triangles: (m, 3) which vertices make the triangles.
        owners: (m,) the part that each triangle belongs to.
        parts: How many parts there are.
    """

    def __init__(
        self,
        program: str,
        sizes: tuple[int, ...],
        vertices: Single,
        triangles: NDArray[np.uint32],
        owners: Int,
        parts: int,
    ) -> None:
        order = np.argsort(owners, kind="stable")
        self._all = np.ascontiguousarray(triangles[order], dtype=np.uint32)
        self._sizes = np.bincount(owners, minlength=parts)
        self._starts = np.cumsum(self._sizes) - self._sizes
        self._shown: Int = np.zeros(0, dtype=np.int64)
        super().__init__(program, sizes, vertices, indices=self._all.ravel(), cull=True)

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Which vertices (m, 3) make its triangles, shown or not."""
        return self._all

    def select(self, parts: Int) -> None:
        """Draw these parts from now on, in their order."""
        if np.array_equal(parts, self._shown):
            return
        self._shown = parts
        self.choose(self._all[ranges(self._starts, self._sizes, parts)].ravel())


@dataclass(frozen=True, slots=True)
class Walls:
    """What can be seen of a world's walls, in parts that are drawn only if they are in sight.

    Args:
        faces: Walls and roofs.
        parts: Where their parts stand.
    """

    faces: PartedPrimitive
    parts: Parts

    def look_from(self, matrix: Float, eye: Float) -> None:
        """Choose what a picture of a matrix (4, 4) from an eye (3,) may show."""
        self.faces.select(self.parts.seen(matrix, eye))


def build_walls(structures: Structures) -> Walls:
    """Build the primitive of all walls and roofs, and the parts that it is drawn in."""
    quads, objects, roofs, roof_objects = paint_walls(structures)
    quad_parts, roof_parts, parts = _parts(structures, quads, objects, roofs, roof_objects)
    corners = 4 * len(quads) + np.arange(3 * len(roofs), dtype=np.uint32)
    faces = PartedPrimitive(
        "walls",
        _SIZES,
        np.concatenate([quads.reshape(-1, 16), roofs.reshape(-1, 16)])[:, _COLUMNS],
        np.concatenate([quad_indices(len(quads)), corners]).reshape(-1, 3).astype(np.uint32),
        np.concatenate([np.repeat(quad_parts, 2), roof_parts]),
        len(parts.boxes.low),
    )
    faces.texture = Texture(layers(structures.indoor))
    return Walls(faces, parts)


def _parts(
    structures: Structures, quads: Single, quad_objects: Int, roofs: Single, roof_objects: Int
) -> tuple[Int, Int, Parts]:
    """The part of each quad and roof triangle, and the parts: objects, or pieces of them."""
    middles = np.concatenate([quads[:, :, :2].mean(axis=1), roofs[:, :, :2].mean(axis=1)])
    cells = np.floor(middles / _LONGEST).astype(np.int64)
    objects = np.concatenate([quad_objects, roof_objects])
    keys = np.column_stack([objects, cells])
    # Small objects are one part wherever they stand.
    small = _sizes_of(structures)[objects] <= _LONGEST
    keys[small, 1:] = 0
    _, owners = np.unique(keys, axis=0, return_inverse=True)
    owners = owners.reshape(-1)
    points = np.concatenate([quads[:, :, :3].reshape(-1, 3), roofs[:, :, :3].reshape(-1, 3)])
    point_owners = np.concatenate(
        [np.repeat(owners[: len(quads)], 4), np.repeat(owners[len(quads) :], 3)]
    )
    boxes = Boxes.around(points.astype(np.float64), point_owners, int(owners.max(initial=-1)) + 1)
    return owners[: len(quads)], owners[len(quads) :], Parts(boxes, _skyline(structures))


def _sizes_of(structures: Structures) -> Float:
    """The longer side (objects,) of the box around each object [m]."""
    count = int(structures.objects.max(initial=-1)) + 1
    ends = structures.segments.reshape(-1, 2)
    flat = np.column_stack([ends, np.zeros(len(ends))])
    boxes = Boxes.around(flat, np.repeat(structures.objects, 2), count)
    return np.asarray((boxes.high - boxes.low).max(axis=1))


def _skyline(structures: Structures) -> Skyline:
    """What hides parts: the solids, as high as their lowest walls."""
    solid = np.flatnonzero(structures.closed)
    order = solid[np.argsort(structures.objects[solid], kind="stable")]
    _, starts, sizes = np.unique(structures.objects[order], return_index=True, return_counts=True)
    lows = structures.heights[order]
    heights = np.minimum.reduceat(lows, starts) if len(starts) else np.zeros(0)
    return Skyline(structures.segments[order, :2], sizes, heights)


def ranges(starts: Int, sizes: Int, chosen: Int) -> Int:
    """The numbers from each chosen start on, as many as its size, one range after the other."""
    counts = sizes[chosen]
    before = np.cumsum(counts) - counts
    return np.repeat(starts[chosen] - before, counts) + np.arange(int(counts.sum()))
