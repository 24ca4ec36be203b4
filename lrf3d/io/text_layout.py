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

from lrf3d.errors import InputError, check_names, one_line, shown
from lrf3d.geometry import Float
from lrf3d.io.fans import FANS
from lrf3d.io.laser_log import A_VALUE, Intake
from lrf3d.io.table import ROLES, SETTINGS, Table, meaning

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

UNITS = re.compile(r"(?<=\w)\s?[\[(](rad|deg|degrees|[mcun]?[ms])[\])]")
"""Units in brackets after names in headers."""

NESTED = re.compile(r"\s*[\[(]\s*[\[(]([^\])]*)[\])]").match
"""Matches a line of tuples; the first group is the first of them."""

CLOCK = re.compile(r"(?<![\w.:-])(?:\d{4}[-/]\d\d[-/]\d\d[T/ ]+)?(\d\d):(\d\d):(\d\d(?:\.\d*)?)")
"""Times of day, with a date before them or without."""

BOOLEANS = {"True": "1", "False": "0"}

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?").fullmatch
"""Matches numbers with a decimal comma."""

LABELS = re.compile(r"(?<!\w)([A-Za-z_]\w*+)\s*+[:=]\s*([-+]?[\d.]+(?:e[-+]?\d+)?)")
"""Numbers that have their names before them."""

SERIES = re.compile(r"(.*?)[\s\[(;._]*(?<![\d.])(-?\d+(?:\.\d+)?)[\s\])]*").fullmatch
"""Matches one of a series of columns: its name and its number."""


class Form:
    """How the lines of a file are written, by the first of them.

    Lines may hold tuples of ``nested`` numbers, a reading each. Where lines of several kinds begin
    with a word, those with the most numbers, and this ``word``, hold scans.
    """

    def __init__(self, path: Path) -> None:
        lines = (text for _, data in Intake(path).lines() if (text := plain(data)))
        texts = list(islice(lines, SAMPLE))
        if texts and len(texts[-1].split()) < SHORT:
            texts += islice(lines, MANY)
        body = [text for text in texts if not text.startswith("#")]
        joined, words = "".join(body), "".join(body).split()
        self.labelled = sum(len(LABELS.findall(text)) > 1 for text in body) > 0.5 * len(body)
        marks = [mark for mark in "\t;" if joined.count(mark) >= len(body) > 0]
        self.decimal_commas = "," in joined
        if not marks and "," in joined:
            self.decimal_commas = sum(map(bool, map(DECIMAL_COMMA, words))) > 0.5 * len(words)
            marks = [] if self.decimal_commas else [","]
        self.separator = marks[0] if marks else None
        first = NESTED(texts[0]) if texts else None
        self.nested = len(first[1].split(",")) if first else 0
        rows = [words for text in texts for words in self.rows(text)]
        numeric = [words for words in rows if mostly_numbers(words)]
        if not numeric:
            raise InputError(f"{path}: no lines of numbers; expected a scan a line")
        begin, self.header = rows.index(numeric[0]), list[str]()
        if self.labelled:
            self.header = [name.lower() for name, _ in LABELS.findall(body[-1])]
        elif all(map(is_number, numeric[-1])) and _names(numeric[0]):
            # Many of its names are numbers.
            self.header = named(numeric.pop(0))
        elif begin and len(rows[begin - 1]) >= min(len(numeric[0]), 2):
            self.header = named(rows[begin - 1])
        sizes: Counter[str] = Counter()
        for words in numeric:
            if not is_number(words[0]):
                sizes[words[0]] = max(sizes[words[0]], len(words))
        self.word = sizes.most_common(1)[0][0] if sizes else ""
        self.sample = [words for words in numeric if self.has(words)]

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
        if self.labelled:
            words = [number for _, number in LABELS.findall(text)] or [text]
        else:
            bare = BRACKETS.sub(" ", UNITS.sub(r"_\1", text)).strip().lstrip("#% ")
            words = bare.rstrip(self.separator).split(self.separator)
            if self.decimal_commas:
                words = [word.replace(",", ".") for word in words]
            elif len(words) <= SHORT:
                words = [BOOLEANS.get(word, word) for word in words]
        size = self.nested or len(words) or 1
        return [words[k : k + size] for k in range(0, len(words), size)]


@dataclass
class Layout:
    """Where the columns of a line are, from 0; the table has what is known of their numbers."""

    table: Table
    reason: str = "--format"
    columns: dict[str, int] = field(default_factory=dict)
    beams: int | None = None
    length: int | None = None

    def parse(self, spec: str, header: list[str]) -> None:
        """Take the columns and the settings that a format describes."""
        place = 0
        for item in map(str.strip, spec.split(",")):
            key, is_setting, value = item.partition("=")
            column = re.fullmatch(r"([a-z]+|-)(?::([a-z]+))?(?:\*(\d+))?(?:@(.+))?", item)
            if item == "clockwise":
                self.table.clockwise = True
            elif is_setting:
                check_names("--format", [key], SETTINGS)
                self.table.settings[key] = _quantity(value, SETTINGS[key], item)
            elif column is None:
                raise InputError(f"--format: {shown(item)}: expected NAME:UNIT@COLUMN or KEY=VALUE")
            else:
                name, unit, count, where = column.groups()
                if where is not None and where.isdigit() and int(where) > 0:
                    place = int(where) - 1
                elif where is not None:
                    check_names("--format: the header", named([where]), header)
                    place = header.index(named([where])[0])
                if name != "-":
                    check_names("--format", [name], ROLES)
                    self.columns[name] = place
                    if unit:
                        check_names(f"--format: {name}", [unit], ROLES[name])
                        self.table.units[name] = unit
                if name == "ranges":
                    self.beams = int(count) if count else None
                place += int(count or 1)
        if "angles" in self.columns:
            self.beams = 1

    def by_header(self, header: list[str], length: int) -> None:
        """Take the columns that the names in a header give."""
        self.reason, series, units = "the header", dict[str, list[int]](), self.table.units
        labels = dict[int, float]()
        for place, name in enumerate(header):
            role, unit = meaning(name)
            if numbered := SERIES(name):
                series.setdefault(numbered[1], []).append(place)
                labels[place] = float(numbered[2])
            elif role and role not in self.columns:
                self.columns[role] = place
                units |= {role: unit} if unit else {}
        known = {base: places for base, places in series.items() if meaning(base)[0] == "ranges"}
        base, places = max((known or series).items(), key=lambda one: len(one[1]), default=("", []))
        at = self.columns.get("ranges")
        if len(places) > 1 and places == list(range(places[0], places[-1] + 1)):
            self.columns["ranges"], self.beams = places[0], len(places)
            units |= {"ranges": unit} if (unit := meaning(base)[1]) else {}
            bearings = np.array([labels[place] for place in places])
            if bearings[0] not in (0.0, 1.0) or np.ptp(bearings) != len(bearings) - 1:
                self.table.values["angles"] = bearings
            # A single angle beside a whole scan is the heading of the robot.
            if (turn := self.columns.pop("angles", None)) is not None:
                self.columns.setdefault("theta", turn)
                units |= {"theta": unit} if (unit := units.pop("angles", "")) else {}
        elif at is not None and (extra := length - len(header)) > 0:
            # One name for all of them.
            intense = header[at + 1 : at + 2] == ["intensities"]
            self.beams = (extra // 2 if intense else extra) + 1
            self.columns = {k: v + extra * (v > at) for k, v in self.columns.items()}
        elif at is not None:
            if "x" not in self.columns and "theta" in self.columns:
                self.columns.setdefault("angles", self.columns.pop("theta"))
            self.beams = 1

    def find(self, form: Form) -> None:
        """Find the columns by a header, a count, or the numbers themselves."""
        length, often = Counter(map(len, form.sample)).most_common(1)[0]
        fixed = often > 0.9 * len(form.sample)
        if form.header:
            self.by_header(form.header, length)
        if self.beams is None or (self.beams == 1 and "angles" not in self.columns):
            self.table.units, self.table.values = {}, {}
            self.columns, self.beams, self.reason = _by_count(form.sample), None, "a count"
        if not self.columns and fixed:
            self.columns = _by_sweep(form.sample, length)
            self.reason, self.beams = "the bearings, which go round", 1
        if not self.columns and fixed:
            self.columns = _by_length(form.sample, length)
            self.reason, self.beams = "the number of columns", None
        if not self.columns:
            such = "angles:deg@1, ranges:mm@2"
            if length > SHORT:
                such = "stamp:us, x, y, theta, ranges:mm@25', or a preset, '" + "', '".join(PRESETS)
            places = [str(k + 1) for k in range(min(length, SHORT)) if rises(form.sample, k)]
            rising = f", number {', '.join(places)} rising as stamps do" if places else ""
            raise InputError(
                f"{self.table.intake.path}: text of {length} columns{rising}; name them by"
                f" --format, such as '{such}'"
            )
        self.length = length if fixed and self.reason != "a count" else None
        found = ", ".join(f"{role} {column + 1}" for role, column in self.columns.items())
        if self.reason == "the header" and len(form.header) == length:
            used = {*self.columns.values(), *range(self.columns["ranges"], length)[: self.beams]}
            if others := [name for k, name in enumerate(form.header) if name and k not in used]:
                found += f"; not used: {one_line(', '.join(others), 100)}"
        self.table.intake.notes.append(
            f"columns found by {self.reason}: {found}; --format says otherwise"
        )

    def read(self, form: Form) -> list[Float]:
        """Read the numbers of the lines of a file into the table, and return the ranges of each."""
        ranges, one = list[Float](), self.beams == 1 and "angles" in self.columns
        rows: dict[str, Any] = {role: array("d") for role in self.columns}
        begun, intake = False, self.table.intake
        for number, data in intake.lines():
            text = plain(data)
            for words in form.rows(text):
                if not text or text.startswith("#") or not form.has(words):
                    continue
                if named(words) == form.header or not (begun or mostly_numbers(words)):
                    # What comes before the numbers, and headers of files that were joined.
                    continue
                try:
                    found = self._values(words)
                except ValueError as error:
                    intake.refuse(number, error)
                    continue
                if not one and "ranges" in found:
                    ranges.append(found.pop("ranges"))
                for role, values in found.items():
                    rows[role].append(values[0])
                begun = True
                intake.take(len(words) + A_VALUE * len(self.columns), number)
        self.table.values |= {role: np.array(each) for role, each in rows.items() if len(each)}
        return ranges

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
            try:
                values = [word.strip() or "nan" for word in words[place:end]]
                found[role] = np.array(values, dtype=np.float64)
            except ValueError:
                wrong = next(word for word in values if not is_number(word))
                raise ValueError(f"{shown(wrong)}, expected a number") from None
            if role != "ranges" and not np.isfinite(found[role]).all():
                raise ValueError(f"{role} is {words[place]!r}, expected a finite number")
        return found


def _by_count(sample: list[list[str]]) -> dict[str, int]:
    """The columns of lines that state the number of their ranges."""
    for place in range(min(8, min(map(len, sample), default=0) - 1)):
        rests = [(words[place], len(words) - place - 1) for words in sample]
        if all(rest > 8 and is_number(word) and float(word) == rest for word, rest in rests):
            rising = [before for before in range(place) if rises(sample, before)]
            return {"ranges": place + 1} | ({"stamp": rising[0]} if rising else {})
    return {}


def _by_sweep(sample: list[list[str]], length: int) -> dict[str, int]:
    """The columns of a reading a line: a bearing that goes round, and the range beside it."""
    if not 2 <= length <= SHORT:
        return {}
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
            return found | ({"quality": few[-1]} if few and columns[few[-1]].max() < 256.0 else {})
    return {}


def _by_length(sample: list[list[str]], length: int) -> dict[str, int]:
    """The columns of lines with a usual number of beams after the stamp and the pose, if any."""
    leading = ["stamp"] if rises(sample, 0) else []
    for names in (leading, [*leading, "x", "y", "theta"]):
        if length - len(names) in FANS:
            # Headings are of at most two turns, in degrees.
            rows = [words for words in sample if len(words) == length and names != leading]
            turns = [words[len(names) - 1] for words in rows]
            if all(is_number(turn) and abs(float(turn)) <= 720.0 for turn in turns):
                return {name: place for place, name in enumerate([*names, "ranges"])}
    return {}


def rises(sample: list[list[str]], place: int) -> bool:
    """Whether the numbers of a column rise from line to line."""
    words = [words[place] for words in sample if place < len(words)]
    if len(words) < 3 or not all(map(is_number, words)):
        return False
    return bool((np.diff(np.array(words, dtype=np.float64)) > 0.0).all())


def plain(data: bytes) -> str:
    """The text of a line, in which times of day are in seconds."""
    text = data.decode("utf-8-sig", "replace").strip()
    return CLOCK.sub(lambda time: f"{_seconds(time):.6f}", text) if ":" in text else text


def _seconds(time: re.Match[str]) -> float:
    hours, minutes, seconds = map(float, time.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds


def named(words: list[str]) -> list[str]:
    """The names in a header, with words that a capital begins apart."""
    return [re.sub("(?<=[a-z])(?=[A-Z])", "_", word.strip()).lower() for word in words]


def _names(words: list[str]) -> bool:
    """Whether words are the names of columns, most of which are numbers, such as bearings."""
    first, *others = words
    return not all(map(is_number, others)) or (
        not is_number(first) and bool((np.diff(np.array(others, dtype=np.float64)) > 0.0).all())
    )


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


def _quantity(text: str, units: Mapping[str, float], item: str) -> float:
    """A number with one of the units, the first of which may be left out."""
    match = re.fullmatch(r"([-+.\deE]+?)([a-z]*)", text.strip())
    known = match is not None and is_number(match[1]) and np.isfinite(float(match[1]))
    if match is None or not known or (match[2] and match[2] not in units):
        raise InputError(f"--format: {shown(item)}: expected a number with {' or '.join(units)}")
    return float(match[1]) * units[match[2] or next(iter(units))]
