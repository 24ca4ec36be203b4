"""The form and the layout of a text of numbers: how its lines are split, and what columns hold.

The lines of a file leave as a table. Its form is its dialect, its header, and which of its lines
hold scans.
"""

import re
from array import array
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError, check_names, shown
from lrf3d.geometry.lines import Float
from lrf3d.recordings.formats.table import ROLES, SETTINGS, Table
from lrf3d.recordings.formats.text.dialects import Dialect, Words, dialect_of
from lrf3d.recordings.formats.text.lines import (
    MISSING,
    SHORT,
    VARIED,
    are_names,
    is_number,
    mostly_numbers,
    named,
    parsed,
    texts_of,
    trimmed,
    values_of,
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

# Matches a column of a format: its name, its unit, how many columns it takes, and where it is.
COLUMN = re.compile(r"([a-z]+|-)(?::([a-z]+))?(?:\*(\d+))?(?:@(.+))?").fullmatch

# Matches a word of a column that a line leaves blank.
BLANK = re.compile(r"\s*(nan)?\s*", re.IGNORECASE).fullmatch

# Matches a whole number of hundreds, which has no mark between thousands.
HUNDREDS = re.compile(r"[1-9]\d\d").fullmatch

# Matches a number and its unit.
QUANTITY = re.compile(r"([-+.\deE]+?)([a-z]*)").fullmatch


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

    @cached_property
    def table(self) -> Float:
        """The numbers of the lines of the usual length (k, length); NaN for other words."""
        return np.array([values_of(words) for words in self.sample if len(words) == self.length])

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
    header = dialect.names(body) if dialect.names else _header(rows, numeric)
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
    heads = alike or [
        _without_count(row, len(first)) for row in before[-1:] if len(row) >= min(len(first), 2)
    ]
    # A row of units has fewer different words than the row of names before it.
    return named(max(reversed(heads), key=lambda row: len({*row}))) if heads else []


def _without_count(names: Words, columns: int) -> Words:
    """Names without the number of ranges before the last one, as in "time x y 181 ranges"."""
    count = str(columns - len(names) + 2)
    return names[:-2] + names[-1:] if names[-2:-1] == [count] else names


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


@dataclass(slots=True)
class Layout:
    """What the columns of a line hold.

    Args:
        columns: The first column, from 0, of each role.
        beams: Number of columns of ranges; None if they go on to the end of the line.
        length: Number of words in a line; None if it varies.
        units: Units of roles, if known.
        settings: Values for all scans, by the names of `SETTINGS`.
        clockwise: Whether the beams go clockwise.
        bearings: The bearings of the beams, if names of columns give them.
        unused: Names of columns that are not used.
        paired: 1 if the columns of ranges hold bearings and ranges alternately, −1 if each range
            comes before its bearing, else 0.
        skips: Whether lines with a blank column are left out, as they belong to another topic.
    """

    columns: dict[str, int] = field(default_factory=dict)
    beams: int | None = None
    length: int | None = None
    units: dict[str, str] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    clockwise: bool = False
    bearings: Float | None = None
    unused: Words = field(default_factory=list)
    paired: int = 0
    skips: bool = False

    def name(self, role: str, place: int, unit: str = "") -> None:
        """Enter the column of a role, and its unit if it is known."""
        self.columns[role] = place
        self.units |= {role: unit} if unit else {}

    def with_settings(self, other: "Layout") -> "Layout":
        """This layout with the settings and units of another one."""
        settings = {**self.settings, **other.settings}
        units = {**self.units, **other.units}
        clockwise = self.clockwise or other.clockwise
        return replace(self, settings=settings, units=units, clockwise=clockwise)

    def settle(self, table: Table) -> None:
        """Enter the units, settings and bearings that are known into a table."""
        table.units |= self.units
        table.settings |= self.settings
        table.clockwise |= self.clockwise
        if self.bearings is not None:
            table.values["angles"] = self.bearings

    def read(self, form: Form, table: Table) -> list[Float]:
        """Read the numbers of the lines of a file into a table, and return the ranges of each."""
        self.settle(table)
        ranges = list[Float]()
        rows = {role: array("d") for role in self.columns}
        bearings = list[Float]()
        # A line may hold a single reading with its bearing, not a whole scan.
        single = self.beams == 1 and "angles" in self.columns
        begun = False
        for number, words in _rows(form, table.intake):
            # A line before the first numbers is another header.
            if not begun and not mostly_numbers([*filter(None, words)]):
                continue
            if self.skips and self.lacks(words, self.columns):
                continue
            try:
                found = self._values(words)
            except ValueError as error:
                table.intake.refuse(number, error)
                continue
            if self.paired:
                alternate = found["ranges"][:: self.paired]
                bearings.append(alternate[::2])
                found["ranges"] = alternate[1::2]
            if not single and "ranges" in found:
                ranges.append(found.pop("ranges"))
            for role, values in found.items():
                rows[role].append(values[0])
            begun = True
        table.values |= {role: np.array(each) for role, each in rows.items() if len(each)}
        if bearings:
            table.values["angles"] = np.concatenate(bearings)
        return ranges

    def lacks(self, words: Words, roles: Iterable[str]) -> bool:
        """Whether a line leaves the column of a role blank, or all of its ranges."""
        return any(all(map(BLANK, self._words(words, role))) for role in roles)

    def _words(self, words: Words, role: str) -> Words:
        """The words of a role in a line."""
        place = self.columns[role]
        beams = 1 if role != "ranges" else len(words) if self.beams is None else self.beams
        return words[place : place + beams]

    def has_hundreds(self, form: Form) -> bool:
        """Whether many ranges are whole numbers of three digits, which decimal ones are not."""
        rows = [] if self.paired else [self._words(words, "ranges") for words in form.sample]
        return len({word for row in rows for word in row if HUNDREDS(word.strip())}) > VARIED

    def only(self, roles: Container[str], keep: bool) -> "Layout":
        """The layout of lines that hold a stamp and only these roles, or all others."""
        columns = {k: v for k, v in self.columns.items() if (k in roles) == keep or k == "stamp"}
        return replace(self, columns=columns, length=None, skips=True)

    def _values(self, words: Words) -> dict[str, Float]:
        if self.length not in (None, len(words)):
            raise ValueError(f"{len(words)} columns, expected {self.length}")
        found = dict[str, Float]()
        for role, place in self.columns.items():
            if place >= len(words):
                raise ValueError(f"{len(words)} columns, expected {role} in column {place + 1}")
            found[role] = parsed(self._words(words, role))
            if role != "ranges" and not np.isfinite(found[role][0]):
                raise ValueError(f"{role} is {words[place]!r}, expected a finite number")
        return found


def _rows(form: Form, intake: Intake) -> Iterator[tuple[int, Words]]:
    """The numbers of the lines of scans, and their words.

    Repeated headers, as in files that were joined, are left out.
    """
    for number, text in texts_of(intake):
        if text.startswith("#") or not text:
            continue
        for cells in form.dialect.rows(text):
            words = trimmed(cells)
            if words and form.has(words) and named(words) != form.header:
                # Blank cells at the end are missing readings, a last mark is none.
                width = max(len(words), form.width)
                yield number, words if len(cells) < form.width else cells[:width]


def described(spec: str, header: Words) -> Layout:
    """The layout that a format describes; it may refer to columns by their names in a header.

    Raises:
        InputError: It is not a format.
    """
    layout = Layout()
    place = 0
    for item in map(str.strip, spec.split(",")):
        key, is_setting, value = item.partition("=")
        if item == "clockwise":
            layout.clockwise = True
        elif is_setting:
            check_names("--format", [key], SETTINGS)
            layout.settings[key] = _quantity(value, SETTINGS[key], item)
        else:
            place = _take_column(layout, item, place, header)
    if "angles" in layout.columns:
        layout.beams = 1
    return layout


def _take_column(layout: Layout, item: str, place: int, header: Words) -> int:
    """Enter a column of a format, which is at a place if it names none; return the next place."""
    column = COLUMN(item)
    if column is None:
        raise InputError(f"--format: {shown(item)}: expected NAME:UNIT@COLUMN or KEY=VALUE")
    name, unit, count, where = column.groups()
    if where is not None:
        place = _place_of(where, header)
    if name != "-":
        check_names("--format", [name], ROLES)
        if unit:
            check_names(f"--format: {name}", [unit], ROLES[name])
        layout.name(name, place, unit)
    if name == "ranges":
        layout.beams = int(count) if count else None
    return place + int(count or 1)


def _place_of(where: str, header: Words) -> int:
    if where.isdigit() and int(where) > 0:
        return int(where) - 1
    check_names("--format: the header", named([where]), header)
    return header.index(named([where])[0])


def _quantity(text: str, units: Mapping[str, float], item: str) -> float:
    """A number with one of the units, the first of which may be left out."""
    match = QUANTITY(text.strip())
    number, unit = match.groups() if match else ("", "")
    unit = unit or next(iter(units))
    if not is_number(number) or not np.isfinite(float(number)) or unit not in units:
        raise InputError(f"--format: {shown(item)}: expected a number with {' or '.join(units)}")
    return float(number) * units[unit]
