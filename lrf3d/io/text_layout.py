"""The layout of a text of numbers: what its columns hold, by a format, a header or the numbers."""

import re
from array import array
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, check_names, shown
from lrf3d.geometry import Float
from lrf3d.io.intake import A_VALUE, Intake
from lrf3d.io.table import FANS, ROLES, SETTINGS, meaning

SAMPLE, SHORT, MANY = 60, 6, 4000
"""Lines at the beginning that say what the others are like; of lines with few words, many."""

PRESETS = {
    "minesrover": "stamp:us@1, left@3, right@4, ranges:mm*682@25, first=-120deg, last=120deg,"
    " tick=0.24190263mm, track=0.33m, offset=0.145m",
    "lego": "stamp:ms@2, ranges:mm@4, first=-120.0156deg, step=0.3515625deg",
}
"""Formats of known robots: MinesRover's ``.dat``, of encoders with 2,000 ticks a turn on wheels of
77 mm, and a LEGO robot, whose scanner is turned by 4 degrees."""

MARKS = {("", 706): "minesrover", ("", 707): "minesrover", ("S", 663): "lego"}
"""Presets by the word that lines begin with and the number of their columns."""

BRACKETS = re.compile(r"""["'(){}\[\]]""")
"""Brackets and quotes, which lists of numbers stand in."""

NESTED = re.compile(r"\s*[\[(]\s*[\[(]([^\])]*)[\])]").match
"""Matches a line of tuples; the first group is the first of them."""

BOOLEANS = {"True": "1", "False": "0"}

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?").fullmatch
"""Matches numbers with a decimal comma."""

LABELS = re.compile(r"(?<!\w)([A-Za-z_]\w*+)\s*+[:=]\s*([-+]?[\d.]+(?:e[-+]?\d+)?)")
"""Numbers that have their names before them."""


@dataclass
class Form:
    """How the lines of a file are written, by the first of them.

    Lines may hold tuples of ``nested`` numbers, a reading each.
    """

    separator: str | None = None
    decimal_commas: bool = False
    labelled: bool = False
    nested: int = 0
    header: list[str] = field(default_factory=list)
    sample: list[list[str]] = field(default_factory=list)
    word: str = ""

    @classmethod
    def of(cls, path: Path) -> "Form":
        """The form of a file."""
        lines = (text for _, data in Intake(path).lines() if (text := plain(data)))
        texts = list(islice(lines, SAMPLE))
        if texts and len(texts[-1].split()) < SHORT:
            texts += islice(lines, MANY)
        body = [text for text in texts if not text.startswith("#")]
        form, joined = cls(), "".join(body)
        form.labelled = sum(len(LABELS.findall(text)) > 1 for text in body) > 0.5 * len(body)
        for mark in ";\t":
            if joined.count(mark) >= len(body) > 0:
                form.separator, form.decimal_commas = mark, "," in joined
        if form.separator is None and "," in joined:
            words = joined.split()
            form.decimal_commas = sum(map(bool, map(DECIMAL_COMMA, words))) > 0.5 * len(words)
            form.separator = None if form.decimal_commas else ","
        form.nested = len(first[1].split(",")) if texts and (first := NESTED(texts[0])) else 0
        rows = [words for text in texts for words in form.rows(text)]
        numeric = [words for words in rows if mostly_numbers(words)]
        if not numeric:
            raise InputError(f"{path}: no lines of numbers; expected a scan a line")
        begin = rows.index(numeric[0])
        if form.labelled:
            form.header = [name.lower() for name, _ in LABELS.findall(body[-1])]
        elif not all(map(is_number, numeric[0][1:])) and all(map(is_number, numeric[-1])):
            # Many of its names are numbers.
            form.header = named(numeric.pop(0))
        elif begin and len(rows[begin - 1]) >= min(len(numeric[0]), 2):
            form.header = named(rows[begin - 1])
        # Where lines of several kinds begin with a word, those with the most numbers are scans.
        sizes: Counter[str] = Counter()
        for words in numeric:
            if not is_number(words[0]):
                sizes[words[0]] = max(sizes[words[0]], len(words))
        form.word = sizes.most_common(1)[0][0] if sizes else ""
        form.sample = [words for words in numeric if form.has(words)]
        return form

    def has(self, words: list[str]) -> bool:
        """Whether a line is of the kind that holds scans."""
        return not self.word or words[0] == self.word

    @property
    def preset(self) -> str:
        """The preset whose files look like this one; "" if there is none."""
        names = {MARKS.get((self.word, len(words)), "") for words in self.sample}
        [name, *others] = names
        return "" if others or not (self.word or rises(self.sample, 0)) else name

    def rows(self, text: str) -> list[list[str]]:
        """The words of a line, or of each of the brackets in it."""
        words = self.words(text)
        size = self.nested or len(words) or 1
        return [words[k : k + size] for k in range(0, len(words), size)]

    def words(self, text: str) -> list[str]:
        """The words of a line."""
        if self.labelled:
            return [number for _, number in LABELS.findall(text)] or [text]
        text = BRACKETS.sub(" ", text).strip().lstrip("#% ")
        words = text.rstrip(self.separator).split(self.separator)
        if self.decimal_commas:
            return [word.replace(",", ".") for word in words]
        return [BOOLEANS.get(word, word) for word in words] if len(words) <= SHORT else words


@dataclass
class Layout:
    """Where the columns of a line are, from 0, and what is known of their numbers."""

    reason: str = "--format"
    columns: dict[str, int] = field(default_factory=dict)
    beams: int | None = None
    length: int | None = None
    units: dict[str, str] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    clockwise: bool = False
    angles: Float | None = None

    @classmethod
    def parsed(cls, spec: str, header: list[str]) -> "Layout":
        """The layout that a format describes."""
        layout, place = cls(), 0
        for item in map(str.strip, spec.split(",")):
            key, is_setting, value = item.partition("=")
            column = re.fullmatch(r"([a-z]+|-)(?::([a-z]+))?(?:\*(\d+))?(?:@(.+))?", item)
            if item == "clockwise":
                layout.clockwise = True
            elif is_setting:
                check_names("--format", [key], SETTINGS)
                layout.settings[key] = _quantity(value, SETTINGS[key], item)
            elif column is None:
                raise InputError(f"--format: {shown(item)}: expected NAME:UNIT@COLUMN or KEY=VALUE")
            else:
                name, unit, count, where = column.groups()
                if where is not None:
                    place = _place(where, header)
                if name != "-":
                    check_names("--format", [name], ROLES)
                    layout.columns[name] = place
                    if unit:
                        check_names(f"--format: {name}", [unit], ROLES[name])
                        layout.units[name] = unit
                if name == "ranges":
                    layout.beams = int(count) if count else None
                place += int(count or 1)
        if "angles" in layout.columns:
            layout.beams = 1
        return layout

    @classmethod
    def by_header(cls, header: list[str], length: int) -> "Layout":
        """The layout that the names in a header give."""
        layout, series = cls("the header"), dict[str, list[int]]()
        for place, name in enumerate(header):
            base, number = _series(name)
            role, unit = meaning(name)
            if number is not None:
                series.setdefault(base, []).append(place)
            elif role and role not in layout.columns:
                layout.columns[role] = place
                layout.units |= {role: unit} if unit else {}
        known = {base: places for base, places in series.items() if meaning(base)[0] == "ranges"}
        base, places = max((known or series).items(), key=lambda one: len(one[1]), default=("", []))
        if len(places) > 1 and places == list(range(places[0], places[-1] + 1)):
            layout.columns["ranges"], layout.beams = places[0], len(places)
            layout.units |= {"ranges": unit} if (unit := meaning(base)[1]) else {}
            labels = [float(_series(header[k])[1] or 0.0) for k in places]
            if labels[0] not in (0.0, 1.0) or np.ptp(labels) != len(labels) - 1:
                layout.angles = np.array(labels)
        elif "ranges" in layout.columns and (extra := length - len(header)) > 0:
            # One name for all of them.
            place, layout.beams = layout.columns["ranges"], extra + 1
            if header[place + 1 : place + 2] == ["intensities"]:
                layout.beams = extra // 2 + 1
            layout.columns = {k: v + extra * (v > place) for k, v in layout.columns.items()}
        elif "ranges" in layout.columns:
            if "x" not in layout.columns and "theta" in layout.columns:
                layout.columns.setdefault("angles", layout.columns.pop("theta"))
            layout.beams = 1
        return layout

    @classmethod
    def found(cls, path: Path, form: Form) -> "Layout":
        """The layout of a file by its header, a count, or the numbers themselves."""
        length, often = Counter(map(len, form.sample)).most_common(1)[0]
        fixed = often > 0.9 * len(form.sample)
        layout = cls.by_header(form.header, length) if form.header else cls()
        if layout.beams is None or (layout.beams == 1 and "angles" not in layout.columns):
            layout = _by_count(form.sample) or cls()
        if not layout.columns and fixed:
            layout = _by_sweep(form.sample, length) or _by_length(form.sample, length)
        if not layout.columns:
            places = [str(k + 1) for k in range(min(length, SHORT)) if rises(form.sample, k)]
            rising = f", number {', '.join(places)} rising as stamps do" if places else ""
            raise InputError(
                f"{path}: text of {length} columns{rising}; name them by --format, such as"
                " 'stamp:us, x, y, theta, ranges:mm@25', or a preset: " + ", ".join(PRESETS)
            )
        layout.length = length if fixed and layout.reason != "a count" else None
        return layout

    def read(self, intake: Intake, form: Form) -> dict[str, Any]:
        """The numbers of the lines of a file by what they are: one a line, but lists of ranges."""
        lists = "ranges" if self.beams != 1 or "angles" not in self.columns else ""
        rows: dict[str, Any] = {role: [] if role == lists else array("d") for role in self.columns}
        begun = False
        for number, data in intake.lines():
            text = plain(data)
            for words in form.rows(text):
                if not text or text.startswith("#") or not form.has(words):
                    continue
                if not begun and (not mostly_numbers(words) or named(words) == form.header):
                    # What comes before the numbers.
                    continue
                try:
                    found = self._values(words)
                except ValueError as error:
                    intake.refuse(number, error)
                    continue
                for role, values in found.items():
                    rows[role].append(values if role == lists else values[0])
                begun = True
                intake.take(len(words) + A_VALUE * len(found), number)
        return rows

    def _values(self, words: list[str]) -> dict[str, Float]:
        if self.length is not None and len(words) != self.length:
            raise ValueError(f"{len(words)} columns, expected {self.length}")
        found = {}
        for role, place in self.columns.items():
            if place >= len(words):
                raise ValueError(f"{len(words)} columns, expected {role} in column {place + 1}")
            end = place + 1
            if role == "ranges":
                end = len(words) if self.beams is None else place + self.beams
            found[role] = _numbers(words[place:end])
            if role != "ranges" and not np.isfinite(found[role]).all():
                raise ValueError(f"{role} is {words[place]!r}, expected a finite number")
        return found


def _series(name: str) -> tuple[str, str | None]:
    """The name of a series of columns, and the number of one of them, if it has one."""
    match = re.fullmatch(r"(.*?)[\s\[(;._]*(?<![\d.])(-?\d+(?:\.\d+)?)[\s\])]*", name)
    return (match[1], match[2]) if match else (name, None)


def _by_count(sample: list[list[str]]) -> Layout | None:
    """The layout of lines that hold how many ranges follow."""
    for place in range(min(8, min(map(len, sample), default=0) - 1)):
        rests = [(words[place], len(words) - place - 1) for words in sample]
        if all(rest > 8 and is_number(word) and float(word) == rest for word, rest in rests):
            rising = [before for before in range(place) if rises(sample, before)]
            return Layout(
                "a count",
                {
                    "ranges": place + 1,
                    **dict.fromkeys(["stamp"][: len(rising)], rising[0] if rising else 0),
                },
            )
    return None


def _by_sweep(sample: list[list[str]], length: int) -> Layout | None:
    """The layout of a reading a line: a bearing that goes round, and the range beside it."""
    if not 2 <= length <= SHORT:
        return None
    rows = [words for words in sample if len(words) == length]
    columns = [
        np.array([float(w) if is_number(w) else np.nan for w in c]) for c in zip(*rows, strict=True)
    ]
    for place, column in enumerate(columns):
        wide, steps = np.ptp(column), np.diff(column)
        back = np.abs(steps) > 0.5 * wide
        turn = 2.0 * np.pi if wide < 7.0 else 360.0
        if not (0.3 * turn < wide <= 1.01 * turn) or not 1 <= back.sum() < 0.1 * len(steps):
            continue
        if min((steps[~back] > 0.0).mean(), 0.95) < 0.9 and (steps[~back] < 0.0).mean() < 0.9:
            continue
        others = [k for k in range(length) if k != place and len(set(columns[k])) > 10]
        if others:
            after = [k for k in others if k == place + 1] or others
            found = {"angles": place, "ranges": after[0]}
            rest = [k for k in others if k != after[0]]
            found |= {"stamp": 0} if 0 in rest and (np.diff(columns[0]) >= 0.0).all() else {}
            few = [k for k in range(length) if k not in found.values() and columns[k].max() > 1.0]
            found |= {"quality": few[-1]} if few and columns[few[-1]].max() < 256.0 else {}
            return Layout("the bearings, which go round", found, beams=1)
    return None


def _by_length(sample: list[list[str]], length: int) -> Layout:
    """The layout of lines whose number of columns leaves that of a usual range finder."""
    leading = ["stamp"] if rises(sample, 0) else []
    for names in (leading, [*leading, "x", "y", "theta"]):
        if length - len(names) in FANS and (
            names == leading or _is_heading(sample, len(names) - 1)
        ):
            columns = {name: place for place, name in enumerate([*names, "ranges"])}
            return Layout("the number of columns", columns)
    return Layout()


def _is_heading(sample: list[list[str]], place: int) -> bool:
    """Whether the numbers of a column may be headings: of at most two turns, in degrees."""
    return all(is_number(row[place]) and abs(float(row[place])) <= 720.0 for row in sample)


def rises(sample: list[list[str]], place: int) -> bool:
    """Whether the numbers of a column rise from line to line."""
    words = [words[place] for words in sample]
    return (
        len(words) > 2
        and all(map(is_number, words))
        and bool((np.diff(np.array(words, dtype=np.float64)) > 0.0).all())
    )


def plain(data: bytes) -> str:
    """The text of a line."""
    return data.decode("utf-8-sig", "replace").strip()


def named(words: list[str]) -> list[str]:
    """The names in a header."""
    return [word.strip().lower() for word in words]


def is_number(word: str) -> bool:
    """Whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def mostly_numbers(words: list[str]) -> bool:
    """Whether words are those of a line of numbers."""
    return sum(map(is_number, words)) > 0.5 * len(words)


def _numbers(words: list[str]) -> Float:
    """Words as numbers; what is left out is NaN."""
    try:
        return np.array([word.strip() or "nan" for word in words], dtype=np.float64)
    except ValueError:
        wrong = next(word for word in words if word.strip() and not is_number(word))
        raise ValueError(f"{shown(wrong)}, expected a number") from None


def _quantity(text: str, units: Mapping[str, float], item: str) -> float:
    """A number with one of the units, the first of which may be left out."""
    match = re.fullmatch(r"([-+.\deE]+?)([a-z]*)", text.strip())
    try:
        value = float(match[1]) if match else np.nan
    except ValueError:
        value = np.nan
    if match is None or not np.isfinite(value) or (match[2] and match[2] not in units):
        raise InputError(f"--format: {shown(item)}: expected a number with {' or '.join(units)}")
    return value * units[match[2] or next(iter(units))]


def _place(where: str, header: list[str]) -> int:
    """The place of a column, by its number from 1 or its name."""
    if where.isdigit() and int(where) > 0:
        return int(where) - 1
    check_names("--format: the header", [where.lower()], header)
    return header.index(where.lower())
