"""Lines of a text of numbers: lists in brackets are joined, times of day become seconds."""

import re
from collections.abc import Iterator
from datetime import datetime, timedelta

from lrf3d.recordings.log import Intake

# Most lines that a list in brackets may take.
LONGEST_LIST = 500

# Times of day, with or without a date before them and a zone after them.
CLOCK = re.compile(
    r"(?<![\w.:-])(?:(?:(\d{4})[-/](\d\d)[-/](\d\d)|(\d\d)\.(\d\d)\.(\d{4}))[T/ ]+)?"
    r"(\d\d):(\d\d):(\d\d(?:\.\d*|,\d+(?=[;\t]))?)"
    r"(?: ?Z| ?UTC|[-+]\d\d:?\d\d)?"
)

# Finds what each of them has, which is faster.
MINUTES = re.compile(r":\d\d:\d").search

# Numbers as Python prints those of NumPy.
NUMPY = re.compile(r"np\.\w+\(([^()]*)\)")


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
        whole = " ".join(text.lstrip() for _, text in held)
        too_long = len(held) == LONGEST_LIST
        if too_long or sum(map(whole.count, "[(")) <= sum(map(whole.count, "])")):
            yield from held if too_long else [(number, whole)]
            held.clear()
    yield from held


def _text(line: bytes) -> str:
    # Tabs at the ends of a line may be cells without a number.
    text = line.decode("utf-8-sig", "replace").strip(" \r\n")
    bare = text.lstrip()
    if not bare or bare.startswith("//"):
        return ""
    return untyped(in_seconds(bare if bare.startswith("#") else text))


def in_seconds(text: str) -> str:
    """A text with seconds for times of day."""
    return CLOCK.sub(_seconds, text) if MINUTES(text) else text


def untyped(text: str) -> str:
    """A text without the types of NumPy's numbers."""
    return NUMPY.sub(r"\1", text) if "np." in text else text


def _seconds(time: re.Match[str]) -> str:
    """A time of day in seconds, since 1970 if it has a date."""
    *date_first, day_last, month_last, year_last, hours, minutes, seconds = time.groups()
    date_last = (year_last or "1970", month_last or "01", day_last or "01")
    date = "-".join(date_first if date_first[0] else date_last)
    try:
        day = datetime.fromisoformat(f"{date}T00:00Z")
    except ValueError:
        return time[0]
    # Time that has passed may be a day and more.
    minute = day + timedelta(hours=int(hours), minutes=int(minutes))
    return f"{minute.timestamp() + float(seconds.replace(',', '.')):.6f}"
