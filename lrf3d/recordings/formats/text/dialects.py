"""Dialects: the ways in which lines of text hold rows of numbers.

A sample of the lines of a file enters `dialect_of`; the first dialect of `DIALECTS` that recognises
them leaves, and splits each line into rows of words. A line is one row, or one for each reading.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from lrf3d.recordings.formats.text.lines import SHORT, is_number

# Most columns that ``range0 … range681`` in a sentence may name.
MOST_COLUMNS = 100_000

# Brackets and quotes, which lists of numbers stand in.
BRACKETS = re.compile(r"""["'(){}\[\]]""")

# Where one list ends and the next begins.
JOINTS = re.compile(r"[\])}]:?\s*[\[({]")

# Quoted numbers with a decimal comma.
QUOTED = re.compile(r'"(-?\d+),(\d+)"')

# Units in brackets after names in headers.
UNITS = re.compile(r"(?<=[\w\]])\s?[\[(](rad|deg|degrees|[mcun]?[ms])[\])]")

# Matches a line of tuples; the first group is the first of them.
NESTED = re.compile(r"\s*[\[(]\s*[\[(]([^\])]*)[\])]").match

# Matches numbers with a decimal comma.
DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?").fullmatch

# Numbers that have their names before them.
LABELS = re.compile(r"(?<!\w)([A-Za-z_]\w*+)\s*+[:=]\s*([-+]?[\d.]+(?:e[-+]?\d+)?)")

# A list that has its name before it.
LISTED = re.compile(r"([A-Za-z_]\w*+)\s*+[:=]\s*+[\[(]([^\])]*)")

# Matches a sentence that ends with the names of the columns, which are the group.
LEGEND = re.compile(r"(?i).*\b(?:format|legend|columns|fields)\s*:\s*(.*)").match

# The first and the last name of numbered columns: ``r1 ... r180``.
FIRST_TO_LAST = re.compile(r"([A-Za-z_]\w*?)(\d+)\W+(?:\.\.+|…)\W+\1(\d+)")

Words = list[str]


@dataclass(frozen=True, slots=True)
class Dialect:
    """A way to write rows of numbers.

    Args:
        name: Its name.
        what: What its lines look like, in a sentence.
        recognises: Whether the lines of a sample, without comments, are written this way.
        split: The rows of words in a line.
        names: The names that a line gives to its own words; None if lines give none.
    """

    name: str
    what: str
    recognises: Callable[[Sequence[str]], bool]
    split: Callable[[str], list[Words]]
    names: Callable[[str], Words] | None = None

    def rows(self, text: str) -> list[Words]:
        """The rows in a line, or the names that a sentence ends with."""
        if legend := LEGEND(text):
            # What else stands in brackets is the size of a column.
            names = re.sub(r"(?<=\w)\[[A-Za-z_]{4,}\]", "", UNITS.sub(r"_\1", legend[1]))
            return [_parts(FIRST_TO_LAST.sub(_series, names))]
        return [words for words in self.split(text) if any(words)]


def dialect_of(lines: Sequence[str]) -> Dialect:
    """The first dialect that recognises lines."""
    return next(dialect for dialect in DIALECTS if dialect.recognises(lines))


def _series(ends: re.Match[str]) -> str:
    base, first, last = ends.groups()
    numbers = range(int(first), min(int(last) + 1, int(first) + MOST_COLUMNS))
    return " ".join(f"{base}{number}" for number in numbers)


def _parts(text: str) -> Words:
    return text.replace(",", " ").split()


def _labelled(text: str) -> list[Words]:
    words = [number for _, number in LABELS.findall(text)] or [text]
    return [words + [each for found in LISTED.finditer(text) for each in _parts(found[2])]]


def _labels(text: str) -> Words:
    names = [name for name, _ in LABELS.findall(text)]
    return [name.lower() for name in names + [name for name, _ in LISTED.findall(text)]]


def _tuples(text: str) -> list[Words]:
    words = _parts(BRACKETS.sub(" ", text))
    first = NESTED(text)
    size = len(_parts(first[1])) if first else 0
    return [words[k : k + size] for k in range(0, len(words), size)] if size else [words]


def _are_separated(mark: str, lines: Sequence[str]) -> bool:
    return sum(text.lstrip().count(mark) for text in lines) >= len(lines) > 0


def _are_indexed(lines: Sequence[str]) -> bool:
    """Whether a header begins with a tab, and lines do not: the first column has no name."""
    begun = [text.startswith("\t") for text in lines]
    return begun[:1] == [True] and not all(begun) and _are_separated("\t", lines)


def _indexed(text: str) -> list[Words]:
    return [[""] * text.startswith("\t") + words for words in _separated("\t", text)]


def _have_commas(lines: Sequence[str]) -> bool:
    """Whether most lines have commas that separate numbers: not decimal commas between spaces."""
    words = [word for text in lines for word in text.split()[1:]]
    decimal = 2 * sum(map(bool, map(DECIMAL_COMMA, words))) > len(words)
    return 2 * sum("," in text for text in lines) > len(lines) and not decimal


def _separated(mark: str | None, text: str) -> list[Words]:
    """The words between the marks, or between spaces; commas that are no marks are decimal ones."""
    bare = UNITS.sub(r"_\1", QUOTED.sub(r"\1.\2", text))
    bare = BRACKETS.sub(" ", JOINTS.sub(mark or " ", bare)).lstrip().lstrip("#% ")
    words = bare.split(mark)
    if mark != ",":
        words = [word.replace(",", ".") for word in words]
    if len(words) <= SHORT:
        words = [{"True": "1", "False": "0"}.get(word, word) for word in words]
    return [[each for word in words for each in _spaced(word)]]


def _spaced(word: str) -> Words:
    """The numbers in a word, as in a cell of a whole scan; else the word itself."""
    parts = word.split()
    return parts if len(parts) > 1 and all(map(is_number, parts)) else [word]


DIALECTS = [
    Dialect(
        "labels",
        "Each number has its name before it: `theta: 1.5 Dist: 800`, `time=0.1 ranges=[…]`.",
        lambda lines: 2 * sum(len(LABELS.findall(text)) > 1 for text in lines) > len(lines),
        _labelled, _labels,
    ),
    Dialect(
        "tuples",
        "A line is a list of lists of numbers, a row each: `[(15, 0.5, 812), (15, 1.5, 810), …]`.",
        lambda lines: any(map(NESTED, lines)), _tuples,
    ),
    Dialect(
        "tabs below a header that begins with one",
        "The first column, which counts the lines, has no name.",
        _are_indexed, _indexed,
    ),
    Dialect(
        "tabs",
        "Tabs separate the numbers, which may have decimal commas.",
        partial(_are_separated, "\t"), partial(_separated, "\t"),
    ),
    Dialect(
        "semicolons",
        "Semicolons separate the numbers, which may have decimal commas.",
        partial(_are_separated, ";"), partial(_separated, ";"),
    ),
    Dialect(
        "bars",
        "Vertical bars separate the numbers.",
        partial(_are_separated, "|"), partial(_separated, "|"),
    ),
    Dialect(
        "commas",
        "Commas separate the numbers.",
        _have_commas, partial(_separated, ","),
    ),
    Dialect(
        "spaces",
        "Spaces separate the numbers, which may have decimal commas.",
        lambda lines: True, partial(_separated, None),
    ),
]  # fmt: skip
