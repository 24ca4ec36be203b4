"""Clusters of walls: what hangs together by shared ends, and how narrow it is."""

import numpy as np

from lrf3d.casting.kernels.clusters import cluster_of, least_width
from lrf3d.geometry import Float


def narrowest_cluster(segments: Float) -> float:
    """The width [m] of the narrowest cluster of segments (n, 4), or a little less.

    It is 0 where some walls lie in one line, and infinite where there are no walls.
    """
    ends = segments.reshape(-1, 2)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ordered = ends[order]
    first = np.ones(len(ends), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    point = np.empty(len(ends), dtype=np.int64)
    point[order] = np.cumsum(first) - 1
    points = ordered[first]
    cluster = cluster_of(point.reshape(-1, 2), len(points))
    together = np.argsort(cluster, kind="stable")
    starts = np.flatnonzero(np.diff(cluster[together], prepend=-1))
    return float(least_width(points[together], starts))
