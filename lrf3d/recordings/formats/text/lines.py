"""Lines of a text of numbers: lists in brackets are joined, times of day become seconds."""

import re
from collections.abc import Iterator
from datetime import date

from lrf3d.recordings.log import Intake

# Most lines that a list in brackets may take.
LONGEST_LIST = 500

# Times of day, with or without a date before them and a zone after them.
CLOCK = re.compile(
    r"(?<![\w.:-])(?:(\d{4})[-/](\d\d)[-/](\d\d)[T/ ]+)?(\d\d):(\d\d):(\d\d(?:\.\d*)?)"
    r"(?: ?Z| ?UTC|[-+]\d\d:?\d\d)?"
)

# Length of a minute [s].
MINUTE = 60

# Length of an hour [s].
HOUR = 60 * MINUTE

# Length of a day [s].
DAY = 24 * HOUR


def texts_of(intake: Intake) -> Iterator[tuple[int, str]]:
    """The numbers and texts of the lines of a file; a list over several lines is one text.

    Times of day become seconds; comments become empty.
    """
    held: list[tuple[int, str]] = []
    for number, data in intake.lines():
        text = _text(data)
        if not (held or "[" in text or "(" in text):
            yield number, text
            continue
        held.append((number, text))
        whole = " ".join(text for _, text in held)
        too_long = len(held) == LONGEST_LIST
        if too_long or sum(map(whole.count, "[(")) <= sum(map(whole.count, "])")):
            yield from held if too_long else [(number, whole)]
            held.clear()
    yield from held


def _text(line: bytes) -> str:
    # Tabs at the end of a line are cells without a number.
    text = line.decode("utf-8-sig", "replace").lstrip().rstrip(" \r\n")
    if text.startswith("//"):
        return ""
    return CLOCK.sub(_seconds, text) if ":" in text else text


def _seconds(time: re.Match[str]) -> str:
    """A time of day in seconds, since 1970 if it has a date."""
    year, month, day, hours, minutes, seconds = time.groups()
    days = 0
    if year:
        try:
            days = (date(int(year), int(month), int(day)) - date(1970, 1, 1)).days
        except ValueError:
            return time[0]
    return f"{float(DAY * days + HOUR * int(hours) + MINUTE * int(minutes)) + float(seconds):.6f}"
