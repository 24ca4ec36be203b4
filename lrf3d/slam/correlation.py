"""Correlation: where in a window around a guess a surface lies on a map's, however far off.

A coarse field marks which cells lie on or beside the map's walls; the share of the surface's points
in marked cells is found for every pose of the window. The best few are refined by scan matching.
"""

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, wrap_angle
from lrf3d.slam.scan_matching import Match, match_scan
from lrf3d.slam.surface import SurfaceGrid

COARSE_CELL = 0.15
"""Cell of the coarse field [m]: matching finds home from one and a half of them."""

ANGLE_STEP = 0.03
"""Step of the heading [rad]: at the 5 m of a usual range it moves points by a cell."""

COARSE_POINTS = 80
"""Points of a surface that the window is searched with."""

PEAKS = 6
"""Poses of the window that are refined."""

APART, TURNED_APART = 0.3, 0.1
"""Two poses that differ by more [m], [rad] are different places."""

AMBIGUOUS = 0.92
"""No place is accepted if another one explains this share of what it does."""

LOOSE = np.diag([4.0, 4.0, 25.0])
"""Information of the guess when a peak is refined: 0.5 m and 0.2 rad, which leaves it free."""

ITERATIONS = 20
"""Most Gauss-Newton steps that a peak is refined by."""


@compiled
def window_scores(
    points: Float, grid: SurfaceGrid, centre: Float, half: int, angles: Float
) -> Float:
    """How many points (m, 2) fall on marked cells, for each heading and shift in a window.

    Args:
        points: In the frame of the robot [m].
        grid: The map's surface.
        centre: (3,) pose in the middle of the window.
        half: How many cells the window reaches to each side.
        angles: (a,) turns [rad] from the centre.

    Returns:
        Scores (a, 2·half + 1, 2·half + 1): heading, shift in y, shift in x.
    """
    # The field is as large as the map and its margin, in coarse cells.
    cell = COARSE_CELL
    wide = int(grid.size[0] * grid.size[2] / cell) + 3
    high = int(grid.size[1] * grid.size[2] / cell) + 3
    field = np.zeros((high, wide), np.uint8)
    for i in range(len(grid.surface)):
        column = int((grid.surface[i, 0] - grid.corner[0]) / cell) + 1
        row = int((grid.surface[i, 1] - grid.corner[1]) / cell) + 1
        for r in range(row - 1, row + 2):
            for c in range(column - 1, column + 2):
                field[r, c] = max(field[r, c], 2 if r == row and c == column else 1)
    side = 2 * half + 1
    scores = np.zeros((len(angles), side, side))
    for a in range(len(angles)):
        cos, sin = np.cos(centre[2] + angles[a]), np.sin(centre[2] + angles[a])
        for i in range(len(points)):
            x = centre[0] + cos * points[i, 0] - sin * points[i, 1]
            y = centre[1] + sin * points[i, 0] + cos * points[i, 1]
            column = int(np.floor((x - grid.corner[0]) / cell)) + 1 - half
            row = int(np.floor((y - grid.corner[1]) / cell)) + 1 - half
            for r in range(max(row, 0), min(row + side, high)):
                for c in range(max(column, 0), min(column + side, wide)):
                    scores[a, r - row, c - column] += field[r, c]
    return scores


def correlate(
    surface: Float,
    grid: SurfaceGrid,
    guess: Float,
    *,
    window: float,
    turn: float,
    reach: float,
    sigma: float,
) -> list[Match]:
    """The places in a window where a surface lies on a map's, best first.

    Args:
        surface: (m, 4) in the frame of the robot.
        grid: The map's surface.
        guess: (3,) pose in the middle of the window.
        window: Half the side of the window [m].
        turn: Half its angle [rad].
        reach: How far off walls are looked for in matching [m].
        sigma: Standard deviation [m] that a point counts with.
    """
    half = max(1, int(np.ceil(window / COARSE_CELL)))
    turns = max(1, int(np.ceil(turn / ANGLE_STEP)))
    angles: Float = ANGLE_STEP * np.arange(-turns, turns + 1, dtype=np.float64)
    points = np.ascontiguousarray(surface[:: max(1, len(surface) // COARSE_POINTS), :2])
    scores = window_scores(points, grid, guess, half, angles)
    matches: list[Match] = []
    for _ in range(PEAKS):
        a, row, column = np.unravel_index(int(scores.argmax()), scores.shape)
        if scores[a, row, column] <= 0.0:
            break
        shift = COARSE_CELL * np.array([column - half, row - half])
        start = np.array([*(guess[:2] + shift), guess[2] + angles[a]])
        match = match_scan(surface, grid, start, LOOSE, ITERATIONS, reach, sigma)
        if not any(same_place(match.pose, other.pose) for other in matches):
            matches.append(match)
        # The peak's surroundings lead to the same place.
        around = (slice(max(a - 2, 0), a + 3), slice(max(row - 2, 0), row + 3))
        scores[around][..., max(column - 2, 0) : column + 3] = 0.0
    return sorted(matches, key=lambda match: -match.explained)


def same_place(first: Float, second: Float) -> bool:
    """Whether two poses (3,) are the same place."""
    apart = np.hypot(first[0] - second[0], first[1] - second[1])
    return bool(apart < APART and abs(wrap_angle(first[2] - second[2])) < TURNED_APART)
