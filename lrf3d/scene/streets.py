"""Streets: where their middle lines run between houses, and the marks on them."""

from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import QhullError, Voronoi

from lrf3d.geometry import Float, directions, lengths
from lrf3d.scene.structures import Structures
from lrf3d.scene.town import KERB

_STEP = 2.0
"""Distance [m] between the samples along walls: a street's middle is found this finely."""

_NARROWEST, _WIDEST = 3.5, 14.0
"""Half the width [m] of what is taken for a street: not an alley, not a square."""

_SHORTEST = 8.0
"""A middle line below this length [m] is no street."""

_MOST_SAMPLES = 60_000
"""Beyond this many samples the lines are left out: they would cost seconds."""

_KERB_STEP, _KERB_LONGEST = 0.04, 8.0
"""How far a kerb in pieces may be off its line, and the length of a piece at the most [m]."""

_DASH, _GAP = 2.2, 3.8
"""Lengths [m] of a mark and of the gap to the next."""


class Strips(NamedTuple):
    """What lies on streets and is so narrow that a picture blurs it.

    Args:
        marks: (n, 4, 2) corners of pieces of lane marks, counter-clockwise [m].
        kerbs: (m, 4, 2) corners of pieces of kerbs.
    """

    marks: Float
    kerbs: Float

    @classmethod
    def none(cls) -> "Strips":
        """No strips."""
        return cls(np.zeros((0, 4, 2)), np.zeros((0, 4, 2)))


def centre_lines(structures: Structures, streets: Any) -> Any:
    """Middle lines of streets, which are a shapely geometry, as an array of shapely lines.

    They are the edges of the Voronoi diagram of the walls between two façades that run along each
    other, where both are a street's width apart.
    """
    walls = structures.segments[structures.closed]
    points, along = _samples(walls)
    if not 4 <= len(points) <= _MOST_SAMPLES:
        return np.empty(0, dtype=object)
    try:
        diagram = Voronoi(points)
    except QhullError:
        return np.empty(0, dtype=object)
    vertices = np.array(diagram.ridge_vertices)
    first, second = diagram.ridge_points.T
    gap = points[second] - points[first]
    half = 0.5 * np.hypot(gap[:, 0], gap[:, 1])
    street = (vertices.min(axis=1) >= 0) & (half > _NARROWEST) & (half < _WIDEST)
    parallel = np.abs(np.einsum("ij,ij->i", along[first], along[second])) > 0.94
    across = np.abs(np.einsum("ij,ij->i", along[first], gap)) < 0.5 * half
    chosen = vertices[street & parallel & across]
    if not len(chosen):
        return np.empty(0, dtype=object)
    edges = shapely.linestrings(np.round(diagram.vertices[chosen], 3))
    merged = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(edges)))
    # The samples make the line tremble by some decimetres; a street's line does not.
    smooth = shapely.simplify(merged, 0.8)
    smooth = shapely.get_parts(shapely.intersection(smooth, streets))
    return smooth[shapely.length(smooth) > _SHORTEST]


def dashes(lines: Any) -> Float:
    """Marks (n, 4) along lines."""
    marks = [np.empty((0, 4))]
    for line in lines:
        starts = np.arange(_GAP / 2, shapely.length(line) - _DASH, _DASH + _GAP)
        first = shapely.get_coordinates(shapely.line_interpolate_point(line, starts))
        second = shapely.get_coordinates(shapely.line_interpolate_point(line, starts + _DASH))
        marks.append(np.column_stack([first, second]))
    return np.concatenate(marks)


def mark_pieces(marks: Float, width: float) -> Float:
    """Marks (n, 4) of a width [m] as rectangles (4 · n, 4, 2), each cut across into four."""
    start, end = marks[:, None, :2], marks[:, None, 2:]
    side = 0.5 * width * directions(marks)[:, None, ::-1] * [-1.0, 1.0]
    share = np.arange(5)[:, None] / 4
    line = start + share * (end - start)
    right, left = line - side, line + side
    pieces = np.stack([right[:, :-1], right[:, 1:], left[:, 1:], left[:, :-1]], axis=2)
    return np.asarray(pieces.reshape(-1, 4, 2))


def kerb_pieces(streets: Any) -> Float:
    """The kerbs round streets, which are a shapely geometry, in pieces (n, 4, 2)."""
    middle = shapely.simplify(shapely.buffer(streets, 0.5 * KERB, quad_segs=4), _KERB_STEP)
    pieces = [np.zeros((0, 4, 2))]
    for ring in shapely.get_rings(shapely.get_parts(middle)):
        line = shapely.get_coordinates(shapely.segmentize(ring, _KERB_LONGEST))[:-1]
        # Each corner is set square to the way between its neighbours, so that pieces join.
        way = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        side = 0.5 * KERB * way[:, ::-1] * [-1.0, 1.0]
        right, left = line - side, line + side
        pieces.append(np.stack([right, np.roll(right, -1, 0), np.roll(left, -1, 0), left], axis=1))
    found = np.concatenate(pieces)
    # Rings run round holes the other way: all pieces look up.
    first, second = found[:, 1] - found[:, 0], found[:, 3] - found[:, 0]
    down = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    found[down] = found[down, ::-1]
    return found


def _samples(walls: Float) -> tuple[Float, Float]:
    """Points (m, 2) along walls (n, 4) and the direction (m, 2) of the wall of each."""
    if not len(walls):
        return np.empty((0, 2)), np.empty((0, 2))
    counts = np.maximum(1, np.ceil(lengths(walls) / _STEP)).astype(int)
    wall = np.repeat(np.arange(len(walls)), counts)
    place = np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[wall])[:, None]
    points = walls[wall, :2] * (1.0 - share) + walls[wall, 2:] * share
    return points, directions(walls)[wall]
