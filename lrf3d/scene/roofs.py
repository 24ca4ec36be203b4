"""Roofs of solids: hipped ones of small houses with four right corners, flat ones of the others.

Solids enter, triangles leave. Hipped roofs rise from the tops of the walls, which stay as high as
the file says, and less steeply than the sun: the shadow that a house casts stays that of its walls.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Int
from lrf3d.scene.look import spread
from lrf3d.scene.panels import Panels, joined, level_panels, panels, triangles
from lrf3d.scene.shadows import shade_roofs
from lrf3d.scene.structures import Structures

_GREY, _SHARE_OF_GREY = np.array([0.52, 0.52, 0.53]), 0.75
"""Colour of flat roofs, and its share in a roof: the rest is the wall's."""

_CELL, _MOST_CELLS = 0.8, 100_000
"""Side of the pieces that level faces of rooms are cut into [m], as walls are; there are none in
places of more cells."""

_SLIVER = 1e-3
"""Pieces of roofs below this area [m²] are left out."""

_SLOPE = 0.62
"""Rise of a roof [m/m]: 32 degrees."""

_NARROWEST, _WIDEST = 3.5, 13.0
"""The shorter side of a house that has one [m]."""

_LONGEST = 3.0
"""Its longer side, in shorter ones."""

_LOWEST, _HIGHEST = 2.4, 12.5
"""Its height up to the eaves [m]: higher houses have flat roofs."""

_RIGHT = 0.985
"""Share of the rectangle around it that it fills at the least."""

_SHARE = 0.75
"""Share of such houses that have one."""

_TILES = np.array([[0.70, 0.60, 0.55], [0.64, 0.58, 0.55], [0.60, 0.61, 0.62], [0.71, 0.63, 0.57]])
"""Colours of tiles: pale clay and slate."""


class HippedRoofs(NamedTuple):
    """Hipped roofs of some of the solids; what is not of these does not count."""

    chosen: Bool
    """(k,) which solids have one."""
    middle: Float
    """(k, 2) middle of each [m]."""
    along: Float
    """(k, 2) direction of its longer side, of unit length."""
    half: Float
    """(k, 2) half its length and width [m]."""
    colours: Float
    """(k, 3) colours of its tiles."""

    def rise(self, solids: Int, places: Float) -> Float:
        """How high (n,) roofs of solids (n,) are over the eaves at places (n, 2) [m]."""
        way = places - self.middle[solids]
        along = self.along[solids]
        u, v = (way * along).sum(axis=1), along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0]
        length, width = self.half[solids].T
        inward = np.minimum(length - np.abs(u), width - np.abs(v))
        return np.asarray(_SLOPE * np.maximum(inward, 0.0))


def build_roofs(structures: Structures) -> Panels:
    """Triangles (t,) of the roofs of all solids, in the sun and in the shadow of others."""
    polygons, solids, under = shade_roofs(structures)
    if structures.indoor:
        polygons, piece = _cut_small(polygons)
        solids, under = solids[piece], under[piece]
    hips = plan_hips(structures)
    tiled = hips.chosen[solids]
    flat = ~tiled & (shapely.area(polygons) > _SLIVER)
    corners, piece = triangles(polygons[flat])
    owner = solids[flat][piece]
    colours = 1.02 * structures.solid_colours[owner]
    if not structures.indoor:
        walls = structures.solid_colours[owner]
        colours = 1.08 * (walls + _SHARE_OF_GREY * (_GREY - walls))
    level = level_panels(
        corners,
        structures.solid_heights[owner],
        colours,
        under[flat][piece],
        structures.solid_objects[owner],
    )
    return joined(level, _hip_faces(structures, hips, polygons[tiled], solids[tiled], under[tiled]))


def _cut_small(polygons: Any) -> tuple[Any, Int]:
    """Pieces (m,) of polygons (p,) in the cells of a grid, and which of these each is of.

    What hides the robot in a room sinks, and bends where corners are.
    """
    if not len(polygons):
        return polygons, np.zeros(0, np.int64)
    low, high = np.floor(shapely.total_bounds(polygons).reshape(2, 2) / _CELL)
    if np.prod(high - low + 1.0) > _MOST_CELLS:
        return polygons, np.arange(len(polygons))
    x, y = np.meshgrid(np.arange(low[0], high[0] + 1.0), np.arange(low[1], high[1] + 1.0))
    cells = shapely.box(_CELL * x, _CELL * y, _CELL * (x + 1.0), _CELL * (y + 1.0)).ravel()
    cell, polygon = shapely.STRtree(polygons).query(cells, predicate="intersects")
    parts, owner = shapely.get_parts(
        shapely.intersection(cells[cell], polygons[polygon]), return_index=True
    )
    whole = shapely.get_type_id(parts) == 3
    return parts[whole], polygon[owner[whole]]


def plan_hips(structures: Structures) -> HippedRoofs:
    """Choose the houses that have hipped roofs."""
    solids, heights = structures.solids, structures.solid_heights
    count = len(solids)
    boxes = shapely.minimum_rotated_rectangle(solids)
    whole = (shapely.get_type_id(boxes) == 3) & (not structures.indoor)
    corners = np.zeros((count, 4, 2))
    if whole.any():
        corners[whole] = shapely.get_coordinates(boxes[whole]).reshape(-1, 5, 2)[:, :4]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]], axis=1)
    length = np.hypot(sides[..., 0], sides[..., 1])
    long = length.argmax(axis=1)
    rows = np.arange(count)
    half = 0.5 * np.column_stack([length[rows, long], length[rows, 1 - long]])
    along = sides[rows, long] / np.maximum(length[rows, long], 1e-9)[:, None]
    draw = spread(structures.solid_objects, 0.37)
    chosen = whole & (shapely.area(solids) > _RIGHT * shapely.area(boxes))
    chosen &= (2.0 * half[:, 1] >= _NARROWEST) & (2.0 * half[:, 1] <= _WIDEST)
    chosen &= (half[:, 0] <= _LONGEST * half[:, 1]) & (draw < _SHARE)
    chosen &= (heights >= _LOWEST) & (heights <= _HIGHEST)
    colours = _TILES[(draw * 97.0).astype(int) % len(_TILES)]
    return HippedRoofs(chosen, corners.mean(axis=1), along, half, colours)


def _hip_planes(roofs: HippedRoofs, solids: Int) -> tuple[Any, Float]:
    """The four planes of each roof of solids (n,): polygons (n, 4), and normals (n, 4, 3)."""
    length, width = roofs.half[solids].T
    ridge = length - width
    # Corners in the roof's own frame: both long sides, then both ends.
    outlines = np.zeros((len(solids), 4, 4, 2))
    for plane, side in ((0, 1.0), (1, -1.0)):
        outlines[:, plane, :, 0] = np.stack([-length, length, ridge, -ridge], axis=1)
        outlines[:, plane, :2, 1] = side * width[:, None]
        outlines[:, plane + 2, :2, 0] = side * length[:, None]
        outlines[:, plane + 2, 2:, 0] = side * ridge[:, None]
        outlines[:, plane + 2, :2, 1] = np.stack([-width, width], axis=1)
    along = roofs.along[solids]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    frame = np.stack([along, across], axis=1)
    corners = np.einsum("npci,nij->npcj", outlines, frame) + roofs.middle[solids][:, None, None]
    out = np.stack([across, -across, along, -along], axis=1)
    normals = np.concatenate([_SLOPE * out, np.ones((*out.shape[:2], 1))], axis=2)
    return shapely.polygons(corners), normals / np.hypot(_SLOPE, 1.0)


def _hip_faces(
    structures: Structures, roofs: HippedRoofs, polygons: Any, solids: Int, under: Float
) -> Panels:
    """Triangles of hipped roofs, from polygons (p,) of solids by number, so far in shadow."""
    planes, normals = _hip_planes(roofs, solids)
    parts, cell = shapely.get_parts(
        shapely.intersection(polygons[:, None], planes).ravel(), return_index=True
    )
    good = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > _SLIVER)
    corners, part = triangles(parts[good])
    piece, plane = np.divmod(cell[good][part], 4)
    owner = solids[piece]
    rise = roofs.rise(np.repeat(owner, 3), corners.reshape(-1, 2)).reshape(-1, 3, 1)
    return panels(
        np.concatenate([corners, structures.solid_heights[owner, None, None] + rise], axis=2),
        normals[piece, plane][:, None],
        roofs.colours[owner][:, None],
        under[piece, None],
        structures.solid_objects[owner],
    )
