"""Style sheets of SVG drawings: the properties that they give to elements."""

import re
from xml.etree.ElementTree import Element

import cssselect2
import tinycss2


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
        found = overruled(found, {key.strip().lower(): value.strip()})
    return found


def overruled(one: dict[str, str], other: dict[str, str]) -> dict[str, str]:
    """Declarations, overruled by others unless they are important and those are not."""
    return one | {k: v for k, v in other.items() if "!" in v or "!" not in one.get(k, "")}
