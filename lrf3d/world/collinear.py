"""Merging collinear segments that touch, so that a straight wall is one segment."""

import numpy as np

from lrf3d.geometry import Float, Int, directions, lengths

PARALLEL = 1e-5
"""Largest difference [rad] of neighbours in a sorted list of directions that are one cluster."""


def merge_collinear(segments: Float, labels: Int, *, tolerance: float) -> tuple[Float, Int]:
    """Merge segments of one label that lie on one line and touch or overlap.

    Args:
        segments: (n, 4) segments [m].
        labels: (n,) only segments of the same label are merged.
        tolerance: Largest distance of segments from their line, and from each other [m].

    Returns:
        The merged segments (m, 4), whose ends lie within the tolerance of given ends, and the label
        (m,) of each.
    """
    if not len(segments):
        return segments, labels
    origin = np.round(segments.reshape(-1, 2).mean(axis=0))
    local = segments - np.tile(origin, 2)
    unit = directions(local)
    # Both orders of the ends give the same direction, in the half circle [0, π).
    unit[(unit[:, 1] < 0.0) | ((unit[:, 1] == 0.0) & (unit[:, 0] < 0.0))] *= -1.0
    angle = np.arctan2(unit[:, 1], unit[:, 0])
    angle[angle >= np.pi - 0.5 * PARALLEL] -= np.pi
    line = _clusters(angle, PARALLEL, labels)
    # The segments of a cluster are measured along the direction of its longest one.
    longest = np.lexsort((-lengths(local), line))
    first = longest[np.searchsorted(line[longest], np.arange(line.max() + 1))]
    along = unit[first][line]
    ends = local.reshape(-1, 2, 2)
    offset = ends[..., 1] * along[:, None, 0] - ends[..., 0] * along[:, None, 1]
    station = np.einsum("nek,nk->ne", ends, along)
    row = _clusters(offset.mean(axis=1), tolerance, line)
    low, high = station.min(axis=1), station.max(axis=1)
    order = np.lexsort((low, row))
    parts = _runs(row[order], low[order], high[order], tolerance)
    merged, members = [], np.split(order, np.flatnonzero(np.diff(parts)) + 1)
    owners = []
    for member in members:
        spread = np.ptp(offset[member])
        if len(member) == 1 or spread > 2.0 * tolerance:
            merged.append(segments[member])
            owners.append(labels[member])
            continue
        start, end = member[np.argmin(low[member])], member[np.argmax(high[member])]
        points = segments.reshape(-1, 2, 2)
        merged.append(
            np.concatenate(
                [points[start, np.argmin(station[start])], points[end, np.argmax(station[end])]]
            )[None]
        )
        owners.append(labels[member[:1]])
    return np.concatenate(merged), np.concatenate(owners)


def _clusters(values: Float, gap: float, labels: Int) -> Int:
    """Cluster numbers (n,): values of one label without a wider gap between them are a cluster."""
    order = np.lexsort((values, labels))
    apart = (np.diff(values[order]) > gap) | (np.diff(labels[order]) != 0)
    numbers = np.empty(len(values), dtype=np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(apart)])
    return numbers


def _runs(row: Int, low: Float, high: Float, gap: float) -> Int:
    """Numbers (n,) of the runs of intervals that touch; they are sorted by row and low end."""
    reach = np.empty(len(row))
    last = -np.inf
    for index in range(len(row)):
        fresh = index == 0 or row[index] != row[index - 1]
        last = high[index] if fresh else max(last, high[index])
        reach[index] = last
    apart = (np.diff(row) != 0) | (low[1:] > reach[:-1] + gap)
    return np.concatenate([[0], np.cumsum(apart)])
