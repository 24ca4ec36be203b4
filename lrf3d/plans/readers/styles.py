"""Style sheets of SVG drawings: the properties that they give to elements, and their colours."""

import re
from typing import Any
from xml.etree.ElementTree import Element

import cssselect2
import svgelements
import tinycss2

# Properties that an element takes over from those around it.
INHERITED = frozenset(
    "fill stroke stroke-width stroke-linecap stroke-dasharray visibility color fill-rule clip-rule"
    " fill-opacity stroke-opacity marker-start marker-mid marker-end".split()
)

# Matches the use of a variable, with a value in place of one that is not set.
VARIABLE = re.compile(r"var\(\s*(--[\w-]+)\s*(?:,\s*((?:[^()]|\([^()]*\))*))?\)")

# Largest depth of variables whose values use variables.
DEEPEST = 4

# Matches a choice of two colours, one for light paper and one for dark.
LIGHT = re.compile(r"light-dark\(\s*((?:[^(),]|\([^()]*\))*),.*\)")

# Matches a colour given by three shares.
SHARES = re.compile(r"color\(\s*[\w-]+\s+([\d.]+%?)\s+([\d.]+%?)\s+([\d.]+%?)(?=[\s/)])[^)]*\)")

# Matches a channel of a colour.
CHANNEL = re.compile(r"\d*\.?\d+(?:[eE][-+]?\d+)?")


def style_sheet(root: Element) -> dict[Element, dict[str, str]]:
    """The properties that style sheets give to the elements of a drawing."""
    matcher = cssselect2.Matcher()
    texts = [
        "".join(each.itertext())
        for each in root.iter()
        if str(each.tag).rpartition("}")[2] == "style"
    ]
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
            said[each.etree_element] = overruled(said.get(each.etree_element, {}), content)
    return said


def declarations(text: str) -> dict[str, str]:
    """The properties that the declarations of a style set."""
    found = dict[str, str]()
    for part in re.sub(r"/\*.*?\*/", "", text).split(";"):
        key, _, value = part.partition(":")
        key = key.strip()
        # Names of variables are case-sensitive.
        key = key if key.startswith("--") else key.lower()
        found = overruled(found, {key: value.strip()})
    return found


def overruled(one: dict[str, str], other: dict[str, str]) -> dict[str, str]:
    """Declarations, overruled by others unless they are important and those are not."""
    return one | {k: v for k, v in other.items() if "!" in v or "!" not in one.get(k, "")}


def within(outer: dict[str, str], own: dict[str, str]) -> dict[str, str]:
    """The style of an element with its own properties within another style."""
    style = {k: v for k, v in outer.items() if k in INHERITED or k.startswith("--")}
    style |= {k: v for k, v in own.items() if v != "inherit"}
    for _ in range(DEEPEST):
        if any("var(" in value for value in style.values()):
            style = _resolved(style)
    return style


def _resolved(style: dict[str, str]) -> dict[str, str]:
    """A style with the values of its variables; properties that have none are dropped."""

    def value(key: str) -> str:
        # The page around a drawing may set the colour of lines: unknown, it is black.
        unset = "black" if key == "stroke" else ""
        return VARIABLE.sub(lambda use: style.get(use[1], use[2] or unset), style[key])

    return {key: found for key in style if (found := value(key))}


def painted(text: str) -> Any:
    """A colour, for svgelements: whole numbers between commas, and no alpha in percent."""
    text = LIGHT.sub(r"\1", text)
    if shares := SHARES.match(text):
        parts = (s if "%" in s else f"{100 * float(s):g}%" for s in shares.groups())
        text = f"rgb({','.join(parts)})"
    text = re.sub(r"/\s*(\d+)%", lambda alpha: f"/{float(alpha[1]) / 100:f}", text)
    text = re.sub(r"(?<=[\d%])[\s/]+(?=[\d.])", ",", text)
    if re.match(r"rgba?\([^%]+$", text):
        text = CHANNEL.sub(lambda number: f"{float(number[0]):.0f}", text, count=3)
    return svgelements.Color(text)
