"""Vertices: the polylines of at most a number of vertices that explain a scan best.

Single scans are compared at an equal number of vertices, as Schaefer et al. do in "A Maximum
Likelihood Approach to Extract Polylines from 2-D Laser Range Scans" (IROS 2018). They remove
vertices one by one. Here dynamic programming (compiled) finds the best beams for all vertices at
once; then the vertices leave the beams and move to where the squared range errors are least.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan

UNEXPLAINED = 0.4
"""Range error [m] that is charged for a beam on no polyline. Schaefer et al. use 0.5; with less,
fewer beams are left to lines that explain them badly."""

WIDEST_EDGE = 0.95 * np.pi
"""Largest angle [rad] between the ends of an edge: from half a turn on, beams no longer meet it."""


@compiled
def best_vertices(
    angles: Float, ranges: Float, joined: Bool, radii: Float, vertices: int, start: int
) -> tuple[float, Int, Int, Bool]:
    """The vertices that explain the beams best, by dynamic programming.

    Args:
        angles: (n,) angles of the beams [rad], rising.
        ranges: (n,) their ranges [m].
        joined: (n,) whether an edge may continue from each beam to the next.
        radii: (n, offsets) distances [m] along each beam at which a vertex is tried.
        vertices: Largest number of vertices.
        start: −1; or the offset on the first and the last beam at which one closed polyline begins
            and ends.

    Returns:
        The charge [m²]; for each vertex its beam (v,) and its offset (v,), and whether it begins a
        polyline (v,). The charge is infinite if no closed polyline exists.
    """
    count, offsets = radii.shape
    cost, origin, ended, last = _cheapest(angles, ranges, joined, radii, vertices, start)
    v = int(np.argmin(ended[count] if start < 0 else cost[count - 1, start]))
    charge = ended[count, v] if start < 0 else cost[count - 1, start, v]
    beams, places = np.empty(v, np.int64), np.empty(v, np.int64)
    begins = np.zeros(v, np.bool_)
    # Backwards from the last beam: a beam on no polyline is passed over, a polyline is followed.
    i = count
    while v > 0:
        i -= 1
        k = last[i + 1, v] if start < 0 else start
        while k >= 0:
            before = origin[i, k, v]
            v -= 1
            beams[v], places[v], begins[v] = i, k, before < 0
            if before < 0:
                break
            i, k = before // offsets, before % offsets
    return charge, beams, places, begins


@inner
def _cheapest(
    angles: Float, ranges: Float, joined: Bool, radii: Float, vertices: int, start: int
) -> tuple[Float, Int, Float, Int]:
    """The tables of the dynamic programming; arguments as of `best_vertices`.

    Returns:
        cost (n, offsets, vertices + 1): the least charge of the beams up to beam j, if the last of
        v vertices is on it at offset k;
        origin, of the same shape: the beam times offsets plus the offset of the vertex before that
        one, or −1 if it begins a polyline;
        ended (n + 1, vertices + 1): the least charge of the first j beams with v vertices, if every
        polyline has ended;
        last, of the same shape: the offset of the vertex on the last of these beams, or −1 if that
        beam is on no polyline.
    """
    count, offsets = radii.shape
    sums = _running_sums(angles, ranges)
    cost = np.full((count, offsets, vertices + 1), np.inf)
    origin = np.full((count, offsets, vertices + 1), -1)
    ended = np.full((count + 1, vertices + 1), np.inf)
    last = np.full((count + 1, vertices + 1), -1)
    ended[0, 0] = 0.0
    for j in range(count):
        for k in range(offsets):
            # Either a polyline begins here, of which its own beam is charged …
            error = (radii[j, k] - ranges[j]) ** 2
            if start < 0:
                for v in range(vertices):
                    cost[j, k, v + 1] = ended[j, v] + error
            elif j == 0 and k == start:
                cost[j, k, 1] = error
            # … or an edge ends here, from an earlier vertex that no gap separates from this one.
            bx, by = radii[j, k] * np.cos(angles[j]), radii[j, k] * np.sin(angles[j])
            i = j - 1
            while i >= 0 and joined[i] and angles[j] - angles[i] < WIDEST_EDGE:
                for m in range(offsets):
                    ax, ay = radii[i, m] * np.cos(angles[i]), radii[i, m] * np.sin(angles[i])
                    area = ax * by - ay * bx
                    # Two beams at one angle span no edge.
                    if area <= 0.0:
                        continue
                    charge = _edge_charge(sums, i, j, (by - ay) / area, (ax - bx) / area)
                    for v in range(1, vertices):
                        if cost[i, m, v] + charge < cost[j, k, v + 1]:
                            cost[j, k, v + 1] = cost[i, m, v] + charge
                            origin[j, k, v + 1] = i * offsets + m
                i -= 1
        # The beam is on no polyline, or a polyline of at least two vertices ends on it.
        for v in range(vertices + 1):
            ended[j + 1, v] = ended[j, v] + UNEXPLAINED**2
            for k in range(offsets):
                if origin[j, k, v] >= 0 and cost[j, k, v] < ended[j + 1, v]:
                    ended[j + 1, v] = cost[j, k, v]
                    last[j + 1, v] = k
    return cost, origin, ended, last


@inner
def _running_sums(angles: Float, ranges: Float) -> Float:
    """Sums (n + 1, 6) over the first beams of what `_edge_charge` consists of."""
    sums = np.zeros((len(ranges) + 1, 6))
    for i in range(len(ranges)):
        cos, sin = np.cos(angles[i]), np.sin(angles[i])
        inverse, weight = 1.0 / ranges[i], ranges[i] ** 4
        terms = (cos * cos, cos * sin, sin * sin, cos * inverse, sin * inverse, inverse * inverse)
        for k in range(6):
            sums[i + 1, k] = sums[i, k] + weight * terms[k]
    return sums


@inner
def _edge_charge(sums: Float, i: int, j: int, nx: float, ny: float) -> float:
    """Charge of the beams after i and up to j for an edge on the line nx·x + ny·y = 1.

    The range of a beam to this line is r̂ = 1/(nx·cos φ + ny·sin φ). Each beam is charged with
    r⁴·(1/r − 1/r̂)², which is (r − r̂)² for small errors but a polynomial in nx and ny, so that
    running sums give the charge of any edge in a few operations.
    """
    charge: float = (
        nx * nx * (sums[j + 1, 0] - sums[i + 1, 0])
        + 2.0 * nx * ny * (sums[j + 1, 1] - sums[i + 1, 1])
        + ny * ny * (sums[j + 1, 2] - sums[i + 1, 2])
        - 2.0 * nx * (sums[j + 1, 3] - sums[i + 1, 3])
        - 2.0 * ny * (sums[j + 1, 4] - sums[i + 1, 4])
        + sums[j + 1, 5]
        - sums[i + 1, 5]
    )
    # The difference of sums may round to less than 0.
    return max(charge, 0.0)


LEAST_GAIN = 1e-6
"""Share of the squared errors below which moving the vertices on gains too little."""

LEAST_TURN = 1e-6
"""Least angle [rad] between neighbouring vertices, so that no edge points at the laser."""

MISSED = 1e3
"""Range error [m] of a beam that does not meet its edge: no step is taken to such vertices."""


def move_vertices(
    bearings: Float, radii: Float, angles: Float, ranges: Float, *, closed: bool
) -> tuple[Float, Float]:
    """Move the vertices of one polyline to the least squared range errors.

    The ends of an open polyline stay on their beams, so that it goes on explaining the same ones;
    the last vertex of a closed one is the first again, a full turn on. Bearings (v,) [rad] rise;
    the beams that the polyline explains have angles (n,) [rad] and ranges (n,) [m].
    """
    count = len(bearings) - closed
    free = np.arange(count) if closed else np.arange(1, count - 1)

    def placed(values: Float) -> tuple[Float, Float]:
        moved = bearings[:count].copy()
        moved[free] = values[: len(free)]
        return (
            np.append(moved, moved[:1] + 2.0 * np.pi) if closed else moved,
            np.append(values[len(free) :], values[len(free) : len(free) + closed]),
        )

    def off(values: Float) -> Float:
        return range_errors(*placed(values), angles, ranges)

    begin = np.concatenate([bearings[free], radii[:count]])
    found = least_squares(off, begin, ftol=LEAST_GAIN, x_scale="jac")
    return placed(found.x)


def range_errors(bearings: Float, radii: Float, angles: Float, ranges: Float) -> Float:
    """Errors (n,) of the ranges of beams to a polyline [m]; see `MISSED`.

    With the bearings α, β and the radii a, b of the ends of its edge, the range of a beam at φ is
    a·b·sin(β − α) / (b·sin(β − φ) + a·sin(φ − α)).
    """
    if not ((np.diff(bearings) > LEAST_TURN).all() and (radii > 0.0).all()):
        return np.full(len(angles), MISSED)
    turn = 2.0 * np.pi
    # A closed polyline may begin at any bearing: beams before its first vertex meet its last edge.
    angles = np.where(angles < bearings[0] - 1e-12, angles + turn, angles)
    angles = np.where(angles > bearings[-1] + 1e-12, angles - turn, angles)
    edge = np.clip(np.searchsorted(bearings, angles, side="right") - 1, 0, len(bearings) - 2)
    ahead = radii[edge + 1] * np.sin(bearings[edge + 1] - angles)
    back = radii[edge] * np.sin(angles - bearings[edge])
    across = radii[edge] * radii[edge + 1] * np.sin(bearings[edge + 1] - bearings[edge])
    predicted = across / (ahead + back)
    return np.where(predicted > 0.0, ranges - predicted, MISSED)


OFFSETS = 3
"""Number of points along its beam at which a vertex is tried: the return, and a step to each side
of it."""

STEP = 0.03
"""Distance [m] between these points: about the noise of a laser range finder."""


@dataclass(frozen=True, slots=True)
class _Fan:
    """The beams of a scan that returned, rising in angle, possibly past π.

    Args:
        angles: (n,) angles [rad].
        ranges: (n,) ranges [m].
        joined: (n,) whether an edge may continue to the next beam.
        closed: Whether all beams are joined around the laser; the last beam is then the first
            again, a full turn on. Otherwise the fan begins behind a gap, and no edge continues
            past its last beam.
    """

    angles: Float
    ranges: Float
    joined: Bool
    closed: bool


def fit_vertices(scan: LaserScan, vertices: int, *, gap: float = np.inf) -> list[Float]:
    """Fit polylines with at most ``vertices`` vertices in all to a scan.

    Args:
        scan: The scan.
        vertices: Largest number of vertices; a closed polyline counts its first one once.
        gap: Two consecutive returns farther apart than this [m] are not joined.

    Returns:
        The polylines, each (k, 2) points in the world; a closed one ends at its first point.
    """
    fan = _fan(scan, gap)
    if vertices < 3:
        # A closed polyline has at least three.
        fan = replace(fan, closed=False)
    if len(fan.ranges) < 2 or vertices < 2:
        return []
    beams, radii, begins = _choose(fan, vertices)
    if fan.closed and len(beams) > 3:
        # The search fixes a vertex on the first beam. Its other vertices are chosen freely, so the
        # search is repeated with the fan turned to begin at one of them.
        turn = int(beams[len(beams) // 2])
        count = len(fan.ranges) - 1
        angles = np.concatenate([fan.angles[turn:count], fan.angles[: turn + 1] + 2.0 * np.pi])
        ranges = np.concatenate([fan.ranges[turn:count], fan.ranges[: turn + 1]])
        fan = _Fan(angles, ranges, fan.joined, True)
        beams, radii, begins = _choose(fan, vertices)
    cuts = [*np.flatnonzero(begins).tolist(), len(beams)]
    polylines = []
    for first, last in pairwise(cuts):
        explained = slice(int(beams[first]), int(beams[last - 1]) + 1)
        bearings, moved = move_vertices(
            fan.angles[beams[first:last]],
            radii[first:last],
            fan.angles[explained],
            fan.ranges[explained],
            closed=fan.closed,
        )
        heading = scan.pose.theta + bearings
        points = moved[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
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
        # The fan does not go all around: its last beam has no next one.
        joined[-1] = False
    elif joined.all():
        if left > 0.5 * step:
            # Otherwise the scan itself repeats its first beam at its end.
            angles, ranges = (
                np.append(angles, angles[0] + 2.0 * np.pi),
                np.append(ranges, ranges[0]),
            )
        return _Fan(angles, ranges, np.ones(len(ranges), bool), True)
    else:
        # All around, but with a gap somewhere: the fan begins behind the first one.
        begin = int(np.argmin(joined)) + 1
        angles = np.concatenate([angles[begin:], angles[:begin] + 2.0 * np.pi])
        ranges, hit = np.roll(ranges, -begin), np.roll(hit, -begin)
        joined = np.roll(joined, -begin)
    return _Fan(angles[hit], ranges[hit], joined[hit], False)


def _choose(fan: _Fan, vertices: int) -> tuple[Int, Float, Bool]:
    """Beams (v,) of the best vertices, their radii [m], and which begin a polyline."""
    steps = STEP * (np.arange(OFFSETS) - OFFSETS // 2)
    radii = np.maximum(fan.ranges[:, None] + steps, 0.5 * fan.ranges[:, None])
    if not fan.closed:
        _, beams, places, begins = best_vertices(
            fan.angles, fan.ranges, fan.joined, radii, vertices, -1
        )
        return beams, radii[beams, places], begins
    radii[-1] = radii[0]
    # One more vertex, because the last is the first again.
    answers = [
        best_vertices(fan.angles, fan.ranges, fan.joined, radii, vertices + 1, start)
        for start in range(OFFSETS)
    ]
    _, beams, places, begins = min(answers, key=lambda answer: answer[0])
    return beams, radii[beams, places], begins
