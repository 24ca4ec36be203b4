"""SVG's viewports as plain groups: what is drawn in a frame of its own, or only where it is used.

A tree of elements enters and leaves with neither nested ``svg`` nor ``symbol`` in it. A nested
``svg`` becomes a group that is moved and scaled as its ``viewBox`` says; a ``symbol`` a definition,
scaled likewise where ``use`` puts it; and what clips, masks, fills or marks other elements is taken
out, for its outlines are not part of the drawing.
"""

import math
from xml.etree.ElementTree import Element

from lrf3d.errors import WorldError

UNDRAWN = {"clipPath", "mask", "pattern", "marker", "filter", "linearGradient", "radialGradient"}
"""Elements whose parts are no outlines, wherever they stand."""


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
    """Let a ``use`` of a symbol scale it into the size that it asks for."""
    href = next((value for key, value in use.items() if key.rpartition("}")[2] == "href"), "")
    if href[1:] in boxes and (use.get("width") or use.get("height")):
        x, y = _number(use, "x", 0.0), _number(use, "y", 0.0)
        _move(use, _fitted(use, boxes[href[1:]]), x, y)


def _group(element: Element, fitted: str, x: float, y: float) -> None:
    _rename(element, "g")
    _move(element, fitted, x, y)


def _move(element: Element, fitted: str, x: float, y: float) -> None:
    """Say by the transform of an element what its place and its size have said."""
    for key in ("x", "y", "width", "height", "viewBox", "preserveAspectRatio"):
        element.attrib.pop(key, None)
    moved = f"{element.get('transform', '')} translate({x!r},{y!r}) {fitted}"
    element.set("transform", moved.strip())


def _fitted(element: Element, box: str | None) -> str:
    """The transform from a view box into the size of an element, in the middle of it."""
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
    """A length [units of the drawing]; a share of another where it is in per cent."""
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
