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
    length = lengths(segments)
    lit = np.full(len(segments), LIT)
    whole = Strips(np.arange(len(segments)), np.zeros(len(segments)), length, lit, lit)
    if not _sunny(structures):
        return whole
    cast = _cast(structures, segments)
    if not len(cast.face):
        return whole
    faces, starts = np.unique(cast.face, return_index=True)
    bright = np.setdiff1d(whole.face, faces)
    found = [tuple(column[bright] for column in whole)]
    for face, *pieces in zip(faces, *(np.split(c, starts[1:]) for c in cast[1:]), strict=True):
        found.append(_envelope(face, length[face], *(each[:_MOST_PIECES] for each in pieces)))
    return Strips(*(np.concatenate(column) for column in zip(*found, strict=True)))


def shade_roofs(structures: Structures) -> tuple[Any, Int, Float]:
    """Cut the solids where higher ones cast shadows on their roofs.

    Returns:
        Polygons (m,), the solid (m,) that each is of, and how far under the shadow it lies [m].
    """
    solids = structures.solids
    hidden = np.full(len(solids), shapely.Polygon(), dtype=object)
    if _sunny(structures):
        wall, solid = shapely.STRtree(solids).query(
            shapely.polygons(swept(structures.segments, structures.heights)), predicate="intersects"
        )
        above = structures.heights[wall] - structures.solid_heights[solid]
        higher = (above > _LOWEST) & (structures.objects[wall] != structures.solid_objects[solid])
        chosen = np.flatnonzero(higher)[np.argsort(solid[higher], kind="stable")]
        shades = shapely.polygons(swept(structures.segments[wall[chosen]], above[chosen]))
        shapely.geometrycollections(shades, indices=solid[chosen], out=hidden)
        hidden = shapely.union_all(hidden[:, None], axis=1)
    pieces = [shapely.difference(solids, hidden), shapely.intersection(solids, hidden)]
    parts, owner = shapely.get_parts(np.concatenate(pieces), return_index=True)
    # Lines where shadows only touch a roof, and slivers, do not count.
    good = shapely.area(parts) > 1e-4
    parts, owner = parts[good], owner[good]
    dark = owner >= len(solids)
    return parts, owner - len(solids) * dark, np.where(dark, -LIT, LIT)


def swept(segments: Float, heights: Float) -> Float:
    """What walls (n, 4) hide from the sun on the ground so far below their tops: (n, 4, 2)."""
    slide = -_TOWARD / _SLOPE * heights[:, None]
    start, end = segments[:, :2], segments[:, 2:]
    return np.stack([start, end, end + slide, start + slide], axis=1)


def _sunny(structures: Structures) -> bool:
    """Whether the sun casts shadows that are drawn."""
    return not structures.indoor and 0 < len(structures.segments) <= _MOST_WALLS


def _cast(structures: Structures, segments: Float) -> Strips:
    """What walls hide from the faces that look at the sun, as straight pieces, highest first."""
    along, length, tops = directions(segments), lengths(segments), structures.heights
    faces = np.flatnonzero(cross(_TOWARD, along) > _GRAZED)
    toward = swept(segments[faces], np.full(len(faces), -tops.max(initial=0.0)))
    number, wall = structures.tree.query(shapely.polygons(toward), predicate="intersects")
    face = faces[number]
    # Where the ends of a wall lie: as a share of the face along it, and toward the sun from it [m].
    ends = structures.segments[wall].reshape(-1, 2, 2) - segments[face, None, :2]
    along, turn = along[face, None], cross(along[face, None], _TOWARD)
    place, away = cross(ends, _TOWARD) / turn / length[face, None], cross(along, ends) / turn
    # Only what lies toward the sun, and the part of it before the face, hides anything.
    pieces = shapely.linestrings(np.stack([place, away], axis=2))
    pieces = shapely.clip_by_rect(pieces, 0.0, _TOUCH, 1.0, np.abs(away).max(initial=1.0))
    there = shapely.length(pieces) > 0.0
    face, tops = face[there], tops[wall[there]]
    places, away = np.moveaxis(shapely.get_coordinates(pieces[there]).reshape(-1, 2, 2), 2, 0)
    places, heights = places * length[face, None], tops[:, None] - _SLOPE * away
    order = np.argsort(places, axis=1)
    start, end = np.take_along_axis(places, order, axis=1).T
    low, high = np.take_along_axis(heights, order, axis=1).T
    highest = heights.max(axis=1)
    chosen = np.flatnonzero((end - start > 1e-6) & (highest > _LOWEST))
    chosen = chosen[np.lexsort([-highest[chosen], face[chosen]])]
    return Strips(face[chosen], *(each[chosen] for each in (start, end, low, high)))


def _envelope(
    face: int, length: float, start: Float, end: Float, low: Float, high: Float
) -> Strips:
    """The upper envelope of pieces (m,) over a face, and the lit strips between them."""
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
    return Strips(np.full(len(top), face), begin, finish, *edges)
