"""Sphinx's marks in docstrings: :class:`Grid` becomes Grid, and :: before code a colon."""

import re
from typing import Any

ROLE = re.compile(r":(?:attr|class|data|func|meth|mod):(?=<code>)")


def on_page_content(content: str, **_: Any) -> str:
    """Take the roles and the second colons away."""
    return ROLE.sub("", content).replace("::</p>", ":</p>")
