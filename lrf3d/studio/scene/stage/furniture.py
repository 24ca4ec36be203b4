"""Furniture: what stands in rooms and is no wall, and the bedding that makes a box a bed.

Structures enter; which solids are furniture, colours of their tops, and quads on these leave.
"""

import numpy as np
import shapely

from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.studio.scene.stage.structures import Structures

# Largest thickness of solids that are walls of rooms, if they are as high [m].
_THICKEST = 0.5

# Largest height of tables, beds and shelves whose tops are of wood [m].
_LOW = 1.2

# Least and largest width and length of a double bed [m].
_LEAST_BED = np.array([1.3, 1.8])
_LARGEST_BED = np.array([2.2, 2.3])

# Distance from a wall at which the head of a bed stands at the most [m].
_AT_WALL = 0.4

# Factors of the colours of a sheet, a pillow and a cover.
_SHEET = (1.0, 1.0, 1.02)
_PILLOW = (1.3, 1.3, 1.32)
_COVER = (0.66, 0.76, 0.95)

# What the top of a bed shows: from and to where in its width, and in its length from the head on.
_BEDDING = (
    (0.0, 0.0, 1.0, 0.05, _SHEET),
    (0.0, 0.05, 0.08, 0.25, _SHEET),
    (0.08, 0.05, 0.46, 0.25, _PILLOW),
    (0.46, 0.05, 0.54, 0.25, _SHEET),
    (0.54, 0.05, 0.92, 0.25, _PILLOW),
    (0.92, 0.05, 1.0, 0.25, _SHEET),
    (0.0, 0.25, 1.0, 0.36, _SHEET),
    (0.0, 0.36, 1.0, 1.0, _COVER),
)


def is_furniture(structures: Structures) -> Bool:
    """Which solids (k,) stand in rooms; those that are thin, and as high as any, are walls."""
    solids = structures.solids
    thick = 2.0 * shapely.area(solids) >= _THICKEST * shapely.length(solids)
    low = structures.solid_heights < structures.heights.max(initial=0.0)
    return np.asarray(structures.indoor & (thick | low))


def is_wooden(structures: Structures) -> Bool:
    """Which solids (k,) are low furniture, whose tops are of wood."""
    return is_furniture(structures) & (structures.solid_heights <= _LOW)


def bedding(structures: Structures) -> tuple[Float, Int, Float]:
    """Quads (q, 4, 2) of the tops of beds, the solids (q,) of these, and colour factors (q, 3).

    Low furniture of the size of a double bed is one if a wall stands at its head.
    """
    quads = list[Float]()
    beds = list[int]()
    tints = list[tuple[float, ...]]()
    for bed in np.flatnonzero(is_wooden(structures)).tolist():
        head = _head(structures, bed)
        for left, near, right, far, tint in _BEDDING * bool(len(head)):
            shares = np.array([[left, near], [right, near], [right, far], [left, far]])
            quads.append(head[0] + shares @ (head[1:] - head[0]))
            beds.append(bed)
            tints.append(tint)
    return (
        np.reshape(quads, (-1, 4, 2)),
        np.array(beds, np.int64),
        np.reshape(tints, (-1, 3)),
    )


def _head(structures: Structures, solid: int) -> Float:
    """Three corners (3, 2) of a bed, both at the head first; none (0, 2) if it is no bed."""
    outline = structures.solids[solid]
    box = shapely.orient_polygons(shapely.minimum_rotated_rectangle(outline))
    corners = shapely.get_coordinates(box)[:4]
    own = structures.objects == structures.solid_objects[solid]
    walls = shapely.multilinestrings(structures.tree.geometries[~own])
    longest = 0.0
    found = np.zeros((0, 2))
    for turned in range(4):
        first, second, _, last = np.roll(corners, turned, axis=0)
        size = np.hypot(*np.array([second - first, last - first]).T)
        fits = ((size >= _LEAST_BED) & (size <= _LARGEST_BED)).all()
        middle = shapely.points(0.5 * (first + second))
        if fits and size[1] > longest and shapely.dwithin(walls, middle, _AT_WALL):
            longest = size[1]
            found = np.array([first, second, last])
    return found
