"""Whether the dark pixels of a picture close rooms, as the walls of a plan do.

Letters, logos and charts close hardly any. Two kinds of worlds close none, either, and count as
plans: a town of solid blocks, and a few long walls.
"""

import numpy as np
import shapely
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt, label

from lrf3d.geometry.lines import Bool, Float, lengths
from lrf3d.world.grid_walls import grown, on_border, parts_of, walls_of_grid

# Largest mean thickness [m] of a wall that is drawn as an area; only a thicker area may be a floor.
THICKEST = 0.6

# Number of cells along a plan whose rooms are sought, and of empty ones around it.
CELLS = 600
BORDER = 3

# Width [m] of the widest door.
DOOR = 1.2

# Extent [m] below which a plan is that of a model, and the width of its doors as a share of it.
MODEL = 5.0
DOOR_OF_MODEL = 0.05

# Smallest share of the area of a plan that its walls close.
LEAST_CLOSED = 0.15

# Least number of solid blocks in a town.
LEAST_BLOCKS = 12

# Walls are few and long if half of their total length is in walls longer than this share of the
# extent of the plan.
LONGEST = 0.3


def closes_rooms(walls: Bool, pixels: float, thin: Float | None = None) -> bool:
    """Whether walls, and thin ones (n, 4) [pixels], may be a plan; `pixels`: pixels per metre."""
    step = -(-max(walls.shape) // CELLS)
    rows, columns = (np.arange(0, side, step) for side in walls.shape)
    image = Image.fromarray(
        np.logical_or.reduceat(np.logical_or.reduceat(walls, rows), columns, axis=1)
    )
    for side in () if thin is None else thin / step:
        ImageDraw.Draw(image).line([*side], fill=1)
    dark = np.pad(np.asarray(image, dtype=np.bool_), BORDER)
    sides = walls_of_grid(dark)
    metre = pixels / step
    extent = np.ptp(sides.reshape(-1, 2), axis=0).max() if len(sides) else 0.0
    if (
        not extent
        or closed_share(dark, 0.0 if extent <= MODEL * metre else DOOR * metre) > LEAST_CLOSED
    ):
        return True
    core = distance_transform_edt(dark) > 0.5 * THICKEST * metre
    solid = grown(core, 0.5 * THICKEST * metre) & dark
    long = np.sort(lengths(sides))[::-1]
    half = long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())]
    few = half > LONGEST * extent and solid.sum() < 0.9 * dark.sum()
    return bool(few or parts_of(core)[1] >= LEAST_BLOCKS)


def closed_share(dark: Bool, door: float = 0.0) -> float:
    """The share of the hull of dark cells that they close, but for doors of a width [cells].

    Without a width, that of a model's doors is taken.
    """
    points = np.argwhere(dark)
    reach = 0.5 * (door or DOOR_OF_MODEL * float(np.ptp(points, axis=0).max(initial=1)))
    rooms, count = label(distance_transform_edt(~dark) > reach)
    closed = np.arange(count + 1) > 0
    closed[on_border(rooms)] = False
    space = grown(closed[rooms], reach) & ~dark
    hull = shapely.convex_hull(shapely.multipoints(points))
    return float(space.sum() / max(hull.area, 1.0))


def drawn_cells(walls: Float) -> tuple[Bool, float]:
    """The cells (rows, columns) along walls (n, 4), within a border, and their number per metre."""
    points = walls.reshape(-1, 2)
    scale = CELLS / max(float(np.ptp(points, axis=0).max()), 1e-9)
    lines = scale * (walls - np.tile(points.min(axis=0), 2)) + BORDER
    columns, rows = (np.ceil(lines.reshape(-1, 2).max(axis=0)).astype(int) + BORDER).tolist()
    image = Image.new("1", (columns, rows))
    for line in lines:
        ImageDraw.Draw(image).line([*line], fill=1)
    return np.asarray(image, dtype=np.bool_), scale
