"""The layout of a text of numbers: what its columns hold, and reading them into a table."""

import re
from array import array
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from lrf3d.base.errors import InputError, check_names, shown
from lrf3d.geometry.lines import Float
from lrf3d.recordings.formats.table import ROLES, SETTINGS, Table
from lrf3d.recordings.formats.text.dialects import Words
from lrf3d.recordings.formats.text.form import Form
from lrf3d.recordings.formats.text.lines import texts_of
from lrf3d.recordings.formats.text.words import (
    VARIED,
    is_number,
    mostly_numbers,
    named,
    parsed,
    trimmed,
)
from lrf3d.recordings.log import Intake

# Matches a column of a format: its name, its unit, how many columns it takes, and where it is.
COLUMN = re.compile(r"([a-z]+|-)(?::([a-z]+))?(?:\*(\d+))?(?:@(.+))?").fullmatch

# Matches a word of a column that a line leaves blank.
BLANK = re.compile(r"\s*(nan)?\s*", re.IGNORECASE).fullmatch

# Matches a whole number of hundreds, which has no mark between thousands.
HUNDREDS = re.compile(r"[1-9]\d\d").fullmatch

# Matches a number and its unit.
QUANTITY = re.compile(r"([-+.\deE]+?)([a-z]*)").fullmatch


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
