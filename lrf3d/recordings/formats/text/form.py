"""The form of a text of numbers: how its lines are separated, its header, and which hold scans."""

import re
from collections.abc import Iterator
from datetime import date
from itertools import islice
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.recordings.log import Intake

# Most words of a line that holds no whole scan.
SHORT = 6

# Brackets and quotes, which lists of numbers stand in.
BRACKETS = re.compile(r"""["'(){}\[\]]""")

# Where lists follow each other, and quoted numbers with a decimal comma.
JOINTS = re.compile(r"[\])}]:?\s*[\[({]")
QUOTED = re.compile(r'"(-?\d+),(\d+)"')

# Units in brackets after names in headers.
UNITS = re.compile(r"(?<=\w)\s?[\[(](rad|deg|degrees|[mcun]?[ms])[\])]")

# Matches a line of tuples; the first group is the first of them.
NESTED = re.compile(r"\s*[\[(]\s*[\[(]([^\])]*)[\])]").match

# Times of day, with a date before them or without, and a zone or none.
CLOCK = re.compile(
    r"(?<![\w.:-])(?:(\d{4})[-/](\d\d)[-/](\d\d)[T/ ]+)?(\d\d):(\d\d):(\d\d(?:\.\d*)?)"
    r"(?: ?Z| ?UTC|[-+]\d\d:?\d\d)?"
)

# Matches numbers with a decimal comma.
DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?").fullmatch

# Numbers that have their names before them.
LABELS = re.compile(r"(?<!\w)([A-Za-z_]\w*+)\s*+[:=]\s*([-+]?[\d.]+(?:e[-+]?\d+)?)")

# A list that has its name before it.
LISTED = re.compile(r"([A-Za-z_]\w*+)\s*+[:=]\s*+[\[(]([^\])]*)")


class Form:
    """How the lines of a file are written, by the first of them.

    Lines may hold tuples of ``nested`` numbers, a reading each. Where lines of several kinds begin
    with a word, those with the most numbers, and this ``word``, hold scans; where many are far
    longer than others, those of at least ``least`` words.
    """

    def __init__(self, path: Path) -> None:
        lines = (text for _, text in texts_of(Intake(path)) if text)
        # Lines that say what the others are like; of lines with few words, many.
        sample = 60
        many = 4000
        texts = list(islice(lines, sample))
        if texts and len(texts[-1].split()) < SHORT:
            texts += islice(lines, many)
        body = [text for text in texts if not text.startswith("#")]
        joined = "".join(body)
        words = "".join(body).split()
        self.labelled = sum(len(LABELS.findall(text)) > 1 for text in body) > 0.5 * len(body)
        marks = [mark for mark in "\t;" if joined.count(mark) >= len(body) > 0]
        self.decimal_commas = "," in joined
        if not marks and 2 * sum("," in text for text in body) > len(body):
            self.decimal_commas = sum(map(bool, map(DECIMAL_COMMA, words))) > 0.5 * len(words)
            marks = [] if self.decimal_commas else [","]
        self.separator = marks[0] if marks else None
        first = next(filter(None, map(NESTED, texts)), None)
        self.nested = len(first[1].split(",")) if first else 0
        rows = [words for text in texts for words in self.rows(text)]
        numeric = [words for words in rows if mostly_numbers(words)]
        if not numeric:
            raise InputError(f"{path}: no lines of numbers; expected a scan a line")
        begin = rows.index(numeric[0])
        self.header = list[str]()
        if self.labelled:
            self.header = [name.lower() for name, _ in LABELS.findall(body[-1])]
            self.header += [found[1].lower() for found in LISTED.finditer(body[-1])]
        elif all(map(is_number, numeric[-1])) and _names(numeric[0]):
            # Many of its names are numbers.
            self.header = named(numeric.pop(0))
        elif begin and (
            heads := [row for row in rows[:begin] if len(row) == len(numeric[0])]
            or [row for row in rows[begin - 1 : begin] if len(row) >= min(len(numeric[0]), 2)]
        ):
            self.header = named(heads[-1])
        firsts = [words[0] for words in numeric if not is_number(words[0])]
        sizes = {words[0]: len(words) for words in sorted(numeric, key=len) if words[0] in firsts}
        # What differs from line to line is no kind.
        self.word = list(sizes)[-1] if 0 < len(sizes) <= max(0.5 * len(firsts), 1) else ""
        counts = np.array([len(words) for words in numeric])
        often = 0.2  # Least share of the lines of a kind.
        kinds = (counts <= SHORT).mean(), (counts > 2 * SHORT).mean()
        self.least = 2 * SHORT if not self.word and min(kinds) > often else 0
        self.sample = [words for words in numeric if self.has(words)]

    def has(self, words: list[str]) -> bool:
        """Whether a line is of the kind that holds scans."""
        return words[0] == self.word if self.word else len(words) >= self.least

    def rows(self, text: str) -> list[list[str]]:
        """The words of a line, or of each of the brackets in it."""
        if legend := re.match(r"(?i).*\b(?:format|legend|columns|fields)\s*:\s*(.*)", text):
            # A sentence ends with the names of the columns; sizes in brackets are none.
            names = re.sub(r"(?<=\w)\[[A-Za-z_]{4,}\]", "", UNITS.sub(r"_\1", legend[1]))
            first_to_last = r"([A-Za-z_]\w*?)(\d+)\W+(?:\.\.+|…)\W+\1(\d+)"
            return [_split(re.sub(first_to_last, _series, names))]
        if self.labelled:
            words = [number for _, number in LABELS.findall(text)] or [text]
            words += [each for found in LISTED.finditer(text) for each in _split(found[2])]
        else:
            bare = JOINTS.sub(self.separator or " ", QUOTED.sub(r"\1.\2", text))
            bare = BRACKETS.sub(" ", UNITS.sub(r"_\1", bare)).strip().lstrip("#% ")
            words = bare.rstrip(self.separator).split(self.separator)
            if self.decimal_commas:
                words = [word.replace(",", ".") for word in words]
            elif len(words) <= SHORT:
                words = [{"True": "1", "False": "0"}.get(word, word) for word in words]
            # Spaces may separate what comes before a list of commas.
            if len(first := words[0].split() if words else []) > 1 and all(map(is_number, first)):
                words[:1] = first
        size = self.nested or len(words) or 1
        return [words[k : k + size] for k in range(0, len(words), size)]


def rises(sample: list[list[str]], place: int) -> bool:
    """Whether the numbers of a column rise from line to line."""
    words = [words[place] for words in sample if place < len(words)]
    if len(words) < 3 or not all(map(is_number, words)):
        return False
    return bool((np.diff(np.array(words, dtype=np.float64)) > 0.0).all())


def texts_of(intake: Intake) -> Iterator[tuple[int, str]]:
    """The numbers and texts of the lines of a file, those of a list in brackets as one.

    Times of day are in seconds, comments are empty.
    """
    held: list[tuple[int, str]] = []
    longest = 500  # Most lines that a list in brackets may take.
    for number, data in intake.lines():
        text = data.decode("utf-8-sig", "replace").strip()
        text = CLOCK.sub(_seconds, text) if ":" in text else text
        text = "" if text.startswith("//") else text
        if not (held or "[" in text or "(" in text):
            yield number, text
            continue
        held.append((number, text))
        whole = " ".join(text for _, text in held)
        if len(held) < longest and sum(map(whole.count, "[(")) > sum(map(whole.count, "])")):
            continue
        yield from [(number, whole)] if len(held) < longest else held
        held.clear()
    yield from held


def _seconds(time: re.Match[str]) -> str:
    year, month, day, hours, minutes, seconds = time.groups()
    try:
        days = date(int(year), int(month), int(day)).toordinal() - 719163 if year else 0
    except ValueError:
        return time[0]
    return f"{86400.0 * days + 3600.0 * float(hours) + 60.0 * float(minutes) + float(seconds):.6f}"


def _series(ends: re.Match[str]) -> str:
    base, first, last = ends.groups()
    most_beams = 100_000
    numbers = range(int(first), min(int(last) + 1, int(first) + most_beams))
    return " ".join(f"{base}{number}" for number in numbers)


def _split(text: str) -> list[str]:
    return text.replace(",", " ").split()


def named(words: list[str]) -> list[str]:
    """The names in a header, with words that a capital begins apart."""
    return [re.sub("(?<=[a-z])(?=[A-Z])", "_", word.strip()).lower() for word in words]


def _names(words: list[str]) -> bool:
    """Whether words are the names of columns, most of which are numbers, such as bearings."""
    first, *others = filter(None, words)
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
