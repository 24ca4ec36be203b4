"""Roofs of solids: hipped ones of small houses, and flat ones of the others.

Polygons of solids enter; triangles leave, in the rows of :mod:`lrf3d.scene.walls`.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, Single
from lrf3d.scene.facades import ROOF
from lrf3d.scene.hipped_roofs import hip_faces, plan_hips
from lrf3d.scene.outlines import triangles
from lrf3d.scene.structures import Structures

_SLIVER = 1e-3
"""Pieces of roofs below this area [m²] are left out."""


class Roofs(NamedTuple):
    """Triangles of roofs."""

    faces: Single
    """(t, 3, 14) the triangles."""
    objects: Int
    """(t,) the object of each."""
    under: Float
    """(t,) how far under the edge of a shadow each lies [m]."""


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


def build_roofs(structures: Structures, polygons: Any, solids: Int, under: Float) -> Roofs:
    """Build roofs of polygons (p,), the parts of solids (p,) that are so far in shadow (p,) [m]."""
    hips = plan_hips(structures)
    flat = ~hips.chosen[solids] & (shapely.area(polygons) > _SLIVER)
    tiled = hips.chosen[solids]
    corners, piece = triangles(polygons[flat])
    owner = solids[flat][piece]
    heights, colours = structures.solid_heights[owner], structures.solid_colours[owner]
    faces = flat_faces(corners, heights, colours, ROOF)
    sloped, slope = hip_faces(structures, hips, polygons[tiled], solids[tiled])
    owners = np.concatenate([owner, solids[tiled][slope]])
    return Roofs(
        np.concatenate([faces, sloped]),
        structures.solid_objects[owners],
        np.concatenate([under[flat][piece], under[tiled][slope]]),
    )
