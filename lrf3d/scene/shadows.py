"""Shadows of the sun on walls and roofs, baked into their faces, so that they cost no pass.

Everything stands straight on level ground, so that what hides the sun from a wall hides it up to
some height: along the wall that is a profile of straight pieces. Faces are cut where pieces meet,
and each corner holds how far it lies under the profile; the shader has only to compare.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, Single, cross
from lrf3d.scene.look import SUN
from lrf3d.scene.structures import Structures

LIT = -1e3
"""How far under the shadow's edge a corner lies that is in the sun [m]: not at all."""

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

_POSITION, _ALONG = slice(0, 3), 6
"""Where in a row of a face its position is, and its place along the face."""


class Cast(NamedTuple):
    """What walls hide of the sun from others, as straight pieces of a profile.

    Args:
        face: (p,) the face that each lies on, rising.
        start: (p,) where it begins along the face [m].
        end: (p,) where it ends [m].
        low: (p,) its height at the start [m].
        high: (p,) its height at the end [m].
    """

    face: Int
    start: Float
    end: Float
    low: Float
    high: Float


def shade_quads(structures: Structures, quads: Single) -> tuple[Single, Int]:
    """Cut walls where the edge of their shadow bends.

    Args:
        structures: What stands in the sun.
        quads: (n, 4, 14) faces; upright ones may be in shadow.

    Returns:
        Faces (m, 4, 15), each corner with how far under the shadow's edge it lies [m], and the
        face (m,) that each was.
    """
    plain = np.concatenate([quads, np.full((*quads.shape[:2], 1), LIT, np.float32)], axis=2)
    everything = np.arange(len(quads))
    if structures.indoor or not 0 < len(structures.segments) <= _MOST_WALLS:
        return plain, everything
    cast = _cast(structures, quads)
    if not len(cast.face):
        return plain, everything
    strips = _profiles(cast, quads[:, 1, _ALONG].astype(np.float64))
    cut = plain[strips.face]
    length = np.maximum(quads[strips.face, 1, _ALONG].astype(np.float64), 1e-9)
    for corner, (place, height) in enumerate(
        [(strips.start, strips.low), (strips.end, strips.high)] * 2
    ):
        # The corners run round the face: start and end below, end and start above.
        corner, up = (corner, 0) if corner < 2 else (5 - corner, 1)
        low, high = (quads[strips.face, k] for k in ((0, 1), (3, 2))[up])
        share = (place / length)[:, None]
        cut[:, corner, :14] = low + (high - low) * share
        cut[:, corner, 14] = height - cut[:, corner, 2]
    whole = np.setdiff1d(everything, strips.face)
    return np.concatenate([plain[whole], cut]), np.concatenate([whole, strips.face])


def height_of_shadows(structures: Structures, places: Float) -> Float:
    """Height (n,) [m] up to which walls hide the sun over places (n, 2); :data:`LIT` for none."""
    heights = np.full(len(places), LIT)
    walls = structures.segments
    if structures.indoor or not 0 < len(walls) <= _MOST_WALLS or not len(places):
        return heights
    reach = structures.heights.max() / _SLOPE
    ways = shapely.linestrings(np.stack([places, places + reach * _TOWARD], axis=1))
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    place, wall = tree.query(ways, predicate="intersects")
    start, end = walls[wall, :2], walls[wall, 2:]
    turn = cross(end - start, np.broadcast_to(_TOWARD, start.shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        away = -cross(end - start, places[place] - start) / turn
    high = structures.heights[wall] - _SLOPE * np.nan_to_num(np.abs(away), nan=0.0, posinf=0.0)
    np.maximum.at(heights, place, high)
    return heights


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
        shapely.polygons(_swept(structures.segments, structures.heights)), predicate="intersects"
    )
    above = structures.heights[wall] - structures.solid_heights[solid]
    higher = (above > _LOWEST) & (structures.objects[wall] != structures.solid_objects[solid])
    order = np.argsort(solid[higher], kind="stable")
    wall, solid, above = wall[higher][order], solid[higher][order], above[higher][order]
    if not len(solid):
        return solids, every, lit
    shades = shapely.polygons(_swept(structures.segments[wall], above))
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


def _swept(segments: Float, heights: Float) -> Float:
    """What walls (n, 4) hide from the sun on the ground so far below their tops: (n, 4, 2)."""
    slide = -_TOWARD / _SLOPE * heights[:, None]
    start, end = segments[:, :2], segments[:, 2:]
    return np.stack([start, end, end + slide, start + slide], axis=1)


def _cast(structures: Structures, quads: Single) -> Cast:
    """What all walls and trees hide from the faces that look at the sun."""
    base = quads[:, :2, :2].astype(np.float64)
    # Upright faces whose normal looks to the sun; float32 leaves some walls no length.
    bright = quads[:, 0, 3:5].astype(np.float64) @ _TOWARD
    wide = (base[:, 0] != base[:, 1]).any(axis=1)
    faces = np.flatnonzero((bright > _GRAZED) & (quads[:, 0, 5] < 0.5) & wide)
    screens, tops = structures.crowns.screens()
    walls = np.concatenate([structures.segments, screens])
    tops = np.concatenate([np.column_stack([structures.heights] * 2), tops])
    reach = tops.max(initial=0.0) / _SLOPE
    sides = np.concatenate([base[faces, 0], base[faces, 1]], axis=1)
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    toward = shapely.polygons(_swept(sides, np.full(len(sides), -reach * _SLOPE)))
    face, wall = tree.query(toward, predicate="intersects")
    face = faces[face]
    first, second = base[face, 0], base[face, 1]
    length = np.hypot(*(second - first).T)
    along = (second - first) / np.maximum(length, 1e-9)[:, None]
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
    cast = Cast(face[chosen], ends[0, chosen], ends[1, chosen], *heights[:, chosen])
    _, starts, sizes = np.unique(cast.face, return_index=True, return_counts=True)
    rank = np.arange(len(chosen)) - np.repeat(starts, sizes)
    kept = rank < _MOST_PIECES
    return Cast(cast.face[kept], *(column[kept] for column in cast[1:]))


def _profiles(cast: Cast, lengths: Float) -> Cast:
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
    return Cast(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _envelopes(
    faces: Int, lengths: Float, start: Float, end: Float, low: Float, high: Float
) -> Cast:
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
    return Cast(faces[row], begin, finish, *edges)
