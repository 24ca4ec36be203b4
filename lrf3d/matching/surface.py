"""Surfaces: the walls that a scan shows, as points with normals, and a grid to look them up.

Scans enter; rows of `SURFACE` leave. The normal of a point on a straight wall faces the laser. A
post, such as a trunk or the leg of a table, is one point without a normal.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lrf3d.compiling import LANES, borrower, compiled, inner, record
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserScan

# A point [m] and the unit normal there, which is zero at a post.
SURFACE = record(x=float, y=float, nx=float, ny=float)

# Standard deviations up to which an error is taken for noise: the three-sigma rule.
DEVIATIONS = 3.0

# Range [m] beyond which a normal has a longer baseline and a wall may be less straight, as beams
# fan out.
FAR_OFF = 8.0

# Largest gap between adjacent points of one surface near the laser [m].
CONNECTED = 0.2

# Growth of that gap with the range, as a share of it.
CONNECTED_GROWTH = 0.1

# Smallest value of that gap in beam spacings, for lasers of few beams.
CONNECTED_SPACING = 3.0

# Smallest value of that gap in standard deviations of the range noise.
CONNECTED_NOISE = 5.0

# Least cosine between beam and normal: a line along the beam is no wall, but joins two surfaces.
FLATTEST = 0.1

# Distance along a wall over which a map point supports it [m].
ALONG = 0.25

# Least side of a grid cell [m]; lookups read 3 by 3 cells.
CELL = 0.3

# Largest number of cells in a grid: above it, cells grow.
MOST_CELLS = 4_000_000

# Least standard deviation of the range noise that is assumed [m].
LEAST_NOISE = 0.01


class Placement(NamedTuple):
    """A pose as kernels use it."""

    x: float
    y: float
    cos: float
    sin: float


@inner
def placement(pose: Float) -> Placement:
    """Convert a pose (3,) to a position and the cosine and sine of its heading."""
    return Placement(pose[0], pose[1], np.cos(pose[2]), np.sin(pose[2]))


def range_noise(scan: LaserScan) -> float:
    """Estimate the standard deviation [m] of a scan's ranges; 0 where there are too few.

    On a straight wall the inverse range of a beam follows from those of its neighbours, however far
    apart beams lie; the deviation is noise. The median over beams on one surface ignores corners.
    """
    ranges = np.where(scan.hits, scan.ranges, np.nan)
    # The median gives a standard deviation, and a second difference has six times the variance.
    return float(1.4826 * _second_difference(ranges, np.array(scan.angles)) / np.sqrt(6))


@compiled
def _second_difference(ranges: Float, angles: Float) -> float:
    """Median distance of ranges (n,) from the line through their neighbours on a surface [m].

    Ranges may be 0 or NaN, and angles equal: those are left out. It is 0 where none are left.
    """
    found = np.empty(len(ranges))
    count = 0
    for k in range(1, len(ranges) - 1):
        before = ranges[k - 1]
        middle = ranges[k]
        after = ranges[k + 1]
        share_before = np.sin(angles[k + 1] - angles[k]) / before
        share_after = np.sin(angles[k] - angles[k - 1]) / after
        inverse = (share_before + share_after) / np.sin(angles[k + 1] - angles[k - 1])
        rough = 2.0 * abs(inverse - 1.0 / middle) * middle * middle
        # Gap [m] in a surface even where the noise is 0.3 m; it grows twice as fast as `CONNECTED`.
        apart = 0.5 + 2.0 * CONNECTED_GROWTH * middle
        if max(abs(before - middle), abs(after - middle)) < apart and np.isfinite(rough):
            found[count] = rough
            count += 1
    return np.median(found[:count]) if count else 0.0


def points_of(scan: LaserScan, mount: Pose) -> Records:
    """The returns of a scan as points without normals, in the frame of the robot."""
    hits = scan.hits
    ranges = scan.ranges[hits]
    headings = scan.angles[hits] + mount.theta
    points = np.zeros(len(ranges), SURFACE)
    points["x"] = ranges * np.cos(headings) + mount.x
    points["y"] = ranges * np.sin(headings) + mount.y
    return points


def surface_of_scan(scan: LaserScan, mount: Pose, points: Records, noise: float) -> Records:
    """Convert a scan and its `points_of`, by the mount of its laser, to the surface they show."""
    x, y, _ = mount
    step = abs(float(scan.angles[-1] - scan.angles[0])) / max(len(scan.angles) - 1, 1)
    posts = _posts(points, scan.ranges[scan.hits], scan.angles[scan.hits], step, noise)
    return concatenated([posts, _walls(points, x, y, step, noise)])


def concatenated(surfaces: Iterable[Records]) -> Records:
    """Join surfaces, as plain numbers: joining records takes ten times as long."""
    parts = [np.ascontiguousarray(each) for each in surfaces if len(each)]
    if len(parts) == 1:
        return parts[0].view(SURFACE)
    numbers = [np.empty(0), *(each.view(np.float64) for each in parts)]
    one: Records = np.concatenate(numbers).view(SURFACE)
    return one


@compiled
def _posts(points: Records, ranges: Float, angles: Float, step: float, noise: float) -> Records:
    """The posts among points (n,) of beams with ranges and angles (n,).

    A post stands in front of its neighbours on both sides. An object that one of them partly hides
    is left out: its visible edge would move with the robot.
    """
    widest_post = 0.6  # Largest extent of a post [m].
    least_hits = 2  # Fewest points of a post, as one may be noise.
    missed = 1.5 * step  # Angle between hits [rad] beyond which a beam between them had no return.
    posts = np.zeros_like(points)
    found = 0
    left = -1
    for k in range(len(points) - 1):
        apart = max(CONNECTED + 0.5 * CONNECTED_GROWTH * ranges[k], CONNECTED_NOISE * noise)
        if np.hypot(points[k + 1].x - points[k].x, points[k + 1].y - points[k].y) <= apart:
            continue
        # Between two gaps lie the points of one object; beyond them, its neighbours.
        first = left + 1
        number = k - left
        wide = np.hypot(points[k].x - points[first].x, points[k].y - points[first].y)
        if left >= 0 and number >= least_hits and wide < widest_post:
            before = abs(angles[first] - angles[left]) > missed or ranges[left] > ranges[first]
            behind = abs(angles[k + 1] - angles[k]) > missed or ranges[k + 1] > ranges[k]
            if before and behind:
                posts[found].x = points["x"][first : k + 1].mean()
                posts[found].y = points["y"][first : k + 1].mean()
                found += 1
        left = k
    return posts[:found]


class Line(NamedTuple):
    """A line by a point [m], its unit normal, and the variance of points about it [m²]."""

    x: float
    y: float
    nx: float
    ny: float
    variance: float


@borrower
def _line(points: Records, first: int, last: int) -> Line:
    """The line through points from a first to a last one; its variance is inf if they form none."""
    number = last - first + 1
    mean_x = mean_y = 0.0
    for k in range(first, last + 1):
        mean_x += points[k].x / number
        mean_y += points[k].y / number
    xx = xy = yy = 0.0
    for k in range(first, last + 1):
        dx = points[k].x - mean_x
        dy = points[k].y - mean_y
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
    root = np.hypot(0.5 * (xx - yy), xy)
    across = 0.5 * (xx + yy) - root
    along = 0.5 * (xx + yy) + root
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    widest = 0.1  # Variance of a line across, as a share of that along it.
    variance = np.inf if number < 3 or across > widest * along else across / (number - 2)
    return Line(mean_x, mean_y, -np.sin(angle), np.cos(angle), variance)


@compiled
def _walls(points: Records, laser_x: float, laser_y: float, step: float, noise: float) -> Records:
    """The points on straight walls, among points (n,), with normals that face their laser."""
    found = points.copy()
    kept = 0
    # Largest RMS distance of points from their line [m].
    rms_limit = 0.03
    # Its growth per metre beyond `FAR_OFF`, where hedges serve as walls.
    rms_growth = 0.006
    # Its least value in standard deviations of the range noise.
    rms_noise = 1.5
    for i in range(len(points)):
        x = points[i].x - laser_x
        y = points[i].y - laser_y
        away = np.hypot(x, y)
        first = _reach(points, i, -1, away, step, noise)
        last = _reach(points, i, 1, away, step, noise)
        straight = rms_limit + rms_growth * max(away - FAR_OFF, 0.0)
        straight = max(straight, rms_noise * noise)
        line = _line(points, first, last)
        if line.variance > straight * straight:
            # Around a corner only the points on one side lie on the wall.
            line = _line(points, first, i)
            after = _line(points, i, last)
            if after.variance < line.variance:
                line = after
        facing = -(line.nx * x + line.ny * y)
        if line.variance > straight * straight or abs(facing) <= FLATTEST * away:
            continue
        sense = 1.0 if facing > 0.0 else -1.0
        # The point moves onto its line but stays where it was along it.
        off = line.nx * (points[i].x - line.x) + line.ny * (points[i].y - line.y)
        wall = found[kept]
        wall.x = points[i].x - off * line.nx
        wall.y = points[i].y - off * line.ny
        wall.nx = sense * line.nx
        wall.ny = sense * line.ny
        kept += 1
    return found[:kept]


@borrower
def _reach(points: Records, i: int, side: int, away: float, step: float, noise: float) -> int:
    """The last point of a point's baseline on one side."""
    # Half the baseline of a normal [m], which is as long as a cell.
    half_baseline = 0.5 * CELL
    # Its growth per metre beyond `FAR_OFF`.
    baseline_growth = 0.06
    # Its least size in standard deviations of the range noise: adjacent points 2 cm apart would
    # give random normals.
    baseline_noise = 8.0
    baseline = half_baseline + baseline_growth * max(away - FAR_OFF, 0.0)
    baseline = max(baseline, baseline_noise * noise)
    gap = CONNECTED + away * max(CONNECTED_GROWTH, CONNECTED_SPACING * step)
    gap = max(gap, CONNECTED_NOISE * noise)
    # Fewest points of a baseline on each side: few beams still show a wall.
    least_to_side = 2
    # Most of them, so that near walls cost no more than others; more where the noise is large.
    most_to_side = 8
    most = int(most_to_side * max(1.0, baseline_noise * noise / half_baseline))
    end = i
    for number in range(most):
        k = end + side
        if k < 0 or k >= len(points):
            break
        dx = points[k].x - points[end].x
        dy = points[k].y - points[end].y
        if dx * dx + dy * dy > gap * gap:
            break
        end = k
        dx = points[k].x - points[i].x
        dy = points[k].y - points[i].y
        if number + 1 >= least_to_side and dx * dx + dy * dy > baseline * baseline:
            break
    return end


def moved(surface: Records, pose: Float) -> Records:
    """Move a surface by a pose (3,)."""
    x, y, turn = pose
    cos = np.cos(turn)
    sin = np.sin(turn)
    # Points and normals rotate alike.
    pairs = np.ascontiguousarray(surface).view(np.float64).reshape(-1, 2)
    there = np.ascontiguousarray(pairs @ np.array([[cos, sin], [-sin, cos]]))
    rows: Records = there.reshape(-1, 4).view(SURFACE)[:, 0]
    rows["x"] += x
    rows["y"] += y
    return rows


@compiled
def thinned(surface: Records) -> Records:
    """Drop points of a surface that are too near to the last kept one to add to a map."""
    kept = np.ones(len(surface), np.bool_)
    last = 0
    # Least distance between map points of a wall [m]; 0.03 takes 10 % longer for the same errors.
    spacing = 0.05
    alike = 0.98  # Cosine between normals above which two points belong to one wall.
    for i in range(1, len(surface)):
        point = surface[i]
        before = surface[last]
        dx = point.x - before.x
        dy = point.y - before.y
        facing = point.nx * before.nx + point.ny * before.ny
        kept[i] = dx * dx + dy * dy >= spacing * spacing or facing <= alike
        last = i if kept[i] else last
    return surface[kept]


class SurfaceGrid(NamedTuple):
    """A surface sorted into square cells, with the number of the first point of each cell.

    A cell holds also the points of the cells above and below it, so that lookups read one range of
    rows. The columns (5, m) are x, y [m], nx, ny and the number of the row; whole vectors follow.
    """

    columns: Float
    first: Int
    left: float
    low: float
    wide: int
    high: int
    cell: float  # The side of a cell [m].


def grid_of(surface: Records) -> SurfaceGrid | None:
    """Sort a surface into cells; None if it has no point."""
    return SurfaceGrid(*_sorted(surface)) if len(surface) else None


@compiled
def _sorted(surface: Records) -> tuple[Float, Int, float, float, int, int, float]:
    """The fields of the grid of a surface."""
    left = surface["x"].min()
    low = surface["y"].min()
    width = surface["x"].max() - left
    height = surface["y"].max() - low
    cell = max(CELL, np.sqrt(width * height / MOST_CELLS))
    # An empty cell all around: every point of the surface has neighbours on all sides.
    wide = int(width / cell) + 3
    rows = int(height / cell) + 3
    first = np.zeros(wide * rows + 1, np.int64)
    # The cell below each point.
    below = np.empty(len(surface), np.int64)
    for i in range(len(surface)):
        column = int((surface[i].x - left) / cell)
        row = int((surface[i].y - low) / cell)
        below[i] = row * wide + column + 1
        for up in range(3):
            first[below[i] + up * wide + 1] += 1
    first = np.cumsum(first)
    # Sorted by counting: a third of the time of a merge sort.
    filled = first[:-1].copy()
    # Padding behind the last row: zeros, whose row number is past any end.
    columns = np.zeros((5, 3 * len(surface) + LANES))
    columns[4] = np.inf
    for i in range(len(surface)):
        point = surface[i]
        for up in range(3):
            at = filled[below[i] + up * wide]
            columns[:, at] = (point.x, point.y, point.nx, point.ny, np.float64(at))
            filled[below[i] + up * wide] += 1
    return columns, first, left - cell, low - cell, wide, rows, cell
