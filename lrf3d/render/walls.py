"""Walls and roofs as two primitives: faces with a place in metres, from which shaders paint."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.render.arrays import Single, quad_indices
from lrf3d.render.parts import Boxes, PartedPrimitive, Parts
from lrf3d.render.skyline import Skyline
from lrf3d.render.structures import Structures
from lrf3d.render.sun_shade import shade_quads, shade_roofs

FACADE, PLAIN, ROOF, CAP = 0.0, 1.0, 2.0, 3.0
"""What a face is; the shader reads it from the whole part of the fourth colour value."""

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_SIZES = (3, 3, 2, 2, 4)
"""Position, normal, place along and up the face [m], its length and height [m], colour and kind."""

_SHADED_SIZES = (*_SIZES, 1)
"""The same, and how far under the edge of its shadow a corner lies [m]."""

_LOWEST_FACADE = 3.0
"""Walls below this height [m] are fences and garden walls: no windows."""


_LONGEST = 60.0
"""Side of a square [m] that a part is cut to: a block of a mile is not drawn for its corner."""


@dataclass(frozen=True, slots=True)
class Walls:
    """What can be seen of a world's walls, in parts that are drawn only if they are in sight.

    Args:
        facades: Walls with windows.
        plain: Walls without, roofs, and the tops of free walls.
        parts: Where the parts of both stand.
    """

    facades: PartedPrimitive
    plain: PartedPrimitive
    parts: Parts

    def look_from(self, matrix: Float, eye: Float) -> None:
        """Choose what a picture of a matrix (4, 4) from an eye (3,) may show."""
        seen = self.parts.seen(matrix, eye)
        self.facades.select(seen)
        self.plain.select(seen)


class Faces(NamedTuple):
    """Faces of walls.

    Each vertex has its position, its normal, its place along and up the face [m], the face's
    length and height [m], its colour, and its kind with the seed of its object as fraction.

    Args:
        quads: (n, 4, 14) walls and the tops of free ones.
        objects: (n,) the object of each.
        roofs: (t, 3, 14) triangles of the roofs of solids.
        roof_objects: (t,) the object of each.
    """

    quads: Single
    objects: Int
    roofs: Single
    roof_objects: Int


def wall_faces(structures: Structures) -> Faces:
    """Build the faces of all walls, the roofs of solids and the tops of free walls."""
    solid, free = np.flatnonzero(structures.closed), np.flatnonzero(~structures.closed)
    quads = np.concatenate(
        [
            _wall_faces(structures, solid, turned=False),
            _wall_faces(structures, free, turned=False),
            _wall_faces(structures, free, turned=True),
            _caps(structures, free),
        ]
    )
    objects = structures.objects[np.concatenate([solid, free, free, free])]
    solid = np.arange(len(structures.solids))
    return Faces(quads, objects, *_roofs(structures, structures.solids, solid)[:2])


def build_walls(structures: Structures) -> Walls:
    """Build the primitives of all walls, and the parts that they are drawn in."""
    faces = wall_faces(structures)
    quads, face = shade_quads(structures, faces.quads)
    objects = faces.objects[face]
    roofs, roof_objects = _shaded_roofs(structures)
    windows = quads[:, 0, 13] < PLAIN
    quad_parts, roof_parts, parts = _parts(structures, quads, objects, roofs, roof_objects)
    size = sum(_SHADED_SIZES)
    pieces = []
    for program, chosen, triangles in (
        ("facade", windows, roofs[:0]),
        ("walls", ~windows, roofs),
    ):
        count = int(chosen.sum())
        corners = 4 * count + np.arange(3 * len(triangles), dtype=np.uint32)
        pieces.append(
            PartedPrimitive(
                program,
                _SHADED_SIZES,
                np.concatenate([quads[chosen].reshape(-1, size), triangles.reshape(-1, size)]),
                np.concatenate([quad_indices(count), corners]).reshape(-1, 3).astype(np.uint32),
                np.concatenate([np.repeat(quad_parts[chosen], 2), roof_parts[: len(triangles)]]),
                len(parts.boxes.low),
            )
        )
    return Walls(pieces[0], pieces[1], parts)


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


def _wall_faces(structures: Structures, walls: NDArray[Any], *, turned: bool) -> Single:
    """Faces (n, 4, 14) on the right of the walls, or on their left where turned."""
    segments = structures.segments[walls]
    if turned:
        segments = segments[:, [2, 3, 0, 1]]
    heights = structures.heights[walls]
    along = directions(segments)
    length = lengths(segments)
    faces = np.zeros((len(walls), 4, sum(_SIZES)), np.float32)
    for corner, (end, up) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        faces[:, corner, 0:2] = segments[:, 2 * end : 2 * end + 2]
        faces[:, corner, 2] = heights * up
        faces[:, corner, 6] = length * end
        faces[:, corner, 7] = heights * up
    faces[:, :, 3] = along[:, 1, None]
    faces[:, :, 4] = -along[:, 0, None]
    faces[:, :, 8] = length[:, None]
    faces[:, :, 9] = heights[:, None]
    faces[:, :, 10:13] = structures.colours[walls][:, None, :]
    windows = structures.closed[walls] & (heights >= _LOWEST_FACADE) & (not structures.indoor)
    kind = np.where(windows, FACADE, PLAIN) + 0.9 * structures.seeds[walls]
    faces[:, :, 13] = kind[:, None]
    return faces


def _caps(structures: Structures, walls: NDArray[Any]) -> Single:
    """Strips (n, 4, 14) on top of free walls."""
    segments = structures.segments[walls]
    along = directions(segments)
    # The strip goes half its width past the ends, so that corners are filled.
    reach = 0.5 * CAP_WIDTH * along
    side = 0.5 * CAP_WIDTH * np.column_stack([-along[:, 1], along[:, 0]])
    start, end = segments[:, :2] - reach, segments[:, 2:] + reach
    corners = np.stack([start - side, end - side, end + side, start + side], axis=1)
    return _flat(corners, structures.heights[walls], structures.colours[walls], CAP)


def _flat(corners: Float, heights: Float, colours: Float, kind: float) -> Single:
    """Level faces (n, corners, 14) that look up."""
    faces = np.zeros((*corners.shape[:2], sum(_SIZES)), np.float32)
    faces[:, :, 0:2] = corners
    faces[:, :, 2] = heights[:, None]
    faces[:, :, 5] = 1.0
    faces[:, :, 6:8] = corners
    faces[:, :, 8:10] = 1.0
    faces[:, :, 10:13] = colours[:, None, :]
    faces[:, :, 13] = kind + 0.5
    return faces


def _shaded_roofs(structures: Structures) -> tuple[Single, Int]:
    """Triangles (t, 3, 15) of the roofs, each corner with its shadow, and the object of each."""
    polygons, solid, under = shade_roofs(structures)
    roofs, objects, piece = _roofs(structures, polygons, solid)
    shade = np.broadcast_to(under[piece, None, None], (len(roofs), 3, 1))
    return np.concatenate([roofs, shade.astype(np.float32)], axis=2), objects


def _roofs(structures: Structures, polygons: Any, solids: Int) -> tuple[Single, Int, Int]:
    """Triangles (t, 3, 14) of roofs, from polygons of solids by number.

    Returns:
        The triangles, and the object (t,) and the polygon (t,) of each.
    """
    if not len(polygons):
        none = np.zeros(0, np.int64)
        return np.zeros((0, 3, sum(_SIZES)), np.float32), none, none
    triangles, piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    solid = solids[piece]
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    faces = _flat(corners, structures.solid_heights[solid], structures.solid_colours[solid], ROOF)
    return faces, structures.solid_objects[solid], piece
