"""Writing a world as a ROS map: each wall a row of occupied cells in a picture, one cell thick."""

import json
from pathlib import Path

import numpy as np

from lrf3d.errors import OutputError
from lrf3d.geometry import Float, Int
from lrf3d.output import replacing, write_text
from lrf3d.world.model import World

RESOLUTION = 0.05
"""Side of a cell [m], the usual one of maps, where the map does not become too large by it."""

MARGIN = 1.0
"""Free space [m] around the walls."""

MOST_CELLS = 1 << 25
"""Cells of a map, 33 million: a picture of more is more than robots carry."""

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
"""Values of pixels as map_saver writes them."""


def write_ros_map(world: World, path: Path, *, resolution: float | None = None) -> None:
    """Write a world as a ``.yaml`` file and, beside it, a ``.pgm`` picture.

    Args:
        world: The walls; their heights and objects are not kept, but what is known to be free.
        path: The ``.yaml`` file.
        resolution: Side of a cell [m]; 0.05, or what makes the map small enough, if not given.

    Raises:
        OutputError: The files cannot be written, or the map becomes too large.
    """
    margin = max(MARGIN, 2.0 * (resolution or 0.0))
    low, high = world.bounds[0] - margin, world.bounds[1] + margin
    if resolution is None:
        resolution = max(RESOLUTION, float(np.sqrt(np.prod(high - low) / MOST_CELLS)) * 1.001)
    # Whole cells from the origin of the world on, so that even walls stay even.
    first = np.floor(low / resolution)
    columns, rows = (np.ceil(high / resolution) - first).astype(np.int64).tolist()
    if columns * rows > MOST_CELLS:
        raise OutputError(
            f"{path}: {columns} by {rows} cells, more than {MOST_CELLS:,}; choose larger cells"
        )
    cells = np.full((rows, columns), FREE, dtype=np.uint8)
    if world.free is not None:
        x = resolution * (first[0] + 0.5 + np.arange(columns))
        for line in range(rows):
            y = resolution * (first[1] + 0.5 + line)
            known = world.free.contain(np.column_stack([x, np.full(columns, y)]))
            cells[line, ~known] = UNKNOWN
    row, column = _cells(world.segments / resolution - np.tile(first, 2))
    cells[row, column] = OCCUPIED
    picture = path.with_suffix(".pgm")
    with replacing(picture) as unfinished:
        unfinished.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + cells[::-1].tobytes())
    x, y = (first * resolution).tolist()
    write_text(
        path,
        # A text in JSON is one in YAML too, whatever the name holds.
        f"image: {json.dumps(picture.name)}\nresolution: {resolution!r}\n"
        f"origin: [{x!r}, {y!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n",
    )


def _cells(segments: Float) -> tuple[Int, Int]:
    """Rows and columns of the cells that segments (n, 4) [cells] run through, one a step.

    Along the axis that a wall follows more, it has one cell in each column (or row) between those
    of its ends: the one whose middle is nearest.
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
    # A wall shorter than a cell has no middle of a column to go through.
    share = np.where(length[wall] < 1.0, 0.5, share)
    minor = np.floor(across[wall, 0] + share * (across[wall, 1] - across[wall, 0])).astype(np.int64)
    return np.where(steep[wall], major, minor), np.where(steep[wall], minor, major)
