"""Shadows of the sun on walls and roofs, baked into their faces, so that they cost no pass.

Everything stands straight on level ground, so that what hides the sun from a wall hides it up to
some height: along the wall that is a profile of straight pieces. Faces are cut where pieces meet,
and each corner holds how far it lies under the profile; the shader has only to compare.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, cross, directions, lengths
from lrf3d.scene.look import SUN
from lrf3d.scene.panels import LIT
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import Crowns, screens

_SLOPE = float(SUN[2] / np.hypot(SUN[0], SUN[1]))
"""By how much the edge of a shadow falls with the distance [m/m]."""

_TOWARD = SUN[:2] / np.hypot(SUN[0], SUN[1])
"""Level direction to the sun, of unit length."""

_GRAZED = 0.03
"""Faces turned to the sun by less than this sine have hardly any light to lose."""

_TOUCH = 0.01
"""What is nearer than this to a wall [m] is joined to it and hides nothing from it."""

_LOWEST = 0.02
"""Shadows up to this height [m] are left out."""

_MOST_WALLS = 60_000
"""Worlds of more walls are drawn without: it would take seconds until the first frame."""

_MOST_PIECES = 24
"""Number of the highest shadows on a wall that are used; behind a fence of posts there are more."""


class Strips(NamedTuple):
    """Strips of walls, in each of which the edge of the shadow is straight."""

    face: Int
    """(p,) the face that each lies on."""
    start: Float
    end: Float
    """(p,) where it begins and ends along the face [m]."""
    low: Float
    high: Float
    """(p,) heights of the edge at its start and its end [m]."""


def shade_walls(structures: Structures, crowns: Crowns, segments: Float) -> Strips:
    """Cut the faces of walls (n, 4), which look to the right, where the edge of a shadow bends."""
    count = len(segments)
    lit, length = np.full(count, LIT), lengths(segments)
    whole = Strips(np.arange(count), np.zeros(count), length, lit, lit)
    if structures.indoor or not 0 < len(structures.segments) <= _MOST_WALLS:
        return whole
    cast = _cast(structures, crowns, segments)
    if not len(cast.face):
        return whole
    strips = _profiles(cast, length)
    bright = np.setdiff1d(whole.face, strips.face)
    return Strips(*(np.concatenate([a[bright], b]) for a, b in zip(whole, strips, strict=True)))


def shade_roofs(structures: Structures) -> tuple[Any, Int, Float]:
    """Cut the solids where higher ones cast shadows on their roofs.

    Returns:
        Polygons (m,), the solid (m,) that each is of, and how far under the shadow it lies [m].
    """
    solids, every = structures.solids, np.arange(len(structures.solids))
    lit = np.full(len(solids), LIT)
    if structures.indoor or not len(solids) or len(structures.segments) > _MOST_WALLS:
        return solids, every, lit
    wall, solid = shapely.STRtree(solids).query(
        shapely.polygons(swept(structures.segments, structures.heights)), predicate="intersects"
    )
    above = structures.heights[wall] - structures.solid_heights[solid]
    higher = (above > _LOWEST) & (structures.objects[wall] != structures.solid_objects[solid])
    order = np.argsort(solid[higher], kind="stable")
    wall, solid, above = wall[higher][order], solid[higher][order], above[higher][order]
    if not len(solid):
        return solids, every, lit
    shades = shapely.polygons(swept(structures.segments[wall], above))
    dark, starts = np.unique(solid, return_index=True)
    hidden = np.array(
        [shapely.union_all(part) for part in np.split(shades, starts[1:])], dtype=object
    )
    pieces = [np.delete(solids, dark)], [np.delete(every, dark)], [np.delete(lit, dark)]
    for shape, under in (
        (shapely.difference(solids[dark], hidden), LIT),
        (shapely.intersection(solids[dark], hidden), -LIT),
    ):
        parts, owner = shapely.get_parts(shape, return_index=True)
        # Lines where shadows only touch a roof, and slivers, do not count.
        good = shapely.area(parts) > 1e-4
        pieces[0].append(parts[good])
        pieces[1].append(dark[owner[good]])
        pieces[2].append(np.full(int(good.sum()), under))
    return tuple(np.concatenate(part) for part in pieces)  # type: ignore[return-value]


def swept(segments: Float, heights: Float) -> Float:
    """What walls (n, 4) hide from the sun on the ground so far below their tops: (n, 4, 2)."""
    slide = -_TOWARD / _SLOPE * heights[:, None]
    start, end = segments[:, :2], segments[:, 2:]
    return np.stack([start, end, end + slide, start + slide], axis=1)


def _cast(structures: Structures, crowns: Crowns, segments: Float) -> Strips:
    """What walls and trees hide from the faces that look at the sun, as straight pieces."""
    along = directions(segments)
    faces = np.flatnonzero(along[:, 1] * _TOWARD[0] - along[:, 0] * _TOWARD[1] > _GRAZED)
    hedges, tops = screens(crowns)
    walls = np.concatenate([structures.segments, hedges])
    tops = np.concatenate([np.column_stack([structures.heights] * 2), tops])
    reach = tops.max(initial=0.0) / _SLOPE
    sides = segments[faces]
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    toward = shapely.polygons(swept(sides, np.full(len(sides), -reach * _SLOPE)))
    face, wall = tree.query(toward, predicate="intersects")
    face = faces[face]
    first, along, length = segments[face, :2], along[face], lengths(segments[face])
    turn = cross(along, np.broadcast_to(_TOWARD, along.shape))
    place, away = np.empty((2, len(face))), np.empty((2, len(face)))
    for end in range(2):
        way = walls[wall, 2 * end : 2 * end + 2] - first
        place[end] = cross(way, np.broadcast_to(_TOWARD, way.shape)) / turn
        away[end] = cross(along, way) / turn
    # Only what lies toward the sun, and the part of it before the face, hides anything.
    share = np.zeros((2, len(face)))
    share[1] = 1.0
    for values, least, most in ((away, _TOUCH, np.inf), (place, 0.0, length)):
        change = values[1] - values[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            bounds = (np.array([least + 0.0 * length, most + 0.0 * length]) - values[0]) / change
        level = np.abs(change) < 1e-12
        inside = (values[0] >= least) & (values[0] <= most)
        low = np.where(level, np.where(inside, 0.0, 2.0), np.minimum(*bounds))
        high = np.where(level, np.where(inside, 1.0, -1.0), np.maximum(*bounds))
        share[0], share[1] = np.maximum(share[0], low), np.minimum(share[1], high)
    ends = place[0] + (place[1] - place[0]) * share
    low, high = tops[wall].T
    heights = low + (high - low) * share - _SLOPE * (away[0] + (away[1] - away[0]) * share)
    swap = ends[1] < ends[0]
    ends[:, swap], heights[:, swap] = ends[::-1, swap], heights[::-1, swap]
    good = (share[1] > share[0]) & (ends[1] - ends[0] > 1e-6) & (heights.max(axis=0) > _LOWEST)
    chosen = np.flatnonzero(good)
    chosen = chosen[np.lexsort([-heights[:, chosen].max(axis=0), face[chosen]])]
    cast = Strips(face[chosen], ends[0, chosen], ends[1, chosen], *heights[:, chosen])
    _, starts, sizes = np.unique(cast.face, return_index=True, return_counts=True)
    rank = np.arange(len(chosen)) - np.repeat(starts, sizes)
    kept = rank < _MOST_PIECES
    return Strips(cast.face[kept], *(column[kept] for column in cast[1:]))


def _profiles(cast: Strips, lengths: Float) -> Strips:
    """The highest of the pieces over each place of their faces, and the lit strips between them."""
    faces, starts, sizes = np.unique(cast.face, return_index=True, return_counts=True)
    found = []
    before = 0
    # Faces with about as many pieces are worked out together.
    for most in (1, 2, 4, 8, 16, _MOST_PIECES):
        group = np.flatnonzero((sizes > before) & (sizes <= most))
        before = most
        if len(group):
            columns = np.arange(most)
            there = columns < sizes[group, None]
            index = np.where(there, starts[group, None] + columns, 0)
            pieces = [np.where(there, column[index], LIT) for column in cast[1:]]
            found.append(_envelopes(faces[group], lengths[faces[group]], *pieces))
    return Strips(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _envelopes(
    faces: Int, lengths: Float, start: Float, end: Float, low: Float, high: Float
) -> Strips:
    """The upper envelopes of pieces (f, m), one for each face (f,)."""
    slope = (high - low) / np.maximum(end - start, 1e-9)
    level = low - slope * start
    first, second = np.triu_indices(start.shape[1], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        meeting = (level[:, second] - level[:, first]) / (slope[:, first] - slope[:, second])
    whole = np.column_stack([np.zeros(len(faces)), lengths])
    knots = np.concatenate([whole, start, end, np.nan_to_num(meeting, nan=0.0)], axis=1)
    knots = np.sort(np.clip(knots, 0.0, lengths[:, None]), axis=1)
    left, right = knots[:, :-1], knots[:, 1:]
    middle = 0.5 * (left + right)[:, :, None]
    over = (start[:, None] <= middle) & (middle <= end[:, None])
    height = np.where(over, level[:, None] + slope[:, None] * middle, LIT)
    top = height.argmax(axis=2)
    # What lies in the sun is of no piece.
    top[~over.any(axis=2)] = -1
    row, column = np.nonzero(right - left > 1e-4)
    piece = top[row, column]
    new = np.flatnonzero(np.append(True, (row[1:] != row[:-1]) | (piece[1:] != piece[:-1])))
    last = np.append(new[1:], len(row)) - 1
    row, piece = row[new], piece[new]
    begin = left[row, column[new]]
    finish = right[row, column[last]]
    # Strips of a face join without a gap, and reach from its start to its end.
    outer = np.append(True, row[1:] != row[:-1])
    begin[outer] = 0.0
    finish[:-1] = np.where(outer[1:], lengths[row[:-1]], begin[1:])
    finish[-1] = lengths[row[-1]]
    edges = [
        np.where(piece < 0, LIT, level[row, piece] + slope[row, piece] * place)
        for place in (begin, finish)
    ]
    return Strips(faces[row], begin, finish, *edges)
