"""Samples of walls: points along them, and the part of a world that a route is planned in.

The input is segments of any length, at any distance from each other; the output is points, each
with the length of wall that it represents. The cost depends on the walls nearby, not on how far
walls extend.
"""

import numpy as np

from lrf3d.geometry import Float, Int, lengths

SURROUNDINGS = 6.0
"""Width [m] of the land around the walls where a robot may drive."""

WIDEST_WINDOW = 500.0
"""Largest side [m] of the part of a world that is planned in: as much as a drive can show."""

FARTHEST_APART = 100_000.0
"""Side [m] of a world from which on it is first narrowed to the part with the most corners: walls
as long as a country do not show where the town is, and are too long to be sampled."""

WINDOW_BINS = 256
"""Number of bins along each axis in which the corners of such a world are counted."""

SPACING = 0.2
"""Distance [m] between the points of the walls that distances are measured to."""

SAMPLES, MANY_SAMPLES = 4_000_000, 1_000_000
"""Largest number of samples of all walls, and the number above which samples in one small cell are
merged: those of 800 km and of 200 km of walls."""


def planning_window(segments: Float, around: Float | None = None) -> tuple[Float, Float]:
    """Corners (2,) and (2,) of the box to plan in.

    It lies around all walls, or where the most walls stand if that is too wide.

    Args:
        segments: (n, 4) the walls [m].
        around: A position (2,) [m] that the box must contain.
    """
    from scipy.ndimage import uniform_filter

    near = _detailed(segments)
    spacing = spacing_for(near)
    points, weights = sample_walls(near, spacing)
    low, high = points.min(axis=0) - SURROUNDINGS, points.max(axis=0) + SURROUNDINGS
    if around is not None:
        low, high = np.minimum(low, around - SURROUNDINGS), np.maximum(high, around + SURROUNDINGS)
    if (high - low).max() <= WIDEST_WINDOW:
        return low, high
    if around is None:
        # A wall counts for at most the width of the window: one long wall is not a town. The
        # filter adds up 9 by 9 tiles, a window less the tiles that its border cuts.
        long = np.maximum(lengths(near) / WIDEST_WINDOW, 1.0)
        weights /= np.repeat(long, np.ceil(lengths(near) / spacing).astype(int))
        tile = WIDEST_WINDOW / 10.0
        counts = np.minimum(np.ceil((high - low) / tile).astype(int), 4000)
        edges = [np.linspace(low[axis], high[axis], counts[axis] + 1) for axis in (0, 1)]
        amount, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=edges, weights=weights)
        amount = uniform_filter(amount, size=9, mode="constant")
        best = np.array(np.unravel_index(int(np.argmax(amount)), amount.shape))
        around = low + (best + 0.5) * (high - low) / counts
    return np.maximum(low, around - WIDEST_WINDOW / 2), np.minimum(high, around + WIDEST_WINDOW / 2)


def _detailed(segments: Float) -> Float:
    """The walls, and where they are very far apart those in the box with the most ends of them."""
    ends = segments.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    if (high - low).max() <= FARTHEST_APART:
        return segments
    while (high - low).max() > FARTHEST_APART:
        inside = ends[((ends >= low) & (ends <= high)).all(axis=1)]
        edges = [np.linspace(low[axis], high[axis], WINDOW_BINS + 1) for axis in (0, 1)]
        if not all((np.diff(edge) > 0.0).all() for edge in edges):
            # A world of one straight line has no width to cut.
            low, high = low - 1.0, high + 1.0
            continue
        count, _, _ = np.histogram2d(inside[:, 0], inside[:, 1], bins=edges)
        # Blocks of two by two bins overlap, so that a town on the border between bins is found.
        fours = count[:-1, :-1] + count[1:, :-1] + count[:-1, 1:] + count[1:, 1:]
        column, row = np.unravel_index(int(np.argmax(fours)), fours.shape)
        low = np.array([edges[0][column], edges[1][row]])
        high = np.array([edges[0][column + 2], edges[1][row + 2]])
    # An end on the border of the box has some of its wall inside.
    return walls_within(segments, low - 1.0, high + 1.0)[0]


def walls_within(segments: Float, low: Float, high: Float) -> tuple[Float, Int]:
    """The parts (k, 4) of segments (n, 4) inside a box, and the segment (k,) that each is of.

    What lies inside as a whole stays as it is, to the last bit.
    """
    start, span = segments[:, :2], segments[:, 2:] - segments[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - start) / span, (high - start) / span
    # A wall perpendicular to an axis is within the limits of this axis everywhere or nowhere.
    within = np.where((start >= low) & (start <= high), np.inf, -np.inf)
    enter = np.where(span == 0.0, -within, np.minimum(one, other)).max(axis=1)
    leave = np.where(span == 0.0, within, np.maximum(one, other)).min(axis=1)
    enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
    kept = np.flatnonzero(enter < leave)
    parts = segments[kept]
    cut = (enter[kept] > 0.0) | (leave[kept] < 1.0)
    row = kept[cut]
    parts[cut, :2] = start[row] + enter[row, None] * span[row]
    parts[cut, 2:] = start[row] + leave[row, None] * span[row]
    # A part shorter than the resolution of its coordinates has no length left.
    long = lengths(parts) > 0.0
    return parts[long], kept[long]


def sample_walls(segments: Float, spacing: float) -> tuple[Float, Float]:
    """Points (k, 2) along segments (n, 4) at most a spacing apart, and the length (k,) each has."""
    counts = np.ceil(lengths(segments) / spacing).astype(int)
    wall = np.repeat(np.arange(len(segments)), counts)
    step = np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((step + 0.5) / counts[wall])[:, None]
    points = segments[wall, :2] * (1.0 - share) + segments[wall, 2:] * share
    return points, lengths(segments)[wall] / counts[wall]


def spacing_for(segments: Float) -> float:
    """Distance [m] between samples, larger where the walls would have more than `SAMPLES`."""
    return max(SPACING, float(lengths(segments).sum()) / SAMPLES)


def thinned(points: Float, weights: Float) -> tuple[Float, Float]:
    """Samples (k, 2) with their weights; where there are very many, one for each small cell."""
    if len(points) <= MANY_SAMPLES:
        return points, weights
    cells = np.floor((points - points.min(axis=0)) / (0.5 * SPACING)).astype(np.int64)
    rows = cells[:, 0] * (int(cells[:, 1].max()) + 1) + cells[:, 1]
    _, first, cell = np.unique(rows, return_index=True, return_inverse=True)
    total = np.bincount(cell.reshape(-1), weights).astype(np.float64)
    return points[first], total
