"""Worlds from ROS maps: a YAML file that describes a picture of occupied cells (map_server).

The world is in the frame of the map. A cell that is darker than ``occupied_thresh`` is occupied;
walls are the outlines of occupied cells, or the middle of a wall that is one cell thick. Each point
of an outline lies within half a cell of its wall. Walls that touch are one object. Free and unknown
cells do not affect beams, but are kept for planning routes.

A world is written as a picture in which each wall is one cell thick.
"""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import OutputError, WorldError, shown
from lrf3d.files import opened, own_name, read_text, replacing
from lrf3d.geometry import Bool, Float, Int
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.model import World
from lrf3d.world.outlines import BAND
from lrf3d.world.schema import LARGEST_COORDINATE
from lrf3d.world.touching import connected

if TYPE_CHECKING:
    from PIL.Image import Image

LARGEST_YAML = 1 << 16
"""Largest description [bytes]: six lines are usual."""

DEEPEST_YAML = 4
"""Largest nesting depth: the origin is a list in the description."""

LARGEST_PICTURE = 1 << 28
"""Largest picture [bytes]."""

MOST_CELLS = 1 << 26
"""Largest number of cells of a map: 400 m by 400 m at 5 cm."""

MOST_EDGES = 200_000
"""Largest number of edges between occupied cells and others: an office floor has 20,000."""

FEW_EDGES, DENSEST = 20_000, 0.25
"""Number of edges that any map may have, and number for each cell: offices have 0.05, noise 1."""

UNKNOWN = 205
"""Value of the pixels of unknown cells as map_saver writes them."""

DEFAULTS = {"occupied_thresh": 0.65, "free_thresh": 0.25, "negate": 0, "mode": "trinary"}
"""The defaults of map_server."""


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


def read_ros_map(path: Path) -> World:
    """Read the occupied cells of a ROS map as walls.

    Raises:
        WorldError: The file, or the picture that it names, cannot be used.
    """
    from lrf3d.world.grid_walls import walls_of_grid

    description = _Description(path)
    occupied, free = _cells(description)
    edges = int((occupied[1:] != occupied[:-1]).sum() + (occupied[:, 1:] != occupied[:, :-1]).sum())
    if edges > MOST_EDGES or (edges > FEW_EDGES and edges > DENSEST * occupied.size):
        description.refuse(
            f"{edges:,} edges between occupied cells and others, as in noise; clean the map, or"
            " cut it down"
        )
    x, y, yaw = description.origin
    local = walls_of_grid(occupied).reshape(-1, 2) * description.resolution
    if not len(local):
        description.refuse("no wall: all cells are alike, or no occupied one is next to another")
    cos, sin = math.cos(yaw), math.sin(yaw)
    points = local @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
    segments = points.reshape(-1, 4)
    # Ends meet up to rounding; half a cell is the resolution of the map.
    objects = connected(segments, 0.5 * description.resolution)
    known = FreeCells(free, description.resolution, description.origin)
    return World(segments, objects, name=own_name(path), free=known)


class _Description:
    """The YAML file, checked."""

    def __init__(self, path: Path) -> None:
        import yaml

        self.path = path
        text = read_text(path, what="a world file", largest=LARGEST_YAML, error=WorldError)
        try:
            depth = 0
            for event in yaml.parse(text, Loader=yaml.SafeLoader):
                depth += isinstance(event, yaml.CollectionStartEvent)
                depth -= isinstance(event, yaml.CollectionEndEvent)
                if depth > DEEPEST_YAML or isinstance(event, yaml.AliasEvent):
                    line = event.start_mark.line + 1 if event.start_mark else 1
                    raise WorldError(f"{path}:{line}: more than keys and their values")
            node = yaml.compose(text, Loader=yaml.SafeLoader)
            if isinstance(node, yaml.MappingNode):
                self._check_keys(node)
            data = yaml.safe_load(text)
        except WorldError:
            raise
        except yaml.MarkedYAMLError as error:
            line = error.problem_mark.line + 1 if error.problem_mark else 1
            raise WorldError(f"{path}:{line}: not YAML: {error.problem}") from None
        except (yaml.YAMLError, ValueError, RecursionError, OverflowError) as error:
            reason = (str(error).splitlines() or ["nested too deeply"])[0][:80]
            raise WorldError(f"{path}: not YAML: {reason}") from None
        if not isinstance(data, dict):
            self.refuse("expected the description of a ROS map: image, resolution, origin")
        self.data: dict[Any, Any] = DEFAULTS | data
        self.resolution = self._number("resolution", above=0.0)
        self.occupied = self._number("occupied_thresh", most=1.0)
        self.free = self._number("free_thresh", most=1.0)
        if self.free > self.occupied:
            self.refuse("free_thresh is above occupied_thresh")
        negate = self.data["negate"]
        if negate not in (0, 1) or not isinstance(negate, int):
            self.refuse(f"negate is {shown(negate)}, expected 0 or 1")
        self.negate = bool(negate)
        if self.data["mode"] not in ("trinary", "scale", "raw"):
            self.refuse(f"mode is {shown(self.data['mode'])}, expected trinary, scale or raw")
        origin = self.data.get("origin")
        if not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_coordinate, origin)):
            self.refuse(f"origin is {shown(origin)}, expected [x, y, yaw] in metres and radians")
        self.origin = float(origin[0]), float(origin[1]), float(origin[2])

    def _check_keys(self, node: Any) -> None:
        """Check that no key stands twice, of which YAML would take the last one."""
        lines: dict[str, int] = {}
        for key, _ in node.value:
            name, line = str(getattr(key, "value", "")), key.start_mark.line + 1
            if name in lines:
                raise WorldError(
                    f"{self.path}:{line}: the key {shown(name)} stands in line {lines[name]}, too;"
                    " remove one"
                )
            lines[name] = line

    def refuse(self, message: str) -> NoReturn:
        raise WorldError(f"{self.path}: {message}")

    @property
    def picture(self) -> Path:
        """The picture, which must lie in the folder of the description."""
        name = self.data.get("image")
        if not isinstance(name, str) or not name:
            self.refuse(f"image is {shown(name)}, expected the name of a picture")
        plain = name.removeprefix("./")
        if Path(plain).name != plain or "\\" in plain or "\0" in plain:
            self.refuse(f"image is {shown(name)}; put the picture beside this file and name it so")
        picture = self.path.parent / plain
        if picture.is_symlink() and picture.resolve().parent != self.path.parent.resolve():
            self.refuse(f"image {shown(name)} is a link to elsewhere")
        return picture

    def _number(self, key: str, *, above: float = -1e-300, most: float = 1e4) -> float:
        # By default the limit is just below 0, so that 0 is valid.
        value: Any = self.data.get(key)
        if not _is_coordinate(value) or not above < float(value) <= most:
            limit = f"a number above 0 and at most {most:g}" if above >= 0 else f"0 to {most:g}"
            self.refuse(f"{key} is {shown(value)}, expected {limit}")
        return float(value)


def _is_coordinate(value: object) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and -LARGEST_COORDINATE <= value <= LARGEST_COORDINATE
    )


def _cells(description: _Description) -> tuple[Bool, Bool]:
    """Which cells (rows, columns) are occupied and which free, the first row at the bottom."""
    from PIL import Image, UnidentifiedImageError

    picture = description.picture
    with opened(picture, what="a world file", largest=LARGEST_PICTURE, error=WorldError) as file:
        try:
            # Only the formats of map_server, so that no other decoder can be attacked.
            with Image.open(file, formats=["PNG", "PPM", "BMP"]) as image:
                width, height = image.size
                if width * height > MOST_CELLS:
                    raise WorldError(
                        f"{picture}: {width} by {height} cells, more than {MOST_CELLS:,}; cut it"
                    )
                _check_size(picture, image)
                occupied, free = np.empty((2, height, width), dtype=np.bool_)
                step = max(1, BAND // max(1, width))
                for top in range(0, height, step):
                    rows = image.crop((0, top, width, min(top + step, height)))
                    band = slice(top, top + step)
                    occupied[band], free[band] = _rows_of_cells(description, rows)
        except WorldError:
            raise
        except UnidentifiedImageError:
            raise WorldError(f"{picture}: not a PGM, PNG or BMP picture") from None
        except (OSError, ValueError, SyntaxError, MemoryError, EOFError, OverflowError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0][:80]
            raise WorldError(f"{picture}: damaged picture ({reason})") from None
        except Image.DecompressionBombError:
            raise WorldError(f"{picture}: a picture that is far too large") from None
    return occupied[::-1], free[::-1]


def _check_size(picture: Path, image: "Image") -> None:
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


def _rows_of_cells(description: _Description, image: "Image") -> tuple[Bool, Bool]:
    """Which cells (rows, columns) of some rows of the picture are occupied, and which free."""
    mode = description.data["mode"]
    share, opaque = _darkness(image, with_alpha=mode == "trinary")
    if description.negate:
        share = 1.0 - share
    value = np.round(255.0 * (1.0 - share))
    known = np.ones(share.shape, dtype=np.bool_)
    if mode == "trinary":
        # map_saver writes this grey for unknown cells, even if free_thresh is just above it.
        known = value != UNKNOWN
    if mode == "scale":
        # Transparent cells are unknown.
        known &= opaque
    if mode == "raw":
        # The value of a pixel is the occupancy in percent; above 100 it is unknown.
        known, share = value <= 100.0, value / 100.0
    occupied = share > description.occupied
    if mode != "trinary":
        occupied &= known
    return np.asarray(occupied), np.asarray(known & ~occupied & (share <= description.free))


def _darkness(image: "Image", *, with_alpha: bool) -> tuple[Float, Bool | bool]:
    """The darkness of the pixels (rows, columns) of a picture, from 0 for white to 1 for black.

    Args:
        image: The picture.
        with_alpha: Whether opacity counts as another colour, as in map_server.

    Returns:
        The darkness, and which pixels are opaque; True if all are.
    """
    top = 65535.0 if image.mode.startswith("I") else 255.0
    if image.mode in ("P", "PA", "1", "CMYK"):
        clear = image.mode == "PA" or "transparency" in image.info
        image = image.convert("RGBA" if clear else "RGB")
    pixels = np.asarray(image)
    opaque: Bool | bool = True
    if pixels.ndim == 3:
        channels = pixels.shape[2]
        colours = 1 if channels == 2 else 3
        light = pixels[..., :colours].mean(axis=2, dtype=np.float32)
        if channels > colours:
            alpha = pixels[..., colours]
            opaque = alpha == 255
            if with_alpha:
                light = np.float32(0.75) * light + np.float32(0.25) * alpha
        pixels = light
    return np.asarray(1.0 - pixels.astype(np.float32) / np.float32(top)), opaque


def write_ros_map(world: World, path: Path, *, resolution: float | None = None) -> None:
    """Write a world as a ``.yaml`` file and, beside it, a ``.pgm`` picture.

    Args:
        world: The world, of which the walls and the free cells are written.
        path: The ``.yaml`` file.
        resolution: Side of a cell [m]; if not given, 0.05, or more for a large map.

    Raises:
        OutputError: The files cannot be written, or the map becomes too large.
    """
    margin = FREE_MARGIN
    if resolution is None:
        resolution = cell_size(world)
    else:
        margin = max(margin, 2.0 * resolution)
    cells, (x, y) = map_cells(world, resolution, path, margin=margin)
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
    world: World, resolution: float, path: Path, *, margin: float = FREE_MARGIN
) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """The cells of a world, FREE, OCCUPIED or UNKNOWN.

    Args:
        world: The world, with its walls and its free cells.
        resolution: Side of a cell [m].
        path: The file that they are for, which errors name.
        margin: What is mapped beyond the outermost walls [m].

    Returns:
        The cells (rows, columns), the first row at the bottom, and the place x, y [m] of the outer
        corner of the first.

    Raises:
        OutputError: There are too many.
    """
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
