"""Vertices: the polylines of at most a number of vertices that explain a scan best.

Single scans are compared at an equal number of vertices, as Schaefer et al. do in "A Maximum
Likelihood Approach to Extract Polylines from 2-D Laser Range Scans" (IROS 2018). They remove
vertices one by one. Here dynamic programming finds the best returns for all vertices at once; then
the vertices leave the beams and move to where the squared range errors are least.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.laser import LaserScan

UNEXPLAINED = 0.4
"""Range error [m] that is charged for a beam on no polyline. Schaefer et al. use 0.5; with less,
fewer beams are left to lines that explain them badly."""

WIDEST_EDGE = 0.95 * np.pi
"""Largest angle [rad] between the ends of an edge: from half a turn on, beams no longer meet it."""

LEAST_GAIN = 1e-6
"""Share of the squared errors below which moving the vertices on gains too little."""

LEAST_TURN = 1e-6
"""Least angle [rad] between neighbouring vertices, so that no edge points at the laser."""

MISSED = 1e3
"""Range error [m] of a beam that does not meet its edge: no step is taken to such vertices."""


class Fan(NamedTuple):
    """The beams (n,) of a scan that returned: rising angles [rad], possibly past π; ranges [m].

    Joined are the beams from which an edge may continue to the next. If all are, around the laser,
    the fan is closed: its last beam is then the first again, a full turn on.
    """

    angles: Float
    ranges: Float
    joined: Bool
    closed: bool


def fit_vertices(scan: LaserScan, vertices: int, *, gap: float = np.inf) -> list[Float]:
    """Fit polylines (k, 2) in the world with at most a number of vertices in all to a scan.

    Two consecutive returns farther apart than the gap [m] are not joined. A closed polyline ends at
    its first point, which counts once.
    """
    fan = fan_of(scan, gap)
    if vertices < 3:
        # A closed polyline has at least three.
        fan = fan._replace(closed=False)
    if len(fan.ranges) < 2 or vertices < 2:
        return []
    beams, begins = best_vertices(fan, vertices)
    if fan.closed and len(beams) > 3:
        # The search fixes a vertex on the first beam. Its other vertices are chosen freely, so the
        # search is repeated with the fan turned to begin at one of them.
        turn, last = beams[len(beams) // 2], len(fan.ranges) - 1
        angles = np.append(fan.angles[turn:last], fan.angles[: turn + 1] + 2.0 * np.pi)
        ranges = np.append(fan.ranges[turn:last], fan.ranges[: turn + 1])
        fan = fan._replace(angles=angles, ranges=ranges)
        beams, begins = best_vertices(fan, vertices)
    polylines = []
    for first, last in pairwise([*np.flatnonzero(begins), len(beams)]):
        own = beams[first:last]
        explained = slice(own[0], own[-1] + 1)
        bearings, radii = move_vertices(
            fan.angles[own], fan.ranges[own], fan.angles[explained], fan.ranges[explained],
            closed=fan.closed,
        )  # fmt: skip
        heading = scan.pose.theta + bearings
        points = radii[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        polylines.append(np.array([scan.pose.x, scan.pose.y]) + points)
    return polylines


def fan_of(scan: LaserScan, gap: float) -> Fan:
    """The returns of a scan as a fan, which begins behind a gap if there is one."""
    order = np.argsort(scan.angles, kind="stable")
    angles, ranges = scan.angles[order], scan.ranges[order]
    hit = scan.hits[order] & (ranges > 0.0)
    left = 2.0 * np.pi - float(angles[-1] - angles[0])
    step = float(angles[-1] - angles[0]) / max(len(angles) - 1, 1)
    points = np.where(hit, ranges, 0.0)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    chord = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    joined = hit & np.roll(hit, -1) & (chord <= gap)
    if left > 1.5 * step:
        # The fan does not go all around: its last beam has no next one.
        joined[-1] = False
    elif joined.all():
        if left > 0.5 * step:
            # Otherwise the scan itself repeats its first beam at its end.
            angles = np.append(angles, angles[0] + 2.0 * np.pi)
            ranges = np.append(ranges, ranges[0])
        return Fan(angles, ranges, np.ones(len(ranges), np.bool_), True)
    else:
        begin = int(np.argmin(joined)) + 1
        angles = np.append(angles[begin:], angles[:begin] + 2.0 * np.pi)
        ranges, hit = np.roll(ranges, -begin), np.roll(hit, -begin)
        joined = np.roll(joined, -begin)
    return Fan(angles[hit], ranges[hit], joined[hit], False)


def best_vertices(fan: Fan, vertices: int) -> tuple[Int, Bool]:
    """The beams (v,) of the best vertices, and which of these begin a polyline (v,).

    One closed polyline has a vertex on the first beam and another on the last, which is the same;
    if it would need more vertices than there may be, there are none.
    """
    count, most = len(fan.angles), vertices + fan.closed
    # The least charge [m²] with each number of vertices: of the beams up to one with a vertex on
    # it, and where the vertex before is, −1 if there is none; …
    cost = np.full((count, most + 1), np.inf)
    origin = np.full((count, most + 1), -1)
    # … and of the first beams if every polyline has ended, and whether one ended on the last.
    ended = np.full((count + 1, most + 1), np.inf)
    ended[0, 0] = 0.0
    on_last = np.zeros((count + 1, most + 1), np.bool_)
    charge_of = edge_charges(fan)
    # Edges come from beams behind the last gap, and span less than half a turn.
    behind = np.where(np.append(True, fan.joined[:-1]), 0, np.arange(count))
    reached = np.searchsorted(fan.angles, fan.angles - WIDEST_EDGE, side="right")
    earliest = np.maximum(np.maximum.accumulate(behind), reached)
    for j in range(count):
        if j == 0 or not fan.closed:
            cost[j, 1:] = ended[j, :-1]
        if earliest[j] < j:
            totals = cost[earliest[j] : j, :-1] + charge_of(int(earliest[j]), j)[:, None]
            best = totals.argmin(axis=0)
            least = totals[best, np.arange(most)]
            shorter = np.flatnonzero(least < cost[j, 1:])
            cost[j, 1 + shorter] = least[shorter]
            origin[j, 1 + shorter] = earliest[j] + best[shorter]
        alone = ended[j] + UNEXPLAINED**2
        on_last[j + 1] = (origin[j] >= 0) & (cost[j] < alone)
        ended[j + 1] = np.where(on_last[j + 1], cost[j], alone)
    if fan.closed:
        ended[count], on_last[count] = cost[-1], True
    found: list[tuple[int, bool]] = []
    # Backwards: a beam on no polyline is passed over, a polyline is followed to its first vertex.
    j, v = count, int(np.argmin(ended[count]))
    while v > 0:
        j -= 1
        following = on_last[j + 1, v]
        while following:
            before = int(origin[j, v])
            found.append((j, before < 0))
            following, v = before >= 0, v - 1
            j = before if following else j
    beams, begins = np.array(found[::-1]).reshape(-1, 2).T
    return beams.astype(np.int64), begins.astype(np.bool_)


def edge_charges(fan: Fan) -> Callable[[int, int], Float]:
    """What gives the charges (j − i,) [m²] of the edges to a beam j from those from i on.

    The range of a beam to the line nx·x + ny·y = 1 is r̂ = 1/(nx·cos φ + ny·sin φ). Each beam is
    charged with r⁴·(1/r − 1/r̂)², which is (r − r̂)² for small errors but a polynomial in nx and ny,
    so that running sums give the charge of any edge in a few operations.
    """
    cos, sin, inverse = np.cos(fan.angles), np.sin(fan.angles), 1.0 / fan.ranges
    terms = [cos * cos, cos * sin, sin * sin, cos * inverse, sin * inverse, inverse * inverse]
    sums = np.cumsum(fan.ranges**4 * np.array(terms), axis=1)
    x, y = fan.ranges * cos, fan.ranges * sin

    def charges(i: int, j: int) -> Float:
        area = x[i:j] * y[j] - y[i:j] * x[j]
        with np.errstate(divide="ignore", invalid="ignore"):
            nx, ny = (y[j] - y[i:j]) / area, (x[i:j] - x[j]) / area
            cc, cs, ss, c, s, one = sums[:, j : j + 1] - sums[:, i:j]
            charge = nx * nx * cc + 2.0 * nx * ny * cs + ny * ny * ss - 2.0 * (nx * c + ny * s)
        # Two beams at one angle span no edge; the difference of sums may round to less than 0.
        return np.where(area > 0.0, np.maximum(charge + one, 0.0), np.inf)

    return charges


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
        moved, away = bearings[:count].copy(), values[len(free) :]
        moved[free] = values[: len(free)]
        if closed:
            moved, away = np.append(moved, moved[0] + 2.0 * np.pi), np.append(away, away[0])
        return moved, away

    def off(values: Float) -> Float:
        return range_errors(*placed(values), angles, ranges)

    begin = np.append(bearings[free], radii[:count])
    return placed(least_squares(off, begin, ftol=LEAST_GAIN, x_scale="jac").x)


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
