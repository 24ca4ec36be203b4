"""Hipped roofs of small houses with four right corners.

Houses enter; leave sloped triangles in the rows of :mod:`lrf3d.scene.walls`. They rise from the
tops of the walls, which stay as high as the file says, and less steeply than the sun: the shadow
that a house casts stays that of its walls.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Int, Single
from lrf3d.scene.facades import TILED
from lrf3d.scene.look import spread
from lrf3d.scene.outlines import triangles
from lrf3d.scene.structures import Structures

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
    """Hipped roofs of some of the solids.

    Args:
        chosen: (k,) which solids have one.
        middle: (k, 2) middle of each [m]; what follows counts only where chosen.
        along: (k, 2) direction of its longer side, of unit length.
        half: (k, 2) half its length and width [m].
        colours: (k, 3) colours of its tiles.
    """

    chosen: Bool
    middle: Float
    along: Float
    half: Float
    colours: Float

    def rise(self, solids: Int, places: Float) -> Float:
        """How high (n,) roofs of solids (n,) are over the eaves at places (n, 2) [m]."""
        way = places - self.middle[solids]
        along = self.along[solids]
        u, v = (way * along).sum(axis=1), along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0]
        length, width = self.half[solids].T
        inward = np.minimum(length - np.abs(u), width - np.abs(v))
        return np.asarray(_SLOPE * np.maximum(inward, 0.0))


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


def hip_planes(roofs: HippedRoofs, solids: Int) -> tuple[Any, Float]:
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


def hip_faces(
    structures: Structures, roofs: HippedRoofs, polygons: Any, solids: Int
) -> tuple[Single, Int]:
    """Triangles of hipped roofs, from polygons (p,) of solids by number.

    Returns:
        Faces (t, 3, 14), and which of the polygons (t,) each is of.
    """
    planes, normals = hip_planes(roofs, solids)
    parts, cell = shapely.get_parts(
        shapely.intersection(polygons[:, None], planes).ravel(), return_index=True
    )
    good = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > 1e-3)
    corners, part = triangles(parts[good])
    piece, plane = np.divmod(cell[good][part], 4)
    owner = solids[piece]
    rise = roofs.rise(np.repeat(owner, 3), corners.reshape(-1, 2)).reshape(-1, 3)
    faces = np.zeros((len(corners), 3, 14), np.float32)
    faces[..., :2] = corners
    faces[..., 2] = structures.solid_heights[owner, None] + rise
    faces[..., 3:6] = normals[piece, plane][:, None]
    faces[..., 8:10] = 1.0
    faces[..., 10:13] = roofs.colours[owner][:, None]
    faces[..., 13] = TILED + 0.5
    return faces, piece
