"""Sources of plans for display: a picture of the sheet, its size, and a first scale."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.base.errors import WorldError
from lrf3d.base.formats import by_ending, unpacked
from lrf3d.base.isolation import read_file
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Float
from lrf3d.plans.plan import Plan
from lrf3d.plans.rules.doors import USUAL
from lrf3d.world.model import DOOR
from lrf3d.world.pixels import pixels_of
from lrf3d.world.schema import at

# Longest side of the picture of a sheet [pixels].
LONGEST = 3000

# Assumed size of a plan whose scale is unknown [m]: that of a flat.
USUAL_SIZE = 12.0

# Largest number of doors that are offered to set the scale.
OFFERED = 3

# Difference of a usual door from those of a plan, as a share, above which another scale is offered.
OFF = 0.05


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


def suggestions(openings: Float, unit: float, scaled: bool) -> list[dict[str, Any]]:
    """Lengths by which a user may confirm or set the scale: two places, metres, and a reason.

    Places are in units [m] of the drawing.
    """
    widths = np.hypot(*(openings[:, 1] - openings[:, 0]).T)
    usual = DOOR if scaled or not len(widths) else np.median(widths)
    return [
        {
            "between": (openings[each] / unit).tolist(),
            "metres": round(widths[each], 2)
            if scaled and USUAL[0] <= widths[each] <= USUAL[1]
            else DOOR,
            "why": "a door leaf",
        }
        for each in np.argsort(np.abs(widths - usual), kind="stable")[:OFFERED]
    ]


def checked_scale(plan: Plan, openings: Float) -> dict[str, Any]:
    """How wide doors become with the scale of a plan, and other scales, by what they are called."""
    widths = np.sort(np.hypot(*(openings[:, 1] - openings[:, 0]).T))
    offers = list[tuple[str, float]]()
    if not len(widths):
        return {"text": "", "offers": offers}
    middle = float(np.median(widths))
    size = np.ptp(plan.parts.segments.reshape(-1, 2), axis=0)
    span = " to ".join(dict.fromkeys(f"{each:.2f}" for each in widths[[0, -1]]))
    factor = DOOR / middle
    larger = " × ".join(f"{each:.1f}" for each in size * factor)
    if abs(factor - 1.0) > OFF:
        offers.append((f"{DOOR:g} m for most doors: {larger} m", factor))
    return {
        "text": f"{counted(len(widths), 'door')} of {span} m, most of {middle:.2f} m",
        "offers": offers,
    }
