"""Equations as MathML, which browsers draw by themselves: no script, no font, nothing fetched.

The Markdown extension arithmatex marks what is TeX; latex2mathml makes MathML of it.
"""

import html
import re
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

MARKED = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<tex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)

FUNCTION = re.compile(r"(<mi>(?:cos|sin)</mi>)")
"""Names of functions, which browsers set without the space that belongs round them."""


def on_page_content(content: str, **_: Any) -> str:
    """Replace each marked equation."""
    return MARKED.sub(_equation, content)


def _equation(match: re.Match[str]) -> str:
    tex, block = html.unescape(match["tex"]).strip(), match["tag"] == "div"
    try:
        math = convert(tex, display="block" if block else "inline")
    except Exception as error:
        raise PluginError(f"not TeX that latex2mathml reads: {tex}") from error
    if "&amp;" in math:
        raise PluginError(f"columns that latex2mathml does not read: {tex}")
    math = FUNCTION.sub(r'<mspace width="0.17em"/>\1<mspace width="0.17em"/>', math)
    return f'<div class="equation">{math}</div>' if block else math
