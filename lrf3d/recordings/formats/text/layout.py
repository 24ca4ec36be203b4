"""The layout of a text of numbers: what its columns hold, by a format, a header or the numbers."""

import re
from array import array
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, check_names, one_line, shown
from lrf3d.geometry.lines import Float
from lrf3d.recordings.formats.table import CUT, ROLES, SETTINGS, WHOLE, Table, meaning
from lrf3d.recordings.formats.text.fans import FANS
from lrf3d.recordings.formats.text.form import (
    SHORT,
    Form,
    is_number,
    mostly_numbers,
    named,
    rises,
    texts_of,
)
from lrf3d.recordings.log import A_VALUE

# Formats of known robots: MinesRover's ``.dat``, of encoders with 2,000 ticks a turn on wheels of
# 77 mm, and a LEGO robot, whose scanner is turned by 4 degrees.
PRESETS = {
    "minesrover": "stamp:us@1, left@3, right@4, ranges:mm*682@25, first=-120deg, last=120deg,"
    " tick=0.24190263mm, track=0.33m, offset=0.145m",
    "lego": "stamp:ms@2, ranges:mm@4, first=-120.0156deg, step=0.3515625deg",
}

# Presets by the word that lines begin with and the number of their columns.
MARKS = {("", 706): "minesrover", ("", 707): "minesrover", ("S", 663): "lego"}

# Matches one of a series of columns: its name, its number, and a unit.
SERIES = re.compile(
    r"(.*?)[\s\[(;._]*(?<![\d.])(-?\d+(?:\.\d+)?)[\s\])°]*(?:[_/ ]*(?:deg|(mm|cm|m)))?"
).fullmatch


def preset_of(form: Form) -> str:
    """The preset whose files look like a text; "" if there is none."""
    names = {MARKS.get((form.word, len(words)), "") for words in form.sample}
    [name, *others] = names
    return "" if others or not (form.word or rises(form.sample, 0)) else name


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
                base = f"{numbered[1]}_{numbered[3]}" if numbered[3] else numbered[1]
                series.setdefault(base, []).append(place)
                labels[place] = float(numbered[2])
            elif role and role not in self.columns:
                self.columns[role] = place
                units |= {role: unit} if unit else {}
        known = {base: places for base, places in series.items() if meaning(base)[0] == "ranges"}
        base, places = max((known or series).items(), key=lambda one: len(one[1]), default=("", []))
        at = self.columns.get("ranges")
        if len(places) > 1 and places == list(range(places[0], places[-1] + 1)):
            self.columns["ranges"] = places[0]
            self.beams = len(places)
            units |= {"ranges": unit} if (unit := meaning(base)[1]) else {}
            bearings = np.array([labels[place] for place in places])
            counts = bearings[0] in (0.0, 1.0) and np.ptp(bearings) == len(bearings) - 1
            if not counts and np.ptp(bearings) <= 360.0:
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
            self.table.units = {}
            self.table.values = {}
            self.columns = _by_count(form.sample)
            self.beams = None
            self.reason = "a count"
        if not self.columns:
            self.columns, self.beams = _by_echo(form.sample)
            self.reason = "the layout of ros2 topic echo --csv"
        if not self.columns and fixed:
            self.columns = _by_sweep(form.sample, length)
            self.reason = "the bearings, which go round"
            self.beams = 1
        if not self.columns and fixed:
            self.columns = _by_length(form.sample, length)
            self.reason = "the number of columns"
            self.beams = None
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
        left = f"a line of at least {form.least} words" if form.least else ""
        left = f"a line that begins with {form.word}" if form.word else left
        if left:
            self.table.intake.notes.append(f"a scan is {left}: all others are left out")
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
        ranges = list[Float]()
        one = self.beams == 1 and "angles" in self.columns
        rows: dict[str, Any] = {role: array("d") for role in self.columns}
        begun = False
        intake = self.table.intake
        for number, text in texts_of(intake):
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
        found = dict[str, Float]()
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


def _numbers(words: list[str]) -> Float:
    """The numbers that words are; what stands for a reading that is none is not a number."""
    with suppress(ValueError):
        return np.array(words, dtype=np.float64)
    nothing = re.compile(r"null|none|n/?a|nil|-*", re.IGNORECASE)
    values = ["nan" if nothing.fullmatch(word.strip()) else word for word in words]
    if wrong := next((word for word in values if not is_number(word)), ""):
        raise ValueError(f"{shown(wrong)}, expected a number")
    return np.array(values, dtype=np.float64)


def _by_count(sample: list[list[str]]) -> dict[str, int]:
    """The columns of lines that state the number of their ranges."""
    for place in range(min(8, min(map(len, sample), default=0) - 1)):
        rests = [(words[place], len(words) - place - 1) for words in sample]
        if all(rest > 8 and is_number(word) and float(word) == rest for word, rest in rests):
            rising = [before for before in range(place) if rises(sample, before)]
            found = {"ranges": place + 1} | ({"stamp": rising[0]} if rising else {})
            for at in range(place - 2):
                # The first bearing, the last one, and the step, in either order.
                numbers = [float(w) if is_number(w) else np.nan for w in sample[0][at : at + 3]]
                for low, step, high in (numbers, [numbers[k] for k in (0, 2, 1)]):
                    if abs(low + step * (rests[0][1] - 1) - high) < 2.0 * abs(step) < 0.2:
                        names = ("first", "step", "last") if step == numbers[1] else (
                            "first", "last", "step")  # fmt: skip
                        return found | {name: at + k for k, name in enumerate(names)}
            return found
    return {}


def _by_echo(sample: list[list[str]]) -> tuple[dict[str, int], int | None]:
    """The columns of messages that ROS 2 prints as CSV, and the number of their ranges."""
    roles = {"stamp": 0, "nanosec": 1, "first": 3, "last": 4, "step": 5, "ranges": 10}
    counts = []
    for words in sample:
        if len(words) < 12 or is_number(words[2]) or not all(map(is_number, words[3:10])):
            return {}, None
        if CUT in words:
            raise InputError(WHOLE)
        first, last, step = map(float, words[3:6])
        beams = round((last - first) / step) + 1 if step else 0
        # Drivers send a beam more or fewer than they say, and an intensity for each or none.
        values = len(words) - roles["ranges"]
        counts += [n for n in (values, values // 2) if abs(n - beams) <= 1][:1]
    return (roles, Counter(counts).most_common(1)[0][0]) if counts else ({}, None)


def _by_sweep(sample: list[list[str]], length: int) -> dict[str, int]:
    """The columns of a reading a line: a bearing that goes round, and the range beside it."""
    if not 2 <= length <= SHORT:
        return {}
    rows = [words for words in sample if len(words) == length]
    columns = [
        np.array([float(w) if is_number(w) else np.nan for w in c]) for c in zip(*rows, strict=True)
    ]
    for place, column in enumerate(columns):
        wide = np.ptp(column)
        steps = np.diff(column)
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


def _quantity(text: str, units: Mapping[str, float], item: str) -> float:
    """A number with one of the units, the first of which may be left out."""
    match = re.fullmatch(r"([-+.\deE]+?)([a-z]*)", text.strip())
    known = match is not None and is_number(match[1]) and np.isfinite(float(match[1]))
    if match is None or not known or (match[2] and match[2] not in units):
        raise InputError(f"--format: {shown(item)}: expected a number with {' or '.join(units)}")
    return float(match[1]) * units[match[2] or next(iter(units))]
