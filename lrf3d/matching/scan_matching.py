"""Scan matching: the pose near a guess at which a scan's surface lies on that of a map.

A surface in the frame of the robot, the grid of a map's surface, and a guess of the pose with its
information matrix enter; the pose leaves that minimises

    ρ₀((T − T₀)ᵀ Ω₀ (T − T₀)) + Σ ρ(n·(T p − q)) / σ²

over x, y, θ, by Gauss-Newton, with the information matrix of the sum. T₀ is the guess and Ω₀ its
information, weighted by Cauchy's ρ₀; a point p of the surface lies at n·(T p − q) from its wall,
weighted by Geman and McClure's ρ. In a direction that the walls in view do not fix, as along a
corridor, the guess stands.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry.lines import Float, Records
from lrf3d.matching.surface import ALONG, SurfaceGrid, placement

# Least cosine between the normals of a point and of the wall that it is matched to.
ALIGNED = 0.85

# Scale of the robust weight [m] in the first iteration and in the last: at first the guess is off;
# in the end what lies farther off has moved or is not in the map.
FIRST_SCALE = 0.15
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

    The information (3, 3) is without that of the guess; explained is the share of the points that
    lie on the map, and the deviation their RMS distance [m] to it.
    """

    pose: Float
    information: Float
    explained: float
    deviation: float


def match_scan(
    surface: Records, grid: SurfaceGrid, guess: Float, prior: Float, iterations: int = 20
) -> Match:
    """Match a surface, in the frame of the robot, with a map, from a guess (3,) on.

    The prior (3, 3) is the information of the guess. Six iterations are usual.
    """
    reach = 0.3  # Largest distance between a point and its wall [m]; at most a cell of the grid.
    return Match(*_matched(surface, grid, guess, prior, iterations, reach, SIGMA))


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
    # Weight of a post next to that of a point of a wall: other sides of it are seen from elsewhere.
    post = 0.25
    # Points in a coarse iteration, and number of these: they only lead near to the result.
    fewer = 120
    coarsely = 4
    for iteration in range(iterations):
        scale = FIRST_SCALE * (LAST_SCALE / FIRST_SCALE) ** (min(iteration, coarsely) / coarsely)
        stride = 1 + len(surface) // fewer if iteration < min(coarsely, iterations - 1) else 1
        scan_part[:] = 0.0
        gradient[:] = 0.0
        explained = squares = 0.0
        at = placement(pose)
        for i in range(0, len(surface), stride):
            point = surface[i]
            # The point as seen from the robot, in the map's axes: the lever of a turn.
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
                # A post is met like two walls across each other.
                _add(scan_part, gradient, post * strength, (1.0, 0.0, -v), x)
                _add(scan_part, gradient, post * strength, (0.0, 1.0, u), y)
            else:
                _add(scan_part, gradient, strength, (x, y, y * u - x * v), distance)
            explained += weight
            squares += weight * distance * distance
        deviation = np.sqrt(squares / explained) if explained > 0.0 else np.inf
        explained /= max(len(surface), 1)
        # Wheels slip, and bump into things: a guess that scans contradict loses weight.
        off = pose - guess
        trust = 1.0 / (1.0 + off @ prior @ off / (PRIOR_SCALE * PRIOR_SCALE))
        step = np.linalg.solve(scan_part + trust * prior, gradient + trust * (prior @ off))
        pose -= step
        if iteration >= coarsely and np.abs(step).max() < STEP:
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
    """The weight of the map's wall near a point, its normal, and the distance; 0 if there is none.

    All map points around count, not just the nearest: the mean of several views of a wall is better
    than any one of them, and the nearest is always one whose error points to where we are. A point
    without a normal is compared with posts; of these the distances along x and y are returned.
    """
    columns = grid.columns
    rows = grid.rows
    column = int(np.floor((x - grid.left) / grid.cell))
    row = int(np.floor((y - grid.low) / grid.cell))
    total = sum_x = sum_y = sum_off = 0.0
    if column < 0 or row < 0 or column >= columns or row >= rows:
        return 0.0, 0.0, 0.0, 0.0
    post = nx == 0.0 and ny == 0.0
    for other_row in range(max(row - 1, 0), min(row + 2, rows)):
        begin = grid.first[other_row * columns + max(column - 1, 0)]
        end = grid.first[other_row * columns + min(column + 1, columns - 1) + 1]
        for k in range(begin, end):
            wall = grid.surface[k]
            dx = x - wall.x
            dy = y - wall.y
            square = dx * dx + dy * dy
            if square > reach * reach + ALONG * ALONG:
                continue
            if post:
                if wall.nx != 0.0 or wall.ny != 0.0:
                    continue
            elif wall.nx * nx + wall.ny * ny < ALIGNED:
                continue
            off = wall.nx * dx + wall.ny * dy
            # The weight falls with the distance along the wall and across it, so that of two walls
            # one behind the other the nearer one counts. Both factors are bumps that end at 0,
            # which cost a few products where a Gaussian has a power.
            along = 1.0 - (square - off * off) / (ALONG * ALONG)
            across = 1.0 - off * off / (reach * reach)
            if along <= 0.0 or across < 0.0:
                continue
            weight = along * along * across * across
            total += weight
            sum_x += weight * (dx if post else wall.nx)
            sum_y += weight * (dy if post else wall.ny)
            sum_off += weight * off
    if total < 1e-3:
        return 0.0, 0.0, 0.0, 0.0
    # A point that only far-off map points support counts less.
    near = min(1.0, total)
    length = np.hypot(sum_x, sum_y)
    if post:
        return near, sum_x / total, sum_y / total, length / total
    return near, sum_x / length, sum_y / length, sum_off / total
