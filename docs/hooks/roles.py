"""Docstrings name things as Sphinx does, :class:`Grid`; on the site the name alone is left."""

import re
from typing import Any

ROLE = re.compile(r":(?:attr|class|data|func|meth|mod):(?=<code>)")


def on_page_content(content: str, **_: Any) -> str:
    """Take the roles away."""
    return ROLE.sub("", content)
