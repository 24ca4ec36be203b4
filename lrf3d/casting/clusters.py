"""What walls have to do with each other by their ends: where they meet, what hangs together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.clusters import cluster_of, least_width
from lrf3d.geometry import Float, Int

SQUARE = 0.71
"""Sine of the angle from which on a corner is square enough: a little more than of 45°."""


class Ends(NamedTuple):
    """The ends of walls.

    Attributes:
        point: (2 n,) which point each end is, those of a wall side by side.
        points: (m, 2) the points [m], each once, in ascending order of x and y.
    """

    point: Int
    points: Float


def ends_of(segments: Float) -> Ends:
    """The ends of segments (n, 4)."""
    ends = segments.reshape(-1, 2)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ordered = ends[order]
    first = np.ones(len(ends), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    point = np.empty(len(ends), dtype=np.int64)
    point[order] = np.cumsum(first) - 1
    return Ends(point, ordered[first])


def narrowest_cluster(ends: Ends) -> float:
    """The width [m] of the narrowest cluster of walls with these ends, or a little less.

    A cluster is what hangs together by shared ends. Its width is 0 where all lies in one line;
    without walls it is infinite.
    """
    point, points = ends
    cluster = cluster_of(point.reshape(-1, 2), len(points))
    together = np.argsort(cluster, kind="stable")
    starts = np.flatnonzero(np.diff(cluster[together], prepend=-1))
    return float(least_width(points[together], starts))


def square_corners(segments: Float, ends: Ends) -> NDArray[np.bool_]:
    """Which ends (n, 2) of segments (n, 4) are those of just one other too, about square to it."""
    point = ends.point
    order = np.argsort(point, kind="stable")
    count = np.bincount(point)
    first = order[(np.cumsum(count) - count)[count == 2]]
    second = order[(np.cumsum(count) - 1)[count == 2]]
    along = segments[:, 2:] - segments[:, :2]
    one, other = along[first // 2], along[second // 2]
    cross = abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    lengths = np.hypot(one[:, 0], one[:, 1]) * np.hypot(other[:, 0], other[:, 1])
    square = cross > SQUARE * lengths
    found = np.zeros(2 * len(segments), dtype=bool)
    found[first], found[second] = square, square
    return found.reshape(-1, 2)
