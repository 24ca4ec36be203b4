"""Free space: a grid of the cells that scans show to be free, for planning routes.

Scans enter; a :class:`~lrf3d.world.free_cells.FreeCells` leaves.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser.scan import LaserScan
from lrf3d.world.free_cells import FreeCells

CELL = 0.1
"""Side of a cell [m]: a door is several cells wide."""

MOST_CELLS = 4_000_000
"""Largest number of cells of a grid; larger areas have larger cells."""

SIGHT = 15.0
"""Largest range [m] at which a scan shows a cell to be free: beyond, beams are too far apart."""

LARGEST_CELL = 0.5
"""Largest side of a cell [m]: larger ones hide doors. Of scans too far apart for that, those
around the most central one are used."""

MARGIN = 0.1
"""Distance [m] before a return, besides half of a cell, that is not marked free: the noise."""

DRIVEN = 0.2
"""Radius [m] around each pose that is free, because the robot was there."""

MOVED, TURNED = 0.25, np.deg2rad(10.0)
"""Cell [m], [rad] of poses from which only the first scan is used: the others add little."""


def distinct_poses(poses: Float) -> Int:
    """Rows of the poses (k, 3) that are the first in their cell of place and heading."""
    cells = np.floor(poses / [MOVED, MOVED, TURNED]).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.sort(first)


def free_cells(scans: Sequence[LaserScan]) -> FreeCells:
    """The cells that scans show to be free: those before the returns of their beams.

    A cell between two beams is free if both returned from behind it. A beam without return marks
    nothing.

    Args:
        scans: The scans, at their poses in the world.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> from lrf3d.laser.free_space import free_cells
        >>> lrf = lrf3d.LaserRangeFinder()
        >>> scan = lrf3d.LaserScan((0, 0, 0), lrf.angles, np.full(181, 4.0))
        >>> free_cells([scan]).contain(np.array([[3.0, 0.0], [-3.0, 0.0], [5.0, 0.0]])).tolist()
        [True, False, False]
    """
    if not len(scans):
        return FreeCells(np.zeros((1, 1), dtype=np.bool_), CELL)
    places = np.array([scan.pose[:2] for scan in scans])
    reach = 0.5 * LARGEST_CELL * np.sqrt(MOST_CELLS) - SIGHT - CELL
    off = np.abs(places - np.median(places, axis=0)).max(axis=1)
    if off.max() > reach:
        near = np.abs(places - places[np.argmin(off)]).max(axis=1) <= reach
        places, scans = places[near], [scans[k] for k in np.flatnonzero(near).tolist()]
    low, high = places.min(axis=0) - SIGHT - CELL, places.max(axis=0) + SIGHT + CELL
    size = max(CELL, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    # The corner of the first cell is a whole number of cells from the origin.
    low = np.floor(low / size) * size
    columns, rows = np.ceil((high - low) / size).astype(int)
    cells = np.zeros((rows, columns), dtype=np.bool_)
    for scan in scans:
        x, y, theta = scan.pose
        # Some scanners hang upside down and turn the other way.
        way = 1 if scan.angles[-1] >= scan.angles[0] else -1
        angles, ranges = scan.angles[::way].copy(), scan.ranges[::way].copy()
        _mark(cells, np.array([x - low[0], y - low[1], theta]), angles, ranges, size)
    if not cells.any():
        # Poses so far apart that a cell is wider than what a scan shows.
        return FreeCells(np.zeros((1, 1), dtype=np.bool_), CELL)
    held_rows, held_columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    first_row, first_column = held_rows[0], held_columns[0]
    origin = low + size * np.array([first_column, first_row])
    held = cells[first_row : held_rows[-1] + 1, first_column : held_columns[-1] + 1]
    return FreeCells(held, size, (float(origin[0]), float(origin[1]), 0.0))


@compiled
def _mark(cells: Bool, pose: Float, angles: Float, ranges: Float, size: float) -> None:
    """Mark the cells (rows, columns), with sides of size [m], that a scan shows to be free."""
    rows, columns = cells.shape
    beams = len(angles)
    px, py, theta = pose[0], pose[1], pose[2]
    step = max((angles[beams - 1] - angles[0]) / max(beams - 1, 1), 1e-9)
    farthest = DRIVEN
    widest = 0.0
    for i in range(beams):
        if np.isfinite(ranges[i]):
            farthest = max(farthest, min(ranges[i], SIGHT))
        if i > 0:
            widest = max(widest, angles[i] - angles[i - 1])
    # What is seen lies in the box around the robot and the returns, but for the arcs between beams.
    bulge = DRIVEN + farthest * (1.0 - np.cos(0.5 * min(widest, np.pi)))
    low_x = low_y = -bulge
    high_x = high_y = bulge
    for i in range(beams):
        if np.isfinite(ranges[i]):
            reach = min(ranges[i], SIGHT)
            x, y = reach * np.cos(angles[i] + theta), reach * np.sin(angles[i] + theta)
            low_x, high_x = min(low_x, x - bulge), max(high_x, x + bulge)
            low_y, high_y = min(low_y, y - bulge), max(high_y, y + bulge)
    left = max(int(np.floor((px + low_x) / size)), 0)
    right = min(int(np.floor((px + high_x) / size)) + 1, columns)
    bottom = max(int(np.floor((py + low_y) / size)), 0)
    top = min(int(np.floor((py + high_y) / size)) + 1, rows)
    for row in range(bottom, top):
        for column in range(left, right):
            if cells[row, column]:
                continue
            x, y = (column + 0.5) * size - px, (row + 0.5) * size - py
            away = np.sqrt(x * x + y * y)
            if away <= DRIVEN:
                cells[row, column] = True
                continue
            if away > farthest:
                continue
            # Within the full turn that begins at the first beam.
            turn = np.arctan2(y, x) - theta - angles[0]
            turn -= 2.0 * np.pi * np.floor(turn / (2.0 * np.pi))
            after = _first_beam_from(angles, turn, step)
            if after == 0 or after == beams:
                continue
            behind = away + MARGIN + 0.5 * size
            one, other = ranges[after - 1], ranges[after]
            if np.isfinite(one) and np.isfinite(other) and min(one, other) >= behind:
                cells[row, column] = True


@inner
def _first_beam_from(angles: Float, turn: float, step: float) -> int:
    """Number of the first beam that is turned by so much [rad] from the first one, or by more.

    Beams are evenly spaced, or nearly: the right one is beside that of the mean step [rad], and is
    found sooner than by halving.
    """
    beams = len(angles)
    angle = angles[0] + turn
    after = min(int(turn / step) + 1, beams)
    while after > 0 and angles[after - 1] >= angle:
        after -= 1
    while after < beams and angles[after] < angle:
        after += 1
    return after
