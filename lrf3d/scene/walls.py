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
from lrf3d.scene.pieces import cut_small, put_together
from lrf3d.scene.roofs import build_tops, flat_faces, roof_faces
from lrf3d.scene.shadows import LIT, height_of_shadows, shade_quads, shade_roofs
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import trunk_faces

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_SIZES = (3, 3, 2, 2, 4)
"""Position, normal, place along and up the face [m], its length and height [m], colour and kind."""

_STEP, _STEP_INDOOR = 3.2, 0.8
"""Sides of the pieces that walls are cut into for their light [m]."""

_LIGHT_ERROR, _LIGHT_ERROR_INDOOR = 0.05, 0.02
"""How far the light of a larger piece may be off that of the small ones, as a factor of a screen's
colours: what its rays leave to chance. In rooms there is nothing but light to be seen on walls."""

_MOST_PIECES = 60_000
"""About how many pieces there may be: beyond, light takes seconds."""

_LIGHT = [12, 13, 14, 16, 17, 18]
"""Where light stands in the rows of corners."""

_APART = 0.004
"""Half the gap between both faces of a free wall [m]."""

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
    roofs = roof_faces(structures, structures.solids, solid, structures.solid_heights)
    return Faces(quads, objects, *roofs[:2])


class PaintedWalls(NamedTuple):
    """Walls and roofs as pictures show them, and their light.

    Args:
        faces: Faces of corners of 19 values: the 16 of :func:`~lrf3d.scene.facades.lay_walls`, with
            the light on them in the sun, and the light where the sun is hidden, both as factors of
            a screen's colours.
        light: The light of the world.
    """

    faces: Faces
    light: Light


def paint_walls(
    structures: Structures, *, shadows: bool = True, progress: Progress = silent
) -> PaintedWalls:
    """The faces of all walls and roofs as pictures show them.

    Args:
        structures: What the walls make up.
        shadows: Whether the sun's shadows are baked into them.
        progress: Called with finished steps and their number while light is baked.
    """
    faces = wall_faces(structures)
    if shadows:
        quads, number = shade_quads(structures, faces.quads)
        polygons, solid, under = shade_roofs(structures)
    else:
        quads, number = _with_shadow(faces.quads, LIT), np.arange(len(faces.quads))
        solid = np.arange(len(structures.solids))
        polygons, under = structures.solids, np.full(len(solid), LIT)
    top = build_tops(structures, polygons, solid, under, shadows=shadows)
    trunks, leaves = _trees(structures, shadows=shadows)
    # What stands on roofs are walls of their own, after all others, and so are trunks.
    count = len(top.quads) + len(trunks)
    number = np.concatenate([number, len(faces.quads) + np.arange(count)])
    quads = np.concatenate([quads, _with_shadow(top.quads, LIT), trunks])
    trees, crowns = structures.tree_objects, structures.crowns
    objects = np.concatenate([faces.objects, top.quad_objects, np.repeat(trees, 6)])
    pieces, owner = lay_walls(quads, number, indoor=structures.indoor)
    under = top.under.astype(np.float32)
    roofs = np.concatenate([_with_shadow(top.roofs, under[:, None, None]), leaves])
    roofs = lay_roofs(roofs, indoor=structures.indoor)
    step = _STEP_INDOOR if structures.indoor else _STEP
    small = cut_small(pieces, step, _MOST_PIECES)
    pieces = bare_above_foot(small.quads, indoor=structures.indoor)
    # The two faces of a free wall are apart: a ray meets the one that looks at it.
    owner = number[owner][small.owners]
    free = (owner >= int(structures.closed.sum())) & (owner < len(faces.quads))
    free &= pieces[:, 0, 5] < 0.5
    pieces[free, :, :3] += _APART * pieces[free, :, 3:6]
    light = Light(structures, pieces, roofs, progress)
    lit = small._replace(quads=_with_light(pieces, light.quads, indoor=structures.indoor))
    kinds = pieces[:, 0, 8].astype(np.int64)
    error = _LIGHT_ERROR_INDOOR if structures.indoor else _LIGHT_ERROR
    large, first = put_together(lit, _LIGHT, kinds, owner, objects[owner], error=error)
    painted = Faces(
        large.quads,
        objects[owner][first],
        _with_light(roofs, light.roofs, indoor=structures.indoor),
        np.concatenate([top.objects, np.repeat(trees[crowns.trees], len(crowns.triangles))]),
    )
    return PaintedWalls(painted, light)


def _trees(structures: Structures, *, shadows: bool) -> tuple[Single, Single]:
    """The sides (6 · t, 4, 15) of trunks, and the leaves (f, 3, 15) of crowns, in their shadows."""
    crowns = structures.crowns
    under = np.full((len(structures.trees), 1, 1, 1), LIT)
    trunks, leaves = trunk_faces(structures.trees, crowns), crowns.faces()
    if not shadows or structures.indoor:
        return _with_shadow(trunks, LIT), _with_shadow(leaves, LIT)
    # A crown hides the sun, which stands high, from all of its trunk.
    under[crowns.trees] = -LIT
    over = height_of_shadows(structures, leaves[..., :2].reshape(-1, 2).astype(np.float64))
    sides = np.repeat(under, 6, axis=0).reshape(-1, 1, 1)
    shade = over.reshape(-1, 3, 1) - leaves[..., 2:3]
    return _with_shadow(trunks, sides), _with_shadow(leaves, shade)


def _with_light(faces: Single, light: Float, *, indoor: bool) -> Single:
    """Faces with the light in the sun, and where it is hidden, at their corners."""
    rows = np.zeros((*faces.shape[:2], 19), np.float32)
    rows[..., :16] = faces
    sun = np.zeros((1, 1, 3))
    if not indoor:
        # Only leaves look another way at each corner.
        sun = np.maximum(faces[..., 3:6].astype(np.float64) @ SUN, 0.0)[..., None] * SUNSHINE
    rows[..., 12:15] = screen(light + sun)
    rows[..., 16:19] = screen(light)
    return rows


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
    return flat_faces(corners, structures.heights[walls], structures.colours[walls], CAP)
