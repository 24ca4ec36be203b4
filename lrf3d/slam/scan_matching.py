"""Scan matching: the pose at which a scan's surface lies on a map's, point to line.

A surface in the frame of the robot, the grid of a map's surface, and a guess of the pose with its
information matrix enter. The pose leaves that minimises

    ρ₀((T − T₀)ᵀ Ω₀ (T − T₀)) + Σ ρ(n·(T p − q)) / σ²

over x, y, θ, by Gauss-Newton, with the information matrix of both parts. Where the walls in view do
not fix a direction, as along a corridor, the second part says nothing of it, and the guess, which
comes from odometry, stands.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float
from lrf3d.slam.surface import ALONG, SurfaceGrid

ALIGNED = 0.85
"""Least cosine between the normals of a point and of what it is matched to."""

FIRST_SCALE, LAST_SCALE = 0.15, 0.05
"""Scale of the robust weight [m] in the first iteration and in the last: at first the guess is off,
in the end what lies farther off has moved or is not in the map."""

PRIOR_SCALE = 4.0
"""How many deviations the guess may be off before its weight has halved."""

REACH = 0.3
"""How far off walls are looked for [m]; at most a cell of the grid."""

SIGMA = 0.06
"""Standard deviation [m] that a point's distance to its line counts with. The noise of a range is
about 0.01 m, but points of one wall share the errors of its normal and of the map."""

POST = 0.25
"""Strength of a post next to a point of a wall: from elsewhere another side of it is seen, and its
middle is twice as far off."""

FEWER, COARSELY = 120, 4
"""The first number of points is enough for as many first steps as the second says: they only lead
near to where the last ones end."""

ITERATIONS = 12
"""Most Gauss-Newton steps of a match; six are usual."""

STEP = 1e-4
"""An iteration that moves the pose by less [m, rad] is the last."""


class Match(NamedTuple):
    """What matching a scan came to: its pose (3,) in the frame of the map.

    The information (3, 3) is without that of the guess; explained is the share of the points that
    lie on the map, and the deviation their RMS distance [m] to it.
    """

    pose: Float
    information: Float
    explained: float
    deviation: float


def match_scan(
    surface: Float,
    grid: SurfaceGrid,
    guess: Float,
    prior: Float,
    iterations: int = ITERATIONS,
) -> Match:
    """Match a surface (m, 4), in the frame of the robot, with a map from a guess (3,) on.

    The prior (3, 3) is the information of the guess.
    """
    return Match(*_matched(surface, grid, guess, prior, iterations, REACH, SIGMA))


@compiled
def _matched(
    surface: Float,
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
    line = np.empty(4)
    for iteration in range(iterations):
        scale = FIRST_SCALE * (LAST_SCALE / FIRST_SCALE) ** (min(iteration, COARSELY) / COARSELY)
        stride = 1 + len(surface) // FEWER if iteration < min(COARSELY, iterations - 1) else 1
        for a in range(3):
            gradient[a] = 0.0
            for b in range(3):
                scan_part[a, b] = 0.0
        explained = squares = 0.0
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        for i in range(0, len(surface), stride):
            # The lever of the turn: where the point lies from the robot, in the map's axes.
            u = cos * surface[i, 0] - sin * surface[i, 1]
            v = sin * surface[i, 0] + cos * surface[i, 1]
            nx = cos * surface[i, 2] - sin * surface[i, 3]
            ny = sin * surface[i, 2] + cos * surface[i, 3]
            post = nx == 0.0 and ny == 0.0
            if post:
                near = _post_near(grid, pose[0] + u, pose[1] + v, reach, line)
            else:
                near = _line_near(grid, pose[0] + u, pose[1] + v, nx, ny, reach, line)
            if not near:
                continue
            bounded = 1.0 + (line[2] / scale) ** 2
            weight = line[3] / (bounded * bounded)
            strength = stride * weight / (sigma * sigma) * (POST if post else 1.0)
            # A post is met like two walls across each other.
            for side in range(2 if post else 1):
                mx, my, distance = line[0], line[1], line[2]
                if post:
                    mx, my, distance = 1.0 - side, 1.0 * side, line[side]
                turn = my * u - mx * v
                gradient[0] += strength * mx * distance
                gradient[1] += strength * my * distance
                gradient[2] += strength * turn * distance
                scan_part[0, 0] += strength * mx * mx
                scan_part[0, 1] += strength * mx * my
                scan_part[0, 2] += strength * mx * turn
                scan_part[1, 1] += strength * my * my
                scan_part[1, 2] += strength * my * turn
                scan_part[2, 2] += strength * turn * turn
            explained += weight
            squares += weight * line[2] * line[2]
        for a in range(3):
            for b in range(a):
                scan_part[a, b] = scan_part[b, a]
        deviation = np.sqrt(squares / explained) if explained > 0.0 else np.inf
        explained /= max(len(surface), 1)
        # Wheels slip, and bump into things: a guess that scans contradict loses its say.
        square = 0.0
        for a in range(3):
            for b in range(3):
                square += (pose[a] - guess[a]) * prior[a, b] * (pose[b] - guess[b])
        trust = 1.0 / (1.0 + square / (PRIOR_SCALE * PRIOR_SCALE))
        total = scan_part + trust * prior
        for a in range(3):
            for b in range(3):
                gradient[a] += trust * prior[a, b] * (pose[b] - guess[b])
        step = solve3(total, gradient)
        farthest = 0.0
        for a in range(3):
            pose[a] -= step[a]
            farthest = max(farthest, abs(step[a]))
        if iteration >= COARSELY and farthest < STEP:
            break
    return pose, scan_part, explained, deviation


@inner
def _line_near(
    grid: SurfaceGrid, x: float, y: float, nx: float, ny: float, reach: float, line: Float
) -> bool:
    """Whether a map has a wall near a point, and which: normal, distance and weight into a line.

    All map points around count, not just the nearest: the mean of several views of a wall is better
    than any one of them, and the nearest is always one whose error points to where we are.
    """
    columns, rows, cell = int(grid.size[0]), int(grid.size[1]), grid.size[2]
    column = int(np.floor((x - grid.corner[0]) / cell))
    row = int(np.floor((y - grid.corner[1]) / cell))
    if column < 0 or row < 0 or column >= columns or row >= rows:
        return False
    farthest = ALONG * ALONG
    total = sum_x = sum_y = sum_off = 0.0
    for other_row in range(max(row - 1, 0), min(row + 2, rows)):
        begin = grid.first[other_row * columns + max(column - 1, 0)]
        end = grid.first[other_row * columns + min(column + 1, columns - 1) + 1]
        for k in range(begin, end):
            dx, dy = x - grid.surface[k, 0], y - grid.surface[k, 1]
            square = dx * dx + dy * dy
            if square > reach * reach + farthest:
                continue
            mx, my = grid.surface[k, 2], grid.surface[k, 3]
            if mx * nx + my * ny < ALIGNED:
                continue
            off = mx * dx + my * dy
            # Both are bumps that end at 0, which cost a few products where a Gaussian has a power.
            # Map points farther off along the wall do not count, and nearer ones the more.
            along = 1.0 - (square - off * off) / farthest
            if along <= 0.0 or off * off > reach * reach:
                continue
            # Of two walls that lie one behind the other the nearer one is meant.
            across = 1.0 - off * off / (reach * reach)
            weight = along * along * across * across
            total += weight
            sum_x += weight * mx
            sum_y += weight * my
            sum_off += weight * off
    if total < 1e-3:
        return False
    length = np.sqrt(sum_x * sum_x + sum_y * sum_y)
    line[0], line[1] = sum_x / length, sum_y / length
    line[2] = sum_off / total
    # A point that only far-off map points speak for counts less.
    line[3] = min(1.0, total)
    return True


@inner
def _post_near(grid: SurfaceGrid, x: float, y: float, reach: float, line: Float) -> bool:
    """Whether a map has a post near a place, and how far off it is: x, y, distance and weight."""
    columns, rows, cell = int(grid.size[0]), int(grid.size[1]), grid.size[2]
    column = int(np.floor((x - grid.corner[0]) / cell))
    row = int(np.floor((y - grid.corner[1]) / cell))
    if column < 0 or row < 0 or column >= columns or row >= rows:
        return False
    total = sum_x = sum_y = 0.0
    for other_row in range(max(row - 1, 0), min(row + 2, rows)):
        begin = grid.first[other_row * columns + max(column - 1, 0)]
        end = grid.first[other_row * columns + min(column + 1, columns - 1) + 1]
        for k in range(begin, end):
            if grid.surface[k, 2] != 0.0 or grid.surface[k, 3] != 0.0:
                continue
            dx, dy = x - grid.surface[k, 0], y - grid.surface[k, 1]
            near = 1.0 - (dx * dx + dy * dy) / (reach * reach)
            if near > 0.0:
                total += near * near
                sum_x += near * near * dx
                sum_y += near * near * dy
    if total < 1e-3:
        return False
    line[0], line[1] = sum_x / total, sum_y / total
    line[2] = np.sqrt(line[0] * line[0] + line[1] * line[1])
    line[3] = min(1.0, total)
    return True


@inner
def solve3(matrix: Float, right: Float) -> Float:
    """Solve a symmetric positive definite system (3, 3) by Cholesky's factors."""
    l00 = np.sqrt(matrix[0, 0])
    l10 = matrix[1, 0] / l00
    l20 = matrix[2, 0] / l00
    l11 = np.sqrt(matrix[1, 1] - l10 * l10)
    l21 = (matrix[2, 1] - l20 * l10) / l11
    l22 = np.sqrt(matrix[2, 2] - l20 * l20 - l21 * l21)
    a = right[0] / l00
    b = (right[1] - l10 * a) / l11
    c = (right[2] - l20 * a - l21 * b) / l22
    z = c / l22
    y = (b - l21 * z) / l11
    x = (a - l10 * y - l20 * z) / l00
    return np.array([x, y, z])
