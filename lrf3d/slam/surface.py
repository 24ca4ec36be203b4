"""Surfaces: what a scan saw, as points with normals, and a grid that finds those near a place.

The points of a scan enter, in the order in which the beams turn; a surface leaves, rows x, y [m] of
a point on a straight piece of wall and the unit normal of that wall, which faces the laser. Points
with no straight neighbourhood are left out, for no line can be matched to them.

The beams of a sparse laser meet a wall too far apart for that. Its points have unknown normals, for
which a tenth of the direction to the laser stands; a map of many scans finds them.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import beam_directions

BASELINE = 0.15
"""How far a normal reaches to both sides [m]: at 1 m range beams stand 2 cm apart, and the noise of
a centimetre would turn the normal of adjacent points at will."""

MOST_NEIGHBOURS = 8
"""Points that a normal takes in to each side at most, which bounds its cost near a wall."""

CONNECTED, CONNECTED_GROWTH = 0.2, 0.1
"""Following points are of one surface if at most this far apart [m], and this share of the range
more: beams fan out, and meet walls under flat angles."""

STRAIGHT = 0.03
"""Largest RMS distance [m] of points to their line: three times a usual range noise."""

FLATTEST = 0.1
"""Least cosine between beam and normal: a line that the beam runs along joins two surfaces."""

FILLED, FILLED_WITHIN = 0.15, 2.0
"""Points of a map's wall lie at most this far apart [m] where the scan's lie within the second."""

THINNED = 0.05
"""And they lie at least this far apart [m]: 0.03 takes a tenth more time for the same errors."""

UNKNOWN = 0.1
"""Length of the direction to the laser that stands for a normal which is not known."""

LEAST_APART = 0.1
"""Points that give a line lie at least this far apart [m]: a laser meets a wall ahead at one place
again and again."""

LEAST_ON_LINE = 4
"""Points that a line of the map of a sparse laser has at least."""

MOST_AROUND, MOST_LINES = 40, 12
"""Points around one that its normal is found from, and lines to them that are tried, at most."""

CELL = 0.3
"""Side of a cell of the grid [m]; lookups see a cell and those around it."""

MOST_CELLS = 4_000_000
"""Cells that a grid has at most; if there were more, they are made larger."""


@compiled
def surface_of(points: Float, laser: Float) -> Float:
    """Surface (m, 4) of points (n, 2) [m] seen in this order from the laser at (2,) [m]."""
    count = len(points)
    found = np.empty((count, 4))
    kept = 0
    for i in range(count):
        first = _reach(points, laser, i, -1)
        last = _reach(points, laser, i, 1)
        number = last - first + 1
        if number < 3:
            continue
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
        if across > number * STRAIGHT * STRAIGHT or across > 0.1 * along:
            continue
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        nx, ny = -np.sin(angle), np.cos(angle)
        beam_x, beam_y = points[i, 0] - laser[0], points[i, 1] - laser[1]
        reach = np.sqrt(beam_x * beam_x + beam_y * beam_y)
        facing = -(nx * beam_x + ny * beam_y)
        if abs(facing) < FLATTEST * reach:
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
def _reach(points: Float, laser: Float, i: int, way: int) -> int:
    """The last point on one side of a point that its normal takes in."""
    end = i
    for _ in range(MOST_NEIGHBOURS):
        k = end + way
        if k < 0 or k >= len(points):
            break
        dx, dy = points[k, 0] - points[end, 0], points[k, 1] - points[end, 1]
        bx, by = points[end, 0] - laser[0], points[end, 1] - laser[1]
        gap = CONNECTED + CONNECTED_GROWTH * np.sqrt(bx * bx + by * by)
        if dx * dx + dy * dy > gap * gap:
            break
        end = k
        dx, dy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
        if dx * dx + dy * dy > BASELINE * BASELINE:
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
def evenly_spaced(surface: Float) -> Float:
    """A surface (m, 4) as a map needs it: with points at even distances, as far as can be.

    A scanner of few beams sees a wall at points a metre apart, and a scan from elsewhere sees it
    between them; one of many beams sees a near wall at points a centimetre apart, each of which
    would be looked at again and again.
    """
    room = len(surface)
    for i in range(len(surface) - 1):
        room += _between(surface, i)
    whole = np.empty((room, 4))
    place = 0
    last = 0
    for i in range(len(surface)):
        dx, dy = surface[i, 0] - surface[last, 0], surface[i, 1] - surface[last, 1]
        facing = surface[i, 2] * surface[last, 2] + surface[i, 3] * surface[last, 3]
        if i > 0 and dx * dx + dy * dy < THINNED * THINNED and facing > 0.98:
            continue
        last = i
        count = _between(surface, i) if i + 1 < len(surface) else 0
        for part in range(count + 1):
            share = part / (count + 1.0)
            for k in range(4):
                whole[place, k] = surface[i, k]
                if part:
                    whole[place, k] += share * (surface[i + 1, k] - surface[i, k])
            place += 1
    return whole[:place]


@inner
def _between(surface: Float, i: int) -> int:
    """How many points are to be added between a point of a surface and the next."""
    dx, dy = surface[i + 1, 0] - surface[i, 0], surface[i + 1, 1] - surface[i, 1]
    apart = np.sqrt(dx * dx + dy * dy)
    if apart < 2.0 * FILLED or apart > FILLED_WITHIN:
        return 0
    nx, ny = surface[i, 2], surface[i, 3]
    mx, my = surface[i + 1, 2], surface[i + 1, 3]
    # Both normals have to be that of the line between the points.
    if abs(nx * dx + ny * dy) > STRAIGHT or abs(mx * dx + my * dy) > STRAIGHT:
        return 0
    if nx * mx + ny * my < 0.98:
        return 0
    return int(apart / FILLED)


def surface_of_scan(scan: LaserScan, laser: Float, *, sparse: bool) -> Float:
    """The surface (m, 4) that a scan shows, in the frame of a robot with its laser at (2,) [m].

    Args:
        scan: The scan.
        laser: The place of the laser.
        sparse: Whether its beams are too far apart for normals, which stay unknown then.
    """
    hits = scan.hits
    directions = beam_directions(0.0, scan.angles[hits])
    points = scan.ranges[hits, None] * directions + laser
    if sparse:
        return np.column_stack([points, -UNKNOWN * directions])
    return surface_of(points, laser)


def is_unknown(surface: Float) -> Bool:
    """Whether the normal of each point (m,) of a surface (m, 4) is unknown."""
    return np.asarray(np.hypot(surface[:, 2], surface[:, 3]) < 0.5)


class SurfaceGrid(NamedTuple):
    """A surface whose points are sorted into square cells.

    Args:
        surface: (m, 4) the points and normals, cell by cell.
        first: (rows · columns + 1,) the first point of each cell.
        corner: (2,) the lower left corner of the grid [m].
        size: (4,) columns, rows, the side of a cell [m], and how far along a wall a point of it
            speaks for the wall [m].
    """

    surface: Float
    first: Int
    corner: Float
    size: Float


@compiled
def grid_of(surface: Float, along: float) -> SurfaceGrid:
    """Sort a surface (m, 4), which may not be empty, into cells.

    Args:
        surface: The points and normals.
        along: How far along a wall a point of it speaks for the wall [m].
    """
    left = right = surface[0, 0]
    low = high = surface[0, 1]
    for i in range(len(surface)):
        left, right = min(left, surface[i, 0]), max(right, surface[i, 0])
        low, high = min(low, surface[i, 1]), max(high, surface[i, 1])
    cell = max(max(CELL, along), np.sqrt((right - left) * (high - low) / MOST_CELLS))
    # One empty cell all around spares lookups from asking whether a neighbour exists.
    columns = int((right - left) / cell) + 3
    rows = int((high - low) / cell) + 3
    corner = np.array([left - cell, low - cell])
    size = np.array([float(columns), float(rows), cell, along])
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
    return SurfaceGrid(ordered, first, corner, size)


def wall_map(parts: Iterable[tuple[Float, Float]], along: float) -> SurfaceGrid | None:
    """The map of surfaces (m, 4) at poses (3,); None if there is no point in it.

    Args:
        parts: The surfaces and their poses.
        along: How far along a wall a point of it speaks for the wall [m]: see `Resolution`.
    """
    clouds = [moved(surface, pose) for surface, pose in parts]
    cloud = np.concatenate(clouds) if clouds else np.empty((0, 4))
    if not len(cloud):
        return None
    grid = grid_of(cloud, along)
    find_normals(grid)
    return grid


@compiled
def find_normals(grid: SurfaceGrid) -> None:
    """Find the unknown normals of a map's points, from the points around them.

    The wall through a point is the line to one of its neighbours that most of the others lie on. A
    point without such a line keeps its unknown normal: nothing is matched to it.
    """
    columns, rows, cell = int(grid.size[0]), int(grid.size[1]), grid.size[2]
    baseline = grid.size[3]
    cloud = grid.surface.copy()
    near = np.empty((MOST_AROUND, 2))
    for i in range(len(cloud)):
        if not unknown(cloud[i, 2], cloud[i, 3]):
            continue
        x, y, vx, vy = cloud[i, 0], cloud[i, 1], cloud[i, 2], cloud[i, 3]
        column = int((x - grid.corner[0]) / cell)
        row = int((y - grid.corner[1]) / cell)
        count = 0
        for other_row in range(max(row - 1, 0), min(row + 2, rows)):
            begin = grid.first[other_row * columns + max(column - 1, 0)]
            end = grid.first[other_row * columns + min(column + 1, columns - 1) + 1]
            for k in range(begin, end):
                dx, dy = cloud[k, 0] - x, cloud[k, 1] - y
                # What was seen from the other side is the back of a wall.
                if (
                    count < MOST_AROUND
                    and dx * dx + dy * dy < baseline * baseline
                    and vx * cloud[k, 2] + vy * cloud[k, 3] > 0.0
                ):
                    near[count, 0], near[count, 1] = dx, dy
                    count += 1
        most = 0
        best_x = best_y = 0.0
        for k in range(0, count, 1 + count // MOST_LINES):
            away = np.sqrt(near[k, 0] ** 2 + near[k, 1] ** 2)
            if away < LEAST_APART:
                continue
            nx, ny = -near[k, 1] / away, near[k, 0] / away
            on = 0
            for m in range(count):
                if abs(nx * near[m, 0] + ny * near[m, 1]) < STRAIGHT:
                    on += 1
            if on > most:
                most, best_x, best_y = on, nx, ny
        if most < LEAST_ON_LINE:
            continue
        sx = sy = xx = xy = yy = 0.0
        for m in range(count):
            dx, dy = near[m, 0], near[m, 1]
            if abs(best_x * dx + best_y * dy) < STRAIGHT:
                sx += dx
                sy += dy
                xx += dx * dx
                xy += dx * dy
                yy += dy * dy
        number = float(most)
        xx, xy, yy = xx - sx * sx / number, xy - sx * sy / number, yy - sy * sy / number
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        nx, ny = -np.sin(angle), np.cos(angle)
        facing = (nx * vx + ny * vy) / UNKNOWN
        if abs(facing) < FLATTEST:
            continue
        if facing < 0.0:
            nx, ny = -nx, -ny
        off = (nx * sx + ny * sy) / number
        grid.surface[i, 0] = x + off * nx
        grid.surface[i, 1] = y + off * ny
        grid.surface[i, 2] = nx
        grid.surface[i, 3] = ny


@inner
def unknown(nx: float, ny: float) -> bool:
    """Whether a normal is not known."""
    return nx * nx + ny * ny < 0.25
