"""The public names of lrf3d, listed with the first sentence of what their docstrings say."""

from typing import Any

import griffe
from mkdocs.structure.pages import Page

MARK = "<!-- the public names -->"


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Put the list where the page asks for it."""
    if MARK not in markdown:
        return markdown
    package = griffe.load("lrf3d", search_paths=["."], resolve_aliases=True)
    rows = ["| name | what it is |", "|---|---|"]
    for name in sorted(package.exports or [], key=str.lower):
        found = package[name]
        # `slam` is a package that can be called; all others are imported from where they stand.
        found = found.final_target if found.is_alias else found
        said = found.docstring.value.split("\n\n")[0].replace("\n", " ")
        rows.append(f"| [`{name}`][lrf3d.{name}] | {said} |")
    return markdown.replace(MARK, "\n".join(rows))
