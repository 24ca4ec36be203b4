"""Extraction: the walls of one scan.

The beams and ranges of a scan enter; its walls leave, in the world's directions around the laser,
with the moments of their points. Two returns are of different clusters if their gap is larger than
the spacing of beams and the noise explain: a wall above a grazing angle is never separated, at any
distance. Each cluster is divided into the most likely walls by dynamic programming; a full circle
has no seam.

Along a wall with the normal n at the distance c, the inverse range is linear in the direction of
the beam: 1/r = (n_x·cos φ + n_y·sin φ)/c. With the variance s²/r⁴ of 1/r, the maximum-likelihood
line of any run of beams is a linear least-squares fit of two numbers, which running sums give in
a few operations; so every division of a cluster can be compared, and the cheapest one be taken.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner, record
from lrf3d.geometry.lines import Bool, Float, Int, Records
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.laser.noise import USUAL_RANGE
from lrf3d.mapping.line_map import LineMap, solid_map
from lrf3d.mapping.robust.beams import (
    MOST_RANGE,
    Beams,
    in_order,
    is_return,
    longest_loss,
    plain,
)
from lrf3d.mapping.robust.walls import FIT, add_point, end_of, put_line

# [deviations] Noise of two returns that is added to the largest gap in a cluster.
CLUSTER_DEVIATIONS = 4.0

# [cosine] Least incidence in weights: at grazing beams other errors than that of the range
# dominate.
LEAST_INCIDENCE = 0.05

# [deviations] Largest shift of an end along its beam onto its wall: a beam that almost runs along
# the wall would move it far.
END_DEVIATIONS = 5.0


# [χ²] Cost of a further wall: the best division of one noisy wall of a hundred points gains more
# only once in thousands of times. Refits use it, too.
WALL_COST = 20.0

# [χ²] Cost of a point on no wall: that of 3.5 standard deviations.
OUTLIER_COST = 12.0

# [points] Fewest points of a wall: any two define a line.
LEAST_POINTS = 3

# [χ²] Largest excess of a division over the best that may still lead to a better one: the cost of
# the points behind it that are too few for a wall. Exact, no tuning.
PRUNED_COST = max(0.0, (LEAST_POINTS - 1) * OUTLIER_COST - WALL_COST)

# Weighted sums of products, of which a line is fitted to the inverse ranges.
SUMS = record(
    cc=float, cs=float, ss=float,  # of the cosine and the sine of the beam
    ci=float, si=float, ii=float,  # of these and the inverse range
)  # fmt: skip


# A wall of a cluster.
SPAN = record(
    first=int, last=int,  # the first and the last return of a wall
    x=float, y=float,  # [1/m] its normal over its distance, n/c
)  # fmt: skip


class LocalWalls(NamedTuple):
    """The walls (n, 4) [m] of one scan, seen from their left, with the FIT and cluster of each."""

    ends: Float
    fits: Records
    clusters: Int


@inner
def _joined_returns(
    theta: float, angles: Float, ranges: Float, range_max: float, noise: RangeNoise, gap: float
) -> tuple[Beams, Bool]:
    """The beams that returned, and which of them are connected to the next one.

    The last is connected to the first only if the scan closes a circle.
    """
    count = len(angles)
    lost = longest_loss(ranges, range_max)
    kept = 0
    circle = False
    if count >= 3:
        # A scan of 360° whose last beam looks where its first does gives that beam once.
        span = angles[-1] - angles[0]
        step = span / (count - 1)
        left = 2.0 * np.pi - span
        circle = left < 1.5 * step
        count -= left < 0.5 * step
    beams = np.empty((count, 2))
    reaches = np.empty(count)
    deviations = np.empty(count)
    places = np.empty(count, np.int64)
    joined = np.zeros(count, np.bool_)
    for place in range(count):
        reach = ranges[place]
        if is_return(reach, range_max):
            angle = theta + angles[place]
            beams[kept, 0] = np.cos(angle)
            beams[kept, 1] = np.sin(angle)
            reaches[kept] = reach
            deviations[kept] = np.sqrt(noise.floor * noise.floor + (noise.growth * reach) ** 2)
            places[kept] = place
            kept += 1
    # [rad] Walls at a smaller angle of incidence cannot be distinguished from a gap.
    grazing_angle = np.radians(8.0)
    for i in range(kept):
        k = (i + 1) % kept
        if k == i or (k == 0 and not circle):
            continue
        # A lost beam does not show whether the wall goes on between its neighbours.
        if (places[k] - places[i]) % count > 1 + lost:
            continue
        turn = abs(angles[places[k]] - angles[places[i]])
        turn = min(turn, 2.0 * np.pi - turn)
        near = min(reaches[i], reaches[k])
        far = max(reaches[i], reaches[k])
        step = np.sqrt(max(near * near + far * far - 2.0 * near * far * np.cos(turn), 0.0))
        # On a wall met at no less than the grazing angle two beams return points no farther
        # apart than this; noise adds to it. A wider gap than the given one always parts.
        reach = gap
        if turn < grazing_angle:
            reach = min(gap, near * np.sin(turn) / np.sin(grazing_angle - turn))
        blur = CLUSTER_DEVIATIONS * np.sqrt(deviations[i] ** 2 + deviations[k] ** 2)
        joined[i] = step <= reach + blur
    return Beams(beams[:kept], reaches[:kept], deviations[:kept]), joined[:kept]


@inner
def _rolled(begin: int, beams: Beams) -> Beams:
    """The beams of a full turn, from one on."""
    count = len(beams.ranges)
    rolled = Beams(np.empty((count, 2)), np.empty(count), np.empty(count))
    for k in range(count):
        place = (begin + k) % count
        for axis in range(2):
            rolled.units[k, axis] = beams.units[place, axis]
        rolled.ranges[k] = beams.ranges[place]
        rolled.deviations[k] = beams.deviations[place]
    return rolled


@compiled
def extract_walls(
    theta: float, angles: Float, ranges: Float, range_max: float, noise: RangeNoise, gap: float,
    local: LocalWalls,
) -> int:  # fmt: skip
    """Fill in the walls (≥ n // 3 rows) of a scan with a heading [rad]; returns how many.

    Ranges (n,) by rising angles (n,) are valid above 0 and up to range_max; a gap [m] separates
    clusters at any distance.
    """
    beams, joined = _joined_returns(theta, angles, ranges, range_max, noise, gap)
    count = len(beams.ranges)
    spans = np.empty(count // LEAST_POINTS + 1, SPAN)
    found = clusters = 0
    begin = _first_gap(joined)
    closed = begin == count
    if closed and count and segment_cluster(beams, spans) > 1:
        # The scan closes on itself: begin at a corner, so that no wall is cut in two.
        begin = spans[1].first - 1
    # Begin after a gap, so that no cluster wraps around the end of the list.
    beams = _rolled(begin + 1, beams)
    first = 0
    while first < count:
        last = first
        while last < count - 1 and (closed or joined[(begin + 1 + last) % count]):
            last += 1
        last += 1
        run = _part(beams, first, last)
        parts = segment_cluster(run, spans) if last - first >= LEAST_POINTS else 0
        first = last
        size = _polyline(run, spans[:parts], local, found)
        for row in range(found, found + size):
            local.clusters[row] = clusters
        clusters += size > 0
        found += size
    return found


@inner
def _first_gap(joined: Bool) -> int:
    """The first return that is not joined to the next one; their number if all are."""
    place = 0
    while place < len(joined) and joined[place]:
        place += 1
    return place


@inner
def _part(beams: Beams, first: int, last: int) -> Beams:
    """The beams from one up to another."""
    return Beams(beams.units[first:last], beams.ranges[first:last], beams.deviations[first:last])


@inner
def _polyline(beams: Beams, spans: Records, local: LocalWalls, begin: int) -> int:
    """Fill in the segments of one cluster of walls (m,), joined at corners; returns how many."""
    rows = 0
    ends = local.ends[begin:]
    weakest_direction = 0.15  # [rad] Largest standard deviation of the direction of a segment.
    for wall in range(len(spans)):
        span = spans[wall]
        fit = local.fits[begin + rows]
        run = _part(beams, span.first, span.last + 1)
        x, y = fit_wall(run)
        _measure(run, x, y, fit)
        size = np.sqrt(x * x + y * y)
        nx = x / size
        ny = y / size
        spread = fit.xx * ny * ny + fit.yy * nx * nx
        spread -= 2.0 * fit.xy * nx * ny
        if not spread * weakest_direction**2 > 1.0:
            continue
        span.x = x
        span.y = y
        spans[rows] = span
        fit.points = span.last - span.first + 1
        for k in range(2):
            beam = span.last if k else span.first
            # A noisy end goes along its beam onto the wall; near-parallel ones stay put.
            ux, uy = beams.units[beam]
            reach = beams.ranges[beam]
            slope = ux * x + uy * y
            if slope > 0.0 and abs(1.0 / slope - reach) <= END_DEVIATIONS * beams.deviations[beam]:
                reach = 1.0 / slope
            ends[rows, 2 * k] = reach * ux
            ends[rows, 2 * k + 1] = reach * uy
        rows += 1
    _join_corners(beams, spans[:rows], ends)
    return rows


@inner
def _join_corners(beams: Beams, spans: Records, ends: Float) -> None:
    """Move the ends of walls (n,) of one cluster that meet at a corner to that corner."""
    # [sine] Least angle of a corner of a scan: lines that are almost parallel cross at an arbitrary
    # place.
    scan_corner_sine = 0.2
    # [beams] Largest distance between the ends of two walls of a scan that share a corner.
    scan_corner_beams = 3
    # [steps] Largest distance from the two ends to the corner, relative to their distance and
    # noise.
    scan_corner_steps = 1.5
    for row in range(len(spans) - 1):
        one = spans[row]
        other = spans[row + 1]
        turn = one.x * other.y - one.y * other.x
        lengths = np.sqrt((one.x**2 + one.y**2) * (other.x**2 + other.y**2))
        if abs(turn) < scan_corner_sine * lengths or other.first - one.last > scan_corner_beams:
            continue
        x = (other.y - one.y) / turn
        y = (one.x - other.x) / turn
        ax, ay = end_of(ends[row], 1)
        bx, by = end_of(ends[row + 1], 0)
        step = np.hypot(ax - bx, ay - by) + CLUSTER_DEVIATIONS * beams.deviations[one.last]
        if max(np.hypot(x - ax, y - ay), np.hypot(x - bx, y - by)) <= scan_corner_steps * step:
            put_line(ends[row], *end_of(ends[row], 0), x, y)
            put_line(ends[row + 1], x, y, *end_of(ends[row + 1], 1))


@inner
def _measure(beams: Beams, x: float, y: float, fit: Any) -> None:
    """Fill in the moments of the points of a wall n/c = (x, y), each with its own variance."""
    size = np.sqrt(x * x + y * y)
    fit.weight = fit.x = fit.y = fit.xx = fit.xy = fit.yy = 0.0
    for i in range(len(beams.ranges)):
        ux, uy = beams.units[i]
        incidence = max(abs(ux * x + uy * y) / size, LEAST_INCIDENCE)
        weight = 1.0 / (beams.deviations[i] * incidence) ** 2
        add_point(fit, weight, beams.ranges[i] * ux, beams.ranges[i] * uy)


@compiled
def segment_cluster(returns: Beams, spans: Records) -> int:
    """Divide a cluster of returns into walls (≥ n // LEAST_POINTS,); returns how many.

    Returns between the last of one and the first of the next belong to no wall.
    """
    beams, ranges, deviations = returns
    count = len(ranges)
    sums = np.zeros(count + 1, SUMS)
    for i in range(count):
        cos, sin = beams[i]
        square = ranges[i] * ranges[i]
        # The inverse range and its fit are both scaled by r², which keeps the numbers near 1.
        weight = square * square / (deviations[i] * deviations[i])
        inverse = 1.0 / ranges[i]
        before = sums[i]
        after = sums[i + 1]
        after.cc = before.cc + weight * cos * cos
        after.cs = before.cs + weight * cos * sin
        after.ss = before.ss + weight * sin * sin
        after.ci = before.ci + weight * cos * inverse
        after.si = before.si + weight * sin * inverse
        after.ii = before.ii + weight * inverse * inverse
    best = np.zeros(count + 1)
    origin = np.zeros(count + 1, np.int64)
    # Where a wall may still begin; a beginning that costs too much is dropped for good.
    open_first = np.empty(count + 1, np.int64)
    opened = 0
    for last in range(1, count + 1):
        # The last point lies on no wall …
        cheapest = best[last - 1] + OUTLIER_COST
        choice = -1
        # … or it ends a wall that begins behind the point `first`.
        if last >= LEAST_POINTS:
            open_first[opened] = last - LEAST_POINTS
            opened += 1
        total = sums[last]
        kept = 0
        for place in range(opened):
            first = open_first[place]
            start = sums[first]
            cc = total.cc - start.cc
            cs = total.cs - start.cs
            ss = total.ss - start.ss
            ci = total.ci - start.ci
            si = total.si - start.si
            determinant = cc * ss - cs * cs
            misfit = 0.0
            if determinant > 1e-14 * cc * ss:
                explained = (ss * ci * ci - 2.0 * cs * ci * si + cc * si * si) / determinant
                misfit = max(total.ii - start.ii - explained, 0.0)
                cost = best[first] + misfit + WALL_COST
                if cost < cheapest:
                    cheapest = cost
                    choice = first
            # Points that are added only raise the misfit, so a beginning that costs more
            # without its wall than the best division does is never chosen later.
            if best[first] + misfit <= cheapest + PRUNED_COST:
                open_first[kept] = first
                kept += 1
        opened = kept
        best[last] = cheapest
        origin[last] = choice
    return _fill_spans(origin, spans)


@inner
def _fill_spans(origin: Int, spans: Records) -> int:
    """Fill in the walls of the cheapest division, by where each begins; returns how many."""
    found = 0
    last = len(origin) - 1
    while last > 0:
        if origin[last] >= 0:
            spans[found].first = origin[last]
            spans[found].last = last - 1
            found += 1
        last = origin[last] if origin[last] >= 0 else last - 1
    for i in range(found // 2):
        one = spans[i]
        other = spans[found - 1 - i]
        one.first, other.first = other.first, one.first
        one.last, other.last = other.last, one.last
    return found


@compiled
def fit_wall(returns: Beams) -> tuple[float, float]:
    """The wall n/c [1/m] that fits returns best: 1/r = (n/c)·beam."""
    beams, ranges, deviations = returns
    cc = cs = ss = ci = si = 0.0
    # In the frame of the middle beam the two unknowns are all but uncorrelated, so that a wall
    # seen under a tiny angle loses no digits.
    ax, ay = beams[len(ranges) // 2]
    for i in range(len(ranges)):
        ux, uy = beams[i]
        cos = ux * ax + uy * ay
        sin = uy * ax - ux * ay
        square = ranges[i] * ranges[i]
        weight = square * square / (deviations[i] * deviations[i])
        cc += weight * cos * cos
        cs += weight * cos * sin
        ss += weight * sin * sin
        ci += weight * cos / ranges[i]
        si += weight * sin / ranges[i]
    determinant = cc * ss - cs * cs
    if determinant <= 0.0:
        return ax * ci / cc, ay * ci / cc
    along = (ss * ci - cs * si) / determinant
    aside = (cc * si - cs * ci) / determinant
    return along * ax - aside * ay, along * ay + aside * ax


@dataclass(frozen=True, slots=True)
class LikelihoodExtractor:
    """Extracts the most likely walls of a scan under the noise of its ranges.

    A gap [m] separates clusters at any distance; sigma is the standard deviation of the noise at
    range_max [m] (Eq. 7), and the floor that at zero distance.
    """

    gap: float
    sigma: float
    floor: float

    def noise(self, scan: LaserScan) -> RangeNoise:
        """The noise that a scan's ranges have (Eq. 7, and the floor)."""
        range_max = scan.range_max if scan.range_max < MOST_RANGE else USUAL_RANGE
        return RangeNoise.from_sigma(self.sigma, self.floor, range_max)

    def walls(self, scan: LaserScan, heading: float, noise: RangeNoise) -> LocalWalls:
        """Walls of a scan around the laser's place, in a frame where it has a heading [rad]."""
        most = len(scan.ranges) // LEAST_POINTS
        local = LocalWalls(np.empty((most, 4)), np.zeros(most, FIT), np.empty(most, np.int64))
        range_max = min(float(scan.range_max), MOST_RANGE)
        angles, ranges = map(plain, in_order(scan))
        found = slice(extract_walls(heading, angles, ranges, range_max, noise, self.gap, local))
        return LocalWalls._make(column[found] for column in local)

    def local_map(self, scan: LaserScan) -> LineMap:
        """The walls of one scan in the world; those of a cluster are an object."""
        found = self.walls(scan, float(scan.pose.theta), self.noise(scan))
        return solid_map(
            found.ends + np.tile(scan.pose[:2], 2), found.clusters, found.fits["points"]
        )
