"""Lines of a text of numbers, and their words: which are numbers, which are names.

Lists in brackets are joined to one line, times of day become seconds.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from datetime import datetime, timedelta

import numpy as np

from lrf3d.base.errors import shown
from lrf3d.geometry.lines import Float
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

# Largest number of words of a line that is too short to hold a whole scan.
SHORT = 6

# A column of readings has more different numbers than this.
VARIED = 10

# Matches what stands for a reading that is missing.
MISSING = re.compile(r"null|none|n/?a|nil|-*", re.IGNORECASE).fullmatch


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


def is_number(word: str) -> bool:
    """Whether a word is a number, which NaN and infinities are."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def trimmed(words: Sequence[str]) -> list[str]:
    """Words without the blank ones at their end."""
    count = len(words)
    while count and not words[count - 1].strip():
        count -= 1
    return [*words[:count]]


def mostly_numbers(words: Sequence[str]) -> bool:
    """Whether more than half of the words are numbers."""
    return 2 * sum(map(is_number, words)) > len(words)


def values_of(words: Iterable[str]) -> Float:
    """Words as floats; what is not a number becomes NaN."""
    return np.array([float(word) if is_number(word) else np.nan for word in words])


def parsed(words: Sequence[str]) -> Float:
    """Parse words as floats; placeholders of missing readings become NaN.

    Raises:
        ValueError: A word is something else.
    """
    with suppress(ValueError):
        return np.array(words, dtype=np.float64)
    values = ["nan" if MISSING(word.strip()) else word for word in words]
    if wrong := next((word for word in values if not is_number(word)), ""):
        raise ValueError(f"{shown(wrong)}, expected a number")
    return np.array(values, dtype=np.float64)


def named(words: Iterable[str]) -> list[str]:
    """Words as names of columns: in lower case, with an underscore before inner capitals."""
    return [re.sub("(?<=[a-z])(?=[A-Z])", "_", word.strip()).lower() for word in words]


def are_names(words: Sequence[str]) -> bool:
    """Whether words are names of columns; most of these may be numbers, such as bearings."""
    first, *others = filter(None, words)
    if not all(map(is_number, others)):
        return True
    # Tables have bearings beside a corner that is no number, or NaN; a reading may be NaN, too.
    is_corner = not is_number(first) or (len(others) > SHORT and not np.isfinite(float(first)))
    return is_corner and bool((np.diff(values_of(others)) > 0.0).all())


def rises(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Whether the numbers of a column rise from row to row."""
    words = [words[place] for words in rows if place < len(words)]
    if len(words) < 3 or not all(map(is_number, words)):
        return False
    return bool((np.diff(values_of(words)) > 0.0).all())
