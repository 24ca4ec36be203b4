"""Worlds from SVG drawings: every visible outline becomes walls, in its size on paper.

Lengths are metres on paper: ``width`` and ``height`` in mm, cm, in, pt or px (1/96 in) give the
size of the ``viewBox``. y points up, and the lower left corner of the sheet is (0, 0). Curves
become chords no farther from them than :data:`CURVE_ERROR`, or a five-thousandth of the sheet where
that is less. Walls that touch are one object. Texts, pictures, hidden elements and definitions are
ignored.

Before a library opens the file, its size and the copies by ``use`` are limited, and viewports
become plain groups: a nested ``svg`` becomes a group, moved and scaled by its ``viewBox``, and a
``symbol`` a definition, scaled likewise by each ``use``. Elements that clip, mask, fill or
mark others are removed, because their outlines are not part of the drawing.
"""

import math
import re
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import Float
from lrf3d.world.drawing import CURVE_ERROR, world_of_strokes
from lrf3d.world.model import World
from lrf3d.world.schema import LARGEST_COORDINATE
from lrf3d.world.xml_file import go_through

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

MOST_ELEMENTS = 50_000
"""Largest number of drawn elements, with those repeated by ``use``."""

UNDRAWN = {"clipPath", "mask", "pattern", "marker", "filter", "linearGradient", "radialGradient"}
"""Elements whose parts are not outlines."""


def read_svg(path: Path) -> World:
    """Read the outlines of a drawing as walls.

    Raises:
        WorldError: The file cannot be read, is not an SVG drawing or has no outline.
    """
    from xml.etree import ElementTree

    from svgelements import SVG, Shape
    from svgelements import Path as Outline

    check_svg(path)
    root = ElementTree.fromstring(path.read_bytes())
    sheet = _Sheet.of(path, root.attrib)
    # The library would convert units; the size is taken from the sheet instead.
    for key in ("width", "height", "viewBox", "preserveAspectRatio"):
        root.attrib.pop(key, None)
    x, y, width, height = sheet.box
    flatten_viewports(root)
    root.attrib.update(viewBox=f"{x} {y} {width} {height}", width=f"{width}", height=f"{height}")
    drawing = SVG.parse(BytesIO(ElementTree.tostring(root)), ppi=96.0)
    tolerance = min(CURVE_ERROR, SHEET_SHARE * max(width, height) * sheet.scale) / sheet.scale
    strokes = []
    for element in drawing.elements():
        if isinstance(element, Shape) and element.values.get("visibility") in (None, "visible"):
            # `abs` applies the transform of a shape.
            for part in abs(Outline(element)).as_subpaths():
                points = _points(part, tolerance)
                strokes.append((np.array([0.0, height]) + points * [1.0, -1.0]) * sheet.scale)
    return world_of_strokes(strokes, path)


@dataclass(frozen=True, slots=True)
class _Sheet:
    """The visible part of the drawing, x, y, width, height [units], and metres in a unit."""

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
        if not (
            max(abs(x), abs(y), wide, high) <= LARGEST_COORDINATE
            and min(wide, high) > 1.0 / LARGEST_COORDINATE
        ):
            raise WorldError(
                f"{path}: viewBox is {given[:40]!r}, expected a place and a size above 0"
            )
        # The drawing is fitted into the sheet: the tighter of the two sides decides.
        scales = [size / of for size, of in ((width, wide), (height, high)) if size is not None]
        return cls((x, y, wide, high), min(scales, default=PIXEL))


def _metres(path: Path, key: str, text: str) -> float | None:
    """A length [m]; None if it is a percentage or not given."""
    if not text.strip() or text.strip().endswith("%") or text.strip() == "auto":
        return None
    match = _LENGTH.fullmatch(text)
    unit = UNITS.get(match.group(2).lower()) if match else None
    if match is None or unit is None:
        raise WorldError(f"{path}: {key} is {text[:40]!r}, expected a length such as 120mm")
    length = float(match.group(1)) * unit
    if not 0.0 < length <= LARGEST_COORDINATE:
        raise WorldError(f"{path}: {key} is {text[:40]!r}, expected more than 0")
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
        controls = (
            [piece.start, piece.control1, piece.control2, piece.end]
            if isinstance(piece, CubicBezier)
            else [piece.start, piece.control, piece.end]
        )
        second = np.diff([(point.x, point.y) for point in controls], n=2, axis=0)
        degree = len(controls) - 1
        bend = degree * (degree - 1) * float(np.hypot(second[:, 0], second[:, 1]).max())
    # At most a hundred thousand chords.
    if not bend / tolerance <= 8e10:
        raise WorldError("a curve that is too large or not finite")
    return max(1, math.ceil(math.sqrt(bend / (8.0 * tolerance))))


@dataclass(slots=True, eq=False)
class _Element:
    line: int
    parts: list["_Element"] = field(default_factory=list)
    uses: str = ""
    drawn: int = 0


def check_svg(path: Path) -> None:
    """Check that a file is SVG, draws not too many elements, and has no external references.

    Raises:
        WorldError: It does not; the message names the line.
    """
    bounds = _Bounds(path)
    go_through(path, bounds.begin, bounds.end, largest=LARGEST_SVG)
    bounds.count(bounds.root)


class _Bounds:
    """The tree of elements, with their references."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root = _Element(1)
        self.open = [self.root]
        self.named: dict[str, _Element] = {}

    def begin(self, tag: str, attributes: dict[str, str], line: int) -> None:
        if self.open[-1] is self.root and tag != "svg":
            raise WorldError(
                f"{self.path}:{line}: <{tag[:40]}> where <svg> was expected: not an SVG drawing"
            )
        element = _Element(line)
        if tag == "use":
            href = next((v for k, v in attributes.items() if k.rpartition(" ")[2] == "href"), "")
            if href and not href.startswith("#"):
                raise WorldError(
                    f"{self.path}:{line}: uses {href[:40]!r}, which is outside this file; put it in"
                )
            element.uses = href[1:]
        if "id" in attributes:
            self.named.setdefault(attributes["id"], element)
        self.open[-1].parts.append(element)
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()

    def count(self, top: _Element) -> None:
        """Count the elements that each element draws; −1 marks one that is being counted."""
        waiting = [top]
        while waiting:
            element = waiting[-1]
            inside = list(element.parts)
            if element.uses in self.named:
                inside.append(self.named[element.uses])
            if element.drawn == 0:
                element.drawn = -1
                for part in inside:
                    if part.drawn == -1:
                        raise WorldError(f"{self.path}:{part.line}: an element that uses itself")
                waiting += [part for part in inside if part.drawn == 0]
                continue
            waiting.pop()
            if element.drawn == -1:
                element.drawn = 1 + sum(part.drawn for part in inside)
            if element.drawn > MOST_ELEMENTS:
                raise WorldError(
                    f"{self.path}:{element.line}: draws {element.drawn:,} elements, more than the"
                    f" {MOST_ELEMENTS:,} that are read; simplify the drawing"
                )


def flatten_viewports(root: Element) -> None:
    """Turn the viewports below the root element into groups, in place.

    Raises:
        WorldError: A viewport has an invalid place or size.
    """
    named = {element.get("id", ""): element for element in root.iter()}
    boxes = {
        name: box
        for name, element in named.items()
        if _name(element) in ("symbol", "svg") and (box := element.get("viewBox"))
    }
    for element in list(root.iter()):
        for part in list(element):
            if _name(part) in UNDRAWN:
                element.remove(part)
            elif _name(part) == "use":
                _place_use(part, boxes)
            elif _name(part) == "svg":
                x, y = _number(part, "x", 0.0), _number(part, "y", 0.0)
                _group(part, _fitted(part, part.get("viewBox")), x, y)
            elif _name(part) == "symbol":
                _rename(part, "g")
                defined = Element(part.tag[: -len("g")] + "defs")
                element[list(element).index(part)] = defined
                defined.append(part)


def _place_use(use: Element, boxes: dict[str, str]) -> None:
    """Scale a ``use`` of a symbol to its own size."""
    href = next((value for key, value in use.items() if key.rpartition("}")[2] == "href"), "")
    if href[1:] in boxes and (use.get("width") or use.get("height")):
        x, y = _number(use, "x", 0.0), _number(use, "y", 0.0)
        _move(use, _fitted(use, boxes[href[1:]]), x, y)


def _group(element: Element, fitted: str, x: float, y: float) -> None:
    _rename(element, "g")
    _move(element, fitted, x, y)


def _move(element: Element, fitted: str, x: float, y: float) -> None:
    """Express the position and the size of an element by its transform."""
    for key in ("x", "y", "width", "height", "viewBox", "preserveAspectRatio"):
        element.attrib.pop(key, None)
    moved = f"{element.get('transform', '')} translate({x!r},{y!r}) {fitted}"
    element.set("transform", moved.strip())


def _fitted(element: Element, box: str | None) -> str:
    """The transform from a view box to the size of an element, centred."""
    if box is None:
        return ""
    try:
        left, top, wide, high = map(float, box.replace(",", " ").split())
    except ValueError:
        left = top = wide = high = math.nan
    width = _number(element, "width", wide, of=wide)
    height = _number(element, "height", high, of=high)
    if not (min(wide, high, width, height) > 0.0 and math.isfinite(wide + high + left + top)):
        raise WorldError(f"viewBox is {box[:40]!r}, expected a place and a size above 0")
    if element.get("preserveAspectRatio", "").startswith("none"):
        across, down = width / wide, height / high
    else:
        across = down = min(width / wide, height / high)
    x, y = 0.5 * (width - across * wide), 0.5 * (height - down * high)
    return f"translate({x!r},{y!r}) scale({across!r},{down!r}) translate({-left!r},{-top!r})"


def _number(element: Element, key: str, default: float, *, of: float | None = None) -> float:
    """A length [units of the drawing]; a percentage is relative to another length."""
    from svgelements import Length

    text = element.get(key, "auto").strip()
    if text == "auto" or (of is None and "%" in text):
        return default
    try:
        value = float(Length(text).value(ppi=96.0, relative_length=of))
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise WorldError(f"{key} is {text[:40]!r}, expected a length")
    return value


def _name(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _rename(element: Element, name: str) -> None:
    element.tag = element.tag[: -len(_name(element))] + name
