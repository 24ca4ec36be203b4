"""Drawings in SVG, as browsers draw them: style sheets, transforms, uses, symbols, clips, masks.

Lengths are metres on paper: ``width`` and ``height`` in mm, cm, in, pt or px (1/96 in) give the
size of the ``viewBox``. y points up, and the lower left corner of the sheet is (0, 0); what lies
outside of the sheet is read, too. A group gives the layer, by its label or its id. Texts, pictures
and patterns are counted; a shape whose file names no colour at all is its outline.
"""

import math
import re
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.geometry import LARGEST_COORDINATE, Float
from lrf3d.world.drawing import CURVE_ERROR, Canvas, Mark, curve_points, is_area, pen_of
from lrf3d.world.svg_values import (
    PIXEL,
    colour_of,
    declarations,
    length,
    numbers,
    share,
    style_sheet,
    tag,
)

INHERITED = frozenset(
    "fill stroke stroke-width stroke-linecap visibility color fill-rule clip-rule fill-opacity"
    " stroke-opacity".split()
)
SHAPES = frozenset("path rect circle ellipse line polyline polygon".split())
COUNTED = {"text": "text", "image": "picture", "foreignObject": "picture"}
GROUPS = frozenset(("g", "a", "svg", "switch", "use"))
DEEPEST = 100
"""Most groups and uses within each other."""


class State(NamedTuple):
    """What an element gets from those around it."""

    matrix: Float
    """From its units to metres (3, 3)."""
    size: tuple[float, float]
    """Of the viewport, of which lengths in % are parts."""
    style: dict[str, str] = {}  # noqa: RUF012 - never changed.
    clip: Any = None
    alpha: float = 1.0
    names: tuple[str, ...] = ()
    layer: str = ""
    depth: int = 0


def draw_svg(path: Path, scale: float) -> Canvas:
    """The marks of an SVG drawing, enlarged by a scale."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise WorldError(f"not XML: {error}") from None
    if tag(root) != "svg":
        raise WorldError(f"<{tag(root)[:40]}> where <svg> was expected: not an SVG drawing")
    width, height = _size(root)
    # A drawing on paper is a thousandth of the size of what it shows.
    tolerance = min(CURVE_ERROR, 2e-4 * max(width, height) * PIXEL * scale)
    painter = _Painter(root, Canvas(tolerance), pen_of(scale))
    up = scale * PIXEL * np.array([[1.0, 0.0, 0.0], [0.0, -1.0, height], [0.0, 0.0, 0.0]])
    up[2, 2] = 1.0
    box = root.get("viewBox") and numbers(root.get("viewBox", ""))
    matrix = _fitted(root, (0.0, 0.0, width, height), box or None)
    size = (box[2], box[3]) if box else (width, height)
    painter.children(root, painter.state(root, State(up @ matrix, size), transformed=False))
    return painter.canvas


class _Painter:
    """Paints elements on a canvas."""

    def __init__(self, root: Element, canvas: Canvas, pen: float) -> None:
        self.canvas, self.pen = canvas, pen
        self.sheet = style_sheet(root)
        self.by_id = {each.get("id"): each for each in root.iter() if each.get("id")}

    def state(self, element: Element, outer: State, transformed: bool = True) -> State:
        """The state of what is in an element."""
        own = {key: value.strip() for key, value in element.attrib.items()}
        own |= self.sheet.get(element, {}) | declarations(element.get("style", ""))
        style = {k: v for k, v in outer.style.items() if k in INHERITED}
        style |= {k: v for k, v in own.items() if v != "inherit"}
        matrix = outer.matrix
        if transformed and style.get("transform", "none") != "none":
            matrix = matrix @ _transform(style, outer.size)
        label = next((v for k, v in own.items() if k.endswith("}label")), "")
        names = (label, own.get("data-name", ""), own.get("id", ""), own.get("class", ""))
        named = next(filter(None, names), "")
        chosen = label if any(v == "layer" for k, v in own.items() if k.endswith("mode")) else ""
        state = outer._replace(
            matrix=matrix,
            style=style,
            alpha=outer.alpha * share(style.get("opacity", "1")),
            names=tuple(filter(None, names)) + outer.names,
            layer=chosen or outer.layer or (named if tag(element) in GROUPS else ""),
            depth=outer.depth + 1,
        )
        for key in ("clip-path", "mask"):
            if style.get(key, "none") != "none":
                state = state._replace(clip=self._clipped(key, style[key], state))
        return state

    def children(self, element: Element, state: State) -> None:
        """Paint what is in an element."""
        if state.depth > DEEPEST:
            raise WorldError(f"has groups or uses within each other, more than {DEEPEST} deep")
        for child in list(element)[:1] if tag(element) == "switch" else element:
            self.paint(child, state)

    def paint(self, element: Element, outer: State) -> None:
        """Paint an element."""
        self.canvas.count()
        name = tag(element)
        if name in COUNTED:
            self.canvas.left_out[COUNTED[name]] += 1
        if name not in SHAPES and name not in GROUPS:
            return
        state = self.state(element, outer)
        if state.style.get("display") == "none" or state.alpha < 0.02:
            self.canvas.left_out["hidden part"] += 1
        elif name in SHAPES:
            self._shape(element, state)
        elif name == "use":
            self._use(element, state)
        elif name == "svg":
            self.children(element, _viewport(element, element, state))
        else:
            self.children(element, state)

    def _use(self, element: Element, state: State) -> None:
        href = next((v for key, v in element.attrib.items() if key.endswith("href")), "")
        if not href.startswith("#"):
            raise WorldError(f"uses {shown(href)}, which is outside this file; put it in")
        target = self.by_id.get(href[1:])
        if target is None:
            self.canvas.left_out["unresolved use"] += 1
            return
        x = length(element.get("x", "0"), state.size[0])
        y = length(element.get("y", "0"), state.size[1])
        state = state._replace(matrix=state.matrix @ _moved(x, y))
        if tag(target) == "symbol":
            inner = self.state(target, state)
            self.children(target, _viewport(target, element, inner, placed=True))
        else:
            self.paint(target, state)
        if state.depth > DEEPEST:
            raise WorldError(f"has groups or uses within each other, more than {DEEPEST} deep")

    def _clipped(self, key: str, text: str, state: State) -> Any:
        """What a clip path or a mask leaves of the clip of a state."""
        import shapely

        match = re.match(r"""url\(\s*["']?#([^"')]+)""", text)
        target = self.by_id.get(match[1]) if match else None
        if target is None or "objectBoundingBox" in target.attrib.values():
            self.canvas.left_out[f"unread {key}"] += 1
            return state.clip
        inner = _Painter(target, Canvas(self.canvas.tolerance), self.pen)
        inner.sheet, inner.by_id = self.sheet, self.by_id
        plain = State(state.matrix, state.size, depth=state.depth + 1)
        paint = {"fill": "#fff", "stroke": "none"} if key == "clip-path" else {"fill": "#000"}
        inner.children(target, inner.state(target, plain)._replace(style=paint))
        self.canvas.count(len(inner.canvas.marks))
        region = shapely.Polygon()
        for mark in inner.canvas.marks:
            if is_area(mark.shape):
                light = key == "clip-path" or mark.contrast < 0.5
                region = region.union(mark.shape) if light else region.difference(mark.shape)
        return region if state.clip is None else region.intersection(state.clip)

    def _shape(self, element: Element, state: State) -> None:
        style, canvas = state.style, self.canvas
        if style.get("visibility", "visible") != "visible":
            canvas.left_out["hidden part"] += 1
            return
        rings = _outline(element, state, canvas.tolerance)
        mark = Mark(None, state.layer, state.names)
        if not {"fill", "stroke"} & set(style):
            for ring in rings:
                canvas.line(ring, mark, state.clip)
            return
        if "url(" in style.get("fill", ""):
            canvas.left_out["gradient or pattern"] += 1
        contrast, alpha = colour_of(style, "fill", "black", state.alpha)
        rule = style.get("clip-rule" if "clip-path" in style else "fill-rule", "nonzero")
        if alpha > 0.02 and tag(element) != "line":
            solid = mark._replace(contrast=contrast, opaque=alpha > 0.98)
            canvas.area(rings, solid, state.clip, winding=rule != "evenodd")
        contrast, alpha = colour_of(style, "stroke", "none", state.alpha)
        size = math.hypot(*state.size) / math.sqrt(2.0)
        width = length(style.get("stroke-width", "1"), size)
        width *= math.sqrt(abs(np.linalg.det(state.matrix[:2, :2])))
        if alpha > 0.02 and width > 0.0:
            wide = width if width > self.pen or contrast < 0.08 else 0.0
            cap = "flat" if style.get("stroke-linecap", "butt") == "butt" else "square"
            pen = mark._replace(width=wide, contrast=contrast, opaque=alpha > 0.98)
            for ring in rings:
                canvas.line(ring, pen, state.clip, cap)


def _outline(element: Element, state: State, tolerance: float) -> list[Float]:
    """The lines (k, 2) [m] of a shape."""
    import svgelements as svg

    wide, high = state.size
    diagonal = math.hypot(wide, high) / math.sqrt(2.0)

    def number(key: str, whole: float = diagonal, usual: str = "0") -> float:
        return length(state.style.get(key, usual), whole)

    kind = tag(element)
    if kind == "path":
        path = svg.Path(element.get("d", state.style.get("d", "")))
    elif kind == "rect":
        rounded = [number(key, side, "-1") for key, side in (("rx", wide), ("ry", high))]
        rx, ry = (max(own, 0.0) if own >= 0.0 else max(other, 0.0)
                  for own, other in (rounded, rounded[::-1]))  # fmt: skip
        place = number("x", wide), number("y", high), number("width", wide), number("height", high)
        path = svg.Path(svg.Rect(*place, rx=rx, ry=ry)) if min(place[2:]) > 0.0 else svg.Path()
    elif kind in ("circle", "ellipse"):
        rx, ry = (number("r"),) * 2 if kind == "circle" else (number("rx"), number("ry"))
        middle = number("cx", wide), number("cy", high)
        path = svg.Path(svg.Ellipse(*middle, rx, ry)) if min(rx, ry) > 0.0 else svg.Path()
    elif kind == "line":
        one, two = [(number(f"x{n}", wide), number(f"y{n}", high)) for n in (1, 2)]
        path = svg.Path(svg.Move(one), svg.Line(one, two))
    else:
        points = numbers(element.get("points", ""))
        path = svg.Path(f"M{' '.join(map(str, points[: len(points) // 2 * 2]))}" if points else "")
        if kind == "polygon" and points:
            path.closed()
    lines = list[list[Float]]()
    for piece in path:
        if isinstance(piece, svg.Move):
            lines.append([_points([piece.end], state.matrix)])
        elif isinstance(piece, svg.Line | svg.Close):
            if lines and piece.end is not None:
                lines[-1].append(_points([piece.end], state.matrix))
        else:
            curves = piece.as_cubic_curves(12) if isinstance(piece, svg.Arc) else [piece]
            for curve in curves:
                lines[-1].append(curve_points(_controls(curve, state.matrix), tolerance))
    return [np.concatenate(line) for line in lines]


def _controls(curve: Any, matrix: Float) -> Float:
    """The four controls (4, 2) [m] of a curve of two or three."""
    if hasattr(curve, "control1"):
        return _points([curve.start, curve.control1, curve.control2, curve.end], matrix)
    one, two, three = _points([curve.start, curve.control, curve.end], matrix)
    return np.array([one, one + (two - one) / 1.5, three + (two - three) / 1.5, three])


def _points(points: list[Any], matrix: Float) -> Float:
    found = np.array([(point.x, point.y) for point in points])
    return np.asarray(found @ matrix[:2, :2].T + matrix[:2, 2], dtype=np.float64)


def _viewport(element: Element, sized: Element, state: State, placed: bool = False) -> State:
    """The state in a nested drawing or a symbol, with a frame of its own."""
    import shapely

    wide, high = state.size
    x = 0.0 if placed else length(element.get("x", "0"), wide)
    y = 0.0 if placed else length(element.get("y", "0"), high)
    width = length(sized.get("width", element.get("width", "100%")), wide)
    height = length(sized.get("height", element.get("height", "100%")), high)
    box = numbers(element.get("viewBox", "")) or None
    clip = state.clip
    if state.style.get("overflow", "hidden") not in ("visible", "auto"):
        corners = np.array(shapely.box(x, y, x + width, y + height).exterior.coords)
        frame = shapely.Polygon(corners @ state.matrix[:2, :2].T + state.matrix[:2, 2])
        clip = frame if clip is None else clip.intersection(frame)
    matrix = state.matrix @ _fitted(element, (x, y, width, height), box)
    return state._replace(
        matrix=matrix, size=(box[2], box[3]) if box else (width, height), clip=clip
    )


def _fitted(element: Element, frame: tuple[float, ...], box: list[float] | None) -> Float:
    """How the ``viewBox`` fits into a frame: x, y, width, height."""
    x, y, width, height = frame
    if box is None:
        return _moved(x, y)
    if len(box) != 4 or not min(box[2:]) > 0.0:
        raise WorldError(f"viewBox is {shown(element.get('viewBox'))}, expected a place and a size")
    how = element.get("preserveAspectRatio", "xMidYMid").replace("defer", "").split() or [""]
    sx, sy = width / box[2], height / box[3]
    if how[0] != "none":
        sx = sy = max(sx, sy) if "slice" in how else min(sx, sy)
    rest = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
    ax, ay = rest.get(how[0][1:4], 0.5), rest.get(how[0][5:8], 0.5)
    x += ax * (width - sx * box[2]) - sx * box[0]
    y += ay * (height - sy * box[3]) - sy * box[1]
    return np.array([[sx, 0.0, x], [0.0, sy, y], [0.0, 0.0, 1.0]])


def _transform(style: dict[str, str], size: tuple[float, float]) -> Float:
    """The transform of an element, about its origin."""
    from svgelements import Matrix

    m = Matrix(style["transform"])
    matrix = np.array([[m.a, m.c, float(m.e)], [m.b, m.d, float(m.f)], [0.0, 0.0, 1.0]])
    words = style.get("transform-origin", "0 0").split()
    if style.get("transform-box", "view-box") != "view-box" and "transform-origin" in style:
        raise WorldError("has a transform-box, about which nothing is known here; apply transforms")
    sides = {"left": "0%", "top": "0%", "center": "50%", "right": "100%", "bottom": "100%"}
    if words[0] in ("top", "bottom"):
        words = [*words[1:], "center"][:1] + words[:1]
    x, y = (length(sides.get(w, w), side) for w, side in zip([*words, "50%"], size, strict=False))
    about: Float = _moved(x, y) @ matrix @ _moved(-x, -y)
    return about


def _moved(x: float, y: float) -> Float:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _size(root: Element) -> tuple[float, float]:
    """Width and height of a sheet [px]; a side that is not given follows from the ``viewBox``."""
    sides: list[float | None] = []
    for key in ("width", "height"):
        text = root.get(key, "").strip()
        given = text not in ("", "auto") and not text.endswith("%")
        side = length(text, math.nan) if given else None
        if side is not None and not 0.0 < side <= LARGEST_COORDINATE:
            raise WorldError(f"{key} is {shown(text)}, expected a length above 0 such as 120mm")
        sides.append(side)
    width, height = sides
    box = numbers(root.get("viewBox", "0 0 1 1"))
    wide, high = box[2:] if len(box) == 4 else (math.nan, math.nan)
    if not (min(wide, high) > 1e-9 and max(wide, high) <= LARGEST_COORDINATE):
        found = shown(root.get("viewBox"))
        raise WorldError(f"viewBox is {found}, expected a place and a size above 0")
    if width is None:
        width = wide if height is None else height * wide / high
    return width, width * high / wide if height is None else height
