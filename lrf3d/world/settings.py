"""Settings of a world file that are given beside it: ``laser.range_max=20``.

Texts enter, each the name of a table and a key of it and a value as TOML has it; the checked
values leave, by the same rules as those of a file.
"""

import tomllib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

from lrf3d.errors import InputError
from lrf3d.world.schema import TABLES, Invalid, shown


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
            raise InputError(f"setting {text!r}: expected TABLE.KEY=VALUE, as laser.range_max=20")
        checks = TABLES[_known(table, TABLES, name)]
        check = checks[_known(key, checks, name)]
        try:
            tables.setdefault(table, {})[key] = check(toml_value(value))
        except NoValue:
            raise InputError(f"setting {name}: {shown(value)} is no value of TOML") from None
        except Invalid as problem:
            raise InputError(f"setting {name}: {problem}") from None
    return tables


class NoValue(Exception):
    """A text that is no value of TOML."""


def toml_value(text: str) -> Any:
    """The value that a text is in TOML.

    Raises:
        NoValue: It is none, is nested too deeply, or is a number of thousands of digits.
    """
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        raise NoValue from None


def _known(word: str, known: Mapping[str, Any], name: str) -> str:
    if word not in known:
        near = get_close_matches(word, list(known), n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        raise InputError(f"setting {name}: there is no {word!r}; {hint}")
    return word
