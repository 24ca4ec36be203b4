"""Matching: pairs of close segments, and of map segments with the walls that they represent.

A spatial index finds the neighbours, so that large maps need no table of all pairs.
"""

from __future__ import annotations

import numpy as np

from lrf3d.geometry.lines import Float, Int, as_rows, cross, directions, lengths

# Length [m] above which the visible part of a wall counts.
LEAST_VISIBLE = 0.5

# Largest distance [m] of a right sample, or of an explained return, from a wall.
REACH = 0.1


def match_segments(segments: Float, walls: Float) -> Int:
    """Pair map segments (m, 4) with true segments (v, 4), each with at most one of the other.

    Two may be paired when their intersection over union along the true line is above 0.5 and both
    ends of the map segment lie within 0.15 m of that line. Of all assignments, the one
    with the most pairs is taken, and among those the one whose segments overlap best and lie
    nearest: an optimal assignment, so the result does not depend on the order of the segments.

    Returns:
        (k, 2) rows: index of the map segment, index of the true segment; rising in the latter.
    """
    import shapely

    segments = as_rows(segments, "segments", 4)
    walls = as_rows(walls, "walls", 4)
    # Segments without length have no direction to compare.
    mine, theirs = (np.flatnonzero(lengths(each) > 0.0) for each in (segments, walls))
    tree = shapely.STRtree(shapely.linestrings(walls[theirs].reshape(-1, 2, 2)))
    lines = shapely.linestrings(segments[mine].reshape(-1, 2, 2))
    end_tolerance = 0.15  # Largest distance of the end points of a match from the true line [m].
    near = tree.query(lines, predicate="dwithin", distance=end_tolerance)
    own = mine[near[0]]
    wall = theirs[near[1]]
    along = directions(walls[wall])[:, None]
    ends = segments[own].reshape(-1, 2, 2) - walls[wall, None, :2]
    forward = (ends * along).sum(axis=2)
    offset = np.abs(cross(along, ends))
    low = forward.min(axis=1)
    high = forward.max(axis=1)
    length = lengths(walls[wall])
    shared = np.minimum(high, length) - np.maximum(low, 0.0)
    overlap = shared / (np.maximum(high, length) - np.minimum(low, 0.0))
    least_overlap = 0.5  # Intersection over union along the true line that a match must exceed.
    fit = (overlap > least_overlap) & (offset.max(axis=1) <= end_tolerance)
    cost = (1.0 - overlap) + offset.mean(axis=1) / end_tolerance
    return _assign(own[fit], wall[fit], cost[fit])


def _assign(own: Int, wall: Int, cost: Float) -> Int:
    """The most pairs at the least cost, one to one, sorted by wall."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    owns, column = np.unique(own, return_inverse=True)
    walls, row = np.unique(wall, return_inverse=True)
    each = np.arange(len(walls))
    # A column more for each wall that stays unpaired, which costs more than all pairs together;
    # one is added to all costs, since the solver takes zero for no edge.
    costs = np.append(cost, np.full(len(walls), 3 * (len(walls) + 1))) + 1.0
    places = np.append(row, each), np.append(column, len(owns) + each)
    table = coo_array((costs, places), shape=(len(walls), len(owns) + len(walls))).tocsr()
    rows, columns = min_weight_full_bipartite_matching(table)
    paired = columns < len(owns)
    return np.column_stack([owns[columns[paired]], walls[rows[paired]]])


def sample_counts(segments: Float) -> Int:
    """The number of samples (n,) along each of the segments (n, 4): in the middle of equal pieces.

    These are no longer than the spacing, give or take what rounding adds to a length.
    """
    # Distance of samples along a segment [m].
    sample_spacing = LEAST_VISIBLE / 10
    # Share of a piece that rounding may add to a length, even 10⁶ m from the origin.
    length_rounding = 1e-6
    return np.ceil(lengths(segments) / sample_spacing - length_rounding).astype(np.int64)


def sample_offsets(segments: Float, walls: Float, *, reach: float, angle: float) -> Float:
    """Distances (s,) [m] of samples along segments to the nearest wall alongside.

    The samples (s,) are those of the segments (n, 4), one after the other; a wall (m, 4) lies
    alongside within a reach [m] of the sample and an angle [rad] of its segment. The distance is
    that to the line of the wall; +inf if there is none.
    """
    import shapely

    counts = sample_counts(segments)
    walls = walls[lengths(walls) > 0.0]
    ahead = directions(walls)
    own, wall = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2))).query(
        shapely.linestrings(segments.reshape(-1, 2, 2)), predicate="dwithin", distance=reach
    )
    wall = wall[counts[own] > 0]
    own = own[counts[own] > 0]
    alike = np.abs(cross(directions(segments[own]), ahead[wall])) <= np.sin(angle)
    own = own[alike]
    wall = wall[alike]
    # Of each pair, only samples next to the wall or within reach of its ends can be near.
    piece = lengths(segments) / np.maximum(counts, 1)
    ends = walls[wall].reshape(-1, 2, 2) - segments[own, None, :2]
    station = (ends * directions(segments[own])[:, None]).sum(axis=2)
    first = np.floor((station.min(axis=1) - reach) / piece[own]).clip(0, counts[own])
    last = np.ceil((station.max(axis=1) + reach) / piece[own]).clip(0, counts[own])
    sizes = (last - first).astype(np.int64)
    pair = np.repeat(np.arange(len(own)), sizes)
    share = np.arange(len(pair)) - (np.cumsum(sizes) - sizes - first)[pair]
    sample = ((np.cumsum(counts) - counts)[own][pair] + share).astype(np.int64)
    own = own[pair]
    wall = wall[pair]
    share = (share + 0.5) / counts[own]
    place = segments[own, :2] + share[:, None] * (segments[own, 2:] - segments[own, :2])
    off = place - walls[wall, :2]
    forward = (off * ahead[wall]).sum(axis=1)
    aside = np.abs(cross(ahead[wall], off))
    away = np.hypot(aside, forward - forward.clip(0.0, lengths(walls)[wall]))
    # The nearest is written last.
    order = np.argsort(-away, kind="stable")
    order = order[away[order] <= reach]
    offsets = np.full(counts.sum(), np.inf)
    offsets[sample[order]] = aside[order]
    return offsets
