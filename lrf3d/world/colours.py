"""Colours in files: ``"#rrggbb"`` or three numbers, and back, to the last bit."""

import re
from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float

_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


def parse_colour(value: object) -> tuple[float, float, float] | None:
    """Red, green, blue in 0…1 of a colour from a file, or None where it is no colour."""
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
    """The colour (3,) as a file keeps it: ``"#rrggbb"`` where that is exact, else three numbers."""
    steps = np.round(colour * 255)
    if (steps / 255 == colour).all():
        return "#" + "".join(f"{int(step):02x}" for step in steps)
    return [float(part) for part in colour]
