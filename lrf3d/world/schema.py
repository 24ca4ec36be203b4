"""The schema of world files: the keys of each table, and the converter of their values.

A converter takes a value from tomllib and returns it in the form that the program uses, or raises
:class:`Invalid`. Settings on the command line, such as ``laser.range_max=20``, have the same.
"""

import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import LARGEST_COORDINATE, Float
from lrf3d.world.cameras import WIDEST_VIEW
from lrf3d.world.materials import LIMITS
from lrf3d.world.model import MOST_OBJECTS

Converter = Callable[[Any], Any]

_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


class Invalid(Exception):
    """A value that a converter refuses; ``inside`` is the place in it, such as ``[2]``."""

    def __init__(self, message: str, inside: str = "") -> None:
        super().__init__(message)
        self.inside = inside


def number(
    *, above: float = -math.inf, least: float = -math.inf, most: float = math.inf
) -> Converter:
    """A finite number within limits."""
    limit = f" above {above:g}" if above > -math.inf else ""
    limit = f" of at least {least:g}" if least > -math.inf else limit
    limit += f" and at most {most:g}" if most < math.inf else ""

    def convert(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise Invalid(f"expected a number, found {shown(value)}")
        if not (abs(value) <= LARGEST_COORDINATE and least <= value <= most and value > above):
            raise Invalid(f"expected a finite number{limit}, found {shown(value)}")
        return float(value)

    return convert


def integer(*, least: int, most: int = MOST_OBJECTS) -> Converter:
    """A whole number within limits."""

    def convert(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise Invalid(f"expected a whole number from {least} to {most}, found {shown(value)}")
        return value

    return convert


def text(*choices: str) -> Converter:
    """A text, one of the choices where there are any."""

    def convert(value: Any) -> str:
        if not isinstance(value, str):
            raise Invalid(f"expected a text in quotes, found {shown(value)}")
        if choices and value not in choices:
            raise Invalid(f"expected one of {', '.join(choices)}, found {shown(value)}")
        return value

    return convert


def flag(value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise Invalid(f"expected true or false, found {shown(value)}")
    return value


def parse_colour(value: object) -> tuple[float, float, float] | None:
    """Red, green, blue in 0…1 of a colour from a file, or None if it is invalid."""
    if isinstance(value, str) and _HEX.fullmatch(value):
        digits = value[1:] if len(value) == 7 else "".join(2 * digit for digit in value[1:])
        red, green, blue = (int(digits[place : place + 2], 16) / 255 for place in (0, 2, 4))
        return red, green, blue
    if isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 3:
        numbers = [v for v in value if isinstance(v, int | float) and not isinstance(v, bool)]
        if len(numbers) == 3 and all(0.0 <= number <= 1.0 for number in numbers):
            return float(numbers[0]), float(numbers[1]), float(numbers[2])
    return None


def colour_value(colour: Float) -> str | list[float]:
    """The colour (3,) for a file: ``"#rrggbb"`` where that is exact, else three numbers."""
    steps = np.round(colour * 255)
    if (steps / 255 == colour).all():
        return "#" + "".join(f"{int(step):02x}" for step in steps)
    return [float(part) for part in colour]


def colour(value: Any) -> tuple[float, float, float]:
    """A colour."""
    parsed = parse_colour(value)
    if parsed is None:
        raise Invalid(f'expected a colour such as "#c8b49a", found {shown(value)}')
    return parsed


def several(convert: Converter, what: str, *, least: int = 1, alone: bool = False) -> Converter:
    """A list of values; or, where ``alone``, one of them, which is not wrapped in a list."""

    def convert_all(value: Any) -> Any:
        if not isinstance(value, list):
            if alone:
                return convert(value)
            raise Invalid(f"expected a list of {what}, found {shown(value)}")
        if len(value) < least:
            raise Invalid(f"expected a list of at least {least} {what}, found {len(value)}")
        converted = []
        for place, item in enumerate(value):
            try:
                converted.append(convert(item))
            except Invalid as problem:
                raise Invalid(str(problem), f"[{place}]{problem.inside}") from None
        return tuple(converted)

    return convert_all


def row(*names: str) -> Converter:
    """A row of finite numbers, called by these names, as an array."""
    expected, convert_one = f"[{', '.join(names)}]", number()

    def convert(value: Any) -> Float:
        if not isinstance(value, list):
            raise Invalid(f"expected {expected}, found {shown(value)}")
        if len(value) != len(names):
            raise Invalid(f"expected {expected}, found {len(value)} values")
        return np.array([convert_one(item) for item in value], dtype=np.float64)

    return convert


def rows(*names: str, least: int = 1) -> Converter:
    """A list of rows of finite numbers, as an array (k, names)."""
    convert_all = several(row(*names), f"[{', '.join(names)}]", least=least)
    return lambda value: np.array(convert_all(value), dtype=np.float64).reshape(-1, len(names))


_ANGLE = number(least=-3600.0, most=3600.0)
_LENGTH = number(above=0.0)
_NOT_NEGATIVE = number(least=0.0)
_SHARE = number(least=0.0, most=1.0)

OBJECT: Mapping[str, Converter] = {
    "name": text(),
    "points": rows("x", "y", least=2),
    "lines": several(rows("x", "y", least=2), "lines, each a list of [x, y]", least=0),
    "closed": flag,
    "height": several(_LENGTH, "heights", alone=True),
    "colour": colour,
    "number": integer(least=0),
    "material": text(),
}

MATERIAL: Mapping[str, Converter] = {
    "name": text(),
    **{key: number(least=0.0, most=most) for key, most in LIMITS.items()},
}

OBSTACLE: Mapping[str, Converter] = {
    "route": rows("x", "y", least=2),
    "speed": _LENGTH,
    "radius": _LENGTH,
    "points": rows("x", "y", least=3),
    "height": _LENGTH,
}

CAMERA: Mapping[str, Converter] = {
    "name": text(),
    "position": row("x", "y", "z"),
    "target": row("x", "y", "z"),
    "field_deg": number(above=0.0, most=WIDEST_VIEW),
    "track": flag,
}

TABLES: Mapping[str, Mapping[str, Converter]] = {
    "robot": {
        "start": row("x", "y", "degrees"),
        "route": rows("x", "y"),
        "poses": rows("x", "y", "degrees"),
        **dict.fromkeys(("speed", "scan_interval", "lookahead", "radius"), _LENGTH),
    },
    "laser": {
        "angle_min_deg": _ANGLE,
        "angle_max_deg": _ANGLE,
        "beams": integer(least=1, most=1_000_000),
        "range_max": _LENGTH,
        **dict.fromkeys(
            ("range_min", "height", "scan_duration", "threshold", "near_field"), _NOT_NEGATIVE
        ),
        "echo": text("first", "last", "strongest"),
        "echoes": integer(least=1, most=5),
    },
    "noise": {
        "sigma": several(_NOT_NEGATIVE, "sigmas", alone=True),
        **dict.fromkeys(("constant", "resolution"), _NOT_NEGATIVE),
        **dict.fromkeys(("angle_deg", "beam_deg"), number(least=0.0, most=90.0)),
        **dict.fromkeys(("drop_outs", "drop_outs_far"), _SHARE),
    },
    "mapper": {
        "mode": text("paper", "robust"),
        "min_points": integer(least=2),
        **dict.fromkeys(("gap", "split", "merge_length", "merge_distance", "floor"), _LENGTH),
    },
    "film": {"view": text(), "playback": _LENGTH, "points_by": text("range", "intensity")},
}


_NUMBER = re.compile(r"[+-]?(\d+\.\d*|\.\d+)([eE][+-]?\d+)?")
"""Numbers such as ``.5`` and ``5.``, which TOML does not accept without the other digit."""


def value_of(text: str) -> Any:
    """Parse a TOML value; strings need no quotes.

    Raises:
        InputError: The text begins like a list or a quoted string, and is not a valid one.
    """
    text = text.strip()
    if _NUMBER.fullmatch(text):
        return float(text)
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
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
    """The values of settings by table and key; the last one counts if a key is set twice.

    Raises:
        InputError: A text is not a setting, or its name or its value is invalid.
    """
    tables: dict[str, dict[str, Any]] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        table, dot, key = name.strip().partition(".")
        if not (equals and dot):
            raise InputError(
                f"setting {shown(text)}: expected TABLE.KEY=VALUE, such as laser.range_max=20"
            )
        place = f"setting {name[:80]}"
        keys = TABLES[known_key(table, TABLES, place)]
        convert = keys[known_key(key, keys, place)]
        try:
            tables.setdefault(table, {})[key] = convert(value_of(value))
        except (InputError, Invalid) as problem:
            raise InputError(f"{place}: {problem}") from None
    return tables


def known_key(word: str, known: Iterable[str], place: str) -> str:
    """The word, which must be one of those known.

    Raises:
        InputError: It is not; the message names the place and the nearest known word.
    """
    known = list(known)
    if word not in known:
        near = get_close_matches(word, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        raise InputError(f"{place}: there is no {shown(word)}; {hint}")
    return word
