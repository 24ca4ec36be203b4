"""Values of SVG and CSS: lengths, colours, lists of numbers, and style sheets."""

import math
import re
from xml.etree.ElementTree import Element

PIXEL = 0.0254 / 96.0
"""The unit of numbers without one [m]: 1/96 in."""

UNITS = {"": PIXEL, "px": PIXEL, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "q": 0.25e-3}
UNITS |= {"in": 0.0254, "pt": 0.0254 / 72.0, "pc": 0.0254 / 6.0, "em": 16.0 * PIXEL}
"""Metres in the units of lengths."""


def length(text: str, whole: float) -> float:
    """A length [px], or a part of the whole; NaN if it is none."""
    match = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([a-zA-Z]*|%)\s*", text)
    if not match:
        return math.nan
    if match[2] == "%":
        return float(match[1]) * whole / 100.0
    unit = match[2].lower()
    return float(match[1]) * UNITS[unit] / PIXEL if unit in UNITS else math.nan


def share(text: str) -> float:
    """A share, from 0 to 1; 1 if it is none."""
    given = length(text, 1.0)
    return 1.0 if math.isnan(given) else min(max(given, 0.0), 1.0)


def numbers(text: str) -> list[float]:
    """The numbers in a text."""
    return [float(each) for each in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text)]


def tag(element: Element) -> str:
    """The name of an element of SVG; empty for those of others."""
    name = str(element.tag)
    return name.rpartition("}")[2] if "}" not in name or "/svg}" in name else ""


def colour_of(style: dict[str, str], key: str, usual: str, alpha: float) -> tuple[float, float]:
    """How far a colour is from white, and how opaque it is, both from 0 to 1."""
    from svgelements import Color

    text = style.get(key, usual)
    text = style.get("color", "black") if text.lower() == "currentcolor" else text
    if "url(" in text:
        return 0.3, alpha
    colour = Color(text)
    if text == "none" or colour.value is None:
        return 0.0, 0.0
    alpha *= colour.alpha / 255.0 * share(style.get(f"{key}-opacity", "1"))
    return alpha * (1.0 - min(colour.red, colour.green, colour.blue) / 255.0), alpha


def style_sheet(root: Element) -> dict[Element, dict[str, str]]:
    """What the style sheets of a drawing say of its elements."""
    import cssselect2
    import tinycss2

    matcher = cssselect2.Matcher()
    texts = ["".join(each.itertext()) for each in root.iter() if tag(each) == "style"]
    for rule in tinycss2.parse_stylesheet("\n".join(texts), True, True):
        if rule.type == "qualified-rule":
            content = declarations(tinycss2.serialize(rule.content))
            try:
                for selector in cssselect2.compile_selector_list(rule.prelude):
                    matcher.add_selector(selector, content)
            except cssselect2.SelectorError:
                continue
    said = dict[Element, dict[str, str]]()
    for each in cssselect2.ElementWrapper.from_xml_root(root).iter_subtree():
        # From the least specific rule on.
        for *_, content in matcher.match(each):
            said.setdefault(each.etree_element, {}).update(content)
    return said


def declarations(text: str) -> dict[str, str]:
    """The properties that the declarations of a style set."""
    parts = (part.partition(":") for part in re.sub(r"/\*.*?\*/", "", text).split(";"))
    return {key.strip().lower(): value.replace("!important", "").strip() for key, _, value in parts}
