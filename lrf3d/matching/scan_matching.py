"""Scan matching: the pose near a guess at which the surface of a scan lies on that of a map.

A surface in the frame of the robot, the grid of a map's surface, and a guess of the pose with its
information matrix enter. What leaves is the pose T that minimises

    ρ₀((T − T₀)ᵀ Ω₀ (T − T₀)) + Σ ρ(n·(T p − q)) / σ²

over x, y, θ, by Gauss-Newton. T₀ is the guess and Ω₀ its information. A point p of the surface lies
at n·(T p − q) from the wall through q with the normal n. ρ₀ is Cauchy's robust function, ρ that of
Geman and McClure. A direction that the walls in view do not fix, as along a corridor, keeps the
guess.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import LANES, borrower, by_lanes, choose, compiled
from lrf3d.geometry.lines import Float, Records
from lrf3d.matching.surface import ALONG, CELL, SurfaceGrid, placement

# Least cosine between the normals of a point and of the wall that it is matched to.
ALIGNED = 0.85

# Scale of the robust weight in the first iteration [m], while the guess is off.
FIRST_SCALE = 0.15

# The same in the last iterations [m]: what lies farther off has moved or is not in the map.
LAST_SCALE = 0.05

# Standard deviations at which the weight of the guess has halved.
PRIOR_SCALE = 4.0

# Standard deviation of a point's distance to its wall [m]. The noise of a range is about 0.01 m,
# but points of one wall share the errors of its normal and of the map.
SIGMA = 0.06

# An iteration that moves the pose by less [m, rad] is the last.
STEP = 1e-4


class Match(NamedTuple):
    """The result of matching a scan: its pose (3,) in the frame of the map.

    The information (3, 3) excludes that of the guess; ``explained`` is the share of the points that
    lie on the map, and ``deviation`` their RMS distance [m] from it.
    """

    pose: Float
    information: Float
    explained: float
    deviation: float


def match_scan(
    surface: Records, grid: SurfaceGrid, guess: Float, prior: Float, iterations: int = 20
) -> Match:
    """Match a surface, in the frame of the robot, with a map, starting from a guess (3,).

    The prior (3, 3) is the information of the guess. Six iterations are usual. A point and its wall
    are at most a cell of the grid apart.
    """
    return Match(*_matched(surface, grid, guess, prior, iterations, CELL, SIGMA))


@compiled
def _matched(
    surface: Records,
    grid: SurfaceGrid,
    guess: Float,
    prior: Float,
    iterations: int,
    reach: float,
    sigma: float,
) -> tuple[Float, Float, float, float]:
    """The fields of a match. A plain tuple: numba makes a NamedTuple by calling Python code."""
    pose = guess.copy()
    scan_part = np.zeros((3, 3))
    gradient = np.zeros(3)
    sums = np.empty(4 * LANES)
    explained = deviation = 0.0
    # Weight of a post, relative to a point of a wall: from elsewhere other sides of it are seen.
    post_weight = 0.25
    # Coarse iterations, which only lead near to the result, and points that they use.
    coarse = 4
    coarse_points = 120
    for iteration in range(iterations):
        scale = FIRST_SCALE * (LAST_SCALE / FIRST_SCALE) ** (min(iteration, coarse) / coarse)
        stride = 1 + len(surface) // coarse_points if iteration < min(coarse, iterations - 1) else 1
        scan_part[:] = 0.0
        gradient[:] = 0.0
        explained = squares = 0.0
        at = placement(pose)
        for i in range(0, len(surface), stride):
            point = surface[i]
            # The point relative to the robot, along the map's axes: the lever of a turn.
            u = at.cos * point.x - at.sin * point.y
            v = at.sin * point.x + at.cos * point.y
            nx = at.cos * point.nx - at.sin * point.ny
            ny = at.sin * point.nx + at.cos * point.ny
            post = nx == 0.0 and ny == 0.0
            there = Point(at.x + u, at.y + v, nx, ny, 1.0 * post, reach)
            near, x, y, distance = _near(grid, there, sums)
            if near == 0.0:
                continue
            bounded = 1.0 + (distance / scale) ** 2
            weight = near / (bounded * bounded)
            strength = stride * weight / (sigma * sigma)
            if post:
                # A post counts as two walls at a right angle.
                _add(scan_part, gradient, post_weight * strength, (1.0, 0.0, -v), x)
                _add(scan_part, gradient, post_weight * strength, (0.0, 1.0, u), y)
            else:
                _add(scan_part, gradient, strength, (x, y, y * u - x * v), distance)
            explained += weight
            squares += weight * distance * distance
        deviation = np.sqrt(squares / explained) if explained > 0.0 else np.inf
        explained /= max(len(surface), 1)
        # Wheels slip and robots bump into things: a guess that scans contradict loses weight.
        off = pose - guess
        trust = 1.0 / (1.0 + off @ prior @ off / (PRIOR_SCALE * PRIOR_SCALE))
        step = np.linalg.solve(scan_part + trust * prior, gradient + trust * (prior @ off))
        pose -= step
        if iteration >= coarse and np.abs(step).max() < STEP:
            break
    return pose, scan_part, explained, deviation


@borrower
def _add(
    information: Float,
    gradient: Float,
    strength: float,
    row: tuple[float, float, float],
    distance: float,
) -> None:
    """Add a point to the normal equations, by the derivatives (3,) of its distance [m]."""
    for a in range(3):
        gradient[a] += strength * row[a] * distance
        for b in range(3):
            information[a, b] += strength * row[a] * row[b]


class Point(NamedTuple):
    """A point of a scan and its normal; ``post`` is 1 if it has none, and 0 otherwise.

    A wall across which it lies farther than a ``reach`` [m] does not support it.
    """

    x: float
    y: float
    nx: float
    ny: float
    post: float
    reach: float


def _support(
    wall: tuple[float, ...], point: Point, end: float
) -> tuple[bool, float, float, float, float]:
    """Whether a map point before a row supports a point; its weight, weighted normal and distance.

    Of two walls one behind the other the nearer one counts more. The weight is a product of two
    bumps that end at 0: they cost a few products where a Gaussian has a power.
    """
    x, y, nx, ny, row = wall
    dx = point.x - x
    dy = point.y - y
    off = nx * dx + ny * dy
    across = off * off
    beside = -(dx * dx + dy * dy - across) + ALONG * ALONG
    near = point.reach * point.reach - across
    # A post is compared with posts only, whose normal is zero.
    cosine = nx * point.nx + ny * point.ny + point.post * (-(nx * nx + ny * ny) + ALIGNED)
    met = (cosine >= ALIGNED) & (beside > 0.0) & (near > 0.0) & (row < end)
    bump = choose(met, beside * near, 0.0)
    weight = bump * bump
    across_x = nx + point.post * dx
    across_y = ny + point.post * dy
    return met, weight, weight * across_x, weight * across_y, weight * off


add_support = by_lanes(_support, width=5, adds=True)


@borrower
def _near(grid: SurfaceGrid, point: Point, sums: Float) -> tuple[float, float, float, float]:
    """The weight of the map's wall near a point, its normal, and the distance; 0 without a wall.

    All map points around count, not just the nearest: the mean of several views of a wall is better
    than any one of them, and the nearest point is biased towards the guess. A point without a
    normal is compared with posts; their distances along x and y take the place of the normal.
    """
    column = int(np.floor((point.x - grid.left) / grid.cell))
    row = int(np.floor((point.y - grid.low) / grid.cell))
    if column < 0 or column >= grid.wide or row < 0 or row >= grid.high:
        return 0.0, 0.0, 0.0, 0.0
    start = grid.first[row * grid.wide + max(column - 1, 0)]
    end = grid.first[row * grid.wide + min(column + 2, grid.wide)]
    sums[:] = 0.0
    for base in range(start, end, LANES):
        add_support(grid.columns, np.uint64(base), point, np.float64(end), sums)
    total = sum_x = sum_y = sum_off = 0.0
    for k in range(LANES):
        total += sums[k]
        sum_x += sums[LANES + k]
        sum_y += sums[2 * LANES + k]
        sum_off += sums[3 * LANES + k]
    # A point that only far-off map points support counts less.
    near = min(1.0, total / (ALONG * point.reach) ** 4)
    if near < 1e-3:
        return 0.0, 0.0, 0.0, 0.0
    length = np.sqrt(sum_x * sum_x + sum_y * sum_y)
    if point.post > 0.0:
        return near, sum_x / total, sum_y / total, length / total
    return near, sum_x / length, sum_y / length, sum_off / total
