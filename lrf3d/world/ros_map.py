"""Worlds from ROS maps: a YAML file that describes a picture of occupied cells (map_server).

The rules are those of Nav2's map_server. The world is in the frame of the map. A cell at least as
dark as ``occupied_thresh`` is occupied; walls are the outlines of occupied cells, or the middle of
a wall that is one or two cells thick. Walls that touch are one object. Free and unknown cells do
not affect beams, but are kept for planning routes.

A world is written as a picture in which each wall is one cell thick.
"""

import json
import re
import warnings
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.balance import Balance
from lrf3d.base.errors import Lrf3dWarning, OutputError, WorldError, shown
from lrf3d.base.files import own_name, read_text, replacing
from lrf3d.geometry.lines import Bool, Float, Int, Single, number
from lrf3d.geometry.pose import Pose
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.grid_walls import walls_of_grid
from lrf3d.world.model import LARGEST_CELL, World
from lrf3d.world.pieces import connected
from lrf3d.world.pixels import pixels_of
from lrf3d.world.schema import Converter, accepting, row, text

# Grey of an occupied cell, as map_saver writes it.
OCCUPIED = 0

# Grey of an unknown cell, likewise.
UNKNOWN = 205

# Grey of a free cell, likewise.
FREE = 254

# Width of the free space [m] around the walls.
FREE_MARGIN = 1.0

# Largest number of cells of a written map.
MOST_WRITTEN = 1 << 25

# Distance [cells] within which two lines are the same.
_ROUNDING = 1e-3

# Largest distance [cells] of the middles of a thin wall's cells from its line: in a wall two cells
# thick they are half a cell away.
_HALF_WALL = 0.8

# Distance [cells] from the line of a wall that stays within which its cells stay, too; the outline
# of a thick wall runs half a cell beside their middles.
_STAYS = 0.4

# Side of a cell [m] above which it may be given in millimetres: robots' maps have centimetres.
COARSE = 2.0

# Number of grey cells, between the thresholds, from which they are noted: a share of the occupied.
NOTED = 0.1

# Difference in occupancy below which the cells of a map are alike.
LEAST_SHARE = 0.05

# The keys of a description that are read, and the converters of their values.
KEYS: Mapping[str, Converter] = {
    "image": text(),
    "resolution": partial(number, positive=True, most=LARGEST_CELL),
    "origin": row("x", "y", "yaw"),
    **dict.fromkeys(("occupied_thresh", "free_thresh"), partial(number, most=1.0)),
    "negate": accepting("0 or 1", lambda value: value in (0, 1), int),
    # Nav2 reads it in any case.
    "mode": accepting(
        "one of trinary, scale, raw",
        lambda value: str(value).lower() in ("trinary", "scale", "raw"),
        str.lower,
    ),
}


def read_ros_map(path: Path) -> World:
    """Read the occupied cells of a ROS map as walls."""
    values = _values(_described(path))
    picture = _picture_of(path, values["image"])
    if values["free_thresh"] > values["occupied_thresh"]:
        raise WorldError("free_thresh is above occupied_thresh")
    occupied, free = _cells(picture, values)
    resolution = values["resolution"]
    origin = Pose(*values["origin"].tolist())
    local = walls_of_grid(occupied).reshape(-1, 2) * resolution
    if not len(local):
        raise WorldError(f"no wall: {_darkest(picture, values)}")
    balance = cells_of_map(picture, values, occupied, free)
    # Most of a map is free or unknown, which needs no note.
    for reason in ("free cell", "unknown cell"):
        balance.all -= balance.left_out.pop(reason, 0)
    if balance.words() and sum(balance.left_out.values()) < NOTED * balance.used:
        balance = Balance("cell")
    coarse = f"cells of {resolution:g} m? write resolution: {resolution / 1000:g} if it is in mm"
    balance.note(path, coarse if resolution > COARSE else "")
    segments = origin.apply(local).reshape(-1, 4)
    # Ends meet up to rounding; half a cell is the resolution of the map.
    objects = connected(segments, 0.5 * resolution)
    cells = FreeCells(free, resolution, origin, occupied)
    return World(segments, objects, name=own_name(path), free=cells)


def _values(data: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a map's description by their keys, with default values."""
    values: dict[str, Any] = {
        "occupied_thresh": 0.65,
        "free_thresh": 0.25,
        "negate": 0,
        "mode": "trinary",
    }
    for key in filter(KEYS.__contains__, data):
        is_text = key in ("image", "mode")
        values[key] = KEYS[key](data[key] if is_text else _plain(data[key]), key)
    return values


def _described(path: Path) -> dict[str, Any]:
    """The description of a map, whose keys stand in it once."""
    import yaml

    loader = yaml.BaseLoader(read_text(path))
    node = loader.get_single_node()
    data = loader.construct_document(node) if node else None
    if node is None or not (
        isinstance(data, dict) and {"image", "resolution", "origin"} <= set(data)
    ):
        held = data if isinstance(data, dict) else ()
        missing = [key for key in ("image", "resolution", "origin") if key not in held]
        raise WorldError(
            "expected the description of a ROS map: image, resolution, origin;"
            f" it has no {' and no '.join(missing)}"
        )
    lines: dict[str, int] = {}
    for key, _ in node.value:
        name = str(key.value)
        line = key.start_mark.line + 1
        if (first := lines.setdefault(name, line)) != line:
            twice = f"the key {shown(name)} stands in line {first}, too; remove one"
            raise WorldError(f"line {line}: {twice}")
    return data


def _picture_of(path: Path, image: str) -> Path:
    """The picture of a description at a path: next to it, or in a folder there."""
    *folders, name = re.split(r"[/\\]", image)
    below = path.parent.joinpath(*folders, name)
    if folders and ".." not in folders and folders[0] and below.is_file():
        return below
    if name != image.removeprefix("./") or not name.strip("."):
        elsewhere = f"image is {shown(image)}"
        if not (path.parent / name).is_file():
            raise WorldError(f"{elsewhere}; put the picture next to this file and name it so")
        warnings.warn(f"{path}: {elsewhere}; {name} next to it is read", Lrf3dWarning, 4)
    return path.parent / name


def _plain(value: Any) -> Any:
    """Convert texts to the numbers of YAML 1.2, also in a list: PyYAML reads ``5e-2`` as a text."""
    if isinstance(value, list):
        # A list within the list stays: aliases may make it endless.
        return [_plain(each) if isinstance(each, str) else each for each in value]
    if not isinstance(value, str):
        return value
    if not re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", value):
        truth = {"true": 1, "yes": 1, "on": 1, "false": 0, "no": 0, "off": 0}
        return truth.get(value.lower(), value)
    return int(value) if value.isdigit() and len(value) < 16 else float(value)


def cells_of_map(picture: Path, values: Mapping[str, Any], occupied: Bool, free: Bool) -> Balance:
    """The balance of a map's cells: those that are occupied are used."""
    light, opaque = _light(picture)
    unknown = ~occupied & ~free
    # Between the thresholds are cells whose occupancy is low or high, but not enough.
    grey = unknown & ((np.round(255 * light) != UNKNOWN) & opaque)[::-1]
    if values["mode"] == "raw":
        grey[:] = False
    balance = Balance("cell", occupied.size, int(occupied.sum()))
    balance.leave("free cell", int(free.sum()))
    balance.leave("grey cell", int(grey.sum()))
    balance.leave("unknown cell", int((unknown & ~grey).sum()))
    return balance


def _darkest(picture: Path, values: Mapping[str, Any]) -> str:
    """Why a map holds no wall, with a threshold that was tried."""
    light, opaque = _light(picture)
    share = (light if values["negate"] else 1.0 - light)[opaque]
    if values["mode"] == "raw" or not share.size or share.max() - share.min() < LEAST_SHARE:
        return "all cells are alike, or no occupied one is next to another"
    darkest = float(np.floor(100 * share.max()) / 100)
    least = values["occupied_thresh"]
    if darkest >= least:
        return "no occupied cell is next to another"
    count = int((share >= darkest).sum())
    found = f"occupied_thresh is {least:g}, and the darkest cells have {darkest:g}"
    return f"{found}; occupied_thresh: {darkest:g} takes {count:,} of them"


def _cells(picture: Path, values: Mapping[str, Any]) -> tuple[Bool, Bool]:
    """Which cells (rows, columns) are occupied and which free, the first row at the bottom."""
    light, opaque = _light(picture)
    share = light if values["negate"] else 1.0 - light
    value = np.round(255 * light)
    # map_saver writes one grey for unknown cells, even if free_thresh is just above it; read by the
    # rule alone, they would be free.
    known = opaque if values["mode"] == "scale" else (value != UNKNOWN) | bool(values["negate"])
    if values["mode"] == "raw":
        # The value of a pixel is the occupancy in percent, not negated; above 100 it is unknown.
        share = value / 100
        known = share <= 1.0
    occupied = known & (share >= values["occupied_thresh"])
    return occupied[::-1], (known & ~occupied & (share <= values["free_thresh"]))[::-1]


def _light(picture: Path) -> tuple[Single, Bool]:
    """How light the pixels of a picture are on white paper, from 0 to 1, and which are opaque."""
    pixels = pixels_of(picture, deep=True)
    most = np.float32(np.iinfo(pixels.dtype).max)
    alpha = pixels[..., -1] / most
    light = pixels[..., :-1].mean(axis=2, dtype=np.float32) / most
    return np.asarray(1.0 - alpha * (1.0 - light)), np.asarray(alpha == 1.0)


def write_ros_map(world: World, path: Path, *, resolution: float | None = None) -> None:
    """Write the walls and free cells of a world as a ``.yaml`` file and, next to it, a ``.pgm``."""
    resolution = cell_size(world) if resolution is None else resolution
    cells, (x, y) = map_cells(world, resolution, path)
    picture = path.with_suffix(".pgm")
    rows, columns = cells.shape
    # A JSON string is valid YAML for any name.
    text = (
        f"image: {json.dumps(picture.name)}\nresolution: {resolution!r}\n"
        f"origin: [{x!r}, {y!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"
    )
    # Both are complete before either replaces an older one, which it would not match.
    with replacing(path) as described, replacing(picture) as drawn:
        drawn.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + cells[::-1].tobytes())
        described.write_text(text, encoding="utf-8")


def rewrite_map(path: Path, before: Float, after: Float, to: Path) -> None:
    """Write a map again with changed walls: (n, 4) before, and (m, 4) after the change.

    The cells of removed walls become what is nearest to them, free or unknown, those of added walls
    occupied; other cells, the origin and the other keys stay the same.
    """
    import shapely
    from scipy.ndimage import distance_transform_edt

    values = _values(_described(path))
    source = _picture_of(path, values["image"])
    frame = Pose(*values["origin"].tolist()).inverse()

    def lines_in_cells(rows: set[tuple[float, ...]]) -> Any:
        ends = frame.apply(np.array(sorted(rows)).reshape(-1, 2)).reshape(-1, 2, 2)
        return shapely.linestrings(ends / values["resolution"])

    # Most walls are as they were.
    were, are = (set(map(tuple, each.tolist())) for each in (before, after))
    old = shapely.union_all(lines_in_cells(were - are))
    new = shapely.union_all(lines_in_cells(are - were))
    gone = old.difference(new.buffer(_ROUNDING))
    came = new.difference(old.buffer(_ROUNDING))
    # Removed outlines enclose the cells of a wall; at a doorway its jambs close them.
    rings = shapely.get_parts(shapely.polygonize(list(shapely.get_parts(gone.union(came)))))
    along = gone.buffer(0.1)
    filled = [
        each for each in rings if each.exterior.intersection(along).length > 0.3 * each.length
    ]
    area = shapely.union_all([gone.buffer(_HALF_WALL, cap_style="flat"), *filled])
    occupied, _ = _cells(source, values)
    rows, columns = np.nonzero(occupied)
    erased = np.flatnonzero(shapely.contains_xy(area, columns + 0.5, rows + 0.5))
    middles = shapely.points(columns[erased] + 0.5, rows[erased] + 0.5)
    staying = shapely.STRtree(lines_in_cells(were & are))
    erased = np.delete(erased, staying.query(middles, predicate="dwithin", distance=_STAYS)[0])
    grey = pixels_of(source)[::-1, :, 0].copy()
    free, full = (255 - FREE, 255 - OCCUPIED) if values["negate"] else (FREE, OCCUPIED)
    known = np.where(occupied.all(), np.uint8(free), grey)
    near = distance_transform_edt(occupied, return_distances=False, return_indices=True)
    grey[rows[erased], columns[erased]] = known[tuple(near[:, rows[erased], columns[erased]])]
    points, line = shapely.get_coordinates(shapely.get_parts(came), return_index=True)
    joined = line[1:] == line[:-1]
    row, column = _walled_cells(np.hstack([points[:-1][joined], points[1:][joined]]))
    inside = (row >= 0) & (row < len(grey)) & (column >= 0) & (column < grey.shape[1])
    grey[row[inside], column[inside]] = full
    picture = to.with_suffix(".pgm")
    text = re.sub(r"(?m)^image:.*$", f"image: {json.dumps(picture.name)}", read_text(path))
    with replacing(to) as described, replacing(picture) as rewritten:
        rewritten.write_bytes(b"P5\n%d %d\n255\n" % grey.shape[::-1] + grey[::-1].tobytes())
        described.write_text(text, encoding="utf-8")


def cell_size(world: World, least: float = 0.05) -> float:
    """The side of the cells [m] of a world's map: the least, or more for a large world."""
    sides = np.ptp(world.bounds, axis=0) + 2.0 * FREE_MARGIN
    # Rows and columns are rounded up.
    return max(least, 1.001 * float(np.sqrt(np.prod(sides) / MOST_WRITTEN)))


def map_cells(
    world: World, resolution: float, path: Path
) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """The cells (rows, columns) of a world, the first row at the bottom, and their corner x, y [m].

    They reach a metre, or two cells, beyond the walls. Errors name the path that they are for.
    """
    margin = max(FREE_MARGIN, 2.0 * resolution)
    low = world.bounds[0] - margin
    high = world.bounds[1] + margin
    # A whole number of cells from the origin, so that straight walls stay straight.
    first = np.floor(low / resolution)
    columns, rows = (np.ceil(high / resolution) - first).astype(np.int64).tolist()
    if columns * rows > MOST_WRITTEN:
        found = f"{columns} by {rows} cells, more than {MOST_WRITTEN:,}"
        raise OutputError(f"{path}: {found}; choose larger cells")
    cells = np.full((rows, columns), FREE, dtype=np.uint8)
    if world.free is not None:
        x, heights = (resolution * (first[n] + 0.5 + np.arange((columns, rows)[n])) for n in (0, 1))
        for row, y in zip(cells, heights, strict=True):
            row[~world.free.contain(np.column_stack([x, np.full(columns, y)]))] = UNKNOWN
    cells[_walled_cells(world.segments / resolution - np.tile(first, 2))] = OCCUPIED
    x, y = (first * resolution).tolist()
    return cells, (x, y)


def _walled_cells(segments: Float) -> tuple[Int, Int]:
    """Rows and columns of the cells along segments (n, 4) [cells].

    Along its major axis a wall has one cell in each column (or row) between its ends: the one whose
    centre is nearest.
    """
    steep = np.abs(segments[:, 3] - segments[:, 1]) > np.abs(segments[:, 2] - segments[:, 0])
    turned = np.where(steep[:, None], segments[:, [1, 0, 3, 2]], segments)
    backward = turned[:, 0] > turned[:, 2]
    turned[backward] = turned[backward][:, [2, 3, 0, 1]]
    start, end = np.floor(turned[:, ::2]).astype(np.int64).T
    counts = end - start + 1
    wall = np.repeat(np.arange(len(segments)), counts)
    major = start[wall] + np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    x1, y1, x2, y2 = turned[wall].T
    # A wall shorter than a cell may pass through no centre of a column.
    share = np.where(x2 - x1 < 1.0, 0.5, (major + 0.5 - x1) / np.maximum(x2 - x1, 1.0))
    minor = np.floor(y1 + share * (y2 - y1)).astype(np.int64)
    return np.where(steep[wall], major, minor), np.where(steep[wall], minor, major)
