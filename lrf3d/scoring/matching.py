"""Matching: which segment of a map stands for which true wall, one to one."""

import numpy as np

from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.scoring.nearness import close_pairs, in_local_frame

LEAST_OVERLAP = 0.5
"""Overlap over union along the true line that a match must exceed."""

END_TOLERANCE = 0.15
"""Farthest that an end point of a match may lie from the true line [m]."""


def match_segments(segments: Float, walls: Float) -> Int:
    """Pair map segments (m, 4) with true segments (v, 4), each with at most one of the other.

    Two may be paired when their overlap over union along the true line is above 0.5 and both
    ends of the map segment lie within 0.15 m of that line. Of all ways to pair, the one with
    the most pairs is taken, and among those the one whose segments overlap best and lie nearest:
    an optimal assignment, so the result does not depend on the order of the segments.

    Returns:
        (k, 2) rows: index of the map segment, index of the true segment; rising in the latter.
    """
    segments, walls = in_local_frame(segments, walls)
    own, wall = close_pairs(segments, walls, END_TOLERANCE)
    along = directions(walls[wall])
    ends = segments[own].reshape(-1, 2, 2) - walls[wall, None, :2]
    forward = np.einsum("kij,kj->ki", ends, along)
    offset = np.abs(ends[:, :, 1] * along[:, None, 0] - ends[:, :, 0] * along[:, None, 1])
    low, high, length = forward.min(axis=1), forward.max(axis=1), lengths(walls[wall])
    shared = np.minimum(high, length) - np.maximum(low, 0.0)
    overlap = shared / (np.maximum(high, length) - np.minimum(low, 0.0))
    fit = (overlap > LEAST_OVERLAP) & (offset.max(axis=1) <= END_TOLERANCE)
    cost = (1.0 - overlap) + offset.mean(axis=1) / END_TOLERANCE
    return _assign(own[fit], wall[fit], cost[fit])


def _assign(own: Int, wall: Int, cost: Float) -> Int:
    """The most pairs at the least cost, one to one, sorted by wall."""
    # Nearly all pairs have no rival; they need no solver.
    sole = (_occurrences(own) == 1) & (_occurrences(wall) == 1)
    disputed = _assign_rivals(own[~sole], wall[~sole], cost[~sole])
    pairs = np.vstack([np.column_stack([own[sole], wall[sole]]), disputed])
    return pairs[np.argsort(pairs[:, 1])]


def _occurrences(names: Int) -> Int:
    """How often the name (n,) at each place occurs."""
    _, place, counts = np.unique(names, return_inverse=True, return_counts=True)
    return counts[place]


def _assign_rivals(own: Int, wall: Int, cost: Float) -> Int:
    """The same by a sparse assignment, with an exit for every wall that stays alone."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    if not len(own):
        return np.empty((0, 2), np.int64)
    names, column = np.unique(own, return_inverse=True)
    wall_names, row = np.unique(wall, return_inverse=True)
    walls = np.arange(len(wall_names))
    # To leave a wall alone costs more than all pairs together, so pairs are never given up.
    alone = np.full(len(walls), 3.0 * (len(walls) + 1))
    weights = coo_array(
        (
            # One is added to all, since the solver takes a cost of zero for no edge.
            np.concatenate([cost, alone]) + 1.0,
            (np.concatenate([row, walls]), np.concatenate([column, len(names) + walls])),
        ),
        shape=(len(walls), len(names) + len(walls)),
    )
    rows, columns = min_weight_full_bipartite_matching(weights.tocsr())
    paired = columns < len(names)
    return np.column_stack([names[columns[paired]], wall_names[rows[paired]]]).astype(np.int64)
