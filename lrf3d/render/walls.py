"""Walls and roofs as one primitive: faces with a place in metres, from which shaders paint."""

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.geometry import Float, directions, lengths
from lrf3d.render.arrays import Single, quad_indices
from lrf3d.render.structures import Structures

if TYPE_CHECKING:
    from lrf3d.render.primitives import Primitive

FACADE, PLAIN, ROOF, CAP = 0.0, 1.0, 2.0, 3.0
"""What a face is; the shader reads it from the whole part of the fourth colour value."""

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_SIZES = (3, 3, 2, 2, 4)
"""Position, normal, place along and up the face [m], its length and height [m], colour and kind."""

_LOWEST_FACADE = 3.0
"""Walls below this height [m] are fences and garden walls: no windows."""


def wall_primitive(structures: Structures) -> "Primitive":
    """Build the primitive of all walls."""
    # The faces alone serve where there is no OpenGL.
    from lrf3d.render.primitives import Primitive

    vertices, indices = wall_faces(structures)
    return Primitive("walls", _SIZES, vertices, indices=indices, cull=True)


def wall_faces(structures: Structures) -> tuple[Single, NDArray[np.uint32]]:
    """Build the faces of all walls, the roofs of solids and the tops of free walls.

    Returns:
        Vertices (v, 14): position, normal, place along and up the face [m], its length and
        height [m], colour, and its kind with the seed of its object as fraction; and indices
        (3 · t,) of triangles, two after the other for each wall.
    """
    closed = structures.closed
    faces = [
        _wall_faces(structures, np.flatnonzero(closed), turned=False),
        _wall_faces(structures, np.flatnonzero(~closed), turned=False),
        _wall_faces(structures, np.flatnonzero(~closed), turned=True),
        _caps(structures, np.flatnonzero(~closed)),
    ]
    quads = np.concatenate(faces)
    roofs, roof_indices = _roofs(structures)
    vertices = np.concatenate([quads.reshape(-1, sum(_SIZES)), roofs])
    indices = np.concatenate([quad_indices(len(quads)), roof_indices + 4 * len(quads)])
    return vertices, indices.astype(np.uint32)


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


def _roofs(structures: Structures) -> tuple[Single, NDArray[Any]]:
    """Triangles of the roofs: vertices (v, 14) and indices (3 · t,)."""
    if not len(structures.solids):
        return np.zeros((0, sum(_SIZES)), np.float32), np.zeros(0, np.uint32)
    triangles, solid = shapely.get_parts(
        shapely.constrained_delaunay_triangles(structures.solids), return_index=True
    )
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    faces = _flat(corners, structures.solid_heights[solid], structures.solid_colours[solid], ROOF)
    return faces.reshape(-1, sum(_SIZES)), np.arange(3 * len(faces), dtype=np.uint32)
