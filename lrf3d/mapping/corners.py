"""Corners: segments that meet at one belong to one object, though no scan saw both at once."""

import numpy as np

from lrf3d.geometry import Float, Int, directions

SHARPEST_STRAIGHT = 0.25
"""Sine of the smallest turn that is a corner: two segments that go nearly straight on are one
wall seen through a gap, and merging decides about those."""


def corner_pairs(ends: Float, reach: float) -> Int:
    """Rows (k, 2) of the pairs of segments (m, 4) that meet at a corner.

    Their lines cross no farther than ``reach`` [m] from an end of each.
    """
    from scipy.spatial import cKDTree

    if len(ends) < 2:
        return np.empty((0, 2), np.int64)
    points = ends.reshape(-1, 2)
    # Two ends that lie within reach of one point are at most twice the reach apart.
    near = cKDTree(points).query_pairs(2.0 * reach, output_type="ndarray")
    one, other = near[:, 0] // 2, near[:, 1] // 2
    units = directions(ends)
    turn = units[one, 0] * units[other, 1] - units[one, 1] * units[other, 0]
    sharp = np.abs(turn) > SHARPEST_STRAIGHT
    near, one, other, turn = near[sharp], one[sharp], other[sharp], turn[sharp]
    step = points[near[:, 1]] - points[near[:, 0]]
    ahead = (step[:, 0] * units[other, 1] - step[:, 1] * units[other, 0]) / turn
    back = (step[:, 0] * units[one, 1] - step[:, 1] * units[one, 0]) / turn
    # `ahead` and `back` are how far the crossing lies from each of the two ends.
    meet = (np.abs(ahead) <= reach) & (np.abs(back) <= reach)
    return np.asarray(np.column_stack([one, other])[meet], dtype=np.int64)


def connect(labels: Int, pairs: Int) -> Int:
    """Labels (m,) from 0, the same for rows that share a label or are joined by pairs (k, 2)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, labels = np.unique(labels, return_inverse=True)
    count = int(labels.max(initial=-1)) + 1
    if not count:
        return labels
    links = labels[pairs]
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    _, groups = connected_components(graph, directed=False)
    _, first = np.unique(groups[labels], return_index=True)
    # Number the groups in the order in which they appear.
    order = np.empty(len(first), np.int64)
    order[np.argsort(first)] = np.arange(len(first))
    return np.asarray(order[groups[labels]])
