"""Clusters: runs of consecutive returns that may lie on one object (section 3)."""

from collections.abc import Iterator

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan


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
