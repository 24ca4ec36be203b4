"""The local map of one scan, as section 3 of the paper (and its [4]) makes it.

A scan enters; runs of returns no farther apart than a fixed gap are clusters, and split-and-merge
makes a polyline of each.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from lrf3d.geometry import Bool, Float, Int, fit_line
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.mapping.segment_table import SegmentTable, fit_ends, measure_moments

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


def ordered_returns(scan: LaserScan) -> tuple[Int, bool]:
    """Beams (n,) of a scan by rising angle, each direction once, and whether they close a circle.

    A scan of 360° whose last beam looks where its first does gives that beam once.
    """
    order = np.argsort(scan.angles, kind="stable")
    if len(order) < 3:
        return order, False
    angles = scan.angles[order]
    step = float(np.median(np.diff(angles)))
    left = 2.0 * np.pi - float(angles[-1] - angles[0])
    if left < 0.5 * step:
        return order[:-1], True
    return order, left < 1.5 * step


def clusters(scan: LaserScan, joined: Bool, order: Int, *, circle: bool) -> Iterator[Int]:
    """Runs (n,) of beams that returned and hang together; lone points are dropped.

    Args:
        scan: The scan.
        joined: (m,) whether beam i of the order hangs together with the next, the last one with
            the first.
        order: (m,) beams by rising angle.
        circle: Whether the last beam and the first are neighbours.
    """
    hit = scan.hits[order]
    linked = joined & hit & np.roll(hit, -1)
    if not circle:
        linked[-1:] = False
    elif linked.all():
        # One wall all round: any place is as good to begin at.
        yield order
        return
    else:
        # Begin behind a break, so that no cluster runs over the end of the list.
        begin = int(np.argmin(linked)) + 1
        order, linked = np.roll(order, -begin), np.roll(linked, -begin)
    first = 0
    for last in np.flatnonzero(~linked).tolist():
        if last > first:
            yield order[first : last + 1]
        first = last + 1


def near_each_other(points: Float, gap: float) -> Bool:
    """Whether each of points (n, 2) lies within a gap [m] of the next, as the paper has it."""
    steps = np.roll(points, -1, axis=0) - points
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]) <= gap)


@dataclass(frozen=True, slots=True)
class SplitMergeExtractor:
    """The paper's: clusters by a fixed gap, split-and-merge, plain total least squares.

    Args:
        gap: Two following points farther apart than this [m] are of two clusters.
        split: A polyline is split where a point is farther off than this [m].
    """

    gap: float
    split: float

    def __call__(self, scan: LaserScan) -> SegmentTable:
        """The local map of a scan, in the world's directions around the laser's place."""
        order, circle = ordered_returns(scan)
        ranges = np.where(scan.hits, scan.ranges, 0.0)
        points = ranges[:, None] * beam_directions(scan.pose.theta, scan.angles)
        joined = near_each_other(points[order], self.gap)
        polylines = [
            split_and_merge(points[beams], self.split)
            for beams in clusters(scan, joined, order, circle=circle)
        ]
        return _join(polylines)


def _join(polylines: list[SegmentTable]) -> SegmentTable:
    table = SegmentTable.empty()
    for number, polyline in enumerate(polylines):
        table = table.join(replace(polyline, unions=np.full(len(polyline), number)))
    return table
