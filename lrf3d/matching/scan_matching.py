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

from lrf3d.compiling import borrower, compiled, inner
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
    explained = deviation = 0.0
    # Weight of a post, relative to a point of a wall: from elsewhere other sides of it are seen.
    post = 0.25
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
            near, x, y, distance = _near(grid, at.x + u, at.y + v, nx, ny, reach)
            if near == 0.0:
                continue
            bounded = 1.0 + (distance / scale) ** 2
            weight = near / (bounded * bounded)
            strength = stride * weight / (sigma * sigma)
            if nx == 0.0 and ny == 0.0:
                # A post counts as two walls at a right angle.
                _add(scan_part, gradient, post * strength, (1.0, 0.0, -v), x)
                _add(scan_part, gradient, post * strength, (0.0, 1.0, u), y)
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


@inner
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


@inner
def _near(
    grid: SurfaceGrid, x: float, y: float, nx: float, ny: float, reach: float
) -> tuple[float, float, float, float]:
    """The weight of the map's wall near a point, its normal, and the distance; 0 without a wall.

    All map points around count, not just the nearest: the mean of several views of a wall is better
    than any one of them, and the nearest point is biased towards the guess. A point without a
    normal is compared with posts; their distances along x and y take the place of the normal.
    """
    left, right = _cells_near((x - grid.left) / grid.cell, grid.columns)
    low, high = _cells_near((y - grid.low) / grid.cell, grid.rows)
    total = sum_x = sum_y = sum_off = 0.0
    post = nx == 0.0 and ny == 0.0
    for row in range(low, high):
        start = row * grid.columns
        for k in range(grid.first[start + left], grid.first[start + right]):
            wall = grid.surface[k]
            dx = x - wall.x
            dy = y - wall.y
            off = wall.nx * dx + wall.ny * dy
            weight = _weight(dx * dx + dy * dy - off * off, off * off, reach * reach)
            # A post is compared with posts only.
            alike = wall.nx * nx + wall.ny * ny >= ALIGNED
            weight = weight if (wall.nx == wall.ny == 0.0 if post else alike) else 0.0
            u, v = (dx, dy) if post else (wall.nx, wall.ny)
            total += weight
            sum_x += weight * u
            sum_y += weight * v
            sum_off += weight * off
    if total < 1e-3:
        return 0.0, 0.0, 0.0, 0.0
    # A point that only far-off map points support counts less.
    near = min(1.0, total)
    length = np.hypot(sum_x, sum_y)
    if post:
        return near, sum_x / total, sum_y / total, length / total
    return near, sum_x / length, sum_y / length, sum_off / total


@borrower
def _cells_near(place: float, count: int) -> tuple[int, int]:
    """The range of up to three cells around a place [cells]; empty outside of the grid."""
    cell = int(np.floor(place))
    if cell < 0 or cell >= count:
        return 0, 0
    return max(cell - 1, 0), min(cell + 2, count)


@borrower
def _weight(along: float, across: float, reach: float) -> float:
    """The weight of a map point by its squared distances [m²]: along its wall and across it.

    Of two walls one behind the other the nearer one counts more. The weight is a product of two
    bumps that end at 0: they cost a few products where a Gaussian has a power.
    """
    beside = max(1.0 - along / (ALONG * ALONG), 0.0)
    near = max(1.0 - across / reach, 0.0)
    return beside * beside * near * near
