"""Field: which coarse cells of a map are walls and which are free, and windows of poses in it.

Key scans and their poses enter. A cell that a beam of theirs hit is a wall, one that beams passed
is free, and of the others nothing is known. For each pose of a window leaves what the hits of
another scan would meet.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.frames import compose
from lrf3d.geometry import Float, Int
from lrf3d.slam.views import BEHIND, Key

COARSE_CELL = 0.15
"""Cell of the coarse field [m]: matching finds home from one and a half of them."""

DEVIATIONS = 3.0
"""A window reaches as many standard deviations to each side."""

CELL, STRIDE = 0.05, 3
"""Side of a cell of the field [m], and how many of them a cell of the window has."""

WALL, FREE = 4, -4
"""What a hit counts in the cell of a wall, and in a free one; it counts one less for each cell that
it lies beside a wall."""

FARTHEST = 50.0
"""Cells farther from the last key scan are left out [m]."""


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
        laser = compose(pose, np.array([*key.laser, 0.0]))
        _clear(field, laser, key.angles, key.ranges, BEHIND + 3.0 * key.noise)
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
        for step in range(0, int((least - behind) / CELL), 2):
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
    # A cell more, so that the least window has neighbours to each side.
    wide = spread + np.diag(np.full(2, (COARSE_CELL / DEVIATIONS) ** 2))
    x, y = (
        np.arange(-most, most + 1)
        for most in np.ceil(DEVIATIONS * np.sqrt(wide.diagonal()) / COARSE_CELL).astype(np.int64)
    )
    shifts = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    metres = COARSE_CELL * shifts
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
                c, r = column + STRIDE * shifts[s, 0], row + STRIDE * shifts[s, 1]
                if c >= 0 and c < wide and r >= 0 and r < high:
                    scores[a, s] += field.cells[r, c]
    return scores


@compiled
def climbed(points: Float, field: Field, start: Float, step: float) -> Float:
    """The pose (3,) around a peak of the window at which points (m, …) meet the most walls.

    The step is that of the window's headings [rad]; it is halved until it is that of a cell.
    """
    high, wide = field.cells.shape
    best, most = start.copy(), -np.inf
    centre = start.copy()
    for halved in range(4):
        shift, turn = 0.5 * COARSE_CELL / 2.0**halved, 0.5 * step / 2.0**halved
        centre[:] = best
        for k in range(27):
            pose = centre + np.array(
                [shift * (k % 3 - 1), shift * (k // 3 % 3 - 1), turn * (k // 9 - 1)]
            )
            cos, sin = np.cos(pose[2]), np.sin(pose[2])
            total = 0.0
            for i in range(len(points)):
                x = pose[0] + cos * points[i, 0] - sin * points[i, 1] - field.corner[0]
                y = pose[1] + sin * points[i, 0] + cos * points[i, 1] - field.corner[1]
                c, r = int(np.floor(x / CELL)), int(np.floor(y / CELL))
                if c >= 0 and c < wide and r >= 0 and r < high:
                    total += field.cells[r, c]
            if total > most:
                most, best = total, pose
    return best
