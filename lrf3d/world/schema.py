"""The schema of world files: the keys of each table, and the checks of their values.

A check takes a value from tomllib and returns it in the form that the program uses, or raises
:class:`Invalid`, which names what was expected and the place inside the value. Settings on the
command line, such as ``laser.range_max=20``, have the same checks.
"""

import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, cast

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float
from lrf3d.world.cameras import WIDEST_VIEW
from lrf3d.world.locate import KeyPath
from lrf3d.world.materials import LIMITS
from lrf3d.world.model import LARGEST_COORDINATE as LARGEST_COORDINATE
from lrf3d.world.model import MOST_OBJECTS

Check = Callable[[object], object]


_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


class Invalid(Exception):
    """A value that a check refuses.

    Args:
        message: What was found and what was expected.
        inside: Indices of the invalid element, if the value is an array.
    """

    def __init__(self, message: str, inside: KeyPath = ()) -> None:
        super().__init__(message)
        self.inside = inside


def number(
    *, above: float = -math.inf, least: float = -math.inf, most: float = LARGEST_COORDINATE
) -> Check:
    """A check for a finite number within limits."""

    def check(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise Invalid(f"expected a number, found {shown(value)}")
        if not (-LARGEST_COORDINATE <= value <= most and value >= least and value > above):
            limit = f" above {above:g}" if above > -math.inf else ""
            limit = f" of at least {least:g}" if least > -math.inf else limit
            limit += f" and at most {most:g}" if most < value < math.inf else ""
            raise Invalid(f"expected a finite number{limit}, found {shown(value)}")
        return float(value)

    return check


def integer(*, least: int, most: int = MOST_OBJECTS) -> Check:
    """A check for a whole number within limits."""

    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise Invalid(f"expected a whole number from {least} to {most}, found {shown(value)}")
        return value

    return check


def text(*choices: str) -> Check:
    """A check for a text, one of the choices where there are any."""

    def check(value: object) -> str:
        if not isinstance(value, str):
            raise Invalid(f"expected a text in quotes, found {shown(value)}")
        if choices and value not in choices:
            raise Invalid(f"expected one of {', '.join(choices)}, found {shown(value)}")
        return value

    return check


def flag(value: object) -> bool:
    """Check that a value is true or false."""
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


def colour(value: object) -> tuple[float, float, float]:
    """Check a colour."""
    parsed = parse_colour(value)
    if parsed is None:
        raise Invalid(f'expected a colour such as "#c8b49a", found {shown(value)}')
    return parsed


def _list(value: object, expected: str) -> list[object]:
    if not isinstance(value, list):
        raise Invalid(f"expected {expected}, found {shown(value)}")
    return value


def one_or_more(check: Check, what: str) -> Check:
    """A check for a value or a list of such values; a single value is not wrapped in a list."""

    def check_all(value: object) -> object:
        if not isinstance(value, list):
            return check(value)
        if not value:
            raise Invalid(f"expected {what} or a list of them, found an empty list")
        return tuple(_inside(check, item, (place,)) for place, item in enumerate(value))

    return check_all


def _inside(check: Check, value: object, place: KeyPath) -> object:
    try:
        return check(value)
    except Invalid as problem:
        raise Invalid(str(problem), (*place, *problem.inside)) from None


def row(*names: str) -> Check:
    """A check for one row of finite numbers, called by these names."""
    expected = f"[{', '.join(names)}]"

    def check(value: object) -> Float:
        items = _list(value, expected)
        if len(items) != len(names):
            raise Invalid(f"expected {expected}, found {len(items)} values")
        return np.array([_inside(number(), item, ()) for item in items], dtype=np.float64)

    return check


def point() -> Check:
    """A check for a point; it returns a tuple x, y, z."""
    check_row = row("x", "y", "z")

    def check(value: object) -> tuple[float, float, float]:
        x, y, z = cast(Float, check_row(value)).tolist()
        return x, y, z

    return check


def rows(*names: str, least: int = 1) -> Check:
    """A check for a list of rows of finite numbers; it returns an array (k, names)."""
    check_row = row(*names)
    expected = f"a list of [{', '.join(names)}]"

    def check(value: object) -> Float:
        items = _list(value, expected)
        if len(items) < least:
            raise Invalid(f"expected {expected} of at least {least}, found {len(items)}")
        checked = [_inside(check_row, item, (place,)) for place, item in enumerate(items)]
        return np.array(checked, dtype=np.float64).reshape(-1, len(names))

    return check


def several_lines(value: object) -> list[Float]:
    """Check the lines of an object: a list of lists of points."""
    check = rows("x", "y", least=2)
    items = _list(value, "a list of lines, each a list of [x, y]")
    return [cast(Float, _inside(check, item, (place,))) for place, item in enumerate(items)]


_ANGLE = number(least=-3600.0, most=3600.0)
_LENGTH = number(above=0.0)
_SHARE = number(least=0.0, most=1.0)

OBJECT: Mapping[str, Check] = {
    "name": text(),
    "points": rows("x", "y", least=2),
    "lines": several_lines,
    "closed": flag,
    "height": one_or_more(_LENGTH, "a height"),
    "colour": colour,
    "number": integer(least=0),
    "material": text(),
}

MATERIAL: Mapping[str, Check] = {
    "name": text(),
    **{key: number(least=0.0, most=most) for key, most in LIMITS.items()},
}

OBSTACLE: Mapping[str, Check] = {
    "route": rows("x", "y", least=2),
    "speed": _LENGTH,
    "radius": _LENGTH,
    "points": rows("x", "y", least=3),
    "height": _LENGTH,
}

PLACE = row("longitude", "latitude")

TABLES: Mapping[str, Mapping[str, Check]] = {
    "robot": {
        "start": row("x", "y", "degrees"),
        "route": rows("x", "y"),
        "poses": rows("x", "y", "degrees"),
        "speed": _LENGTH,
        "scan_interval": _LENGTH,
        "lookahead": _LENGTH,
        "radius": _LENGTH,
    },
    "laser": {
        "angle_min_deg": _ANGLE,
        "angle_max_deg": _ANGLE,
        "beams": integer(least=1, most=1_000_000),
        "range_min": number(least=0.0),
        "range_max": _LENGTH,
        "height": number(least=0.0),
        "scan_duration": number(least=0.0),
        "threshold": number(least=0.0),
        "near_field": number(least=0.0),
        "echo": text("first", "last", "strongest"),
        "echoes": integer(least=1, most=5),
    },
    "noise": {
        "sigma": one_or_more(number(least=0.0), "a sigma"),
        "constant": number(least=0.0),
        "angle_deg": number(least=0.0, most=90.0),
        "beam_deg": number(least=0.0, most=90.0),
        "drop_outs": _SHARE,
        "drop_outs_far": _SHARE,
        "resolution": number(least=0.0),
    },
    "mapper": {
        "mode": text("paper", "robust"),
        "gap": _LENGTH,
        "split": _LENGTH,
        "min_points": integer(least=2),
        "merge_length": _LENGTH,
        "merge_distance": _LENGTH,
        "floor": _LENGTH,
    },
    "film": {"view": text(), "playback": _LENGTH, "points_by": text("range", "intensity")},
}

CAMERA: Mapping[str, Check] = {
    "name": text(),
    "position": point(),
    "target": point(),
    "field_deg": number(above=0.0, most=WIDEST_VIEW),
    "track": flag,
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
        # The value is nested too deeply, or is a number of thousands of digits.
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
