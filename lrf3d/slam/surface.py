"""Surfaces: what a scan saw, as points with normals, and a grid that finds those near a place.

The points of a scan enter, in the order in which the beams turn; a surface leaves, rows x, y [m] of
a point and a unit normal there. On a straight piece of wall the normal is that of the wall, and
faces the laser. A trunk or the leg of a table is a post: one point, whose normal is zero.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import beam_directions

FAR_OFF = 8.0
"""From this range on [m] beams stand so far apart that normals take in more of what they hit."""

BASELINE, BASELINE_GROWTH, BASELINE_NOISE = 0.15, 0.06, 8.0
"""How far a normal reaches to both sides [m]: at 1 m range beams stand 2 cm apart, and the noise of
a centimetre would turn the normal of adjacent points at will. Far off it reaches this much more a
metre, and with a noisy laser as many deviations."""

LEAST_TO_SIDE, MOST_TO_SIDE = 2, 8
"""Points that a normal takes in to each side: at least, which is what lasers of few beams show of a
wall, and at most, which bounds its cost near a wall; of noisy ones more."""

CONNECTED, CONNECTED_GROWTH, CONNECTED_SPACING, CONNECTED_NOISE = 0.2, 0.1, 3.0, 5.0
"""Following points are of one surface if at most this far apart [m], and this share of the range
more: beams fan out, and meet walls under flat angles. Lasers of few beams need the third, spacings
of their beams, and noisy ones the last, deviations."""

STRAIGHT, STRAIGHT_GROWTH, STRAIGHT_NOISE = 0.03, 0.006, 1.5
"""Largest RMS distance [m] of points to their line: three times a usual range noise; this much more
a metre far off, for hedges there are as good as walls; and in deviations of a noisy laser."""

FLATTEST = 0.1
"""Least cosine between beam and normal: a line that the beam runs along joins two surfaces."""

WIDEST_POST, LEAST_HITS = 0.6, 2
"""Largest extent of a post [m], and how many beams have to hit it: a single one may be noise."""

THINNED = 0.05
"""Points of a map's wall lie at least this far apart [m]: 0.03 takes a tenth more time for the same
errors."""

ALONG = 0.25
"""How far along a wall a point of it speaks for the wall [m]."""

CELL = 0.3
"""Side of a cell of the grid [m]; lookups see a cell and those around it."""

MOST_CELLS = 4_000_000
"""Cells that a grid has at most; if there were more, they are made larger."""

LEAST_NOISE = 0.01
"""Noise of a usual range [m]; that of a scan is never taken for less."""


def range_noise(scan: LaserScan) -> float:
    """The standard deviation [m] of a scan's ranges, from how rough they are from beam to beam.

    The second differences of a smooth wall's ranges are those of the noise alone, and the median
    ignores the edges. It is 0 for a scan of too few hits.
    """
    ranges = np.where(scan.hits, scan.ranges, np.nan)
    rough = np.abs(ranges[2:] - 2.0 * ranges[1:-1] + ranges[:-2])
    known = rough[np.isfinite(rough)]
    return float(1.4826 * np.median(known) / np.sqrt(6.0)) if len(known) else 0.0


def surface_of_scan(scan: LaserScan, laser: Float, noise: float = LEAST_NOISE) -> Float:
    """The surface (m, 4) that a scan shows, in the frame of a robot with its laser at (2,) [m]."""
    hits = scan.hits
    points = scan.ranges[hits, None] * beam_directions(0.0, scan.angles[hits]) + laser
    step = abs(float(scan.angles[-1] - scan.angles[0])) / max(len(scan.angles) - 1, 1)
    return surface_of(points, laser, step, noise)


@compiled
def surface_of(points: Float, laser: Float, step: float, noise: float) -> Float:
    """Surface (m, 4) of points (n, 2) [m] seen in this order from the laser at (2,) [m].

    The step [rad] is that between beams, the noise [m] that of ranges.
    """
    count = len(points)
    found = np.empty((2 * count, 4))
    kept = _posts(points, laser, step, noise, found)
    for i in range(count):
        beam_x, beam_y = points[i, 0] - laser[0], points[i, 1] - laser[1]
        away = np.sqrt(beam_x * beam_x + beam_y * beam_y)
        if away == 0.0:
            continue
        first = _reach(points, i, -1, away, step, noise)
        last = _reach(points, i, 1, away, step, noise)
        number = last - first + 1
        mean_x = mean_y = 0.0
        for k in range(first, last + 1):
            mean_x += points[k, 0] / number
            mean_y += points[k, 1] / number
        xx = xy = yy = 0.0
        for k in range(first, last + 1):
            dx, dy = points[k, 0] - mean_x, points[k, 1] - mean_y
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
        half = 0.5 * (xx - yy)
        root = np.sqrt(half * half + xy * xy)
        across = max(0.5 * (xx + yy) - root, 0.0)
        along = 0.5 * (xx + yy) + root
        farther = max(away - FAR_OFF, 0.0)
        straight = max(STRAIGHT + STRAIGHT_GROWTH * farther, STRAIGHT_NOISE * noise)
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        nx, ny = -np.sin(angle), np.cos(angle)
        facing = -(nx * beam_x + ny * beam_y)
        if (
            number < 3
            or across > number * straight * straight
            or across > 0.1 * along
            or abs(facing) < FLATTEST * away
        ):
            continue
        if facing < 0.0:
            nx, ny = -nx, -ny
        # The point moves onto its line but stays where it was along it.
        off = nx * (points[i, 0] - mean_x) + ny * (points[i, 1] - mean_y)
        found[kept, 0] = points[i, 0] - off * nx
        found[kept, 1] = points[i, 1] - off * ny
        found[kept, 2] = nx
        found[kept, 3] = ny
        kept += 1
    return found[:kept]


@inner
def _posts(points: Float, laser: Float, step: float, noise: float, found: Float) -> int:
    """Write the posts among points (n, 2) to the first rows of a surface; returns how many.

    They stand before what their neighbours on both sides hit: an edge of what is partly hidden is
    elsewhere as soon as the robot moves.
    """
    kept = first = 0
    away = np.sqrt((points[:, 0] - laser[0]) ** 2 + (points[:, 1] - laser[1]) ** 2)
    for i in range(len(points)):
        if i + 1 < len(points) and _gap_between(points, i, i + 1, away, noise) <= 0.0:
            continue
        wide = np.sqrt(np.sum((points[i] - points[first]) ** 2))
        inside = first > 0 and i + 1 < len(points) and i + 1 - first >= LEAST_HITS
        if inside and wide < WIDEST_POST:
            before = _hidden(points, first, first - 1, laser, away, step)
            if before and _hidden(points, i, i + 1, laser, away, step):
                number = i + 1 - first
                found[kept, 0] = np.sum(points[first : i + 1, 0]) / number
                found[kept, 1] = np.sum(points[first : i + 1, 1]) / number
                found[kept, 2] = found[kept, 3] = 0.0
                kept += 1
        first = i + 1
    return kept


@inner
def _gap_between(points: Float, i: int, k: int, away: Float, noise: float) -> float:
    """How much farther [m] two points are apart than those of one post may be."""
    apart = np.sqrt(np.sum((points[i] - points[k]) ** 2))
    return float(apart - max(CONNECTED + 0.5 * CONNECTED_GROWTH * away[i], CONNECTED_NOISE * noise))


@inner
def _hidden(points: Float, i: int, k: int, laser: Float, away: Float, step: float) -> bool:
    """Whether the neighbour of a point lies behind it, or beams between them met nothing."""
    ux, uy = points[i, 0] - laser[0], points[i, 1] - laser[1]
    vx, vy = points[k, 0] - laser[0], points[k, 1] - laser[1]
    angle = np.abs(np.arctan2(ux * vy - uy * vx, ux * vx + uy * vy))
    return bool(away[k] > away[i] or angle > 1.5 * step)


@inner
def _reach(points: Float, i: int, way: int, away: float, step: float, noise: float) -> int:
    """The last point on one side of a point that its normal takes in."""
    baseline = BASELINE + BASELINE_GROWTH * max(away - FAR_OFF, 0.0)
    baseline = max(baseline, BASELINE_NOISE * noise)
    gap = CONNECTED + away * max(CONNECTED_GROWTH, CONNECTED_SPACING * step)
    gap = max(gap, CONNECTED_NOISE * noise)
    most = int(MOST_TO_SIDE * max(1.0, BASELINE_NOISE * noise / BASELINE))
    end = i
    for number in range(most):
        k = end + way
        if k < 0 or k >= len(points):
            break
        dx, dy = points[k, 0] - points[end, 0], points[k, 1] - points[end, 1]
        if dx * dx + dy * dy > gap * gap:
            break
        end = k
        dx, dy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
        if number + 1 >= LEAST_TO_SIDE and dx * dx + dy * dy > baseline * baseline:
            break
    return end


@compiled
def moved(surface: Float, pose: Float) -> Float:
    """A surface (m, 4) as it lies after it was moved by a pose (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    there = np.empty(surface.shape)
    for i in range(len(surface)):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        there[i, 0] = pose[0] + cos * x - sin * y
        there[i, 1] = pose[1] + sin * x + cos * y
        there[i, 2] = cos * nx - sin * ny
        there[i, 3] = sin * nx + cos * ny
    return there


@compiled
def thinned(surface: Float) -> Float:
    """A surface (m, 4) as a map needs it: near walls are seen at points a centimetre apart."""
    chosen = np.empty(len(surface), np.int64)
    count = last = 0
    for i in range(len(surface)):
        dx, dy = surface[i, 0] - surface[last, 0], surface[i, 1] - surface[last, 1]
        facing = surface[i, 2] * surface[last, 2] + surface[i, 3] * surface[last, 3]
        if i == 0 or dx * dx + dy * dy >= THINNED * THINNED or facing <= 0.98:
            last = chosen[count] = i
            count += 1
    return surface[chosen[:count]]


class SurfaceGrid(NamedTuple):
    """A surface (m, 4) sorted into square cells: the number of the first point of each cell.

    The size (3,) holds columns, rows and the side of a cell [m].
    """

    surface: Float
    first: Int
    corner: Float
    size: Float


def grid_of(surface: Float) -> SurfaceGrid:
    """Sort a surface (m, 4), which may not be empty, into cells."""
    return SurfaceGrid(*_sorted(surface))


def wall_map(parts: Iterable[tuple[Float, Float]]) -> SurfaceGrid | None:
    """The map of surfaces (m, 4) at poses (3,); None if there is no point in it."""
    clouds = [moved(surface, pose) for surface, pose in parts]
    cloud = np.concatenate(clouds) if clouds else np.empty((0, 4))
    return grid_of(cloud) if len(cloud) else None


@compiled
def _sorted(surface: Float) -> tuple[Float, Int, Float, Float]:
    """The fields of the grid of a surface (m, 4)."""
    left = right = surface[0, 0]
    low = high = surface[0, 1]
    for i in range(len(surface)):
        left, right = min(left, surface[i, 0]), max(right, surface[i, 0])
        low, high = min(low, surface[i, 1]), max(high, surface[i, 1])
    cell = max(CELL, np.sqrt((right - left) * (high - low) / MOST_CELLS))
    # One empty cell all around spares lookups from asking whether a neighbour exists.
    columns = int((right - left) / cell) + 3
    rows = int((high - low) / cell) + 3
    corner = np.array([left - cell, low - cell])
    size = np.array([float(columns), float(rows), cell])
    first = np.zeros(columns * rows + 1, np.int64)
    places = np.empty(len(surface), np.int64)
    for i in range(len(surface)):
        column = int((surface[i, 0] - corner[0]) / cell)
        row = int((surface[i, 1] - corner[1]) / cell)
        places[i] = row * columns + column
        first[places[i] + 1] += 1
    for k in range(columns * rows):
        first[k + 1] += first[k]
    filled = first[:-1].copy()
    ordered = np.empty(surface.shape)
    for i in range(len(surface)):
        target = filled[places[i]]
        filled[places[i]] += 1
        for k in range(4):
            ordered[target, k] = surface[i, k]
    return ordered, first, corner, size
