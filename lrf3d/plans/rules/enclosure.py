"""Whether the dark pixels of a picture close rooms, as the walls of a plan do.

Letters, logos and charts close hardly any. Two kinds of worlds close none, either, and count as
plans: a town of solid blocks, and a few long walls.
"""

import numpy as np
import shapely
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt, label

from lrf3d.geometry.lines import ROUNDING, Bool, Float, Int, lengths
from lrf3d.plans.canvas import THICKEST_SOLID
from lrf3d.world.grid_walls import extent_of, grown, on_border, parts_of, walls_of_grid

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


def reduced(walls: Bool, pixels: float, thin: Float | None = None) -> tuple[Bool, float]:
    """The cells of walls, and of thin ones (n, 4) [pixels], in a border; their number per metre.

    Args:
        walls: Which pixels (rows, columns) are walls.
        pixels: Pixels per metre.
        thin: Walls that are lines.
    """
    step = -(-max(walls.shape) // CELLS)
    rows, columns = (np.arange(0, side, step) for side in walls.shape)
    cells = np.logical_or.reduceat(np.logical_or.reduceat(walls, rows), columns, axis=1)
    if thin is not None:
        cells |= drawn_on(cells.shape, thin / step)
    return np.pad(cells, BORDER), pixels / step


def closes_rooms(dark: Bool, metre: float) -> bool:
    """Whether dark cells may be a plan; `metre`: cells per metre."""
    extent = extent_of(dark)
    if not extent or closed_share(dark, _door(extent, metre)) > LEAST_CLOSED:
        return True
    core = distance_transform_edt(dark) > 0.5 * THICKEST_SOLID * metre
    solid = grown(core, 0.5 * THICKEST_SOLID * metre) & dark
    long = np.sort(lengths(walls_of_grid(dark)))[::-1]
    half = long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())]
    town = parts_of(core)[1] >= LEAST_BLOCKS
    return bool(town if solid.sum() > 0.9 * dark.sum() else half > LONGEST * extent)


def shut_share(dark: Bool, metre: float) -> float:
    """The share of the rooms, by area, from which no door leads to most of the others.

    Houses that are closed on all sides stand apart, and each has rooms of its own.
    """
    rooms = _rooms(dark, 0.5 * _door(extent_of(dark), metre)) > 0
    spaces, count = label(~dark)
    houses, _ = label(spaces != spaces[0, 0])
    area = np.bincount(spaces[rooms], minlength=count + 1)
    house = np.zeros(count + 1, dtype=np.int64)
    if not area[spaces[0, 0]]:
        house[spaces[rooms]] = houses[rooms]
    main = np.zeros(houses.max() + 1)
    np.maximum.at(main, house, area)
    return float(1.0 - main.sum() / max(area.sum(), 1.0)) if area.any() else 0.0


def closed_share(dark: Bool, door: float | None = None) -> float:
    """The share of the hull of dark cells that they close, but for doors of a width [cells].

    Without a width, that of a model's doors is taken.
    """
    reach = 0.5 * (_door(extent_of(dark), np.inf) if door is None else door)
    space = grown(_rooms(dark, reach) > 0, reach) & ~dark
    hull = shapely.convex_hull(shapely.multipoints(np.argwhere(dark)))
    return float(space.sum() / max(hull.area, 1.0))


def _door(extent: float, metre: float) -> float:
    """The width [cells] of the doors of a plan of an extent [cells]."""
    return DOOR_OF_MODEL * extent if extent <= MODEL * metre else DOOR * metre


def _rooms(dark: Bool, reach: float) -> Int:
    """The numbers of the rooms that cells farther than a reach [cells] from dark ones are in."""
    rooms, count = label(distance_transform_edt(~dark) > reach)
    closed = np.arange(count + 1)
    closed[on_border(rooms)] = 0
    return np.asarray(closed[rooms])


def drawn_cells(walls: Float) -> tuple[Bool, float]:
    """The cells (rows, columns) along walls (n, 4), within a border, and their number per metre."""
    points = walls.reshape(-1, 2)
    scale = CELLS / max(float(np.ptp(points, axis=0).max()), ROUNDING)
    lines = scale * (walls - np.tile(points.min(axis=0), 2)) + BORDER
    columns, rows = (np.ceil(lines.reshape(-1, 2).max(axis=0)).astype(int) + BORDER).tolist()
    return drawn_on((rows, columns), lines), scale


def drawn_on(shape: tuple[int, ...], lines: Float, width: int = 1) -> Bool:
    """The cells of a grid of a shape under lines (n, 4) [cells] of a width [cells]."""
    rows, columns = shape
    image = Image.new("1", (columns, rows))
    pen = ImageDraw.Draw(image)
    for line in lines.tolist():
        pen.line(line, fill=1, width=width)
    return np.asarray(image, dtype=np.bool_)
