"""Worlds from drawings, SVG and DXF: every visible outline becomes walls.

Curves become chords no farther from them than :data:`CURVE_ERROR`, or less in a small drawing.
Walls that touch are one object. Texts, pictures, hatches, dimensions and hidden parts are ignored.

In SVG lengths are metres on paper: ``width`` and ``height`` in mm, cm, in, pt or px (1/96 in) give
the size of the ``viewBox``. y points up, and the lower left corner of the sheet is (0, 0). Symbols
are drawn where they are used.

In DXF ``$INSUNITS`` gives the unit; a drawing without one is in metres. Blocks are inserted,
multilines become their lines. Layers that are off or frozen, paper space and heights (z) are
ignored.
"""

import math
import re
from collections.abc import Iterable, Iterator
from contextlib import redirect_stdout
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.geometry import LARGEST_COORDINATE, Float
from lrf3d.world.model import World
from lrf3d.world.pieces import world_of_strokes

CURVE_ERROR = 0.005
"""Largest distance [m] of chords from their curve: about the width of a laser beam."""

DPI, PIXEL = 96.0, 0.0254 / 96.0
"""Pixels of CSS, the unit of numbers without one, in an inch, and such a pixel [m]."""

UNITS = {"": PIXEL, "px": PIXEL, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "q": 0.25e-3}
UNITS |= {"in": 0.0254, "pt": 0.0254 / 72.0, "pc": 0.0254 / 6.0}
"""Metres in the units of lengths."""

OUTLINES = frozenset("LINE LWPOLYLINE POLYLINE ARC CIRCLE ELLIPSE SPLINE SOLID TRACE".split())
"""Entities of DXF that are walls."""


def read_svg(path: Path) -> World:
    """Read the outlines of an SVG drawing as walls."""
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
    # A drawing on paper is a thousandth of the size of what it shows.
    tolerance = min(CURVE_ERROR / PIXEL, 2e-4 * max(width, height))
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
    defined = SubElement(root, "defs")
    fits = [each for each in root.iter() if "viewBox" in each.attrib]
    fitted = {f"#{each.get('id')}" for each in fits if _name(each) == "symbol"}
    for element in list(root.iter()):
        for part in list(element):
            if _name(part) in ("clipPath", "mask", "pattern", "marker", "symbol"):
                element.remove(part)
            if _name(part) == "symbol":
                part.tag = "g"
                defined.append(part)
        used = [href for key, href in element.attrib.items() if key.endswith("href")]
        for href in used if _name(element) == "use" else ():
            if not href.startswith("#"):
                raise WorldError(f"uses {shown(href)}, which is outside this file; put it in")
            if href in fitted:
                raise WorldError(f"uses {shown(href)}, a symbol with a viewBox; draw it to size")
        if _name(element) == "svg" and element is not root and element not in fits:
            element.tag = "g"
            element.set("transform", f"translate({element.get('x', '0')},{element.get('y', '0')})")


def _size(root: Element) -> tuple[float, float]:
    """Width and height of a sheet [px]; a side that is not given follows from the ``viewBox``."""
    sides: list[float | None] = []
    for key in ("width", "height"):
        text = root.get(key, "").strip()
        match = re.fullmatch(rf"([+\d.eE-]*[\d.])\s*({'|'.join(UNITS)})", text, re.IGNORECASE)
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
        found = shown(root.get("viewBox"))
        raise WorldError(f"viewBox is {found}, expected a place and a size above 0")
    if width is None:
        width = wide if height is None else height * wide / high
    return width, width * high / wide if height is None else height


def _points(outline: Any, tolerance: float) -> Float:
    """The corners (k, 2) [units] of one outline, with curves as chords."""
    import shapely
    from svgelements import Close, Line, Move

    points = [np.empty((0, 2))]
    for piece in outline:
        if isinstance(piece, Move | Line | Close):
            points.append(np.array([piece.end or ()], dtype=np.float64).reshape(-1, 2))
        else:
            # Chords over h of a curve are h²·max|curve″| / 8 off it, here less than the tenth left.
            curve = piece.npoint(np.linspace(0.0, 1.0, 4097))
            with np.errstate(all="ignore"):
                chords = shapely.simplify(
                    shapely.linestrings(curve), 0.9 * tolerance, preserve_topology=False
                )
            points.append(shapely.get_coordinates(chords)[1:])
    return np.concatenate(points)


def _name(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def read_dxf(path: Path) -> World:
    """Read the outlines of a DXF drawing as walls."""
    # It prints where it cannot keep a list of the fonts that it finds, which no wall needs.
    with redirect_stdout(StringIO()):
        from ezdxf import units
        from ezdxf.enums import InsertUnits
        from ezdxf.filemanagement import readfile

    drawing = readfile(path)
    code = drawing.header.get("$INSUNITS", 0)
    if code not in range(25):
        raise WorldError(f"$INSUNITS is {code!r}, expected 0 to 24")
    scale = units.conversion_factor(InsertUnits(code), InsertUnits.Meters) if code else 1.0
    off = [layer for layer in drawing.layers if layer.is_off() or layer.is_frozen()]
    outlines = _outlines(drawing.modelspace(), {layer.dxf.name.lower() for layer in off})
    strokes = [each * scale for one in outlines for each in _strokes(one, CURVE_ERROR / scale)]
    return world_of_strokes(strokes, path)


def _outlines(entities: Iterable[Any], hidden: set[str]) -> Iterator[Any]:
    """The visible outlines among entities, with those of inserted blocks."""
    for entity in entities:
        if entity.dxf.get("layer", "0").lower() in hidden or entity.dxf.get("invisible", 0):
            continue
        kind = entity.dxftype()
        if kind == "INSERT":
            for one in entity.multi_insert() if entity.mcount > 1 else (entity,):
                yield from _outlines(one.virtual_entities(), hidden)
        elif kind == "MLINE":
            yield from _outlines(entity.virtual_entities(), hidden)
        elif kind in OUTLINES:
            yield entity


def _strokes(entity: Any, tolerance: float) -> Iterator[Float]:
    """The polylines (k, 2) [units] of an entity."""
    from ezdxf.path import make_path

    if entity.dxftype() == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        return
    outline = make_path(entity)
    corners = np.array([(point.x, point.y) for point in outline.control_vertices()])
    if len(corners) < 2:
        return
    extent = float(np.ptp(corners, axis=0).max())
    if not extent <= LARGEST_COORDINATE:
        raise WorldError("holds a curve that is not finite, or far too large")
    distance = min(tolerance, extent / 2000.0)
    for part in outline.sub_paths():
        yield np.array([(point.x, point.y) for point in part.flattening(distance, segments=4)])
