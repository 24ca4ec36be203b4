"""Parts: which pieces of a large scene stand in the picture, near ones first.

In go the triangles of static primitives, each owned by a part such as a building; for a camera
the parts leave that it may see: those within the picture, less those that nearer buildings hide.
What is left out is not on the graphics side's mind at all, and what is drawn from near to far is
painted once: the farther pixels fail their depth test.

What hides others is the skyline: for each of many narrow columns of the view its height is kept, as
a slope from the eye. Buildings raise it as they are passed on the way out; what stays below it
everywhere is hidden. All of it is on the safe side: what may be seen by a hand's breadth is drawn.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Bool, Float, Int, Single, quad_indices
from lrf3d.render.primitives import Primitive, Span, Texture
from lrf3d.scene.facades import BLANK, layers
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import PaintedWalls

COLUMNS = 512
"""Columns of the view, over half a turn: a third of a degree each."""

HIDING_REACH = 100.0
"""Solids farther off [m] hide too little to be looked at."""

FIRST = 8
"""Parts that are looked at together at first; then twice as many each time."""


class Skyline:
    """Solids that hide what stands behind them.

    Args:
        corners: (n, 2) corners of all solids, one solid after the other [m].
        sizes: (k,) how many corners each solid has.
        heights: (k,) heights of their lowest walls [m], which stand on the ground.
    """

    def __init__(self, corners: Float, sizes: Int, heights: Float) -> None:
        self._corners = corners
        self._sizes = sizes
        self._starts = np.cumsum(sizes) - sizes
        self._heights = heights
        self._first = corners[self._starts] if len(sizes) else np.zeros((0, 2))

    def unhidden(
        self, parts: Int, away: Float, low: Float, high: Float, eye: Float, ahead: Float
    ) -> Int:
        """Those of the parts that nearer solids do not hide.

        Args:
            parts: Numbers of the parts, near ones first.
            away: How far off the nearest point of each is [m], rising.
            low: Least x, y, z of the boxes around all parts [m].
            high: Largest x, y, z of them [m].
            eye: (3,) where the eye is [m].
            ahead: Where the eye looks; only x and y matter.
        """
        turn = float(np.arctan2(ahead[1], ahead[0]))
        first, last, slopes, far = self._raised(eye, turn)
        left, right = _columns(parts, low, high, eye, turn)
        tops = high[parts, 2] - eye[2]
        steepest = tops / np.maximum(away, 1e-3)
        whole = (right - left < COLUMNS // 2) & (tops > 0.0)
        skyline = np.full(COLUMNS + 1, -np.inf)
        seen = np.ones(len(parts), dtype=bool)
        added, start, size = 0, 0, FIRST
        while start < len(parts):
            stop = min(start + size, len(parts))
            # Only what ends nearer than the parts begin stands before all of them.
            upto = int(np.searchsorted(far, away[start], side="right"))
            for solid in range(added, upto):
                place = slice(first[solid], last[solid])
                np.maximum(skyline[place], slopes[solid], out=skyline[place])
            added = max(added, upto)
            bounds = np.column_stack([left[start:stop], right[start:stop] + 1]).ravel()
            least = np.minimum.reduceat(skyline, bounds)[::2]
            seen[start:stop] = ~whole[start:stop] | (steepest[start:stop] >= least)
            start, size = stop, 2 * size
        return np.asarray(parts[seen])

    def _raised(self, eye: Float, turn: float) -> tuple[Int, Int, Float, Float]:
        """Near solids by their far end: the columns that each fills, its slope and that distance.

        A solid is of one piece, so that it fills all columns between its outermost corners.
        """
        near = np.abs(self._first - eye[:2]).max(axis=1, initial=0.0) < HIDING_REACH
        solids = np.flatnonzero(near & (self._heights > eye[2]))
        if not len(solids):
            none = np.zeros(0, dtype=np.int64)
            return none, none, np.zeros(0), np.zeros(0)
        sizes = self._sizes[solids]
        starts = np.cumsum(sizes) - sizes
        index = np.repeat(self._starts[solids] - starts, sizes) + np.arange(int(sizes.sum()))
        points = self._corners[index] - eye[:2]
        columns = _column(points, turn)
        left = np.ceil(np.minimum.reduceat(columns, starts)).astype(np.int64)
        right = np.floor(np.maximum.reduceat(columns, starts)).astype(np.int64)
        far = np.maximum.reduceat(np.hypot(points[:, 0], points[:, 1]), starts)
        # What reaches far behind the eye, or is seen over half a turn, may lie round it.
        good = (right > left) & (right - left < COLUMNS)
        good &= (left > -COLUMNS // 6) & (right < COLUMNS + COLUMNS // 6)
        good &= (right > 0) & (left < COLUMNS)
        order = np.flatnonzero(good)[np.argsort(far[good])]
        slopes = (self._heights[solids] - eye[2]) / far
        left, right = np.maximum(left, 0), np.minimum(right, COLUMNS)
        return left[order], right[order], slopes[order], far[order]


def _columns(parts: Int, low: Float, high: Float, eye: Float, turn: float) -> tuple[Int, Int]:
    """First and last column (n,) that the boxes of the parts reach into."""
    x = np.stack([low[parts, 0], high[parts, 0]], axis=1) - eye[0]
    y = np.stack([low[parts, 1], high[parts, 1]], axis=1) - eye[1]
    corners = np.stack([x[:, [0, 1, 1, 0]], y[:, [0, 0, 1, 1]]], axis=2)
    columns = np.clip(np.floor(_column(corners, turn)), 0, COLUMNS - 1).astype(np.int64)
    return columns.min(axis=1), columns.max(axis=1)


def _column(points: Float, turn: float) -> Float:
    """The column, as a fraction, in which points (…, 2) are seen by an eye at the origin."""
    angles = np.arctan2(points[..., 1], points[..., 0]) - turn
    angles = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray((angles / np.pi + 0.5) * COLUMNS)


TILE = 160.0
"""Side of a tile [m]: parts are checked one by one only in tiles that are in sight."""

_LONGEST = 60.0
"""Side of a square [m] that a part is cut to: a block of a mile is not drawn for its corner."""

_SIZES, _COLUMNS = (3, 3, 3, 3, 1, 3), [0, 1, 2, *range(6, 19)]
"""What a corner has, position, place on the texture, colour, light in the sun, how far under the
edge of its shadow it lies and light in the shadow, and where in the rows of
:func:`~lrf3d.scene.walls.paint_walls` that stands."""


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
        bare: The program of triangles without a texture, and which of the triangles (m,) those are.
    """

    def __init__(
        self,
        program: str,
        sizes: tuple[int, ...],
        vertices: Single,
        triangles: NDArray[np.uint32],
        owners: Int,
        parts: int,
        bare: tuple[str, Bool],
    ) -> None:
        # Of each part there are two runs of triangles, first of all with a texture, then of bare.
        self._bare, without = bare
        self._parts = parts
        runs = owners + parts * without
        order = np.argsort(runs, kind="stable")
        self._all = np.ascontiguousarray(triangles[order], dtype=np.uint32)
        self._sizes = np.bincount(runs, minlength=2 * parts)
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
        runs = np.concatenate([parts, parts + self._parts])
        self.choose(self._all[ranges(self._starts, self._sizes, runs)].ravel())

    @property
    def spans(self) -> tuple[Span, ...]:
        """Its triangles without a texture, which have a program of their own, and those with one.

        Those that cost more come last, so that fewer of them are drawn where others hide them.
        """
        cut = 3 * int(self._sizes[self._shown].sum())
        return (self._bare, cut, self.count - cut), (self.program, 0, cut)


@dataclass(frozen=True, slots=True)
class PartedWalls:
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


def build_walls(structures: Structures, painted: PaintedWalls) -> PartedWalls:
    """Build the primitive of all walls and roofs, and the parts that it is drawn in."""
    quads, objects, roofs, roof_objects = painted.faces
    quad_parts, roof_parts, parts = _parts(structures, quads, objects, roofs, roof_objects)
    corners = 4 * len(quads) + np.arange(3 * len(roofs), dtype=np.uint32)
    faces = PartedPrimitive(
        "walls",
        _SIZES,
        np.concatenate([quads.reshape(-1, 19), roofs.reshape(-1, 19)])[:, _COLUMNS],
        np.concatenate([quad_indices(len(quads)), corners]).reshape(-1, 3).astype(np.uint32),
        np.concatenate([np.repeat(quad_parts, 2), roof_parts]),
        len(parts.boxes.low),
        ("plain", np.concatenate([np.repeat(quads[:, 0, 8], 2), roofs[:, 0, 8]]) == BLANK),
    )
    faces.texture = Texture(layers(structures.indoor))
    return PartedWalls(faces, parts)


def _parts(
    structures: Structures, quads: Single, quad_objects: Int, roofs: Single, roof_objects: Int
) -> tuple[Int, Int, Parts]:
    """The part of each quad and roof triangle, and the parts: objects, or pieces of them."""
    middles = np.concatenate([quads[:, :, :2].mean(axis=1), roofs[:, :, :2].mean(axis=1)])
    cells = np.floor(middles / _LONGEST).astype(np.int64)
    objects = np.concatenate([quad_objects, roof_objects])
    keys = np.column_stack([objects, cells])
    # Small objects are one part wherever they stand.
    small = _sizes_of(structures, int(objects.max(initial=-1)) + 1)[objects] <= _LONGEST
    keys[small, 1:] = 0
    _, owners = np.unique(keys, axis=0, return_inverse=True)
    owners = owners.reshape(-1)
    points = np.concatenate([quads[:, :, :3].reshape(-1, 3), roofs[:, :, :3].reshape(-1, 3)])
    point_owners = np.concatenate(
        [np.repeat(owners[: len(quads)], 4), np.repeat(owners[len(quads) :], 3)]
    )
    boxes = Boxes.around(points.astype(np.float64), point_owners, int(owners.max(initial=-1)) + 1)
    return owners[: len(quads)], owners[len(quads) :], Parts(boxes, _skyline(structures))


def _sizes_of(structures: Structures, count: int) -> Float:
    """The longer side (count,) of the box around each object's walls [m]."""
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
