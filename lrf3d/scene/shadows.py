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

_MOST_WALLS = 20_000
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


def shade_walls(structures: Structures, segments: Float) -> Strips:
    """Cut the faces of walls (n, 4), which look to the right, where the edge of a shadow bends."""
    count = len(segments)
    lit, length = np.full(count, LIT), lengths(segments)
    whole = Strips(np.arange(count), np.zeros(count), length, lit, lit)
    if structures.indoor or not 0 < len(structures.segments) <= _MOST_WALLS:
        return whole
    cast = _cast(structures, segments)
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


def _cast(structures: Structures, segments: Float) -> Strips:
    """What walls hide from the faces that look at the sun, as straight pieces."""
    along = directions(segments)
    faces = np.flatnonzero(along[:, 1] * _TOWARD[0] - along[:, 0] * _TOWARD[1] > _GRAZED)
    walls, tops = structures.segments, structures.heights
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    toward = swept(segments[faces], np.full(len(faces), -tops.max(initial=0.0)))
    face, wall = tree.query(shapely.polygons(toward), predicate="intersects")
    face = faces[face]
    first, along, length = segments[face, :2], along[face], lengths(segments[face])
    sun = np.broadcast_to(_TOWARD, along.shape)
    # Where the ends of a wall lie, along the face and toward the sun from it.
    ways = walls[wall, :2] - first, walls[wall, 2:] - first
    turn = cross(along, sun)
    place = np.array([cross(way, sun) / turn for way in ways])
    away = np.array([cross(along, way) / turn for way in ways])
    # Only what lies toward the sun, and the part of it before the face, hides anything.
    share = np.array([np.zeros(len(face)), np.ones(len(face))])
    for values, least, most in ((away, _TOUCH, np.inf), (place, 0.0, length)):
        change = values[1] - values[0]
        change = np.where(np.abs(change) < 1e-12, 1e-12, change)
        bounds = (least - values[0]) / change, (most - values[0]) / change
        share = np.array(
            [np.maximum(share[0], np.minimum(*bounds)), np.minimum(share[1], np.maximum(*bounds))]
        )
    ends = place[0] + (place[1] - place[0]) * share
    heights = tops[wall] - _SLOPE * (away[0] + (away[1] - away[0]) * share)
    swap = ends[1] < ends[0]
    ends[:, swap], heights[:, swap] = ends[::-1, swap], heights[::-1, swap]
    good = (share[1] > share[0]) & (ends[1] - ends[0] > 1e-6) & (heights.max(axis=0) > _LOWEST)
    chosen = np.flatnonzero(good)
    chosen = chosen[np.lexsort([-heights[:, chosen].max(axis=0), face[chosen]])]
    return Strips(face[chosen], ends[0, chosen], ends[1, chosen], *heights[:, chosen])


def _profiles(cast: Strips, lengths: Float) -> Strips:
    """The highest of the pieces over each place of their faces, and the lit strips between them."""
    faces, starts = np.unique(cast.face, return_index=True)
    found = []
    for face, *pieces in zip(faces, *(np.split(c, starts[1:]) for c in cast[1:]), strict=True):
        columns = _envelope(float(lengths[face]), *(each[:_MOST_PIECES] for each in pieces))
        found.append((np.full(len(columns[0]), face), *columns))
    return Strips(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _envelope(
    length: float, start: Float, end: Float, low: Float, high: Float
) -> tuple[Float, ...]:
    """The upper envelope of pieces (m,) over a face: start, end, and heights there, of strips."""
    slope = (high - low) / np.maximum(end - start, 1e-9)
    level = low - slope * start
    with np.errstate(divide="ignore", invalid="ignore"):
        meeting = np.subtract.outer(level, level) / -np.subtract.outer(slope, slope)
    meeting = meeting[np.isfinite(meeting)]
    knots = np.unique(np.clip(np.concatenate([[0.0, length], start, end, meeting]), 0.0, length))
    knots = knots[np.append(True, np.diff(knots) > 1e-4)]
    knots[-1] = length
    middle = 0.5 * (knots[:-1] + knots[1:])[:, None]
    height = np.where((start <= middle) & (middle <= end), level + slope * middle, LIT)
    top = np.where(height.max(axis=1) > LIT, height.argmax(axis=1), -1)
    new = np.flatnonzero(np.append(True, np.diff(top) != 0))
    top, begin, finish = top[new], knots[new], np.append(knots[new[1:]], length)
    # What lies in the sun is of no piece.
    edges = (np.where(top < 0, LIT, level[top] + slope[top] * place) for place in (begin, finish))
    return begin, finish, *edges
