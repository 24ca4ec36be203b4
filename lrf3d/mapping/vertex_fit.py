"""Vertex fit: the polylines of at most so many vertices that explain a scan best.

Single scans are compared at an equal number of vertices, as Schaefer et al. do in "A Maximum
Likelihood Approach to Extract Polylines from 2-D Laser Range Scans" (IROS 2018). Where they take
vertices away one by one, dynamic programming finds the best choice of beams for all vertices at
once; then the vertices leave the beams and move to where the squared range errors are least.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan
from lrf3d.mapping.vertex_choice import best_vertices
from lrf3d.mapping.vertex_moves import move_vertices

OFFSETS = 3
"""How many places along its beam a vertex is tried at: the return, and one step to each side."""

STEP = 0.03
"""How far [m] apart these places lie: about the noise of a laser range finder."""


@dataclass(frozen=True, slots=True)
class _Fan:
    """Beams by rising angle, rotated so that none follows on the last; angles go on rising."""

    angles: Float
    ranges: Float
    joined: Bool
    closed: bool


def fit_vertices(scan: LaserScan, vertices: int, *, gap: float = np.inf) -> list[Float]:
    """Polylines with at most ``vertices`` vertices altogether.

    Args:
        scan: The scan.
        vertices: How many vertices there may be; a closed polyline counts its first one once.
        gap: Two following returns farther apart than this [m] are not joined.

    Returns:
        The polylines, (k, 2) points in the world; the last is the first again where one is
        closed.
    """
    fan = _fan(scan, gap)
    if vertices < 3:
        # A closed polyline has at least three.
        fan = replace(fan, closed=False)
    if len(fan.ranges) < 2 or vertices < 2:
        return []
    beams, radii, starts = _choose(fan, vertices)
    if fan.closed and len(beams) > 3:
        # Any beam could be the first; one in the middle of the best choice is a true vertex.
        turn = int(beams[len(beams) // 2])
        count = len(fan.ranges) - 1
        angles = np.concatenate([fan.angles[turn:count], fan.angles[: turn + 1] + 2.0 * np.pi])
        ranges = np.concatenate([fan.ranges[turn:count], fan.ranges[: turn + 1]])
        fan = _Fan(angles, ranges, fan.joined, True)
        beams, radii, starts = _choose(fan, vertices)
    cuts = [*np.flatnonzero(starts).tolist(), len(beams)]
    polylines = []
    for first, last in pairwise(cuts):
        part = slice(int(beams[first]), int(beams[last - 1]) + 1)
        place, reach = move_vertices(
            fan.angles[beams[first:last]],
            radii[first:last],
            fan.angles[part],
            fan.ranges[part],
            closed=fan.closed,
        )
        heading = scan.pose.theta + place
        points = reach[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        polylines.append(np.array([scan.pose.x, scan.pose.y]) + points)
    return polylines


def _fan(scan: LaserScan, gap: float) -> _Fan:
    order = np.argsort(scan.angles, kind="stable")
    angles, ranges, hit = scan.angles[order], scan.ranges[order], scan.hits[order]
    hit = hit & (ranges > 0.0)
    step = float(angles[-1] - angles[0]) / max(len(angles) - 1, 1)
    left = 2.0 * np.pi - float(angles[-1] - angles[0])
    points = np.where(hit, ranges, 0.0)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    chord = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    joined = hit & np.roll(hit, -1) & (chord <= gap)
    if left > 1.5 * step:
        joined[-1] = False
    elif joined.all():
        if left > 0.5 * step:
            angles, ranges = (
                np.append(angles, angles[0] + 2.0 * np.pi),
                np.append(ranges, ranges[0]),
            )
        return _Fan(angles, ranges, np.ones(len(ranges), bool), True)
    else:
        begin = int(np.argmin(joined)) + 1
        angles = np.concatenate([angles[begin:], angles[:begin] + 2.0 * np.pi])
        ranges, hit = np.roll(ranges, -begin), np.roll(hit, -begin)
        joined = np.roll(joined, -begin)
    return _Fan(angles[hit], ranges[hit], joined[hit], False)


def _choose(fan: _Fan, vertices: int) -> tuple[Int, Float, Bool]:
    """Beams (v,) of the best vertices, their radii [m], and which begin a polyline."""
    middle = (OFFSETS - 1) // 2
    steps = STEP * (np.arange(OFFSETS) - middle)
    radii = np.maximum(fan.ranges[:, None] + steps, 0.5 * fan.ranges[:, None])
    if not fan.closed:
        _, beams, place, starts = best_vertices(
            fan.angles, fan.ranges, fan.joined, radii, vertices, -1
        )
        return beams, radii[beams, place], starts
    radii[-1] = radii[0]
    answers = [
        best_vertices(fan.angles, fan.ranges, fan.joined, radii, vertices + 1, start)
        for start in range(OFFSETS)
    ]
    _, beams, place, starts = min(answers, key=lambda answer: answer[0])
    return beams, radii[beams, place], starts
