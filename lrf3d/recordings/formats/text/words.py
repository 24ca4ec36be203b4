"""Words of a line: which are numbers, which are names, and columns of them."""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress

import numpy as np

from lrf3d.base.errors import shown
from lrf3d.geometry.lines import Float

# Largest number of words of a line that is too short to hold a whole scan.
SHORT = 6

# A column of readings has more different numbers than this.
VARIED = 10

# Matches what stands for a reading that is missing.
MISSING = re.compile(r"null|none|n/?a|nil|-*", re.IGNORECASE).fullmatch


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
