"""Worlds from SVG drawings: every visible outline becomes walls, in its size on paper.

Lengths are metres on paper: ``width`` and ``height`` in mm, cm, in, pt or px (1/96 in) give the
size of the ``viewBox``. y points up, and the lower left corner of the sheet is (0, 0). Curves
become chords no farther from them than :data:`CURVE_ERROR`, or a five-thousandth of the sheet where
that is less. Walls that touch are one object. Texts, pictures, hidden elements and definitions are
ignored; symbols are drawn where they are used.
"""

import math
import re
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.geometry import LARGEST_COORDINATE, Float
from lrf3d.world.model import World
from lrf3d.world.pieces import CURVE_ERROR, world_of_strokes

SHEET_SHARE = 2e-4
"""Chords lie no farther from their curves than this share of the sheet: a drawing on paper is a
thousandth of the size of what it shows."""

DPI = 96.0
"""Pixels of CSS, the unit of numbers without one, in an inch."""

PIXEL = 0.0254 / DPI
"""Such a pixel [m]."""

UNITS = {"": PIXEL, "px": PIXEL, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "q": 0.25e-3}
UNITS |= {"in": 0.0254, "pt": 0.0254 / 72.0, "pc": 0.0254 / 6.0}
"""Metres in the units of lengths."""

_LENGTH = re.compile(rf"([+\d.eE-]*[\d.])\s*({'|'.join(UNITS)})", re.IGNORECASE)

UNDRAWN = {"clipPath", "mask", "pattern", "marker"}
"""Elements whose parts are not drawn."""


def read_svg(path: Path) -> World:
    """Read the outlines of a drawing as walls.

    Raises:
        WorldError: The file is not an SVG drawing or has no outline.
    """
    from svgelements import SVG, Shape
    from svgelements import Path as Outline

    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise WorldError(f"not XML: {error}") from None
    if _name(root) != "svg":
        raise WorldError(f"<{_name(root)[:40]}> where <svg> was expected: not an SVG drawing")
    width, height = _size(root)
    _prepare(root)
    root.attrib.update(width=f"{width}", height=f"{height}", preserveAspectRatio="xMinYMax")
    drawing = SVG.parse(BytesIO(ElementTree.tostring(root)), ppi=DPI)
    tolerance = min(CURVE_ERROR / PIXEL, SHEET_SHARE * max(width, height))
    strokes = [
        (np.array([0.0, height]) + _points(part, tolerance) * [1.0, -1.0]) * PIXEL
        for element in drawing.elements()
        if isinstance(element, Shape) and element.values.get("visibility") in (None, "visible")
        # `abs` applies the transform of a shape.
        for part in abs(Outline(element)).as_subpaths()
    ]
    return world_of_strokes(strokes, path)


def _prepare(root: Element) -> None:
    """Take out what is not drawn, and make symbols and frames groups, which the library knows."""
    symbols = [each for each in root.iter() if _name(each) == "symbol" and "viewBox" in each.attrib]
    fitted = {f"#{each.get('id')}" for each in symbols}
    for element in list(root.iter()):
        for part in [part for part in element if _name(part) in UNDRAWN]:
            element.remove(part)
        for key, href in element.attrib.items():
            if _name(element) == "use" and key.endswith("href") and not href.startswith("#"):
                raise WorldError(f"uses {shown(href)}, which is outside this file; put it in")
            if _name(element) == "use" and key.endswith("href") and href in fitted:
                raise WorldError(f"uses {shown(href)}, a symbol with a viewBox; draw it to size")
        if _name(element) == "svg" and element is not root and "viewBox" not in element.attrib:
            element.tag = f"{element.tag[: -len('svg')]}g"
            element.set("transform", f"translate({element.get('x', '0')},{element.get('y', '0')})")
        if _name(element) == "symbol":
            head = element.tag[: -len("symbol")]
            group = Element(
                f"{head}g", {key: element.attrib[key] for key in {"id"} & set(element.attrib)}
            )
            group.extend(element)
            element.clear()
            element.tag = f"{head}defs"
            element.append(group)


def _size(root: Element) -> tuple[float, float]:
    """Width and height of a sheet [px]; a side that is not given follows from the ``viewBox``."""
    sides: list[float | None] = []
    for key in ("width", "height"):
        text = root.get(key, "").strip()
        match = _LENGTH.fullmatch(text)
        length = float(match.group(1)) * UNITS[match.group(2).lower()] / PIXEL if match else 0.0
        given = text not in ("", "auto") and not text.endswith("%")
        if given and not 0.0 < length <= LARGEST_COORDINATE:
            raise WorldError(f"{key} is {shown(text)}, expected a length above 0 such as 120mm")
        sides.append(length if given else None)
    width, height = sides
    try:
        _, _, wide, high = map(float, root.get("viewBox", "0 0 1 1").replace(",", " ").split())
    except ValueError:
        wide = high = math.nan
    if not (min(wide, high) > 1e-9 and max(wide, high) <= LARGEST_COORDINATE):
        raise WorldError(
            f"viewBox is {shown(root.get('viewBox'))}, expected a place and a size above 0"
        )
    if width is None:
        width = wide if height is None else height * wide / high
    return width, width * high / wide if height is None else height


def _points(outline: Any, tolerance: float) -> Float:
    """The corners (k, 2) [units] of one outline, with curves as chords."""
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
    """The number of chords within a tolerance of an arc or a Bézier curve.

    A chord over a share h of a curve is off by at most h²·max|curve″| / 8; the second derivative
    of a Bézier curve of degree n is at most n·(n − 1) times its largest second difference, and
    that of an arc its larger radius times its angle squared.
    """
    from svgelements import Arc, CubicBezier

    if isinstance(piece, Arc):
        bend = max(abs(piece.rx), abs(piece.ry)) * float(piece.sweep) ** 2
    else:
        cubic = isinstance(piece, CubicBezier)
        inner = [piece.control1, piece.control2] if cubic else [piece.control]
        controls = [(point.x, point.y) for point in (piece.start, *inner, piece.end)]
        second = np.diff(controls, n=2, axis=0)
        bend = (6 if cubic else 2) * float(np.hypot(second[:, 0], second[:, 1]).max())
    # At most a hundred thousand chords.
    if not bend / tolerance <= 8e10:
        raise WorldError("holds a curve that is too large or not finite")
    return max(1, math.ceil(math.sqrt(bend / (8.0 * tolerance))))


def _name(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]
