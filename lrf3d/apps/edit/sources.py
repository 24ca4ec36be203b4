"""Sources of plans as a person sees them: a picture of the sheet, its size, a first scale."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.geometry.lines import Float
from lrf3d.plans.parts import Parts
from lrf3d.plans.plan import Plan
from lrf3d.world.files import is_picture
from lrf3d.world.pixels import pixels_of

# Longest side of the picture of a sheet [pixels].
LONGEST = 3000

# Size of a plan [m] whose scale is not known: that of a flat.
USUAL_SIZE = 12.0

# Width of a usual door leaf [m], and the widths that one may have.
LEAF = 0.9
LEAVES = (0.6, 1.25)

# Most doors that are offered as a scale.
OFFERED = 3


class Sheet(NamedTuple):
    """The size of a sheet in units of the drawing, and its picture from above, if it has one."""

    size: tuple[float, float]
    picture: NDArray[np.uint8] | None


def empty_plan() -> Plan:
    """An empty sheet."""
    nothing: Float = np.empty((0, 4))
    return Plan(nothing, np.empty(0), parts=Parts.of(nothing, "wall"))


def guessed_resolution(path: Path) -> float:
    """The side of a pixel [m] by which a picture of a plan is read until its scale is known."""
    with Image.open(path) as picture:
        return USUAL_SIZE / max(picture.size)


def sheet_of(path: Path, page: int = 1) -> Sheet | None:
    """The sheet of a picture or a PDF; other drawings are shown by their strokes."""
    if is_picture(path):
        pixels = pixels_of(path)
        size = float(pixels.shape[1]), float(pixels.shape[0])
        colours = pixels[..., :3] if pixels.shape[2] == 4 else pixels[..., 0]
        return Sheet(size, _smaller(Image.fromarray(np.ascontiguousarray(colours))))
    if path.suffix.lower() == ".pdf":
        import pypdfium2

        handle = pypdfium2.PdfDocument(path)[page - 1]
        size = handle.get_size()
        scale = min(4.0, LONGEST / max(size))
        return Sheet(size, _smaller(handle.render(scale=scale).to_pil()))
    return None


def _smaller(picture: Any) -> NDArray[np.uint8]:
    picture = picture.convert("RGB")
    picture.thumbnail((LONGEST, LONGEST))
    return np.asarray(picture)


def suggestions(plan: Plan) -> list[dict[str, Any]]:
    """Lengths by which a person may confirm or set the scale: two places, metres, and why.

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
