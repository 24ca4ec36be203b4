"""Split-and-merge: a cluster of points becomes a polyline (section 3 of the paper, and its [4])."""

from itertools import pairwise

import numpy as np

from lrf3d.geometry import Float, fit_line
from lrf3d.mapping.table import SegmentTable, fit_ends, measure_moments

LEAST_LENGTH = 1e-9
"""Length [m] that a segment is longer than: points nearer to each other say no direction."""


def split_and_merge(points: Float, split: float) -> SegmentTable:
    """Polyline of a cluster of points (n, 2), its lines fitted by total least squares.

    The cluster is split at the point farthest from the chord of its ends while that point is
    farther than ``split`` [m]; then neighbours are merged again where all their points lie
    within ``split`` of one common line. A piece of one point, or of points at one place, is no
    segment.
    """
    cuts = _merge(points, _split(points, split), split)
    rows = [_segment(points[first : last + 1]) for first, last in pairwise(cuts)]
    rows = [row for row in rows if np.hypot(*(row[0][2:] - row[0][:2])) > LEAST_LENGTH]
    if not rows:
        return SegmentTable.empty()
    return SegmentTable(
        np.array([ends for ends, _, _ in rows]),
        np.array([moments for _, moments, _ in rows]),
        np.array([count for _, _, count in rows]),
        np.zeros(len(rows), np.int64),
    )


def _split(points: Float, split: float) -> list[int]:
    """Rising indices of the vertices of the polyline; neighbours share theirs."""
    cuts = [0]
    stack = [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        chord = points[last] - points[first]
        offset = points[first : last + 1] - points[first]
        length = np.hypot(*chord)
        if length > 0.0:
            away = np.abs(chord[0] * offset[:, 1] - chord[1] * offset[:, 0]) / length
        else:
            away = np.hypot(offset[:, 0], offset[:, 1])
        farthest = int(np.argmax(away))
        if 0 < farthest < last - first and away[farthest] > split:
            stack += [(first + farthest, last), (first, first + farthest)]
        else:
            cuts.append(last)
    return cuts


def _merge(points: Float, cuts: list[int], split: float) -> list[int]:
    """The vertices that are left when neighbours on one line are merged, straightest first."""
    while len(cuts) > 2:
        spread = [
            _largest_distance(points[first : last + 1])
            for first, last in zip(cuts[:-2], cuts[2:], strict=True)
        ]
        straightest = int(np.argmin(spread))
        if spread[straightest] > split:
            break
        del cuts[straightest + 1]
    return cuts


def _largest_distance(points: Float) -> float:
    mean, unit = fit_line(points)
    centred = points - mean
    return float(np.abs(unit[0] * centred[:, 1] - unit[1] * centred[:, 0]).max())


def _segment(points: Float) -> tuple[Float, Float, int]:
    moments = measure_moments(points, np.ones(len(points)))
    span = np.concatenate([points[:-1], points[1:]], axis=1)
    # Two equal points span nothing; the chord of the whole piece gives the way it runs.
    chord = np.concatenate([points[0], points[-1]])[None]
    return fit_ends(moments, np.concatenate([chord, span])), moments, len(points)
