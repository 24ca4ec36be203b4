"""Free space: a grid of the cells that scans show to be free, for planning routes.

Scans enter; a :class:`~lrf3d.world.free_cells.FreeCells` leaves.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.laser.scan import LaserScan, reflection_points
from lrf3d.world.free_cells import FreeCells

# [m] Largest range at which a scan shows a cell to be free: beyond, beams are too far apart.
SIGHT = 15.0

# [m] Least side of a cell: a door is several cells wide.
CELL = 0.1

# [m] Distance before a return, in addition to a cell, that is not marked free: the noise.
MARGIN = CELL

# [m] Radius around each pose that is free, because the robot was there.
DRIVEN = 2.0 * CELL


def distinct_poses(poses: Float) -> Int:
    """Rows of the poses (k, 3) that are the first in their cell of place and heading."""
    # [m], [rad] Size of a cell of poses from which only the first scan is used: others add little.
    moved = 0.25
    turned = np.deg2rad(10)
    cells = np.floor(poses / [moved, moved, turned]).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.sort(first)


def free_cells(scans: Sequence[LaserScan]) -> FreeCells:
    """The cells that scans show to be free: those before the returns of their beams.

    A cell between two beams is free if both returned from behind it.
    """
    from PIL import Image, ImageDraw

    if not len(scans):
        return FreeCells(np.zeros((1, 1), dtype=np.bool_), CELL)
    places = np.array([scan.pose[:2] for scan in scans])
    most_cells = 4_000_000  # Largest number of cells of a grid; larger areas have larger cells.
    largest_cell = 0.5  # [m] Larger cells hide doors.
    # Of scans too far apart for such cells, those around the most central one are used.
    reach = 0.5 * largest_cell * np.sqrt(most_cells) - SIGHT - CELL
    off = np.abs(places - np.median(places, axis=0)).max(axis=1)
    if off.max() > reach:
        near = np.abs(places - places[np.argmin(off)]).max(axis=1) <= reach
        places = places[near]
        scans = [scans[k] for k in np.flatnonzero(near).tolist()]
    low = places.min(axis=0) - SIGHT - CELL
    high = places.max(axis=0) + SIGHT + CELL
    size = max(CELL, float(np.sqrt(np.prod(high - low) / most_cells)))
    # The corner of the first cell is a whole number of cells from the origin.
    low = np.floor(low / size) * size
    columns, rows = np.ceil((high - low) / size).astype(int)
    picture = Image.new("L", (int(columns), int(rows)))
    drawing = ImageDraw.Draw(picture)
    for scan in scans:
        x, y, _ = scan.pose
        reach = np.where(np.isfinite(scan.ranges), np.minimum(scan.ranges, SIGHT), 0.0)
        between = np.minimum(reach[:-1], reach[1:]) - MARGIN - size
        # Two corners for each gap between two beams, as far away as the nearer return allows.
        away = np.repeat(np.maximum(between, 0.0), 2)
        angles = np.column_stack([scan.angles[:-1], scan.angles[1:]]).ravel()
        corners = reflection_points(scan.pose, angles, away)
        outline = np.round((np.vstack([corners, [x, y], [x, y]]) - low) / size - 0.5)
        drawing.polygon(outline.ravel().tolist(), fill=1)
        column, row = (np.array([x, y]) - low) / size - 0.5
        driven = DRIVEN / size - 0.5
        drawing.ellipse([column - driven, row - driven, column + driven, row + driven], fill=1)
    box = picture.getbbox()
    if box is None:
        # Poses so far apart that a cell is wider than what a scan shows.
        return FreeCells(np.zeros((1, 1), dtype=np.bool_), CELL)
    x, y = (low + size * np.array(box[:2])).tolist()
    return FreeCells(np.array(picture.crop(box), dtype=np.bool_), size, (x, y, 0.0))
