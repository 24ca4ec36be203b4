"""Search: the places in a window from which a scan fits into a map, by all that its beams met.

Key scans and their poses enter. A cell that a beam of theirs hit is a wall, one that beams passed
is free, and of the others nothing is known. The poses of a window at which the hits of another scan
meet most walls, and few free cells, are matched with the map (Olson 2009), and leave.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int
from lrf3d.pose import compose
from lrf3d.slam.scan_matching import Match, match_scan
from lrf3d.slam.surface import SurfaceGrid
from lrf3d.slam.views import BEHIND, Key, same_place

CELL = 0.15
"""Side of a cell [m]: matching finds home from one and a half of them."""

DEVIATIONS = 3.0
"""A window reaches as many standard deviations to each side."""

WALL, FREE = 2, -2
"""What a hit counts in the cell of a wall, and in a free one; next to a wall it counts one."""

FARTHEST = 50.0
"""Cells farther from the last key scan are left out [m]."""

ANGLE_STEPS = 0.01, 0.03
"""Bounds of the step of the heading [rad]; it moves the points far off by a cell."""

COARSE_POINTS = 80
"""Points of a surface that the window is searched with."""

PEAKS = 6
"""Poses of the window that are refined."""

CLOSE = 0.7
"""Peaks that score less than this share of what the best one does are no places."""

LOOSE = np.diag([4.0, 4.0, 25.0])
"""Information of the guess when a peak is refined: 0.5 m and 0.2 rad, which leaves it free."""

HELD = np.diag([1e6, 1e6, 1e7])
"""The same where it would slide away: a millimetre."""


class Field(NamedTuple):
    """What is known of the cells (rows, columns) of a map, from its lower left corner (2,) on."""

    cells: NDArray[np.int8]
    corner: Float


def field_of(keys: Sequence[Key], poses: Float) -> Field:
    """The field that key scans show from poses (k, 3)."""
    reach = max(float(np.abs(key.hits).max(initial=0.0)) for key in keys)
    around = 1.5 * min(reach, FARTHEST) + WALL * CELL
    low, high = poses[:, :2].min(axis=0) - around, poses[:, :2].max(axis=0) + around
    columns, rows = ((high - low) / CELL).astype(np.int64).tolist()
    field = Field(np.zeros((rows, columns), np.int8), low)
    for key, pose in zip(keys, poses, strict=True):
        for fan in key.fans:
            laser = compose(pose, np.array([*fan.laser, 0.0]))
            _clear(field, laser, fan.angles, fan.ranges, BEHIND + 3.0 * key.noise)
    for key, pose in zip(keys, poses, strict=True):
        _mark(field, pose, key.hits)
    return field


@compiled
def _clear(field: Field, laser: Float, angles: Float, ranges: Float, behind: float) -> None:
    """Mark the cells free that the beams of a laser at a pose (3,) passed."""
    high, wide = field.cells.shape
    column, row = (laser[0] - field.corner[0]) / CELL, (laser[1] - field.corner[1]) / CELL
    for k in range(1, len(angles) - 1):
        least = min(ranges[k - 1], ranges[k], ranges[k + 1])
        if not (least > 0.0 and np.isfinite(least)):
            continue
        along, up = np.cos(laser[2] + angles[k]), np.sin(laser[2] + angles[k])
        for step in range(int((least - behind) / CELL)):
            c, r = int(column + step * along), int(row + step * up)
            if c < 0 or c >= wide or r < 0 or r >= high:
                break
            field.cells[r, c] = FREE


@compiled
def _mark(field: Field, pose: Float, hits: Float) -> None:
    """Mark the cells of hits (h, 2) of a scan from a pose (3,) as walls, and those around."""
    high, wide = field.cells.shape
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for i in range(len(hits)):
        x = pose[0] + cos * hits[i, 0] - sin * hits[i, 1] - field.corner[0]
        y = pose[1] + sin * hits[i, 0] + cos * hits[i, 1] - field.corner[1]
        column, row = int(x / CELL), int(y / CELL)
        if not (WALL <= column < wide - WALL and WALL <= row < high - WALL):
            continue
        for r in range(row - WALL + 1, row + WALL):
            for c in range(column - WALL + 1, column + WALL):
                here = WALL - max(abs(r - row), abs(c - column))
                field.cells[r, c] = max(field.cells[r, c], here)


def shifts_within(guess: Float, spread: Float, near: float) -> Int:
    """Shifts (s, 2) of a window in cells: of its ellipse, as far as they are near the origin."""
    # A step more, so that the least window has neighbours to each side.
    wide = spread + np.diag(np.full(2, (CELL / DEVIATIONS) ** 2))
    x, y = (
        np.arange(-most, most + 1)
        for most in np.ceil(DEVIATIONS * np.sqrt(wide.diagonal()) / CELL).astype(np.int64)
    )
    shifts = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    metres = CELL * shifts
    inside = np.hypot(*(guess[:2] + metres).T) < near
    square = np.einsum("si,ij,sj->s", metres, np.linalg.inv(wide), metres)
    chosen: Int = shifts[inside & (square <= DEVIATIONS**2)]
    return chosen


@compiled
def window_scores(points: Float, field: Field, centre: Float, shifts: Int, angles: Float) -> Float:
    """What points (m, …) meet in the field (a, s), for each heading and shift [cells]."""
    high, wide = field.cells.shape
    scores = np.zeros((len(angles), len(shifts)))
    for a in range(len(angles)):
        cos, sin = np.cos(centre[2] + angles[a]), np.sin(centre[2] + angles[a])
        for i in range(len(points)):
            x = centre[0] + cos * points[i, 0] - sin * points[i, 1]
            y = centre[1] + sin * points[i, 0] + cos * points[i, 1]
            column = int(np.floor((x - field.corner[0]) / CELL))
            row = int(np.floor((y - field.corner[1]) / CELL))
            for s in range(len(shifts)):
                c, r = column + shifts[s, 0], row + shifts[s, 1]
                if c >= 0 and c < wide and r >= 0 and r < high:
                    scores[a, s] += field.cells[r, c]
    return scores


def search(
    scan: Key, grid: SurfaceGrid, field: Field, guess: Float, spread: Float, near: float = np.inf
) -> list[Match]:
    """The places in a window where a scan lies on a map, those first whose hits fit best.

    The window has a covariance (3, 3), its spread, around a guess (3,); places farther than a
    distance [m] from the map's origin are left out.
    """
    shifts = shifts_within(guess, spread[:2, :2], near)
    surface, hits = scan.surface, scan.hits
    if not len(surface) or not len(shifts):
        return []
    far = float(np.quantile(np.hypot(hits[:, 0], hits[:, 1]), 0.8))
    step = float(np.clip(CELL / max(far, 1e-3), *ANGLE_STEPS))
    turns = max(1, int(np.ceil(DEVIATIONS * np.sqrt(spread[2, 2]) / step)))
    angles: Float = step * np.arange(-turns, turns + 1, dtype=np.float64)
    points, sample = thin(hits), thin(surface)
    scores = window_scores(points, field, guess, shifts, angles)
    places: list[tuple[Float, Float]] = []
    least = max(CLOSE * float(scores.max()), 0.0)
    for _ in range(PEAKS):
        a, s = np.unravel_index(int(scores.argmax()), scores.shape)
        if scores[a, s] <= least:
            break
        peak = guess + np.array([*(CELL * shifts[s]), angles[a]])
        place, prior = match_scan(sample, grid, peak, LOOSE).pose, LOOSE
        if not (np.isfinite(place).all() and same_place(place, peak, 0.5)):
            # It slid away, as along a corridor: that is another place.
            place, prior = peak, HELD
        if not any(same_place(place, other) for other, _ in places):
            places.append((place, prior))
        # The peak's surroundings lead to the same place.
        around = np.flatnonzero((np.abs(shifts - shifts[s]) <= 2).all(axis=1))
        scores[max(a - 2, 0) : a + 3, around] = 0.0
    return [match_scan(surface, grid, place, prior) for place, prior in places]


def thin(points: Float) -> Float:
    """Some of many points (m, …), which are enough to find a place."""
    return np.ascontiguousarray(points[:: 1 + len(points) // COARSE_POINTS])
