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


def surface_of_scan(
    scan: LaserScan, laser: Float, noise: float = LEAST_NOISE, heading: float = 0.0
) -> Float:
    """The surface (m, 4) that a scan shows, in the frame of a robot.

    Its laser is at (2,) [m] on the robot, and has a heading [rad] there.
    """
    hits, directions = scan.hits, scan.angles + heading
    angles, ranges = directions[hits], scan.ranges[hits]
    points = ranges[:, None] * beam_directions(0.0, angles)
    step = abs(float(directions[-1] - directions[0])) / max(len(directions) - 1, 1)
    found = np.vstack([_posts(points, ranges, angles, step, noise), _walls(points, step, noise)])
    found[:, :2] += laser
    return found


def _posts(points: Float, ranges: Float, angles: Float, step: float, noise: float) -> Float:
    """The posts (p, 4) among points (n, 2), as seen from the laser.

    They stand before what their neighbours on both sides hit: an edge of what is partly hidden is
    elsewhere as soon as the robot moves.
    """
    gaps = np.hypot(*np.diff(points, axis=0).T)
    apart = gaps > np.maximum(
        CONNECTED + 0.5 * CONNECTED_GROWTH * ranges[:-1], CONNECTED_NOISE * noise
    )
    if apart.sum() < 2:
        return np.empty((0, 4))
    # Between two gaps lie the points of one thing; beyond them, its neighbours.
    left, right = np.flatnonzero(apart)[:-1], np.flatnonzero(apart)[1:] + 1
    first, last = left + 1, right - 1
    missed = np.abs(np.diff(angles)) > 1.5 * step
    before = missed[left] | (ranges[left] > ranges[first])
    behind = missed[last] | (ranges[right] > ranges[last])
    wide = np.hypot(*(points[last] - points[first]).T)
    narrow = before & behind & (wide < WIDEST_POST) & (last - left >= LEAST_HITS)
    sums = np.vstack([np.zeros(2), np.cumsum(points, axis=0)])
    middles = (sums[right] - sums[first]) / (last - left)[:, None]
    return np.pad(middles[narrow], ((0, 0), (0, 2)))


@compiled
def _walls(points: Float, step: float, noise: float) -> Float:
    """Those of points (n, 2) that lie on straight walls (m, 4), seen in this order from (0, 0)."""
    found = np.empty((len(points), 4))
    kept = 0
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        away = np.hypot(x, y)
        first = _reach(points, i, -1, away, step, noise)
        last = _reach(points, i, 1, away, step, noise)
        number = last - first + 1
        mean_x, mean_y = points[first : last + 1, 0].mean(), points[first : last + 1, 1].mean()
        xx = xy = yy = 0.0
        for k in range(first, last + 1):
            dx, dy = points[k, 0] - mean_x, points[k, 1] - mean_y
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
        root = np.hypot(0.5 * (xx - yy), xy)
        across, along = 0.5 * (xx + yy) - root, 0.5 * (xx + yy) + root
        straight = STRAIGHT + STRAIGHT_GROWTH * max(away - FAR_OFF, 0.0)
        straight = max(straight, STRAIGHT_NOISE * noise)
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        nx, ny = -np.sin(angle), np.cos(angle)
        facing = -(nx * x + ny * y)
        if (
            number < 3
            or across > number * straight * straight
            or across > 0.1 * along
            or abs(facing) <= FLATTEST * away
        ):
            continue
        if facing < 0.0:
            nx, ny = -nx, -ny
        # The point moves onto its line but stays where it was along it.
        off = nx * (x - mean_x) + ny * (y - mean_y)
        found[kept] = np.array([x - off * nx, y - off * ny, nx, ny])
        kept += 1
    return found[:kept]


@inner
def _reach(points: Float, i: int, side: int, away: float, step: float, noise: float) -> int:
    """The last point on one side of a point that its normal takes in."""
    baseline = BASELINE + BASELINE_GROWTH * max(away - FAR_OFF, 0.0)
    baseline = max(baseline, BASELINE_NOISE * noise)
    gap = CONNECTED + away * max(CONNECTED_GROWTH, CONNECTED_SPACING * step)
    gap = max(gap, CONNECTED_NOISE * noise)
    most = int(MOST_TO_SIDE * max(1.0, BASELINE_NOISE * noise / BASELINE))
    end = i
    for number in range(most):
        k = end + side
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


def moved(surface: Float, pose: Float) -> Float:
    """A surface (m, 4) as it lies after it was moved by a pose (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    there: Float = (surface.reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]])).reshape(-1, 4)
    there[:, :2] += pose[:2]
    return there


@compiled
def thinned(surface: Float) -> Float:
    """A surface (m, 4) as a map needs it: near walls are seen at points a centimetre apart."""
    kept = np.ones(len(surface), np.bool_)
    last = 0
    for i in range(1, len(surface)):
        dx, dy = surface[i, 0] - surface[last, 0], surface[i, 1] - surface[last, 1]
        facing = surface[i, 2] * surface[last, 2] + surface[i, 3] * surface[last, 3]
        kept[i] = dx * dx + dy * dy >= THINNED * THINNED or facing <= 0.98
        last = i if kept[i] else last
    return surface[kept]


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


@compiled
def _sorted(surface: Float) -> tuple[Float, Int, Float, Float]:
    """The fields of the grid of a surface (m, 4)."""
    left, low = surface[:, 0].min(), surface[:, 1].min()
    width, height = surface[:, 0].max() - left, surface[:, 1].max() - low
    cell = max(CELL, np.sqrt(width * height / MOST_CELLS))
    # One empty cell all around spares lookups from asking whether a neighbour exists.
    columns, rows = int(width / cell) + 3, int(height / cell) + 3
    first = np.zeros(columns * rows + 1, np.int64)
    places = np.empty(len(surface), np.int64)
    for i in range(len(surface)):
        column, row = int((surface[i, 0] - left) / cell), int((surface[i, 1] - low) / cell)
        places[i] = (row + 1) * columns + column + 1
        first[places[i] + 1] += 1
    first = np.cumsum(first)
    # Sorted by counting: a third of the time of a merge sort.
    filled, order = first[:-1].copy(), np.empty(len(surface), np.int64)
    for i in range(len(surface)):
        order[filled[places[i]]] = i
        filled[places[i]] += 1
    corner = np.array([left - cell, low - cell])
    return surface[order], first, corner, np.array([columns, rows, cell])


def wall_map(parts: Iterable[tuple[Float, Float]]) -> SurfaceGrid | None:
    """The map of surfaces (m, 4) at poses (3,); None if there is no point in it."""
    clouds = [moved(surface, pose) for surface, pose in parts]
    cloud = np.concatenate(clouds) if clouds else np.empty((0, 4))
    return grid_of(cloud) if len(cloud) else None
