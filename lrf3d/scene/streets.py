"""Streets: where their middle lines run between houses, and the marks on them."""

from typing import Any

import numpy as np
import shapely
from scipy.spatial import QhullError, Voronoi

from lrf3d.geometry import Float, directions, lengths
from lrf3d.scene.structures import Structures

_STEP = 2.0
"""Distance [m] between the samples along walls: a street's middle is found this finely."""

_NARROWEST, _WIDEST = 3.5, 14.0
"""Half the width [m] of what is taken for a street: not an alley, not a square."""

_SHORTEST = 8.0
"""A middle line below this length [m] is no street."""

_MOST_SAMPLES = 60_000
"""Beyond this many samples the lines are left out: they would cost seconds."""

_DASH, _GAP = 2.2, 3.8
"""Lengths [m] of a mark and of the gap to the next."""


def centre_lines(structures: Structures, kerb: Any) -> Any:
    """Middle lines of streets, as an array of shapely lines.

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
    if kerb is not None:
        smooth = shapely.get_parts(shapely.difference(smooth, kerb))
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
