"""Whether what is dark in a picture closes rooms, as the walls of a plan do.

Letters, logos and charts close hardly any. The blocks of a town, each solid, and a few long walls
close none, either, but are worlds.
"""

import numpy as np
import shapely
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt, label

from lrf3d.geometry.lines import Bool, Float, lengths
from lrf3d.plans.plan import THICKEST
from lrf3d.world.grid_walls import grown, on_border, parts_of, walls_of_grid


def closes_rooms(walls: Bool, thin: Float, pixels: float) -> bool:
    """Whether walls, and thin ones (n, 4) [pixels], may be a plan; so many pixels are a metre."""
    # Width of the widest door [m]; of a model, which is smaller than this [m], its share.
    door = 1.2
    model = 5.0
    share = 0.05
    # Smallest share of the area of a plan that is closed; the solid blocks of a town; the share of
    # its extent that half of the length of a few long walls exceeds.
    least = 0.15
    blocks = 12
    longest = 0.3
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
    reach = 0.5 * (door * metre if extent > model * metre else share * extent)
    rooms, count = label(distance_transform_edt(~dark) > reach)
    closed = np.arange(count + 1) > 0
    closed[on_border(rooms)] = False
    space = grown(closed[rooms], reach) & ~dark
    if space.sum() > least * shapely.convex_hull(shapely.multipoints(points)).area:
        return True
    core = distance_transform_edt(dark) > 0.5 * THICKEST * metre
    solid = grown(core, 0.5 * THICKEST * metre) & dark
    long = np.sort(lengths(sides))[::-1]
    half = long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())]
    few = half > longest * extent and solid.sum() < 0.9 * dark.sum()
    return bool(few or parts_of(core)[1] >= blocks)
