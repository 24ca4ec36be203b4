"""Walls and roofs as faces: cut where shadows and storeys end, lit, and laid on the texture.

What walls make up enters; leave corners that have all that a renderer must know of a face.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, Single, directions, lengths
from lrf3d.scene.facades import CAP, FACADE, PLAIN, ROOF, lay_roofs, lay_walls
from lrf3d.scene.shadows import LIT, shade_quads, shade_roofs
from lrf3d.scene.structures import Structures

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_SIZES = (3, 3, 2, 2, 4)
"""Position, normal, place along and up the face [m], its length and height [m], colour and kind."""

_LOWEST_FACADE = 3.0
"""Walls below this height [m] are fences and garden walls: no windows."""


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


def paint_walls(structures: Structures, *, shadows: bool = True) -> Faces:
    """The faces of all walls and roofs as pictures show them.

    Args:
        structures: What the walls make up.
        shadows: Whether the sun's shadows are baked into them.

    Returns:
        Faces whose corners are the 16 values of :func:`~lrf3d.scene.facades.lay_walls`.
    """
    faces = wall_faces(structures)
    if shadows:
        quads, number = shade_quads(structures, faces.quads)
        polygons, solid, under = shade_roofs(structures)
        roofs, roof_objects, piece = _roofs(structures, polygons, solid)
        dark = under[piece].astype(np.float32)
    else:
        quads, number = _with_shadow(faces.quads, LIT), np.arange(len(faces.quads))
        roofs, roof_objects = faces.roofs, faces.roof_objects
        dark = np.full(len(roofs), LIT, np.float32)
    pieces, owner = lay_walls(quads, number, indoor=structures.indoor)
    roofs = lay_roofs(_with_shadow(roofs, dark[:, None, None]), indoor=structures.indoor)
    return Faces(pieces, faces.objects[number[owner]], roofs, roof_objects)


def _with_shadow(faces: Single, under: Any) -> Single:
    """Faces whose corners also hold how far under the edge of their shadow they lie [m]."""
    column = np.broadcast_to(np.asarray(under, np.float32), (*faces.shape[:2], 1))
    return np.concatenate([faces, column], axis=2)


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
