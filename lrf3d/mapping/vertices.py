"""Vertices: the polylines of at most a number of vertices that explain a scan best.

Single scans are compared at an equal number of vertices, as Schaefer et al. do in "A Maximum
Likelihood Approach to Extract Polylines from 2-D Laser Range Scans" (IROS 2018). Where they take
vertices away one by one, dynamic programming (compiled) finds the best choice of beams for all
vertices at once; then the vertices leave the beams and move to where the squared range errors are
least.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan

UNEXPLAINED = 0.4
"""Range error [m] that a beam is charged with which no polyline explains: theirs is 0.5, and
less gives fewer beams up to lines that explain them badly."""


@compiled
def best_vertices(
    angles: Float, ranges: Float, joined: Bool, radii: Float, vertices: int, start: int
) -> tuple[float, Int, Int, Bool]:  # pragma: no cover
    """The best vertices; with a start ≥ 0, one closed polyline that begins and ends at it.

    Edges are charged with r⁴·(1/r − 1/r̂)², which is (r − r̂)² for small errors and adds up by
    running sums. ``cost[i, k, v]`` is the least charge of v vertices, the last at beam i.
    """
    count, offsets = radii.shape
    sums = np.zeros((count + 1, 6))
    for i in range(count):
        cos, sin = np.cos(angles[i]), np.sin(angles[i])
        inverse, weight = 1.0 / ranges[i], ranges[i] ** 4
        terms = (cos * cos, cos * sin, sin * sin, cos * inverse, sin * inverse, inverse * inverse)
        for k in range(6):
            sums[i + 1, k] = sums[i, k] + weight * terms[k]
    cost = np.full((count, offsets, vertices + 1), np.inf)
    origin = np.full((count, offsets, vertices + 1), -1)
    free = np.full((count + 1, vertices + 1), np.inf)
    left = np.full((count + 1, vertices + 1), -2)
    free[0, 0] = 0.0
    alone = UNEXPLAINED**2
    for j in range(count):
        for k in range(offsets):
            off = (radii[j, k] - ranges[j]) ** 2
            if start < 0:
                for v in range(vertices):
                    cost[j, k, v + 1] = free[j, v] + off
            elif j == 0 and k == start:
                cost[j, k, 1] = off
            bx, by = radii[j, k] * np.cos(angles[j]), radii[j, k] * np.sin(angles[j])
            i = j - 1
            while i >= 0 and joined[i] and angles[j] - angles[i] < 0.95 * np.pi:
                for m in range(offsets):
                    ax, ay = radii[i, m] * np.cos(angles[i]), radii[i, m] * np.sin(angles[i])
                    area = ax * by - ay * bx
                    if area <= 0.0:
                        continue
                    nx, ny = (by - ay) / area, (ax - bx) / area
                    charge = (
                        nx * nx * (sums[j + 1, 0] - sums[i + 1, 0])
                        + 2.0 * nx * ny * (sums[j + 1, 1] - sums[i + 1, 1])
                        + ny * ny * (sums[j + 1, 2] - sums[i + 1, 2])
                        - 2.0 * nx * (sums[j + 1, 3] - sums[i + 1, 3])
                        - 2.0 * ny * (sums[j + 1, 4] - sums[i + 1, 4])
                        + sums[j + 1, 5]
                        - sums[i + 1, 5]
                    )
                    charge = max(charge, 0.0)
                    for v in range(1, vertices):
                        if cost[i, m, v] + charge < cost[j, k, v + 1]:
                            cost[j, k, v + 1] = cost[i, m, v] + charge
                            origin[j, k, v + 1] = i * offsets + m
                i -= 1
        for v in range(vertices + 1):
            free[j + 1, v] = free[j, v] + alone
            left[j + 1, v] = -1
            for k in range(offsets):
                if origin[j, k, v] >= 0 and cost[j, k, v] < free[j + 1, v]:
                    free[j + 1, v] = cost[j, k, v]
                    left[j + 1, v] = k
    beams = np.empty(vertices + 1, np.int64)
    place = np.empty(vertices + 1, np.int64)
    starts = np.zeros(vertices + 1, np.bool_)
    found = 0
    # The way back: how many beams and vertices are left of it.
    rest, v = count, int(np.argmin(free[count] if start < 0 else cost[count - 1, start]))
    least = free[count, v] if start < 0 else cost[count - 1, start, v]
    while rest > 0:
        k = left[rest, v] if start < 0 else start
        rest -= 1
        if k < 0:
            continue
        # Along a polyline, to its first vertex.
        i = rest
        while True:
            beams[found], place[found] = i, k
            found += 1
            before = origin[i, k, v]
            v -= 1
            if before < 0:
                starts[found - 1] = True
                break
            i, k = before // offsets, before % offsets
        rest = i if start < 0 else 0
    order = np.arange(found - 1, -1, -1)
    return least, beams[order], place[order], starts[order]


ROUNDS = 30
"""How often the vertices are moved at most; a dozen times is usual."""


def move_vertices(
    place: Float, reach: Float, angles: Float, ranges: Float, *, closed: bool
) -> tuple[Float, Float]:
    """Vertices (v,), their angles [rad] and distances [m], at the least squared range errors.

    Levenberg-Marquardt steps; the ends of an open polyline stay on their beams, so that it goes
    on explaining the same ones.
    """
    best, damping = _errors(place, reach, angles, ranges), 1e-3
    for _ in range(ROUNDS):
        matrix, vector = _normal_equations(place, reach, angles, ranges, closed=closed)
        scaled = matrix + damping * np.diag(np.diag(matrix) + 1e-12)
        step = np.linalg.solve(scaled, vector).reshape(-1, 2)
        if closed:
            step = np.vstack([step, step[:1]])
        moved = place + step[:, 0], reach + step[:, 1]
        fits = (np.diff(moved[0]) > 1e-6).all() and (moved[1] > 0.0).all()
        error = _errors(*moved, angles, ranges) if fits else np.inf
        if error < best:
            gain = best - error
            (place, reach), best, damping = moved, error, 0.3 * damping
            if gain < 1e-6 * best:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return place, reach


def _predicted(place: Float, reach: Float, angles: Float) -> tuple[Float, Int, Float, Float, Float]:
    """Ranges of beams to a polyline, the edge of each, and what they are made of."""
    turn = 2.0 * np.pi
    # A closed polyline begins anywhere: beams before its first vertex look at its last edge.
    angles = np.where(angles < place[0] - 1e-12, angles + turn, angles)
    angles = np.where(angles > place[-1] + 1e-12, angles - turn, angles)
    edge = np.clip(np.searchsorted(place, angles, side="right") - 1, 0, len(place) - 2)
    ahead = reach[edge + 1] * np.sin(place[edge + 1] - angles)
    back = reach[edge] * np.sin(angles - place[edge])
    across = reach[edge] * reach[edge + 1] * np.sin(place[edge + 1] - place[edge])
    return across / (ahead + back), edge, angles, ahead + back, across


def _errors(place: Float, reach: Float, angles: Float, ranges: Float) -> float:
    predicted = _predicted(place, reach, angles)[0]
    if not (predicted > 0.0).all():
        return np.inf
    return float(((ranges - predicted) ** 2).sum())


def _normal_equations(
    place: Float, reach: Float, angles: Float, ranges: Float, *, closed: bool
) -> tuple[Float, Float]:
    predicted, edge, angles, below, across = _predicted(place, reach, angles)
    one, two = place[edge], place[edge + 1]
    near, far = reach[edge], reach[edge + 1]
    slopes = np.zeros((len(angles), len(place), 2))
    rows = np.arange(len(angles))
    cosine = near * far * np.cos(two - one)
    slopes[rows, edge, 0] = (-cosine + predicted * near * np.cos(angles - one)) / below
    slopes[rows, edge + 1, 0] = (cosine - predicted * far * np.cos(two - angles)) / below
    slopes[rows, edge, 1] = (across / near - predicted * np.sin(angles - one)) / below
    slopes[rows, edge + 1, 1] = (across / far - predicted * np.sin(two - angles)) / below
    if closed:
        slopes[:, 0] += slopes[:, -1]
        slopes = slopes[:, :-1]
    else:
        slopes[:, [0, -1], 0] = 0.0
    flat = slopes.reshape(len(angles), -1)
    matrix = flat.T @ flat
    # Directions that no beam determines stay as they are.
    idle = np.diag(matrix) <= 0.0
    matrix[idle, idle] = 1.0
    return matrix, flat.T @ (ranges - predicted)


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
