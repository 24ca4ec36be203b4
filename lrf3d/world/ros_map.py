"""Worlds from ROS maps: a YAML file that describes a picture of occupied cells (map_server).

The world is in the frame of the map. A cell that is darker than ``occupied_thresh`` is occupied;
walls are the outlines of occupied cells, or the middle of a wall that is one or two cells thick.
Walls that touch are one object. Free and unknown cells do not affect beams, but are kept for
planning routes.

A world is written as a picture in which each wall is one cell thick.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import InputError, OutputError, WorldError, shown
from lrf3d.files import opened, own_name, read_text, replacing
from lrf3d.geometry import Bool, Float, Int, Single, is_finite
from lrf3d.pose import as_pose
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.grid_walls import walls_of_grid
from lrf3d.world.model import World
from lrf3d.world.touching import connected

LARGEST_YAML, LARGEST_PICTURE = 1 << 16, 1 << 28
"""Largest description and largest picture [bytes]."""

MOST_CELLS = 1 << 26
"""Largest number of cells of a map: 400 m by 400 m at 5 cm."""

FEW_EDGES, DENSEST = 20_000, 0.25
"""Number of edges between occupied cells and others that any map may have, and number for each
cell: offices have 0.05, noise 1."""

UNKNOWN = 205
"""Value of the pixels of unknown cells as map_saver writes them."""

RESOLUTION = 0.05
"""Default side of a cell [m], unless the map becomes too large."""

FREE_MARGIN = 1.0
"""Width of the free space [m] around the walls."""

MOST_WRITTEN = 1 << 25
"""Largest number of cells of a written map, 33 million."""

ROUNDED_UP = 1.001
"""Factor of the side of a cell in such a large map, whose rows and columns are rounded up."""

OCCUPIED, FREE = 0, 254
"""Values of pixels as map_saver writes them."""


@dataclass(frozen=True, slots=True)
class _Description:
    """How a picture is read as a map; the defaults are those of map_server."""

    picture: Path
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    occupied: float = 0.65
    free: float = 0.25
    negate: bool = False
    mode: str = "trinary"


def read_ros_map(path: Path) -> World:
    """Read the occupied cells of a ROS map as walls.

    Raises:
        WorldError: The file, or the picture that it names, cannot be used.
    """
    description = _description(path)
    occupied, free = _cells(description)
    known = FreeCells(free, description.resolution, description.origin)
    return _world(description, occupied, path, known)


def read_picture(path: Path, *, resolution: float | None = None) -> World:
    """Read the dark pixels of a picture of a floor plan as walls.

    Its lower left corner is at (0, 0). Light pixels may be outside the house, so none is known to
    be free.

    Args:
        path: The picture.
        resolution: Side of a pixel [m].

    Raises:
        WorldError: No resolution is given, or the picture cannot be used.
    """
    if resolution is None:
        raise WorldError(
            "a picture does not say how large it is; give --resolution, the metres per pixel, or"
            f" write {path.with_suffix('.yaml').name} next to it: image: {path.name},"
            " resolution: 0.05, origin: [0, 0, 0]"
        )
    if not (is_finite(resolution) and 0.0 < resolution <= 1e4):
        raise WorldError(
            f"resolution {shown(resolution)}: expected more than 0 and at most 10000 m"
        )
    description = _Description(path, resolution)
    return _world(description, _cells(description)[0], path, None)


def _world(description: _Description, occupied: Bool, path: Path, free: FreeCells | None) -> World:
    edges = int((occupied[1:] != occupied[:-1]).sum() + (occupied[:, 1:] != occupied[:, :-1]).sum())
    if edges > FEW_EDGES and edges > DENSEST * occupied.size:
        raise WorldError(
            f"{edges:,} edges between occupied cells and others, as in noise; clean the map"
        )
    local = walls_of_grid(occupied).reshape(-1, 2) * description.resolution
    if not len(local):
        raise WorldError("no wall: all cells are alike, or no occupied one is next to another")
    x, y, yaw = description.origin
    cos, sin = math.cos(yaw), math.sin(yaw)
    segments = (local @ np.array([[cos, sin], [-sin, cos]]) + [x, y]).reshape(-1, 4)
    # Ends meet up to rounding; half a cell is the resolution of the map.
    objects = connected(segments, 0.5 * description.resolution)
    return World(segments, objects, name=own_name(path), free=free)


def _description(path: Path) -> _Description:
    """What a YAML file says, checked."""
    data = _yaml(path)
    name = data.get("image")
    if not isinstance(name, str) or not name:
        raise WorldError(f"image is {shown(name)}, expected the name of a picture")
    plain = name.removeprefix("./")
    if Path(plain).name != plain or "\\" in plain or "\0" in plain:
        raise WorldError(
            f"image is {shown(name)}; put the picture next to this file and name it so"
        )
    resolution = _number(data, "resolution", most=1e4)
    if not resolution:
        raise WorldError("resolution is 0, expected the metres per cell")
    free, occupied = (
        _number({"free_thresh": 0.25, "occupied_thresh": 0.65} | data, key, most=1.0)
        for key in ("free_thresh", "occupied_thresh")
    )
    if free > occupied:
        raise WorldError("free_thresh is above occupied_thresh")
    negate, mode = data.get("negate", 0), data.get("mode", "trinary")
    origin: Any = data.get("origin")
    if negate not in (0, 1):
        raise WorldError(f"negate is {shown(negate)}, expected 0 or 1")
    if mode not in ("trinary", "scale", "raw"):
        raise WorldError(f"mode is {shown(mode)}, expected trinary, scale or raw")
    try:
        x, y, yaw = as_pose(origin)
    except InputError:
        raise WorldError(
            f"origin is {shown(origin)}, expected [x, y, yaw] in metres and radians"
        ) from None
    picture, place = path.parent / plain, (x, y, yaw)
    return _Description(picture, resolution, place, occupied, free, bool(negate), mode)


def _yaml(path: Path) -> dict[str, Any]:
    """The keys and values of a YAML file, of which no key stands twice."""
    import yaml

    text = read_text(path, what="a world file", largest=LARGEST_YAML, error=WorldError)
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        data = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}: " if mark else ""
        reason = getattr(error, "problem", None) or type(error).__name__
        raise WorldError(f"{line}not YAML: {reason}") from None
    if not isinstance(node, yaml.MappingNode):
        raise WorldError("expected the description of a ROS map: image, resolution, origin")
    lines: dict[str, int] = {}
    for key, _ in node.value:
        name, line = str(key.value), key.start_mark.line + 1
        if lines.setdefault(name, line) != line:
            raise WorldError(
                f"line {line}: the key {shown(name)} stands in line {lines[name]}, too; remove one"
            )
    return dict(data)


def _number(data: dict[str, Any], key: str, *, most: float) -> float:
    value: Any = data.get(key)
    if isinstance(value, bool) or not is_finite(value) or not 0.0 <= float(value) <= most:
        raise WorldError(f"{key} is {shown(value)}, expected a number from 0 to {most:g}")
    return float(value)


def _cells(description: _Description) -> tuple[Bool, Bool]:
    """Which cells (rows, columns) are occupied and which free, the first row at the bottom."""
    light, opaque = _light(description.picture)
    share = light if description.negate else 1.0 - light
    value = np.round(255.0 * (1.0 - share))
    if description.mode == "raw":
        # The value of a pixel is the occupancy in percent; above 100 it is unknown.
        known, share = value <= 100.0, value / 100.0
    elif description.mode == "scale":
        known = opaque
    else:
        # map_saver writes this grey for unknown cells, even if free_thresh is just above it.
        known = value != UNKNOWN
    occupied = known & (share > description.occupied)
    return occupied[::-1], (known & ~occupied & (share <= description.free))[::-1]


def _light(picture: Path) -> tuple[Single, Bool]:
    """How light the pixels (rows, columns) of a picture are on white paper, from 0 to 1.

    Returns:
        The lightness, and which pixels are opaque.
    """
    from PIL import Image

    with opened(picture, what="a world file", largest=LARGEST_PICTURE, error=WorldError) as file:
        try:
            with Image.open(file, formats=["PNG", "PPM", "BMP"]) as image:
                width, height = image.size
                if width * height > MOST_CELLS:
                    raise WorldError(
                        f"{picture}: {width} by {height} cells, more than {MOST_CELLS:,}; cut it"
                    )
                _check_size(picture, image)
                if image.mode in ("L", "I", "I;16", "I;16B"):
                    most = np.float32(255.0 if image.mode == "L" else 65535.0)
                    light = np.asarray(image).astype(np.float32) / most
                    return light, np.ones(light.shape, dtype=np.bool_)
                pixels = np.asarray(image.convert("RGBA"))
        except WorldError:
            raise
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0][:80]
            raise WorldError(
                f"{picture}: damaged, or not a PGM, PNG or BMP picture ({reason})"
            ) from None
    alpha = pixels[..., 3] / np.float32(255.0)
    light = pixels[..., :3].mean(axis=2, dtype=np.float32) / np.float32(255.0)
    return np.asarray(1.0 - alpha * (1.0 - light)), np.asarray(alpha == 1.0)


def _check_size(picture: Path, image: Any) -> None:
    """Check that a PGM holds as many pixels as its header says; others would be drawn askew."""
    (codec, _, begin, mode), *_ = getattr(image, "tile", None) or [("", (), 0, "")]
    if image.format != "PPM" or codec != "raw":
        return
    depth = 2 if "16" in str(mode) else len(image.getbands())
    expected = image.width * image.height * depth
    # A line break behind the pixels is harmless.
    found = picture.stat().st_size - begin
    if not expected <= found <= expected + 2:
        raise WorldError(
            f"{picture}: {found:,} bytes of pixels, but {image.width} by {image.height} pixels by"
            f" its header are {expected:,}; save the picture again"
        )


def write_ros_map(world: World, path: Path, *, resolution: float | None = None) -> None:
    """Write the walls and the free cells of a world as a ``.yaml`` file and, beside it, a ``.pgm``.

    A cell has a side of ``resolution`` [m]; if not given, of 0.05, or more for a large map.

    Raises:
        OutputError: The files cannot be written, or the map becomes too large.
    """
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


def cell_size(world: World, least: float = RESOLUTION) -> float:
    """The side of the cells [m] of a world's map: the least, or more for a large world."""
    low, high = world.bounds[0] - FREE_MARGIN, world.bounds[1] + FREE_MARGIN
    smallest = float(np.sqrt(np.prod(high - low) / MOST_WRITTEN))
    return max(least, ROUNDED_UP * smallest)


def map_cells(
    world: World, resolution: float, path: Path
) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """The cells (rows, columns) of a world, FREE, OCCUPIED or UNKNOWN, the first row at the bottom.

    They reach a metre, or two cells, beyond the walls. The place x, y [m] of the outer corner of
    the first cell is returned, too.

    Raises:
        OutputError: There are too many; the message names the path that they are for.
    """
    margin = max(FREE_MARGIN, 2.0 * resolution)
    low, high = world.bounds[0] - margin, world.bounds[1] + margin
    # A whole number of cells from the origin, so that straight walls stay straight.
    first = np.floor(low / resolution)
    columns, rows = (np.ceil(high / resolution) - first).astype(np.int64).tolist()
    if columns * rows > MOST_WRITTEN:
        raise OutputError(
            f"{path}: {columns} by {rows} cells, more than {MOST_WRITTEN:,}; choose larger cells"
        )
    cells = np.full((rows, columns), FREE, dtype=np.uint8)
    if world.free is not None:
        x = resolution * (first[0] + 0.5 + np.arange(columns))
        for row in range(rows):
            y = resolution * (first[1] + 0.5 + row)
            known = world.free.contain(np.column_stack([x, np.full(columns, y)]))
            cells[row, ~known] = UNKNOWN
    cells[_walled_cells(world.segments / resolution - np.tile(first, 2))] = OCCUPIED
    x, y = (first * resolution).tolist()
    return cells, (x, y)


def _walled_cells(segments: Float) -> tuple[Int, Int]:
    """Rows and columns of the cells along segments (n, 4) [cells].

    Along its major axis a wall has one cell in each column (or row) between its ends: the one whose
    centre is nearest.
    """
    steep = np.abs(segments[:, 3] - segments[:, 1]) > np.abs(segments[:, 2] - segments[:, 0])
    along = np.where(steep[:, None], segments[:, [1, 3]], segments[:, [0, 2]])
    across = np.where(steep[:, None], segments[:, [0, 2]], segments[:, [1, 3]])
    backward = along[:, 0] > along[:, 1]
    along[backward], across[backward] = along[backward, ::-1], across[backward, ::-1]
    start, end = np.floor(along).astype(np.int64).T
    counts = end - start + 1
    wall = np.repeat(np.arange(len(segments)), counts)
    major = start[wall] + np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = along[:, 1] - along[:, 0]
    share = (major + 0.5 - along[wall, 0]) / np.maximum(length, 1e-12)[wall]
    # A wall shorter than a cell may pass through no centre of a column.
    share = np.where(length[wall] < 1.0, 0.5, share)
    minor = np.floor(across[wall, 0] + share * (across[wall, 1] - across[wall, 0])).astype(np.int64)
    return np.where(steep[wall], major, minor), np.where(steep[wall], minor, major)
