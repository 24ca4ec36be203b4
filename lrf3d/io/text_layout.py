"""The layout of a text of numbers: what its columns hold, by a format, a header or their number."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, check_names, shown
from lrf3d.geometry import Float
from lrf3d.io.carmen import lines_of
from lrf3d.io.columns import FANS, ROLES, SETTINGS

SAMPLE = 60
"""Lines at the beginning that say what the others are like."""

PRESETS = {
    "minesrover": "stamp:us@1, left@3, right@4, ranges:mm*682@25, first=-120deg, last=120deg,"
    " tick=0.24190263mm, track=0.33m, offset=0.145m",
    "lego": "stamp:ms@2, ranges:mm@4, first=-120.0156deg, step=0.3515625deg",
}
"""Formats of known robots: MinesRover's ``.dat``, of encoders with 2,000 ticks a turn on wheels of
77 mm, and a LEGO robot, whose scanner is turned by 4 degrees."""

MARKS = {("", 706): "minesrover", ("", 707): "minesrover", ("S", 663): "lego"}
"""Presets by the word that lines begin with and the number of their columns."""

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?").fullmatch
"""Matches numbers with a decimal comma."""

SYNONYMS = {
    "stamp": "stamp time timestamp t ts sec secs seconds nsec", "x": "x px posx", "y": "y py posy",
    "theta": "theta th yaw heading phi", "left": "left leftticks enc_left", "right": "right",
    "dx": "dx", "dy": "dy", "dtheta": "dtheta dyaw dth",
    "angles": "angle bearing azimuth", "poses": "poses pose trajectory odometry odom",
    "ranges": "ranges range r distances distance dist d scan laser lidar readings",
}  # fmt: skip
"""Words for columns in headers."""

OTHERS = "scan_time time_increment range_min range_max seq frame_id child_frame_id".split()
"""Columns of ROS messages with such words in them that hold something else."""


@dataclass
class Form:
    """How the lines of a file are written, by the first of them."""

    separator: str | None
    decimal_commas: bool
    header: list[str]
    sample: list[list[str]]
    word: str = ""

    @classmethod
    def of(cls, path: Path) -> "Form":
        """The form of a file."""
        texts = []
        for _, data, fault in lines_of(path):
            text = plain(data)
            if text and not fault:
                texts.append(text)
            if len(texts) == SAMPLE:
                break
        body = [text for text in texts if not text.startswith("#")]
        joined = "".join(body)
        separator, commas = None, False
        for mark in ";\t":
            if joined.count(mark) >= len(body) > 0:
                separator, commas = mark, "," in joined
        if separator is None and "," in joined:
            words = joined.split()
            commas = sum(map(bool, map(DECIMAL_COMMA, words))) > 0.5 * len(words)
            separator = None if commas else ","
        form = cls(separator, commas, [], [])
        lines = [form.words(text) for text in texts]
        numeric = [words for words in lines if sum(map(is_number, words)) > 0.5 * len(words)]
        if not numeric:
            raise InputError(f"{path}: no lines of numbers; expected a scan a line")
        first = lines.index(numeric[0])
        if first and len(lines[first - 1]) >= min(len(numeric[0]), 2):
            form.header = [word.strip().lower() for word in lines[first - 1]]
        # Where lines of several kinds begin with a word, those with the most numbers are scans.
        sizes: Counter[str] = Counter()
        for words in numeric:
            if not is_number(words[0]):
                sizes[words[0]] = max(sizes[words[0]], len(words))
        form.word = sizes.most_common(1)[0][0] if sizes else ""
        form.sample = [words for words in numeric if not form.word or words[0] == form.word]
        return form

    @property
    def preset(self) -> str:
        """The preset whose files look like this one; "" if there is none."""
        kinds = {(self.word, len(words)) for words in self.sample}
        names = [MARKS.get(kind, "") for kind in kinds]
        return names[0] if len(set(names)) == 1 and (self.word or _rises(self.sample, 0)) else ""

    def words(self, text: str) -> list[str]:
        """The words of a line."""
        words = text.lstrip("#% ").rstrip(self.separator).split(self.separator)
        return [word.replace(",", ".") for word in words] if self.decimal_commas else words


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
        if "ranges" not in layout.columns:
            raise InputError(f"--format: {shown(spec)}: no column of ranges; expected 'ranges'")
        return layout

    def values(self, words: list[str]) -> dict[str, Any]:
        """The numbers of a line by what they are; a ValueError says why there are none."""
        if self.length is not None and len(words) != self.length:
            raise ValueError(f"{len(words)} columns, expected {self.length}")
        found: dict[str, Any] = {}
        for role, place in self.columns.items():
            if place >= len(words):
                raise ValueError(f"{len(words)} columns, expected {role} in column {place + 1}")
            end = None if self.beams is None else place + self.beams
            numbers = _numbers(words[place:end] if role == "ranges" else words[place : place + 1])
            if role != "ranges" and not np.isfinite(numbers).all():
                raise ValueError(f"{role} is {words[place]!r}, expected a finite number")
            found[role] = numbers if role == "ranges" else float(numbers[0])
        return found


def found_layout(path: Path, form: Form) -> Layout:
    """The layout of a file without a format: by its header, a count, or the number of columns."""
    lengths = Counter(map(len, form.sample))
    length, often = lengths.most_common(1)[0]
    fixed = length if often > 0.9 * len(form.sample) else None
    layout = _by_header(form.header, length) if form.header else None
    layout = (
        layout or _by_count(form.sample) or (_by_length(form.sample, length) if fixed else None)
    )
    if layout is None:
        rises = ", the first of them rising" if _rises(form.sample, 0) else ""
        raise InputError(
            f"{path}: text of {length} columns{rises}; name them by --format, such as"
            " 'stamp:us, x, y, theta, ranges:mm@25', or a preset: " + ", ".join(PRESETS)
        )
    layout.length = fixed if layout.reason != "a count" else None
    return layout


def _by_header(header: list[str], length: int) -> Layout | None:
    """The layout that the names in a header give; None if they name no ranges."""
    layout = Layout("the header")
    series: dict[str, list[int]] = {}
    for place, name in enumerate(header):
        base, number = _series(name)
        if number is not None:
            series.setdefault(base, []).append(place)
            continue
        role, unit = meaning(name)
        if role in ROLES and role not in layout.columns:
            layout.columns[role] = place
            if unit:
                layout.units[role] = unit
    named = {base: places for base, places in series.items() if meaning(base)[0] == "ranges"}
    places = max((named or series).values(), key=len, default=[])
    if len(places) > 1 and places == list(range(places[0], places[-1] + 1)):
        layout.columns["ranges"], layout.beams = places[0], len(places)
        base = next(base for base, own in series.items() if own is places)
        if unit := meaning(base)[1]:
            layout.units["ranges"] = unit
        labels = [float(_series(header[k])[1] or 0.0) for k in places]
        if labels != [labels[0] + k for k in range(len(labels))] or labels[0] not in (0.0, 1.0):
            layout.angles = np.array(labels)
    elif layout.columns.get("ranges") is not None and length > len(header):
        # One name for all of them.
        place, extra = layout.columns["ranges"], length - len(header)
        layout.beams = extra + 1
        for role, other in layout.columns.items():
            layout.columns[role] = other + extra if other > place else other
    elif {"angles", "ranges"} <= layout.columns.keys():
        layout.beams = 1
    return layout if layout.beams else None


def _series(name: str) -> tuple[str, str | None]:
    """The name of a series of columns, and the number of one of them, if it has one."""
    match = re.fullmatch(r"(.*?)[\s\[(;._]*(?<![\d.])(-?\d+(?:\.\d+)?)[\s\])]*", name)
    return (match[1], match[2]) if match else (name, None)


def meaning(name: str) -> tuple[str, str]:
    """What a column of this name holds, and its unit, as far as the name says so."""
    if name.rpartition(".")[2] in OTHERS:
        return "", ""
    words = [word for word in re.split(r"[^a-z]+", name) if word]
    units = [word for word in words if any(word in known for known in ROLES.values())]
    words = [word for word in words if word not in units or len(words) == 1]
    for word in reversed(words):
        for role, known in SYNONYMS.items():
            if word in known.split() or word.removesuffix("s") in known.split():
                unit = units[-1] if units and units[-1] in ROLES.get(role, {}) else ""
                return role, unit
    return "", ""


def _by_count(sample: list[list[str]]) -> Layout | None:
    """The layout of lines that hold how many ranges follow."""
    for place in range(min(8, min(map(len, sample)) - 1)):
        rests = [(words[place], len(words) - place - 1) for words in sample]
        if all(rest > 8 and is_number(word) and float(word) == rest for word, rest in rests):
            layout = Layout("a count", {"ranges": place + 1})
            for before in range(place):
                if _rises(sample, before):
                    layout.columns["stamp"] = before
                    break
            return layout
    return None


def _by_length(sample: list[list[str]], length: int) -> Layout | None:
    """The layout of lines whose number of columns leaves that of a usual range finder."""
    leading = ["stamp"] if _rises(sample, 0) else []
    for names in (leading, [*leading, "x", "y", "theta"]):
        if length - len(names) in FANS:
            columns = {name: place for place, name in enumerate([*names, "ranges"])}
            return Layout("the number of columns", columns)
    return None


def _rises(sample: list[list[str]], place: int) -> bool:
    """Whether the numbers of a column rise from line to line."""
    words = [words[place] for words in sample]
    return (
        len(words) > 2
        and all(map(is_number, words))
        and bool((np.diff(np.array(words, dtype=np.float64)) > 0.0).all())
    )


def plain(data: bytes) -> str:
    """The text of a line without brackets and quotes, which lists of numbers stand in."""
    return re.sub(r"""["'(){}\[\]]""", " ", data.decode("utf-8-sig", "replace")).strip()


def is_number(word: str) -> bool:
    """Whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


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
