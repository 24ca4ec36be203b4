"""Worlds from SVG drawings: every visible outline becomes walls, in its size on paper.

Lengths are metres on paper: ``width`` and ``height`` in mm, cm, in, pt or px (1/96 in) give the
size of the ``viewBox``. y points up, and the lower left corner of the sheet is (0, 0). Curves
become chords no farther from them than :data:`CURVE_ERROR`, or a five-thousandth of the sheet where
that is less. Walls that touch are one object. Texts, pictures, hidden elements and definitions are
ignored.
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
from lrf3d.files import opened
from lrf3d.geometry import LARGEST_COORDINATE, Float
from lrf3d.world.drawing import CURVE_ERROR, world_of_strokes
from lrf3d.world.model import World

SHEET_SHARE = 2e-4
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

LARGEST_SVG = 1 << 25
"""Largest drawing [bytes]: the plan of a factory is smaller."""

UNDRAWN = {"clipPath", "mask", "pattern", "marker", "symbol"}
"""Elements whose parts are not drawn in their place."""


def read_svg(path: Path) -> World:
    """Read the outlines of a drawing as walls.

    Raises:
        WorldError: The file is not an SVG drawing or has no outline.
    """
    from svgelements import SVG, Shape
    from svgelements import Path as Outline

    with opened(path, what="a world file", largest=LARGEST_SVG, error=WorldError) as file:
        try:
            root = ElementTree.parse(file).getroot()
        except ElementTree.ParseError as error:
            raise WorldError(f"not XML: {error}") from None
    if _name(root) != "svg":
        raise WorldError(f"<{_name(root)[:40]}> where <svg> was expected: not an SVG drawing")
    _place_symbols(root)
    (x, y, width, height), scale = _sheet(root)
    # The library converts units by pixels; the scale is applied here instead.
    root.attrib.pop("preserveAspectRatio", None)
    root.attrib.update(viewBox=f"{x} {y} {width} {height}", width=f"{width}", height=f"{height}")
    drawing = SVG.parse(BytesIO(ElementTree.tostring(root)), ppi=96.0)
    tolerance = min(CURVE_ERROR / scale, SHEET_SHARE * max(width, height))
    strokes = [
        (np.array([0.0, height]) + _points(part, tolerance) * [1.0, -1.0]) * scale
        for element in drawing.elements()
        if isinstance(element, Shape) and element.values.get("visibility") in (None, "visible")
        # `abs` applies the transform of a shape.
        for part in abs(Outline(element)).as_subpaths()
    ]
    return world_of_strokes(strokes, path)


def _place_symbols(root: Element) -> None:
    """Draw symbols where they are used and viewports where they are, as the library does not."""
    symbols = {each.get("id"): each for each in root.iter() if _name(each) == "symbol"}
    for element in list(root.iter()):
        for part in list(element):
            if _name(part) in UNDRAWN:
                element.remove(part)
    for use in [each for each in root.iter() if _name(each) == "use"]:
        key = next((key for key in use.attrib if key.rpartition("}")[2] == "href"), None)
        href = "" if key is None else use.get(key, "")
        if href and not href.startswith("#"):
            raise WorldError(f"uses {shown(href)}, which is outside this file; put it in")
        if key is not None and (symbol := symbols.get(href[1:])) is not None:
            head = use.tag[: -len("use")]
            box: dict[str, str] = {
                k: v for k, v in symbol.items() if k in ("viewBox", "preserveAspectRatio")
            }
            place: dict[str, str] = {
                k: use.attrib.pop(k) for k in ("x", "y", "width", "height") if k in use.attrib
            }
            viewport = Element(f"{head}svg", {**box, **place})
            viewport.extend(symbol)
            del use.attrib[key]
            use.tag = f"{head}g"
            use.append(viewport)
    for part in [each for each in root.iter() if _name(each) == "svg" and each is not root]:
        if "viewBox" not in part.attrib:
            part.tag = f"{part.tag[: -len('svg')]}g"
            part.set("transform", f"translate({part.get('x', '0')},{part.get('y', '0')})")


def _sheet(root: Element) -> tuple[tuple[float, float, float, float], float]:
    """The visible part of a drawing, x, y, width, height [units], and the metres in a unit."""
    width, height = (_metres(key, root.get(key, "")) for key in ("width", "height"))
    given = root.get("viewBox")
    if given is None:
        return (0.0, 0.0, (width or 1.0) / PIXEL, (height or width or 1.0) / PIXEL), PIXEL
    try:
        x, y, wide, high = map(float, given.replace(",", " ").split())
    except ValueError:
        x = y = wide = high = math.nan
    if not (max(abs(x), abs(y), wide, high) <= LARGEST_COORDINATE and min(wide, high) > 1e-9):
        raise WorldError(f"viewBox is {shown(given)}, expected a place and a size above 0")
    # The drawing is fitted into the sheet: the tighter of the two sides decides.
    scales = [size / of for size, of in ((width, wide), (height, high)) if size is not None]
    return (x, y, wide, high), min(scales, default=PIXEL)


def _metres(key: str, text: str) -> float | None:
    """A length [m]; None if it is a percentage or not given."""
    if text.strip() in ("", "auto") or text.strip().endswith("%"):
        return None
    match = _LENGTH.fullmatch(text)
    unit = UNITS.get(match.group(2).lower()) if match else None
    length = float(match.group(1)) * unit if match and unit else math.nan
    if not 0.0 < length <= LARGEST_COORDINATE:
        raise WorldError(f"{key} is {shown(text)}, expected a length above 0 such as 120mm")
    return length


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
