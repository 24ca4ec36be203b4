"""Sources of plans for display: a picture of the sheet, its size, and a first scale."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.base.errors import WorldError
from lrf3d.base.formats import by_ending, unpacked
from lrf3d.base.isolation import read_file
from lrf3d.plans.plan import Plan
from lrf3d.world.pixels import pixels_of
from lrf3d.world.schema import at

# Longest side of the picture of a sheet [pixels].
LONGEST = 3000

# Assumed size of a plan whose scale is unknown [m]: that of a flat.
USUAL_SIZE = 12.0

# Usual width of a door leaf [m], and its least and largest width.
LEAF = 0.9
LEAVES = (0.6, 1.25)

# Largest number of doors that are offered to set the scale.
OFFERED = 3


class Sheet(NamedTuple):
    """The size of a sheet in units of the drawing, and its picture from above."""

    size: tuple[float, float]
    picture: NDArray[np.uint8]


def sheet_of(path: Path, page: int = 1) -> Sheet | None:
    """The sheet of a picture or a PDF; other drawings are shown as strokes."""
    row = by_ending(path, "picture", "drawing")
    if row is None or not (row.kind == "picture" or "page" in row.options):
        return None
    reader = "lrf3d.apps.edit.sources:size_and_picture"
    with at(str(path)):
        found = read_file(reader, path, {"page": page}, isolated=row.apart, error=WorldError)
    return Sheet(*found)


def size_and_picture(path: Path, page: int) -> tuple[tuple[float, float], NDArray[np.uint8]]:
    """The size and the picture of a sheet; called in the process that reads the file."""
    row = by_ending(path, "picture", "drawing")
    assert row is not None
    with unpacked(path, row.largest) as plain:
        if row.kind == "picture":
            pixels = pixels_of(plain)
            size = float(pixels.shape[1]), float(pixels.shape[0])
            colours = pixels[..., :3] if pixels.shape[2] == 4 else pixels[..., 0]
            return size, _smaller(Image.fromarray(np.ascontiguousarray(colours)))
        import pypdfium2

        handle = pypdfium2.PdfDocument(plain.read_bytes())[page - 1]
        size = handle.get_size()
        scale = min(4.0, LONGEST / max(size))
        return size, _smaller(handle.render(scale=scale).to_pil())


def _smaller(picture: Any) -> NDArray[np.uint8]:
    picture = picture.convert("RGB")
    picture.thumbnail((LONGEST, LONGEST))
    return np.asarray(picture)


def suggestions(plan: Plan) -> list[dict[str, Any]]:
    """Lengths by which a user may confirm or set the scale: two places, metres, and a reason.

    Places are in units of the drawing.
    """
    widths = sorted(plan.doors, key=lambda door: abs(door.width - LEAF))
    return [
        {
            "between": (door.opening / plan.unit).tolist(),
            "metres": round(door.width, 2) if LEAVES[0] <= door.width <= LEAVES[1] else LEAF,
            "why": "a door leaf",
        }
        for door in widths[:OFFERED]
    ]
