"""The form of a text of numbers: its dialect, its header, and which of its lines hold scans."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.recordings.formats.text.dialects import Dialect, Words, dialect_of
from lrf3d.recordings.formats.text.lines import texts_of
from lrf3d.recordings.formats.text.words import (
    MISSING,
    SHORT,
    are_names,
    is_number,
    mostly_numbers,
    named,
    trimmed,
)
from lrf3d.recordings.log import Intake

# Number of first lines from which the form of a file is inferred.
SAMPLE = 60

# Number of further lines that are sampled, where lines have few words.
LARGE_SAMPLE = 4000

# Where short lines and long ones each exceed this share, only the long ones hold scans.
LEAST_SHARE = 0.2

# Share of equally long lines above which a line of another length is refused.
STEADY = 0.9

# Finds numbers with commas between digits, which the dialects read as decimal ones.
COMMAS = re.compile(r"(?<![\w.,])\d+(?:,\d+)+(?![\w.,])").findall

# Finds those in quotes, between other commas.
QUOTED = re.compile(r'"(\d+(?:,\d+)+)"').findall

# Matches numbers with marks between thousands.
GROUPED = re.compile(r"[1-9]\d{0,2}(?:,\d{3})+").fullmatch


@dataclass(frozen=True)
class Form:
    """How the lines of a file are written, by the first of them.

    Args:
        dialect: How lines are split.
        header: The names of the columns; empty if there are none.
        word: The word that lines of scans begin with; "" if they begin with numbers.
        least: Least number of words of a line that holds a scan.
        sample: The words of the first lines that hold scans.
        grouped: A number of a line whose thousands may be marked, such as 1,234; "" if none is.
    """

    dialect: Dialect
    header: Words
    word: str
    least: int
    sample: list[Words]
    grouped: str = ""

    def has(self, words: Words) -> bool:
        """Whether a line is of the kind that holds scans."""
        return words[0] == self.word if self.word else len(words) >= self.least

    @cached_property
    def length(self) -> int:
        """The usual number of words of a line."""
        return Counter(map(len, self.sample)).most_common(1)[0][0]

    @cached_property
    def width(self) -> int:
        """Number of columns: the largest number of words of a line, or of names."""
        return max(map(len, [self.header, *self.sample]))

    @property
    def is_steady(self) -> bool:
        """Whether nearly all lines have the usual number of words."""
        usual = sum(len(words) == self.length for words in self.sample)
        return usual > STEADY * len(self.sample)

    @property
    def has_numbers(self) -> bool:
        """Whether it is steady and no label ends the lines."""
        return self.is_steady and any(map(_is_reading, (words[-1] for words in self.sample)))


def _is_reading(word: str) -> bool:
    return is_number(word) or bool(MISSING(word.strip()))


def form_of(path: Path) -> Form:
    """The form of the text in a file."""
    texts = _first_texts(path)
    body = [text for text in texts if not text.startswith("#")]
    dialect = dialect_of(body)
    rows = _rows_of(dialect, texts)
    numeric = [words for words in rows if mostly_numbers(words)]
    if not numeric:
        raise InputError(f"{path}: no lines of numbers; expected a scan a line")
    header = dialect.names(body[-1]) if dialect.names else _header(rows, numeric)
    numeric = [words for words in numeric if named(words) != header]
    word = _first_word(numeric)
    least = 0 if word else _least_words(numeric)
    form = Form(dialect, header, word, least, [], _grouped(body, dialect))
    form.sample.extend(filter(form.has, numeric))
    return form


def _grouped(texts: Sequence[str], dialect: Dialect) -> str:
    """A number whose thousands may be marked, as all with commas have three digits after them."""
    find = QUOTED if dialect.name == "commas" else COMMAS
    commas = [number for text in texts for number in find(text)]
    return commas[0] if commas and all(map(GROUPED, commas)) else ""


def _rows_of(dialect: Dialect, texts: Sequence[str]) -> list[Words]:
    """The words of lines, without blank ones at the end of all of them."""
    cells = [row for text in texts for row in dialect.rows(text)]
    # Blank cells at the end are columns if any line has a word there; a last mark is none.
    width = max((len(trimmed(row)) for row in cells), default=0)
    rows = (row[:width] if len(row) >= width else trimmed(row) for row in cells)
    return [row for row in rows if any(map(str.strip, row))]


def _first_texts(path: Path) -> list[str]:
    lines = (text for _, text in texts_of(Intake(path)) if text)
    texts = list(islice(lines, SAMPLE))
    if texts and len(texts[-1].split()) < SHORT:
        texts += islice(lines, LARGE_SAMPLE)
    return texts


def _header(rows: Sequence[Words], numeric: Sequence[Words]) -> Words:
    """The names of the columns: a first row of names and rising numbers, or a row before it."""
    first = numeric[0]
    if all(map(is_number, numeric[-1])) and are_names(first):
        return named(first)
    before = [r for r in rows[: rows.index(first)] if not all(map(is_number, filter(None, r)))]
    alike = [row for row in before if len(row) == len(first)]
    heads = alike or [row for row in before[-1:] if len(row) >= min(len(first), 2)]
    # A row of units has fewer different words than the row of names before it.
    return named(max(reversed(heads), key=lambda row: len({*row}))) if heads else []


def _first_word(numeric: Sequence[Words]) -> str:
    """The word that lines of scans begin with: of several kinds of lines, the longest."""
    worded = sorted((words for words in numeric if not is_number(words[0])), key=len)
    kinds = list(dict.fromkeys(words[0] for words in worded))
    # A word that differs from line to line is no kind.
    return kinds[-1] if 0 < len(kinds) <= max(0.5 * len(worded), 1) else ""


def _least_words(numeric: Sequence[Words]) -> int:
    """Least number of words of a scan, where many lines are far longer than many others."""
    counts = np.array([len(words) for words in numeric])
    kinds = (counts <= SHORT).mean(), (counts > 2 * SHORT).mean()
    return 2 * SHORT if min(kinds) > LEAST_SHARE else 0
