"""Numbers as words: what tables and pages of benchmarks print."""

import math
from collections.abc import Sequence

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
"""Units of time [s]."""


def duration(seconds: float, digits: int = 3) -> str:
    """A time with some digits, in the unit that suits it."""
    # A little less than a unit is one: ticks of logarithmic axes are rounded.
    unit, name = next((u for u in UNITS if seconds >= 0.999 * u[0]), UNITS[-1])
    value = seconds / unit
    # Rounded by hand: %g would write 480 with two digits as 4.8e+02.
    value = round(value, digits - 1 - math.floor(math.log10(value))) if value > 0.0 else 0.0
    return f"{value:g} {name}"


def quartiles(low: float, high: float) -> str:
    """Two times [s] as a span."""
    return f"{duration(low)}–{duration(high)}"


def metres(length: float) -> str:
    """An error [m] with two digits."""
    return "exact" if length == 0.0 else f"{length:.1e} m"


def percent(share: float) -> str:
    """A share in percent; none is a plain 0."""
    return "0" if share == 0.0 else f"{100.0 * share:.2g} %"


def times_words(ratio: float) -> str:
    """How many times as much, with three digits."""
    return f"{ratio:,.0f} ×" if ratio >= 100.0 else f"{ratio:.3g} ×"


def error_words(error: float) -> str:
    """An error with three digits, or the word for no error."""
    return "none" if error == 0.0 else f"{error:.3g}"


def left_out_lines(lines: Sequence[str]) -> list[str]:
    """What was left out, as ``WHAT: WHY``, with all that one reason holds for in one line."""
    whys: dict[str, list[str]] = {}
    for line in lines:
        what, _, why = line.rpartition(": ")
        whys.setdefault(why, []).append(what)
    return [f"{', '.join(dict.fromkeys(whats))}: {why}" for why, whats in whys.items()]
