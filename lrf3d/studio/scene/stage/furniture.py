"""Furniture: which solids stand in rooms and are no walls, and what the tops of beds show.

Structures enter; masks of their solids, and quads on these with their tints leave.
"""

import numpy as np
import shapely

from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.studio.scene.stage.structures import Structures

# Largest thickness of solids that are walls of rooms, if they are as high [m].
_THICKEST = 0.5

# Largest height of furniture whose top is of wood [m].
_LOW = 1.2

# Least and largest width and length of double beds (2, 2) [m].
_BEDS = np.array([[1.3, 1.8], [2.2, 2.3]])

# Distance from a wall at which the head of a bed stands at the most [m].
_AT_WALL = 0.25

# Largest height of a bed [m]: that of a plan's furniture; counters and workbenches are higher.
_BED_HIGH = 0.8

# The sheet of a bed round two pillows, and its cover: from and to where in its width and, from the
# head on, in its length, as shares.
_BEDDING = np.array(
    [
        [0.00, 0.00, 1.00, 0.05],
        [0.00, 0.05, 0.08, 0.25],
        [0.46, 0.05, 0.54, 0.25],
        [0.92, 0.05, 1.00, 0.25],
        [0.00, 0.25, 1.00, 0.36],
        [0.08, 0.05, 0.46, 0.25],
        [0.54, 0.05, 0.92, 0.25],
        [0.00, 0.36, 1.00, 1.00],
    ]
)

# Factors of their colours.
_LINEN = np.array([*[[1.0, 1.0, 1.02]] * 5, *[[1.3, 1.3, 1.32]] * 2, [0.66, 0.76, 0.95]])


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
    low = is_wooden(structures)
    wall = ~np.isin(structures.objects, structures.solid_objects[low])
    walls = shapely.multilinestrings(structures.tree.geometries[wall])
    boxes = shapely.orient_polygons(shapely.minimum_rotated_rectangle(structures.solids))
    # Each of the four sides of a box may be the head.
    corners = shapely.get_coordinates(boxes).reshape(-1, 5, 2)[:, :4]
    sides = np.roll(corners, -1, axis=1) - corners
    width = np.hypot(*np.moveaxis(sides, 2, 0))
    size = np.stack([width, np.roll(width, -1, axis=1)], axis=2)
    low &= structures.solid_heights <= _BED_HIGH
    fits = ((size >= _BEDS[0]) & (size <= _BEDS[1])).all(axis=2) & low[:, None]
    fits &= shapely.dwithin(walls, shapely.points(corners + 0.5 * sides), _AT_WALL)
    beds = np.flatnonzero(fits.any(axis=1))
    head = np.argmax(fits[beds] * size[beds, :, 1], axis=1)
    axes = np.stack([sides[beds, head], -sides[beds, head - 1]], axis=1)
    places = _BEDDING[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] @ axes[:, None]
    quads = corners[beds, head][:, None, None] + places
    return (
        quads.reshape(-1, 4, 2),
        np.repeat(beds, len(_BEDDING)),
        np.tile(_LINEN, (len(beds), 1)),
    )
