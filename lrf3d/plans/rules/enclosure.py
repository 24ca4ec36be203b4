"""Whether the dark pixels of a picture close rooms, as the walls of a plan do.

Letters, logos and charts close hardly any. Two kinds of worlds close none, either, and count as
plans: a town of solid blocks, and a few long walls.
"""

import numpy as np
import shapely
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt, label

from lrf3d.geometry.lines import Bool, Float, lengths
from lrf3d.plans.plan import THICKEST
from lrf3d.world.grid_walls import grown, on_border, parts_of, walls_of_grid

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


def closes_rooms(walls: Bool, thin: Float, pixels: float) -> bool:
    """Whether walls, and thin ones (n, 4) [pixels], may be a plan; `pixels`: pixels per metre."""
    step = -(-max(walls.shape) // 600)
    rows, columns = (np.arange(0, side, step) for side in walls.shape)
    image = Image.fromarray(
        np.logical_or.reduceat(np.logical_or.reduceat(walls, rows), columns, axis=1)
    )
    for side in thin / step:
        ImageDraw.Draw(image).line([*side], fill=1)
    dark = np.pad(np.asarray(image, dtype=np.bool_), 3)
    sides = walls_of_grid(dark)
    metre = pixels / step
    if not len(sides):
        return True
    points = sides.reshape(-1, 2)
    extent = np.ptp(points, axis=0).max()
    reach = 0.5 * (DOOR * metre if extent > MODEL * metre else DOOR_OF_MODEL * extent)
    rooms, count = label(distance_transform_edt(~dark) > reach)
    closed = np.arange(count + 1) > 0
    closed[on_border(rooms)] = False
    space = grown(closed[rooms], reach) & ~dark
    if space.sum() > LEAST_CLOSED * shapely.convex_hull(shapely.multipoints(points)).area:
        return True
    core = distance_transform_edt(dark) > 0.5 * THICKEST * metre
    solid = grown(core, 0.5 * THICKEST * metre) & dark
    long = np.sort(lengths(sides))[::-1]
    half = long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())]
    few = half > LONGEST * extent and solid.sum() < 0.9 * dark.sum()
    return bool(few or parts_of(core)[1] >= LEAST_BLOCKS)
