"""Roofs of solids, with a parapet round those of houses.

Enter: polygons of solids; leave: level triangles, and the inner sides of parapets, in the rows of
:mod:`lrf3d.scene.walls`. A parapet stands within its house and is as high as that: what the laser
meets, and how high houses are, stays what the file says.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, Single
from lrf3d.scene.facades import CAP, ROOF
from lrf3d.scene.structures import Structures

_WIDTH, _DEPTH = 0.28, 0.55
"""Width of a parapet, and how deep the roof lies below its top [m]."""

_LOWEST = 4.0
"""Houses below this height [m] have none."""

_ROOM = 0.5
"""Share of a house's area that must be left within its parapet."""

_SLIVER = 1e-3
"""Pieces of roofs below this area [m²] are left out."""


class RoofFaces(NamedTuple):
    """Level triangles of roofs.

    Args:
        faces: (t, 3, 14) triangles.
        objects: (t,) the object of each.
        pieces: (t,) the polygon of each.
    """

    faces: Single
    objects: Int
    pieces: Int


class Tops(NamedTuple):
    """Roofs with their parapets.

    Args:
        roofs: Their triangles.
        pieces: (p,) the polygon that each piece of a roof was a part of.
        inner: (n, 4, 14) the inner sides of parapets.
        inner_objects: (n,) the object of each.
    """

    roofs: RoofFaces
    pieces: Int
    inner: Single
    inner_objects: Int


def flat_faces(corners: Float, heights: Float, colours: Float, kind: float) -> Single:
    """Level faces (n, corners, 14) that look up."""
    faces = np.zeros((*corners.shape[:2], 14), np.float32)
    faces[:, :, 0:2] = corners
    faces[:, :, 2] = heights[:, None]
    faces[:, :, 5] = 1.0
    faces[:, :, 6:8] = corners
    faces[:, :, 8:10] = 1.0
    faces[:, :, 10:13] = colours[:, None, :]
    faces[:, :, 13] = kind + 0.5
    return faces


def roof_faces(structures: Structures, polygons: Any, solids: Int, heights: Float) -> RoofFaces:
    """Triangles of roofs at heights (p,) [m], from polygons (p,) of solids by number."""
    if not len(polygons):
        none = np.zeros(0, np.int64)
        return RoofFaces(np.zeros((0, 3, 14), np.float32), none, none)
    triangles, piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    solid = solids[piece]
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    faces = flat_faces(corners, heights[piece], structures.solid_colours[solid], ROOF)
    return RoofFaces(faces, structures.solid_objects[solid], piece)


def add_parapets(structures: Structures, polygons: Any, solids: Int) -> Tops:
    """Lower the roofs of houses, which are polygons (p,) of solids by number, behind parapets."""
    inner = shapely.buffer(structures.solids, -_WIDTH, join_style="mitre")
    with_one = (structures.solid_heights >= _LOWEST) & (not structures.indoor)
    with_one &= shapely.area(inner) > _ROOM * shapely.area(structures.solids)
    inner = np.where(with_one, inner, structures.solids)
    found, owners, levels, kinds = [], [], [], []
    heights = structures.solid_heights[solids]
    for shape, chosen, depth, made_of in (
        (shapely.difference(polygons, inner[solids]), with_one[solids], 0.0, CAP),
        (shapely.intersection(polygons, inner[solids]), np.ones(len(solids), bool), _DEPTH, ROOF),
    ):
        parts, owner = shapely.get_parts(shape, return_index=True)
        good = chosen[owner] & (shapely.area(parts) > _SLIVER)
        parts, owner = parts[good], owner[good]
        found.append(parts)
        owners.append(owner)
        levels.append(heights[owner] - depth * with_one[solids[owner]])
        kinds.append(np.full(len(owner), made_of))
    pieces, level, kind = (np.concatenate(each) for each in (owners, levels, kinds))
    roofs = roof_faces(structures, np.concatenate(found), solids[pieces], level)
    roofs.faces[..., 13] = kind[roofs.pieces, None] + 0.5
    return Tops(roofs, pieces, *_inner_sides(structures, inner, np.flatnonzero(with_one)))


def _inner_sides(structures: Structures, inner: Any, chosen: Int) -> tuple[Single, Int]:
    """The sides (n, 4, 14) of parapets that look at their roofs, and the object (n,) of each."""
    shapes, solid = shapely.get_parts(inner[chosen], return_index=True)
    rings, shape = shapely.get_rings(shapely.orient_polygons(shapes), return_index=True)
    ends, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    start, end = ends[:-1][same], ends[1:][same]
    owner = chosen[solid[shape[ring[:-1][same]]]]
    along = (end - start) / np.maximum(np.hypot(*(end - start).T), 1e-9)[:, None]
    sides = np.zeros((len(start), 4, 14), np.float32)
    high = structures.solid_heights[owner]
    # The roof lies to the left of its outline: seen from it, the outline runs to the left.
    corners = [(end, high - _DEPTH), (start, high - _DEPTH), (start, high), (end, high)]
    for corner, (place, up) in enumerate(corners):
        sides[:, corner, 0:2], sides[:, corner, 2] = place, up
    sides[:, :, 3], sides[:, :, 4] = -along[:, 1, None], along[:, 0, None]
    sides[:, :, 8:10] = 1.0
    sides[:, :, 10:13] = structures.solid_colours[owner][:, None]
    sides[:, :, 13] = CAP + 0.5
    return sides, structures.solid_objects[owner]
