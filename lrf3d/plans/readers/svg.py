"""Drawings in SVG, as browsers draw them: style sheets, transforms, uses, symbols, clips, masks.

svgelements reads shapes, transforms, colours and frames; what it does not know is resolved here.
Lengths are metres on paper: ``width`` and ``height`` in mm, cm, in, pt or px (1/96 in) give the
size of the ``viewBox``. y points up, and the lower left corner of the sheet is (0, 0); what lies
outside of the sheet is read, too. A group gives the layer, by its label or its id. Texts, pictures
and patterns are counted; a shape whose file names no colour at all is its outline. An item is an
element that may be painted, however often it is used.
"""

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import shapely
import svgelements

from lrf3d.base.errors import WorldError, one_line, shown
from lrf3d.base.units import INCH, METRES
from lrf3d.geometry.lines import LARGEST_COORDINATE, ROUNDING, Float
from lrf3d.plans.canvas import (
    FAINT,
    POINT,
    UNKNOWN,
    WHITE,
    Canvas,
    Mark,
    PerUnit,
    contrast_to_white,
    curve_points,
    is_area,
    scale_of,
)
from lrf3d.plans.readers.styles import declarations, overruled, painted, style_sheet, within
from lrf3d.plans.scale import sheet_scales

# A pixel [m]: the unit of lengths that name none.
PIXEL = INCH / 96

# Metres in the units of lengths.
UNITS = {
    "": PIXEL, "px": PIXEL, "m": 1.0, "cm": METRES["cm"], "mm": METRES["mm"], "q": METRES["mm"] / 4,
    "in": INCH, "pt": POINT, "pc": 12 * POINT, "em": 16 * PIXEL,
}  # fmt: skip

# Properties of styles that move what they are set for, unless they have one of these values.
MOVES = ("translate", "rotate", "scale")
NO_MOVES = ("none", "unset", "initial", "inherit", "revert", "0", "0px", "0deg", "1", "100%")

# Distance [m] from the edge of a clip within which a line is on it: coordinates are rounded.
ON_EDGE = 1e-6

# Elements that are painted, and their classes of svgelements.
SHAPES = {
    "path": svgelements.Path,
    "rect": svgelements.Rect,
    "circle": svgelements.Circle,
    "ellipse": svgelements.Ellipse,
    "line": svgelements.SimpleLine,
    "polyline": svgelements.Polyline,
    "polygon": svgelements.Polygon,
}

# Elements that are not read, and what they are called.
COUNTED = {"text": "text", "image": "picture", "foreignObject": "picture"}

# Elements that hold others.
GROUPS = frozenset(("g", "a", "svg", "switch", "use"))

# Elements whose content is painted only where it is referred to.
DEFINITIONS = frozenset(("defs", "symbol", "clipPath", "mask", "marker", "pattern"))

# Elements that paint nothing, nor does their content; elements of foreign namespaces have no name.
SILENT = frozenset(
    " title desc metadata style script filter linearGradient radialGradient view cursor set font"
    " animate animateMotion animateTransform animateColor color-profile solidColor".split(" ")
)


class State(NamedTuple):
    """What an element inherits from those around it."""

    # The matrix (3, 3) from its units to metres.
    matrix: Float
    # The size of the viewport, to which lengths in % refer.
    size: tuple[float, ...]
    style: dict[str, str] = {}  # noqa: RUF012 - never changed.
    clip: Any = None
    alpha: float = 1.0
    names: tuple[str, ...] = ()
    layer: str = ""


def draw(path: Path, scale: float | PerUnit) -> Canvas:
    """The marks of an SVG drawing, enlarged by a scale."""
    root = ElementTree.parse(path).getroot()
    if _tag(root) != "svg":
        raise WorldError(f"<{_tag(root)[:40]}> where <svg> was expected: not an SVG drawing")
    width, height = _size(root)
    sheet = _framed(root, (0.0, 0.0, width, height), State(np.eye(3), (width, height)))
    # Round the unit to the digits that svgelements gives reliably.
    unit = float(f"{PIXEL * math.hypot(*sheet.matrix[:2, 0]):.9g}")
    scale = scale_of(scale, unit)
    canvas = Canvas.of_sheet(max(width, height) * PIXEL * scale, scale)
    canvas.unit = unit * scale
    canvas.scale = scale
    texts = (text for each in root.iter() if _tag(each) == "text" for text in each.itertext())
    canvas.scales = sheet_scales(" ".join(texts), scale)
    by_id = {each.get("id", ""): each for each in root.iter() if each.get("id")}
    painter = _ElementPainter(canvas, style_sheet(root), by_id)
    up = np.diag([scale * PIXEL, -scale * PIXEL, 1.0])
    up[1, 2] = scale * PIXEL * height
    sheet = sheet._replace(matrix=up @ sheet.matrix)
    painter.children(root, painter.state(root, sheet, transformed=False))
    canvas.find_paper()
    canvas.pictured /= width * height * (scale * PIXEL) ** 2
    for element, defined in painter.items(root):
        canvas.held += 1
        if defined:
            canvas.leave("definition", element)
    return canvas


class _ElementPainter(NamedTuple):
    """Paints elements on a canvas."""

    canvas: Canvas
    # The properties that style sheets give to elements.
    sheet: dict[Element, dict[str, str]]
    by_id: dict[str, Element]

    def state(self, element: Element, outer: State, transformed: bool = True) -> State:
        """The state of what is in an element."""
        own = {key: value.strip() for key, value in element.attrib.items()}
        declared = overruled(self.sheet.get(element, {}), declarations(element.get("style", "")))
        own |= {key: value.partition("!")[0].strip() for key, value in declared.items()}
        _refuse_moves({key: own[key] for key in declared})
        style = within(outer.style, own)
        names, layer = _named(_tag(element), own, outer)
        state = outer._replace(
            style=style,
            alpha=outer.alpha * _share(style.get("opacity", "1")),
            names=names,
            layer=layer,
        )
        if transformed and style.get("transform", "none") != "none":
            state = state._replace(matrix=outer.matrix @ _transform(style, outer.size))
        for key in ("clip-path", "mask"):
            if style.get(key, "none") != "none":
                state = state._replace(clip=self._clipped(key, style[key], state))
        return state

    def children(self, element: Element, state: State) -> None:
        """Paint what is in an element."""
        chosen = [*element]
        if _tag(element) == "switch":
            chosen = [each for each in element if _is_for_all(each)][:1]
        for child in chosen:
            self.paint(child, state)
        self.leave([each for each in element if each not in chosen], "other choice")

    def items(self, within: Iterable[Element], defined: bool = False) -> Iterator[tuple[Any, bool]]:
        """The elements that may be painted, and for each whether only a use paints it."""
        for element in within:
            name = _tag(element)
            if name == "use" and self.target(element) is not None:
                continue
            if name in DEFINITIONS or (name in GROUPS and name != "use"):
                yield from self.items(element, defined or name in DEFINITIONS)
            elif name not in SILENT:
                yield element, defined
                if name not in SHAPES and name not in COUNTED:
                    # The content of an unknown element may be used elsewhere.
                    yield from self.items(element, True)

    def leave(self, elements: Iterable[Element], reason: str) -> None:
        """Leave out elements and their content."""
        for each, _ in self.items(elements):
            self.canvas.leave(reason, each)

    def target(self, use: Element) -> Element | None:
        """The element that a use refers to, if it is in this file."""
        href = next((v for key, v in use.attrib.items() if key.endswith("href")), "")
        return self.by_id.get(href[1:]) if href.startswith("#") else None

    def paint(self, element: Element, outer: State) -> None:
        """Paint an element."""
        self.canvas.count()
        name = _tag(element)
        if name not in SHAPES and name not in GROUPS:
            if name == "image":
                self._picture(element, self.state(element, outer))
            if name not in DEFINITIONS:
                self.leave([element], COUNTED.get(name, name))
            return
        state = self.state(element, outer)
        if _is_hidden(name, state):
            self.leave([element], "hidden part")
        elif name in SHAPES:
            self._shape(element, state)
        elif name == "use":
            self._use(element, state)
        elif name == "svg":
            self.children(element, _viewport(element, element, state))
        else:
            self.children(element, state)

    def _picture(self, element: Element, state: State) -> None:
        """Add the share of the sheet that a picture covers."""
        wide, high = state.size
        sides = _length(element, "width", wide) * _length(element, "height", high)
        self.canvas.pictured += abs(sides * np.linalg.det(state.matrix[:2, :2]))

    def _use(self, element: Element, state: State) -> None:
        target = self.target(element)
        if target is None:
            href = next((v for key, v in element.attrib.items() if key.endswith("href")), "")
            self.canvas.leave(f"use of what is not in this file: {one_line(href, 60)}", element)
            return
        place = (_length(element, key, side) for key, side in zip("xy", state.size, strict=True))
        state = state._replace(matrix=state.matrix @ _moved(*place))
        if _tag(target) == "symbol":
            inner = self.state(target, state)
            self.children(target, _viewport(target, element, inner, placed=True))
        else:
            self.paint(target, state)

    def _clipped(self, key: str, text: str, state: State) -> Any:
        """The clip of a state within a clip path or a mask."""
        match = re.match(r"""url\(\s*["']?#([^"')]+)""", text)
        target = self.by_id.get(match[1]) if match else None
        if target is None or "objectBoundingBox" in target.attrib.values():
            self.canvas.ignored[f"unread {key}"] += 1
            return state.clip
        inner = self._replace(canvas=Canvas(self.canvas.tolerance, self.canvas.pen))
        plain = State(state.matrix, state.size)
        paint = {"fill": "#fff", "stroke": "none"} if key == "clip-path" else {"fill": "#000"}
        inner.children(target, inner.state(target, plain)._replace(style=paint))
        self.canvas.count(len(inner.canvas.marks))
        region = shapely.Polygon()
        for mark in inner.canvas.marks:
            if is_area(mark.shape):
                light = key == "clip-path" or mark.contrast < 0.5
                region = region.union(mark.shape) if light else region.difference(mark.shape)
        return _within(state.clip, region)

    def _shape(self, element: Element, state: State) -> None:
        style = state.style
        canvas = self.canvas
        if any("url(" in style.get(f"marker-{end}", "") for end in ("start", "mid", "end")):
            canvas.leave("arrow", element)
            return
        canvas.begin(element)
        rings = _outline(_tag(element), state, canvas.tolerance)
        dashed = style.get("stroke-dasharray", "none")
        paints = (style.get(key, "none") for key in ("stroke", "fill"))
        drawn = painted(next(filter(_is_plain, paints), ""))
        mark = Mark(
            None,
            state.layer,
            state.names,
            dashed=re.search("[1-9]", dashed) is not None,
            colour="" if drawn.value is None else drawn.hexrgb,
        )
        if not ({"fill", "stroke"} & set(style) or element.get("fill-opacity")):
            for ring in rings:
                canvas.line(ring, mark, state.clip)
            return
        if "url(" in style.get("fill", ""):
            canvas.ignored["gradient or pattern"] += 1
        contrast, alpha = _colour(style, "fill", "black", state.alpha)
        rule = style.get("clip-rule" if "clip-path" in style else "fill-rule", "nonzero")
        fill = contrast, 0.0 if _tag(element) == "line" else alpha, rule != "evenodd"
        contrast, alpha = _colour(style, "stroke", "none", state.alpha)
        width = self._width(state)
        square = style.get("stroke-linecap", "butt") != "butt"
        stroke = contrast, alpha if width > 0.0 else 0.0, width, square
        canvas.shape(rings, mark, state.clip, fill, stroke)

    def _width(self, state: State) -> float:
        """The width of a stroke [m]."""
        whole = math.hypot(*state.size) / math.sqrt(2.0)
        width = _length(state.style, "stroke-width", whole, "1")
        if state.style.get("vector-effect") == "non-scaling-stroke":
            return width * PIXEL * self.canvas.scale
        return width * math.sqrt(abs(np.linalg.det(state.matrix[:2, :2])))


def _outline(kind: str, state: State, tolerance: float) -> list[Float]:
    """The lines (k, 2) [m] of a shape."""
    path = svgelements.Path(SHAPES[kind](_measures(kind, state)))
    path.approximate_arcs_with_cubics(1.0 / 48.0)
    lines = list[list[Float]]()
    for piece in path:
        found = _controls(piece) @ state.matrix[:2, :2].T + state.matrix[:2, 2]
        if isinstance(piece, svgelements.Move):
            lines.append([found[-1:]])
        elif lines and len(found) > 1:
            lines[-1].append(curve_points(found, tolerance))
    return [np.concatenate(line) for line in lines]


def _controls(piece: Any) -> Float:
    """The control points (k, 2) of a piece of a path, in its units."""
    names = ("start", "control", "control1", "control2", "end")
    points = [p for p in (getattr(piece, name, None) for name in names) if p is not None]
    return np.array([(p.x, p.y) for p in points]).reshape(-1, 2)


def _measures(kind: str, state: State) -> dict[str, Any]:
    """The attributes of a shape: lengths in pixels, and points and paths as they are written."""
    wide, high = state.size
    sides = dict.fromkeys(("x", "cx", "x1", "x2", "rx", "width"), wide)
    sides |= dict.fromkeys(("y", "cy", "y1", "y2", "ry", "height"), high)
    given = {key: _length(state.style, key, side, "auto") for key, side in sides.items()}
    if kind == "circle":
        given["rx"] = given["ry"] = _length(state.style, "r", math.hypot(wide, high) / math.sqrt(2))
    least = dict.fromkeys(("rx", "ry", "width", "height"), 0.0)
    for key, value in given.items():
        if not value >= least.get(key, -math.inf):
            # Radii of a rectangle that are not given follow from each other.
            given[key] = math.nan if kind == "rect" and key in ("rx", "ry") else 0.0
    values: dict[str, Any] = {key: value for key, value in given.items() if value == value}
    for key in {"d", "points"} & set(state.style):
        # svgelements takes minutes for thousands of closings in a row.
        values[key] = re.sub(r"[zZ](?:[\s,]*+[zZ])++", "z", state.style[key])
    return values


def _named(tag: str, own: dict[str, str], outer: State) -> tuple[tuple[str, ...], str]:
    """The names of an element, its own before those around it, and the layer that it is in."""
    label = next((v for k, v in own.items() if k.endswith("}label")), "")
    names = (label, own.get("data-name", ""), own.get("id", ""), own.get("class", ""))
    named = tuple(filter(None, names))
    chosen = label if any(v == "layer" for k, v in own.items() if k.endswith("mode")) else ""
    group = named[0] if named and tag in GROUPS else ""
    return named + outer.names, chosen or outer.layer or group


def _is_hidden(tag: str, state: State) -> bool:
    """Whether an element is not shown; a group that is not visible may hold shapes that are."""
    invisible = tag in SHAPES and state.style.get("visibility", "visible") != "visible"
    return invisible or state.style.get("display") == "none" or state.alpha < FAINT


def _within(clip: Any, region: Any) -> Any:
    """What a clip leaves of a region; None clips nothing."""
    # Half of a line on the edge is seen.
    region = region.buffer(ON_EDGE, join_style="mitre")
    return region if clip is None else clip.intersection(region)


def _viewport(element: Element, sized: Element, state: State, placed: bool = False) -> State:
    """The state in a nested drawing or a symbol, with a frame of its own."""
    wide, high = state.size
    x, y = (0.0, 0.0) if placed else (_length(element, "x", wide), _length(element, "y", high))
    width = _length(sized, "width", wide, element.get("width", "100%"))
    height = _length(sized, "height", high, element.get("height", "100%"))
    if state.style.get("overflow", "hidden") not in ("visible", "auto"):
        corners = np.array(shapely.box(x, y, x + width, y + height).exterior.coords)
        frame = shapely.Polygon(corners @ state.matrix[:2, :2].T + state.matrix[:2, 2])
        state = state._replace(clip=_within(state.clip, frame))
    return _framed(element, (x, y, width, height), state)


def _framed(element: Element, frame: tuple[float, ...], state: State) -> State:
    """The state in a frame, x, y, width, height, into which an element's ``viewBox`` is fitted."""
    if not element.get("viewBox"):
        return state._replace(matrix=state.matrix @ _moved(*frame[:2]), size=frame[2:])
    box = _box(element)
    how = element.get("preserveAspectRatio", "xMidYMid").replace("defer", "").strip()
    fitted = svgelements.Viewbox.viewbox_transform(*frame, *box, how)
    return state._replace(matrix=state.matrix @ _matrix(fitted), size=box[2:])


def _refuse_moves(style: dict[str, str]) -> None:
    """Refuse a style that moves by properties of their own, which are not followed here."""
    for key in MOVES:
        if style.get(key, "none") not in NO_MOVES:
            raise WorldError(f"has {key}: {shown(style[key])} in a style; apply transforms")


def _transform(style: dict[str, str], size: tuple[float, ...]) -> Float:
    """The transform of an element, about its origin."""
    words = style.get("transform-origin", "0 0").split()
    if style.get("transform-box", "view-box") != "view-box" and "transform-origin" in style:
        raise WorldError("has a transform-box, about which nothing is known here; apply transforms")
    sides = {"left": "0%", "top": "0%", "center": "50%", "right": "100%", "bottom": "100%"}
    if words[0] in ("top", "bottom"):
        words = [*words[1:], "center"][:1] + words[:1]
    words = [sides.get(word, word) for word in [*words, "50%"]]
    x, y = (_length({"": word}, "", side) for word, side in zip(words, size, strict=False))
    about: Float = _moved(x, y) @ _matrix(style["transform"]) @ _moved(-x, -y)
    return about


def _matrix(text: str) -> Float:
    if re.search(r"\([^()]*+\(", text):
        raise WorldError(f"has brackets within brackets in transform {shown(text)}; save it again")
    m = svgelements.Matrix(text)
    return np.array([[m.a, m.c, float(m.e)], [m.b, m.d, float(m.f)], [0.0, 0.0, 1.0]])


def _moved(x: float, y: float) -> Float:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _size(root: Element) -> tuple[float, float]:
    """Width and height of a sheet [px]; a side that is not given follows from the ``viewBox``."""
    sides: dict[str, float] = {}
    for key in ("width", "height"):
        text = root.get(key, "").strip()
        if text not in ("", "auto") and not text.endswith("%"):
            sides[key] = _length({key: text}, key, math.nan)
            if not 0.0 < sides[key] <= LARGEST_COORDINATE:
                raise WorldError(f"{key} is {shown(text)}, expected a length above 0 such as 120mm")
    _, _, wide, high = _box(root)
    usual = sides["height"] * wide / high if "height" in sides else wide
    width = sides.get("width", usual)
    return width, sides.get("height", width * high / wide)


def _box(element: Element) -> tuple[float, ...]:
    """The ``viewBox`` of an element: x, y, width, height."""
    text = element.get("viewBox") or "0 0 1 1"
    box = tuple(map(float, re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text)))
    if len(box) != 4 or not (min(box[2:]) > ROUNDING and max(box[2:]) <= LARGEST_COORDINATE):
        raise WorldError(f"viewBox is {shown(text)}, expected a place and a size above 0")
    return box


def _length(values: Any, key: str, whole: float, usual: str = "0") -> float:
    """A length [px] of a key, or a part of the whole; NaN if it is invalid."""
    text = values.get(key, usual)
    match = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([a-zA-Z]*|%)\s*", text)
    if not match:
        return math.nan
    unit = 0.01 * whole if match[2] == "%" else UNITS.get(match[2].lower(), math.nan) / PIXEL
    return float(match[1]) * unit


def _share(text: str) -> float:
    """A share, from 0 to 1; 1 if it is invalid."""
    given = _length({"": text}, "", 1.0)
    return 1.0 if math.isnan(given) else min(max(given, 0.0), 1.0)


def _tag(element: Element) -> str:
    """The name of an element of SVG; empty for those of others."""
    name = str(element.tag)
    return name.rpartition("}")[2] if "}" not in name or "/svg}" in name else ""


def _colour(style: dict[str, str], key: str, usual: str, alpha: float) -> tuple[float, float]:
    """The contrast of a colour, and how opaque it is, both from 0 to 1."""
    text = style.get(key, usual)
    text = style.get("color", "black") if text.lower() == "currentcolor" else text
    if "url(" in text:
        return UNKNOWN, alpha
    colour = painted(text)
    if text == "none" or colour.value is None:
        return 0.0, 0.0
    alpha *= colour.alpha / WHITE * _share(style.get(f"{key}-opacity", "1"))
    return alpha * contrast_to_white(colour.red, colour.green, colour.blue), alpha


def _is_for_all(choice: Element) -> bool:
    """Whether a choice of a switch needs no extension and no other language than English."""
    languages = choice.get("systemLanguage", "en").replace(" ", "").split(",")
    return not choice.get("requiredExtensions") and any(e[:2] == "en" for e in languages)


def _is_plain(text: str) -> bool:
    """Whether a text names a colour, not a pattern."""
    return text != "none" and "url(" not in text
