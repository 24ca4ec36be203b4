"""Roofs of solids: hipped ones of small houses, and flat ones with parapets of the others.

Enter: polygons of solids; leave: triangles of roofs, and quads of what stands on them, in the rows
of :mod:`lrf3d.scene.walls`. A parapet stands within its house and is as high as that; what is
higher stands above all beams: what the laser meets stays what the file says.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, Single
from lrf3d.scene.facades import CAP, ROOF
from lrf3d.scene.hipped_roofs import hip_faces, plan_hips
from lrf3d.scene.look import SUN
from lrf3d.scene.outlines import triangles
from lrf3d.scene.roof_boxes import RoofBoxes, plan_boxes
from lrf3d.scene.shadows import LIT
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
    """Roofs, with parapets and what stands on them.

    Args:
        roofs: (t, 3, 14) their triangles.
        objects: (t,) the object of each.
        under: (t,) how far under the edge of a shadow each lies [m].
        quads: (n, 4, 14) the inner sides of parapets, and boxes.
        quad_objects: (n,) the object of each.
    """

    roofs: Single
    objects: Int
    under: Float
    quads: Single
    quad_objects: Int


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
    corners, piece = triangles(polygons)
    solid = solids[piece]
    faces = flat_faces(corners, heights[piece], structures.solid_colours[solid], ROOF)
    return RoofFaces(faces, structures.solid_objects[solid], piece)


def build_tops(
    structures: Structures, polygons: Any, solids: Int, under: Float, *, shadows: bool
) -> Tops:
    """Build what is on top of solids.

    Args:
        structures: What stands in the world.
        polygons: (p,) the parts that their roofs are cut into, where shadows fall on them.
        solids: (p,) the solid of each.
        under: (p,) how far each lies under the edge of a shadow [m].
        shadows: Whether parapets and boxes cast shadows on their roofs.
    """
    hips = plan_hips(structures)
    inner = shapely.buffer(structures.solids, -_WIDTH, join_style="mitre")
    with_one = (structures.solid_heights >= _LOWEST) & (not structures.indoor) & ~hips.chosen
    with_one &= shapely.area(inner) > _ROOM * shapely.area(structures.solids)
    inner = np.where(with_one, inner, structures.solids)
    low = structures.solid_heights - _DEPTH * with_one
    flat = np.where(hips.chosen, shapely.Polygon(), inner)
    boxes = plan_boxes(structures, hips, flat, low)
    dark = np.where(shadows & with_one, _shaded(flat, boxes), shapely.Polygon())
    ring, level, tiled = with_one[solids], ~hips.chosen[solids], hips.chosen[solids]
    on_roof = shapely.intersection(polygons, inner[solids])
    found = []
    for shape, chosen, height, made_of, shade in (
        (shapely.difference(polygons, inner[solids]), ring, structures.solid_heights, CAP, under),
        (shapely.difference(on_roof, dark[solids]), level, low, ROOF, under),
        (shapely.intersection(on_roof, dark[solids]), level, low, ROOF, 0.0 * under - LIT),
    ):
        parts, owner = shapely.get_parts(shape, return_index=True)
        good = chosen[owner] & (shapely.area(parts) > _SLIVER)
        parts, owner = parts[good], owner[good]
        faces, objects, piece = roof_faces(structures, parts, solids[owner], height[solids[owner]])
        faces[..., 13] = made_of + 0.5
        found.append((faces, objects, shade[owner[piece]]))
    faces, piece = hip_faces(structures, hips, polygons[tiled], solids[tiled])
    found.append((faces, structures.solid_objects[solids[tiled][piece]], under[tiled][piece]))
    roofs, objects, shade = (np.concatenate(column) for column in zip(*found, strict=True))
    sides, side_objects = _inner_sides(structures, inner, np.flatnonzero(with_one))
    owners = structures.solid_objects[boxes.solids]
    return Tops(
        roofs,
        objects,
        shade,
        np.concatenate([sides, boxes.sides(), boxes.tops()]),
        np.concatenate([side_objects, np.repeat(owners, 4), owners]),
    )


def _shaded(roofs: Any, boxes: RoofBoxes) -> Any:
    """Where parapets and boxes hide the sun from flat roofs (k,), as shapely geometries."""
    slide = -SUN[:2] / SUN[2]
    lit = shapely.transform(roofs, lambda places: places + _DEPTH * slide)
    shaded = shapely.difference(roofs, lit)
    ends = boxes.outlines + ((boxes.high - boxes.low)[:, None] * slide)[:, None]
    cast = shapely.convex_hull(shapely.multipoints(np.concatenate([boxes.outlines, ends], axis=1)))
    for solid in np.unique(boxes.solids):
        shaded[solid] = shapely.union_all([shaded[solid], *cast[boxes.solids == solid]])
    return shaded


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
