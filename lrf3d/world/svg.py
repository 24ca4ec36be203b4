"""Worlds from SVG drawings: every outline that is drawn becomes walls, in the size on paper.

A path enters; a :class:`World` leaves. Lengths are those of the drawing, in metres: mm, cm, in, pt
and px (1/96 in) of ``width`` and ``height``, through the ``viewBox``. y points up, and the lower
left corner of the sheet is (0, 0). Curves become chords no farther from them than
:data:`CURVE_ERROR`, or a five-thousandth of the sheet where that is less. Walls that touch are one
object. Texts, pictures, hidden elements and what is only defined are no walls.
"""

import math
import re
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import Float
from lrf3d.world.drawing import CURVE_ERROR, world_of_strokes
from lrf3d.world.model import World
from lrf3d.world.schema import FARTHEST
from lrf3d.world.svg_bounds import check_svg
from lrf3d.world.svg_viewports import flatten_viewports

FINEST = 2e-4
"""Chords lie no farther from their curves than this share of the sheet: a drawing on paper is a
thousandth of the size of what it shows."""

PIXEL = 0.0254 / 96.0
"""A pixel of CSS [m], the unit of numbers without one."""

UNITS = {
    "": PIXEL,
    "px": PIXEL,
    "mm": 1e-3,
    "cm": 1e-2,
    "in": 0.0254,
    "pt": 0.0254 / 72.0,
    "pc": 0.0254 / 6.0,
    "q": 0.25e-3,
    "m": 1.0,
}
"""Metres in the units of lengths."""

_LENGTH = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-zA-Z]*)\s*")


def read_svg(path: Path) -> World:
    """Read the outlines of a drawing as walls.

    Raises:
        WorldError: The file cannot be read, is no SVG or holds no outline.
    """
    from xml.etree import ElementTree

    from svgelements import SVG, Shape
    from svgelements import Path as Outline

    check_svg(path)
    root = ElementTree.fromstring(path.read_bytes())
    sheet = _Sheet.of(path, root.attrib)
    # The library turns a unit of the drawing into one number; sizes are taken from the sheet.
    for key in ("width", "height", "viewBox", "preserveAspectRatio"):
        root.attrib.pop(key, None)
    x, y, width, height = sheet.box
    flatten_viewports(root)
    root.attrib.update(viewBox=f"{x} {y} {width} {height}", width=f"{width}", height=f"{height}")
    drawing = SVG.parse(BytesIO(ElementTree.tostring(root)), ppi=96.0)
    tolerance = min(CURVE_ERROR, FINEST * max(width, height) * sheet.scale) / sheet.scale
    strokes = []
    for element in drawing.elements():
        if isinstance(element, Shape) and element.values.get("visibility") in (None, "visible"):
            # Shapes that are turned keep their transform apart until it is asked for.
            for part in abs(Outline(element)).as_subpaths():
                points = _points(part, tolerance)
                strokes.append((np.array([0.0, height]) + points * [1.0, -1.0]) * sheet.scale)
    return world_of_strokes(strokes, path)


@dataclass(frozen=True, slots=True)
class _Sheet:
    """The part of the drawing that is shown, x, y, width, height [units], and metres in a unit."""

    box: tuple[float, float, float, float]
    scale: float

    @classmethod
    def of(cls, path: Path, attributes: dict[str, str]) -> "_Sheet":
        """The sheet that the attributes of the root element describe."""
        width, height = (_metres(path, key, attributes.get(key, "")) for key in ("width", "height"))
        given = attributes.get("viewBox")
        if given is None:
            box = (0.0, 0.0, (width or 1.0) / PIXEL, (height or width or 1.0) / PIXEL)
            return cls(box, PIXEL)
        try:
            x, y, wide, high = map(float, given.replace(",", " ").split())
        except ValueError:
            raise WorldError(f"{path}: viewBox is {given[:40]!r}, expected four numbers") from None
        if not (max(abs(x), abs(y), wide, high) <= FARTHEST and min(wide, high) > 1.0 / FARTHEST):
            raise WorldError(
                f"{path}: viewBox is {given[:40]!r}, expected a place and a size above 0"
            )
        # The drawing is fitted into the sheet: the tighter of the two sides decides.
        scales = [size / of for size, of in ((width, wide), (height, high)) if size is not None]
        return cls((x, y, wide, high), min(scales, default=PIXEL))


def _metres(path: Path, key: str, text: str) -> float | None:
    """A length [m]; None where it is a share of something or not given."""
    if not text.strip() or text.strip().endswith("%") or text.strip() == "auto":
        return None
    match = _LENGTH.fullmatch(text)
    unit = UNITS.get(match.group(2).lower()) if match else None
    if match is None or unit is None:
        raise WorldError(f"{path}: {key} is {text[:40]!r}, expected a length such as 120mm")
    length = float(match.group(1)) * unit
    if not 0.0 < length <= FARTHEST:
        raise WorldError(f"{path}: {key} is {text[:40]!r}, expected more than 0")
    return length


def _points(outline: Any, tolerance: float) -> Float:
    """The corners (k, 2) [units] of one outline, its curves cut into chords."""
    from svgelements import Close, Line, Move

    points = [np.empty((0, 2))]
    for piece in outline:
        if piece.end is None:
            continue
        if not isinstance(piece, Move | Line | Close):
            shares = np.linspace(0.0, 1.0, _chords(piece, tolerance) + 1)[1:-1]
            points.append(np.asarray(piece.npoint(shares), dtype=np.float64).reshape(-1, 2))
        points.append(np.array([[piece.end.x, piece.end.y]], dtype=np.float64))
    return np.concatenate(points)


def _chords(piece: Any, tolerance: float) -> int:
    """Chords that keep within a tolerance of an arc or a Bézier curve.

    A chord over a share h of a curve is off by at most h²·max|curve″| / 8; the second derivative
    of a Bézier curve of degree n is at most n·(n − 1) times its largest second difference, and
    that of an arc its larger radius times its angle squared.
    """
    from svgelements import Arc, CubicBezier

    if isinstance(piece, Arc):
        bend = max(abs(piece.rx), abs(piece.ry)) * float(piece.sweep) ** 2
    else:
        controls = (
            [piece.start, piece.control1, piece.control2, piece.end]
            if isinstance(piece, CubicBezier)
            else [piece.start, piece.control, piece.end]
        )
        second = np.diff([(point.x, point.y) for point in controls], n=2, axis=0)
        degree = len(controls) - 1
        bend = degree * (degree - 1) * float(np.hypot(second[:, 0], second[:, 1]).max())
    if not bend / tolerance <= 8e10:
        raise WorldError("a curve that is too large or not finite")
    return max(1, math.ceil(math.sqrt(bend / (8.0 * tolerance))))
