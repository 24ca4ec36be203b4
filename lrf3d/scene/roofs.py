"""Roofs of solids: hipped ones of small houses with four right corners, flat ones of the others.

Solids enter, triangles leave. Hipped roofs rise from the tops of the walls, which stay as high as
the file says, and less steeply than the sun: the shadow that a house casts stays that of its walls.
"""

from typing import Any

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Int
from lrf3d.scene.look import spread
from lrf3d.scene.panels import LIT, joined, level_panels, panels, triangles
from lrf3d.scene.shadows import shade_roofs
from lrf3d.scene.shapes import Painted
from lrf3d.scene.structures import Structures

_GREY, _SHARE_OF_GREY = np.array([0.52, 0.52, 0.53]), 0.75
"""Colour of flat roofs, and its share in a roof: the rest is the wall's."""

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


def build_roofs(structures: Structures) -> Painted:
    """Triangles (t,) of the roofs of all solids; flat ones also in the shadow of others."""
    hipped = hipped_houses(structures)
    polygons, solids, under = shade_roofs(structures)
    flat = ~hipped[solids] & (shapely.area(polygons) > _SLIVER)
    polygons, solids, under = polygons[flat], solids[flat], under[flat]
    corners, piece = triangles(polygons)
    owner = solids[piece]
    walls = structures.solid_colours[owner]
    grey = 1.08 * (walls + _SHARE_OF_GREY * (_GREY - walls))
    level = level_panels(
        corners,
        structures.solid_heights[owner],
        1.02 * walls if structures.indoor else grey,
        under[piece],
        structures.solid_objects[owner],
    )
    return joined(level, _hips(structures, np.flatnonzero(hipped)))


def hipped_houses(structures: Structures) -> Bool:
    """Which solids (k,) have hipped roofs."""
    solids, heights = structures.solids, structures.solid_heights
    half = 0.5 * _sides(solids)[1]
    chosen = shapely.area(solids) > _RIGHT * 4.0 * half[:, 0] * half[:, 1]
    chosen &= (2.0 * half[:, 1] >= _NARROWEST) & (2.0 * half[:, 1] <= _WIDEST)
    chosen &= half[:, 0] <= _LONGEST * half[:, 1]
    chosen &= spread(structures.solid_objects, 0.37) < _SHARE
    chosen &= (heights >= _LOWEST) & (heights <= _HIGHEST)
    return np.asarray(chosen & (not structures.indoor))


def _sides(solids: Any) -> tuple[Float, Float]:
    """Corners (k, 4, 2) of the rectangles round solids, counter-clockwise, and their sides (k, 2).

    The first side is a longer one; they are 0 where there is no rectangle.
    """
    boxes = shapely.orient_polygons(shapely.minimum_rotated_rectangle(solids))
    whole = shapely.get_type_id(boxes) == 3
    corners = np.zeros((len(solids), 4, 2))
    corners[whole] = shapely.get_coordinates(boxes[whole]).reshape(-1, 5, 2)[:, :4]
    sides = np.linalg.norm(corners[:, 1:3] - corners[:, 0:2], axis=2)
    across = sides[:, 1] > sides[:, 0]
    corners[across] = np.roll(corners[across], -1, axis=1)
    return corners, np.where(across[:, None], sides[:, ::-1], sides)


def _hips(structures: Structures, solids: Int) -> Painted:
    """Triangles of the hipped roofs of solids (n,): two long sides and both ends of each."""
    corners, sides = _sides(structures.solids[solids])
    eaves = structures.solid_heights[solids]
    ends = 0.5 * (corners + np.roll(corners, -1, axis=1))[:, [3, 1]]
    along = (ends[:, 1] - ends[:, 0]) / np.maximum(sides[:, :1], 1e-9)
    inward = 0.5 * sides[:, 1:] * along
    ridge = np.stack([ends[:, 0] + inward, ends[:, 1] - inward], axis=1)
    high = np.stack([eaves] * 4 + [eaves + 0.5 * _SLOPE * sides[:, 1]] * 2, axis=1)
    points = np.concatenate([np.concatenate([corners, ridge], axis=1), high[..., None]], axis=2)
    faces = points[:, [[0, 1, 5], [0, 5, 4], [1, 2, 5], [2, 3, 4], [2, 4, 5], [3, 0, 4]]]
    faces = faces.reshape(-1, 3, 3)
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    area, owner = np.linalg.norm(normals, axis=1), np.repeat(structures.solid_objects[solids], 6)
    # A square house has no ridge.
    good = area > _SLIVER
    faces, owner, normals = faces[good], owner[good], normals[good] / area[good, None]
    colours = _TILES[(spread(owner, 0.37) * 97.0).astype(int) % len(_TILES)]
    return panels(faces, normals[:, None], colours[:, None], np.array(LIT), owner)
