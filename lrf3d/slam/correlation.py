"""Correlation: where in a window around a guess a surface lies on a map's, however far off.

A coarse field marks which cells lie on or next to the map's surface; the share of the points in
marked cells is found for every pose of the window. The best few are refined by scan matching, and
leave as places, best first: a place is believed where it is clearly better than the next one.
"""

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.slam.scan_matching import Match, match_scan
from lrf3d.slam.surface import SurfaceGrid

COARSE_CELL = 0.15
"""Cell of the coarse field [m]: matching finds home from one and a half of them."""

ANGLE_STEPS = 0.01, 0.03
"""Bounds of the step of the heading [rad]; it moves the points far off by a cell."""

COARSE_POINTS = 80
"""Points of a surface that the window is searched with."""

DEVIATIONS = 3.0
"""A window reaches as many standard deviations to each side."""

PEAKS = 6
"""Poses of the window that are refined."""

APART, TURNED_APART = 0.3, 0.1
"""Two poses that differ by more [m], [rad] are different places."""

CLOSE = 0.7
"""Peaks that score less than this share of what the best one does are no places. Those that, once
refined with the points of the window's search, explain more than it of what the best one does are
refined with all points."""

LEAST_FOUND, CLEARLY = 0.3, 0.8
"""A place is believed if it explains the first share of the points, and if the log odds of a point
to be explained are larger by the second than at any other place: around one half that is a fifth of
the points. In woods hardly half of a scan is explained at the right place, too."""

LOOSE = np.diag([4.0, 4.0, 25.0])
"""Information of the guess when a peak is refined: 0.5 m and 0.2 rad, which leaves it free."""

ITERATIONS = 20
"""Most Gauss-Newton steps that a peak is refined by."""


def search(
    surface: Float, grid: SurfaceGrid, guess: Float, spread: Float, near: float = np.inf
) -> list[Match]:
    """The places in a window where a surface lies on a map's, best first.

    The window has a covariance (3, 3), its spread, around a guess (3,); places farther than a
    distance [m] from the map's origin are left out.
    """
    if not len(surface):
        return []
    shifts = shifts_within(guess, spread[:2, :2], near)
    far = float(np.quantile(np.hypot(surface[:, 0], surface[:, 1]), 0.8))
    step = float(np.clip(COARSE_CELL / max(far, 1e-3), *ANGLE_STEPS))
    turns = max(1, int(np.ceil(DEVIATIONS * np.sqrt(spread[2, 2]) / step)))
    angles: Float = step * np.arange(-turns, turns + 1, dtype=np.float64)
    sample = np.ascontiguousarray(surface[:: 1 + len(surface) // COARSE_POINTS])
    scores = window_scores(sample, grid, guess, shifts, angles)
    matches: list[Match] = []
    least = CLOSE * float(scores.max(initial=0.0))
    for _ in range(PEAKS if len(shifts) else 0):
        a, s = np.unravel_index(int(scores.argmax()), scores.shape)
        if scores[a, s] <= least:
            break
        shift = COARSE_CELL * shifts[s]
        start = np.array([*(guess[:2] + shift), guess[2] + angles[a]])
        match = match_scan(sample, grid, start, LOOSE, ITERATIONS)
        # One that slid away, as along a corridor, is another place, and may be out of the window.
        stayed = bool(np.isfinite(match.pose).all()) and same_place(match.pose, start)
        if stayed and not any(same_place(match.pose, other.pose) for other in matches):
            matches.append(match)
        # The peak's surroundings lead to the same place.
        around = np.flatnonzero((np.abs(shifts - shifts[s]) <= 2).all(axis=1))
        scores[max(a - 2, 0) : a + 3, around] = 0.0
    least = CLOSE * max((match.explained for match in matches), default=0.0)
    places = [
        match_scan(surface, grid, match.pose, LOOSE) if match.explained > least else match
        for match in matches
    ]
    return sorted(places, key=lambda match: -match.explained)


def shifts_within(guess: Float, spread: Float, near: float) -> Int:
    """Shifts (s, 2) of a window in cells: of its ellipse, as far as they are near the origin."""
    half = np.ceil(DEVIATIONS * np.sqrt(spread.diagonal()) / COARSE_CELL)
    if np.isfinite(near):
        # Only what of the ellipse is near the origin is laid out.
        half = np.minimum(half, np.ceil((near + np.abs(guess[:2])) / COARSE_CELL))
    x, y = (np.arange(-int(most), int(most) + 1) for most in np.maximum(half, 1.0))
    shifts = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    metres = COARSE_CELL * shifts
    inside = np.hypot(*(guess[:2] + metres).T) < near
    # A cell more, so that the least window has neighbours to each side.
    wide = spread + np.diag(np.full(2, (COARSE_CELL / DEVIATIONS) ** 2))
    square = np.einsum("si,ij,sj->s", metres, np.linalg.inv(wide), metres)
    chosen: Int = shifts[inside & (square <= DEVIATIONS**2)]
    return chosen


@compiled
def window_scores(
    points: Float, grid: SurfaceGrid, centre: Float, shifts: Int, angles: Float
) -> Float:
    """How many points (m, …) fall on marked cells (a, s), for each heading and shift [cells]."""
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
    scores = np.zeros((len(angles), len(shifts)))
    for a in range(len(angles)):
        cos, sin = np.cos(centre[2] + angles[a]), np.sin(centre[2] + angles[a])
        for i in range(len(points)):
            x = centre[0] + cos * points[i, 0] - sin * points[i, 1]
            y = centre[1] + sin * points[i, 0] + cos * points[i, 1]
            column = int(np.floor((x - grid.corner[0]) / cell)) + 1
            row = int(np.floor((y - grid.corner[1]) / cell)) + 1
            for s in range(len(shifts)):
                c, r = column + shifts[s, 0], row + shifts[s, 1]
                if c >= 0 and c < wide and r >= 0 and r < high:
                    scores[a, s] += field[r, c]
    return scores


def log_odds(match: Match) -> float:
    """Log odds of a point to be explained."""
    share = min(max(match.explained, 0.01), 0.99)
    return float(np.log(share / (1.0 - share)))


def same_place(first: Float, second: Float, tolerance: float = 1.0) -> bool:
    """Whether two poses (3,) are the same place."""
    apart = np.hypot(first[0] - second[0], first[1] - second[1])
    turned = abs(wrap_angle(first[2] - second[2]))
    return bool(apart < tolerance * APART and turned < tolerance * TURNED_APART)
