"""Walls and roofs as faces: cut where shadows and storeys end, lit, and laid on the texture.

What walls make up enters; leave corners that have all that a renderer must know of a face.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, Single, directions, lengths
from lrf3d.progress import Progress, silent
from lrf3d.scene.facades import CAP, FACADE, PLAIN, bare_above_foot, lay_roofs, lay_walls
from lrf3d.scene.light import Light, screen
from lrf3d.scene.look import SUN, SUNSHINE
from lrf3d.scene.pieces import cut_small
from lrf3d.scene.roofs import build_roofs, flat_faces
from lrf3d.scene.shadows import LIT, height_of_shadows, shade_quads, shade_roofs
from lrf3d.scene.shapes import Painted, single
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import trunk_faces

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_SIZES = (3, 3, 2, 2, 4)
"""Position, normal, place along and up the face [m], its length and height [m], colour and kind."""

_STEP, _STEP_INDOOR = 3.2, 0.8
"""Sides of the pieces that walls are cut into for their light [m]."""

_MOST_PIECES = 60_000
"""About how many pieces there may be: beyond, light takes seconds."""

_APART = 0.004
"""Half the gap between both faces of a free wall [m]."""

_LOWEST_FACADE = 3.0
"""Walls below this height [m] are fences and garden walls: no windows."""


class Walls(NamedTuple):
    """What pictures show of what stands in a world."""

    walls: Painted
    """Walls and the tops of free ones, as quads."""
    roofs: Painted
    """Roofs and leaves, as triangles."""
    light: Light
    """The light of the world."""


def wall_quads(structures: Structures) -> tuple[Single, Int]:
    """The quads (n, 4, 14) of all walls and of the tops of free ones, and the object (n,) of each.

    A corner has its position, its normal, its place along and up the face [m], the face's length
    and height [m], its colour, and its kind with the seed of its object as fraction.
    """
    solid, free = np.flatnonzero(structures.closed), np.flatnonzero(~structures.closed)
    quads = np.concatenate(
        [
            _wall_faces(structures, solid, turned=False),
            _wall_faces(structures, free, turned=False),
            _wall_faces(structures, free, turned=True),
            _caps(structures, free),
        ]
    )
    return quads, structures.objects[np.concatenate([solid, free, free, free])]


def paint_walls(structures: Structures, *, progress: Progress = silent) -> Walls:
    """The faces of all walls and roofs as pictures show them.

    Progress is called with finished steps and their number while light is baked.
    """
    faces, face_objects = wall_quads(structures)
    quads, number = shade_quads(structures, faces)
    polygons, solid, under = shade_roofs(structures)
    top = build_roofs(structures, polygons, solid, under)
    trunks, leaves = _trees(structures)
    # Trunks are walls of their own, after all others.
    number = np.concatenate([number, len(faces) + np.arange(len(trunks))])
    quads = np.concatenate([quads, trunks])
    trees, crowns = structures.tree_objects, structures.crowns
    objects = np.concatenate([face_objects, np.repeat(trees, 6)])
    pieces, owner = lay_walls(quads, number, indoor=structures.indoor)
    roofs = np.concatenate([_with_shadow(top.faces, top.under[:, None, None]), leaves])
    roofs = lay_roofs(roofs, indoor=structures.indoor)
    step = _STEP_INDOOR if structures.indoor else _STEP
    pieces, cut_from = cut_small(pieces, step, _MOST_PIECES)
    pieces = bare_above_foot(pieces, indoor=structures.indoor)
    # The two faces of a free wall are apart: a ray meets the one that looks at it.
    owner = number[owner][cut_from]
    free = (owner >= int(structures.closed.sum())) & (owner < len(faces))
    free &= pieces[:, 0, 5] < 0.5
    pieces[free, :, :3] += _APART * pieces[free, :, 3:6]
    light = Light(structures, pieces, roofs, progress)
    owners = np.concatenate([top.objects, np.repeat(trees[crowns.trees], len(crowns.triangles))])
    indoor = structures.indoor
    return Walls(
        _painted(pieces, light.quads, objects[owner], indoor=indoor),
        _painted(roofs, light.roofs, owners, indoor=indoor),
        light,
    )


def _painted(faces: Single, light: Float, objects: Int, *, indoor: bool) -> Painted:
    """Faces in their light, in the sun and where it is hidden."""
    sun = np.zeros((1, 1, 3))
    if not indoor:
        # Only leaves look another way at each corner.
        sun = np.maximum(faces[..., 3:6].astype(np.float64) @ SUN, 0.0)[..., None] * SUNSHINE
    return Painted(
        places=single(faces[..., :3]),
        normals=single(faces[..., 3:6]),
        texture=single(faces[..., 6:9]),
        colours=single(faces[..., 9:12]),
        lit=single(screen(light + sun)),
        shaded=single(screen(light)),
        under=single(faces[..., 15]),
        objects=objects,
    )


def _trees(structures: Structures) -> tuple[Single, Single]:
    """The sides (6 · t, 4, 15) of trunks, and the leaves (f, 3, 15) of crowns, in their shadows."""
    crowns = structures.crowns
    under = np.full((len(structures.trees), 1, 1, 1), LIT)
    trunks, leaves = trunk_faces(structures.trees, crowns), crowns.faces()
    if structures.indoor:
        return _with_shadow(trunks, LIT), _with_shadow(leaves, LIT)
    # A crown hides the sun, which stands high, from all of its trunk.
    under[crowns.trees] = -LIT
    over = height_of_shadows(structures, leaves[..., :2].reshape(-1, 2).astype(np.float64))
    sides = np.repeat(under, 6, axis=0).reshape(-1, 1, 1)
    shade = over.reshape(-1, 3, 1) - leaves[..., 2:3]
    return _with_shadow(trunks, sides), _with_shadow(leaves, shade)


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
    windows = structures.closed[walls] & (heights >= _LOWEST_FACADE) & ~structures.smooth[walls]
    windows &= not structures.indoor
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
    return flat_faces(corners, structures.heights[walls], structures.colours[walls], CAP)
