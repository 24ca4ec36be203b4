"""The schema of world files: converters of values and tables, and the keys of objects.

A converter takes a value and the path of its key, such as ``object[2].points``, with which its
errors begin. The tables of the robot and of what it carries are in ``lrf3d.simulation.tables``.
"""

import re
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import MISSING, fields
from functools import partial
from inspect import signature
from typing import Any, get_args

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning, WorldError, check_names, shown
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, number, whole_number
from lrf3d.geometry.pose import Pose

Converter = Callable[[Any, str], Any]

# Largest number of an object: a name and a colour are stored for every number up to it.
MOST_OBJECTS = 1_000_000


def accepting(
    expected: str, accepts: Callable[[Any], Any], make: Callable[[Any], Any]
) -> Converter:
    """The converter of values that are accepted; messages say what is expected."""

    def convert(found: Any, key: str) -> Any:
        if not accepts(found):
            raise InputError(f"{key}: expected {expected}, found {shown(found)}")
        return make(found)

    return convert


def text(*choices: str) -> Converter:
    """A text, one of the choices where there are any."""
    expected = f"one of {', '.join(choices)}" if choices else "a text in quotes"
    return accepting(expected, lambda x: isinstance(x, str) and (not choices or x in choices), str)


def parse_colour(value: Any) -> tuple[float, float, float] | None:
    """Red, green, blue in 0…1 of a colour from a file, or None if it is invalid."""
    if isinstance(value, str) and re.fullmatch(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})", value):
        digits = value[1:] if len(value) == 7 else re.sub("(.)", r"\1\1", value[1:])
        value = [part / 255 for part in bytes.fromhex(digits)]
    if not isinstance(value, list) or len(value) != 3:
        return None
    red, green, blue = value
    fits = all(type(part) in (int, float) and 0.0 <= part <= 1.0 for part in value)
    return (float(red), float(green), float(blue)) if fits else None


def colour_value(colour: Float) -> str | list[float]:
    """The colour (3,) for a file: ``"#rrggbb"`` where that is exact, else three numbers."""
    steps = np.round(colour * 255).astype(int)
    return "#" + bytes(steps.tolist()).hex() if (steps / 255 == colour).all() else colour.tolist()


def several(convert: Converter, what: str, *, least: int = 1, alone: bool = False) -> Converter:
    """A list of values; or, where ``alone``, one of them, which is not wrapped in a list."""

    def convert_all(value: Any, key: str) -> Any:
        listed = isinstance(value, list)
        if alone and not listed:
            return convert(value, key)
        if not listed or len(value) < least:
            found = len(value) if listed else shown(value)
            raise InputError(f"{key}: expected a list of at least {least} {what}, found {found}")
        return tuple(convert(item, f"{key}[{place}]") for place, item in enumerate(value))

    return convert_all


def row(*names: str) -> Converter:
    """A row of finite numbers, called by these names, as an array."""

    def fits(found: Any) -> bool:
        plain = isinstance(found, list) and {type(each) for each in found} <= {int, float}
        near = plain and all(abs(each) <= LARGEST_COORDINATE for each in found)
        return near and len(found) == len(names)

    expected = f"[{', '.join(names)}] of finite numbers up to {LARGEST_COORDINATE:g}"
    return accepting(expected, fits, lambda found: np.array(found, dtype=np.float64))


def rows(*names: str, least: int = 1) -> Converter:
    """A list of rows of finite numbers, as an array (k, names)."""
    convert_all = several(row(*names), f"[{', '.join(names)}]", least=least)
    return lambda found, key: np.array(convert_all(found, key))


def _doubt_degrees(angles: Any, what: str) -> None:
    """Warn of the first of several angles in degrees that is probably given in radians."""
    angles = np.ravel(angles)
    # An angle such as 0.785, a multiple of 15° in radians, is unlikely to be meant in degrees.
    step = np.pi / 12
    steps = np.round(angles / step)
    radians = (np.abs(angles - steps * step) < 1e-3) & (steps != 0) & (np.abs(steps) <= 24)
    for angle in angles[radians][:1]:
        found = f"{what} {angle:g} is read as degrees"
        warnings.warn(f"{found}; for radians write {np.degrees(angle):.4g}", Lrf3dWarning, 2)


def in_degrees(found: Any, key: str) -> float:
    """An angle in degrees."""
    angle = _BY_TYPE[float](found, key)
    _doubt_degrees(angle, f"{key}: the angle")
    return float(angle)


def poses(convert: Converter) -> Converter:
    """The rows x, y [m], heading [°] of a converter, with the heading in radians."""

    def turned(found: Any, key: str) -> Any:
        converted = convert(found, key)
        _doubt_degrees(converted[..., 2], f"{key}: the heading")
        return converted * [1.0, 1.0, np.radians(1.0)]

    return turned


def table(
    keys: Mapping[str, Converter], needs: Iterable[str] = (), make: Callable[..., Any] = dict
) -> Converter:
    """A table, which may have these keys, of which it needs some, and what is made of it."""

    def convert(found: Any, key: str) -> Any:
        if not isinstance(found, dict):
            raise InputError(f"{key}: expected a table [{key}], found {shown(found)}")
        check_names(key, found, keys)
        for name in needs:
            if name not in found:
                raise InputError(f"{key}: expected a {name}")
        values = {name: keys[name](each, f"{key}.{name}") for name, each in found.items()}
        with at(key):
            return make(**values)

    return convert


def made(kind: type) -> Converter:
    """A table of the values of a dataclass, which checks them itself."""
    needs = [field.name for field in fields(kind) if field.default is MISSING]
    return table({each.name: lambda found, key: found for each in fields(kind)}, needs, kind)


def tables(convert: Converter, *, alone: bool = False) -> Converter:
    """Tables ``[[key]]``; or, where ``alone``, one table ``[key]``."""

    def convert_all(found: Any, key: str) -> list[Any]:
        if alone and isinstance(found, dict):
            return [convert(found, key)]
        if not isinstance(found, list):
            raise InputError(f"{key}: expected tables [[{key}]]")
        return [convert(each, f"{key}[{place}]") for place, each in enumerate(found)]

    return convert_all


# The converter of a length [m] or a speed [m/s], which is above 0.
LENGTH: Converter = partial(number, positive=True, most=LARGEST_COORDINATE)

# The keys of an object.
OBJECT: Mapping[str, Converter] = {
    "name": text(),
    "points": rows("x", "y", least=2),
    "lines": several(rows("x", "y", least=2), "lines, each a list of [x, y]", least=0),
    "closed": accepting("true or false", lambda x: isinstance(x, bool), bool),
    "height": several(LENGTH, "heights", alone=True),
    "colour": accepting('a colour such as "#c8b49a"', parse_colour, parse_colour),
    "number": partial(whole_number, least=0, most=MOST_OBJECTS),
    "material": text(),
}

# The keys of a dynamic obstacle.
OBSTACLE: Mapping[str, Converter] = {
    "route": rows("x", "y", least=2),
    "points": rows("x", "y", least=3),
    **dict.fromkeys(("speed", "radius", "height"), LENGTH),
}

# The converters of parameters that a table names, by their types.
_BY_TYPE: Mapping[type, Converter] = {
    float: partial(number, least=-LARGEST_COORDINATE, most=LARGEST_COORDINATE),
    int: partial(whole_number, least=0),
    str: text(),
    Pose: poses(row("x", "y", "degrees")),
}


def keys_of(make: Callable[..., Any]) -> dict[str, Converter]:
    """The keys of a table, which are the parameters of what is made of it, by their types.

    An angle in radians is given in degrees, by a key that ends in ``_deg``; a text that is
    annotated with choices is one of them.
    """
    keys: dict[str, Converter] = {}
    for name, parameter in signature(make, eval_str=True).parameters.items():
        kind, *notes = get_args(parameter.annotation) or (parameter.annotation,)
        choices = [each for each in notes if not isinstance(each, type | str)]
        if "rad" in notes:
            keys[f"{name}_deg"] = in_degrees
        else:
            keys[name] = text(*choices[0]) if choices else _BY_TYPE[kind]
    return keys


def value_of(text: str) -> Any:
    """Parse a TOML value; strings need no quotes unless they begin like a list or with one."""
    text = text.strip()
    with suppress(ValueError, RecursionError):
        if [*(found := tomllib.loads(f"value = {text}"))] == ["value"]:
            return found["value"]
    # Python also reads .5 and 5., which TOML does not.
    with suppress(ValueError):
        return float(text)
    if not text or text[0] in "[{\"'":
        expected = 'expected one such as 20, true, [1, 2], paper or "paper"'
        raise InputError(f"{shown(text)} is not a TOML value; {expected}")
    return text


def check_unique(place: str, names: Sequence[str]) -> None:
    """Check that no name stands twice at a place."""
    for name, count in Counter(names).items():
        if count > 1:
            raise WorldError(f"{place}: two of the name {shown(name)}; rename one")


@contextmanager
def at(place: str) -> Iterator[None]:
    """Let errors name a place, such as a file, if they do not begin with it already."""
    try:
        yield
    except InputError as error:
        named = str(error).startswith((f"{place}:", f"{place} "))
        raise WorldError(str(error) if named else f"{place}: {error}") from None
