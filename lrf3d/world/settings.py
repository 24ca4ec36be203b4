"""Settings of a world file that are given beside it: ``laser.range_max=20``.

Texts enter, each the name of a table and a key of it and a value as TOML has it, where a text
needs no quotes; the checked values leave, by the same rules as those of a file.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

from lrf3d.errors import InputError, shown
from lrf3d.world.schema import TABLES, Invalid

_NUMBER = re.compile(r"[+-]?(\d+\.\d*|\.\d+)([eE][+-]?\d+)?")
"""Numbers as people write them, of which TOML wants a digit on either side of the point."""


def value_of(text: str) -> Any:
    """The value of a text as TOML has it; a text may stand without its quotes.

    Raises:
        InputError: It begins as a list or as a text in quotes, and does not end so.
    """
    text = text.strip()
    if _NUMBER.fullmatch(text):
        return float(text)
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        # Nested too deeply, or a number of thousands of digits.
        found = {}
    if list(found) == ["value"]:
        return found["value"]
    if not text or text[0] in "[{\"'":
        raise InputError(
            f"{shown(text)} is not a TOML value; expected one such as"
            ' 20, true, [1, 2], paper or "paper"'
        )
    return text


def read_settings(texts: Iterable[str]) -> dict[str, dict[str, Any]]:
    """The values of settings by table and key; of the same twice the last.

    Raises:
        InputError: A text is no setting, names none, or has a value that cannot be.
    """
    tables: dict[str, dict[str, Any]] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        table, dot, key = name.strip().partition(".")
        if not (equals and dot):
            raise InputError(
                f"setting {shown(text)}: expected TABLE.KEY=VALUE, such as laser.range_max=20"
            )
        checks = TABLES[_known(table, TABLES, name)]
        check = checks[_known(key, checks, name)]
        try:
            tables.setdefault(table, {})[key] = check(value_of(value))
        except (InputError, Invalid) as problem:
            raise InputError(f"setting {name}: {problem}") from None
    return tables


def _known(word: str, known: Mapping[str, Any], name: str) -> str:
    if word not in known:
        near = get_close_matches(word, list(known), n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        raise InputError(f"setting {name[:80]}: there is no {shown(word)}; {hint}")
    return word
