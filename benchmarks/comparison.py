"""Comparing two reports of ``scripts/bench``: what became slower or less exact, beyond the noise.

A time is only called another when it differs by more than both measurements scatter and by more
than the machine's own speed, which the calibration measures, may have changed in between.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.text import duration, error_words
from benchmarks.timing import Method, Timing
from benchmarks.whole import FORMAT, Report
from lrf3d.errors import InputError
from lrf3d.input import read_text
from lrf3d.tables import table

SAME = ("system", "processor", "cores")
"""What makes two machines the same."""

LEAST = 1.05
"""Ratio of times below which no difference is named, however quiet the machine was: where code
and data come to lie in memory alone moves times by some percent."""

ROUNDED = 1e-3
"""Relative difference of errors that other orders of summation may bring."""


@dataclass(frozen=True, slots=True)
class Change:
    """One figure that differs.

    Args:
        part: Name of the part.
        thing: What is done.
        way: How.
        what: ``time`` or ``error``.
        old: The figure then.
        new: The figure now.
        noise_ratio: Ratio up to which a difference may be noise; 1 where nothing is random.
    """

    part: str
    thing: str
    way: str
    what: str
    old: float
    new: float
    noise_ratio: float

    @property
    def ratio(self) -> float | None:
        """Now over then; None where there was nothing then."""
        return self.new / self.old if self.old > 0.0 else None

    @property
    def worse(self) -> bool:
        """Whether it became slower or less exact."""
        return self.new > self.old

    @property
    def words(self) -> str:
        """What happened."""
        if self.what == "time":
            return "slower" if self.worse else "faster"
        return "less exact" if self.worse else "more exact"

    @property
    def size(self) -> float:
        """By what ratio it changed, in either direction."""
        ratio = self.ratio
        return float("inf") if not ratio else max(ratio, 1.0 / ratio)

    def as_dict(self) -> dict[str, Any]:
        names = ("part", "thing", "way", "old", "new", "ratio", "noise_ratio")
        return {"change": self.words, **{name: getattr(self, name) for name in names}}

    def row(self) -> tuple[str, ...]:
        """The change as the cells of a table."""
        show = duration if self.what == "time" else error_words
        return (
            self.words,
            "from none" if self.ratio is None else f"{self.ratio:.3g} ×",
            f"{self.noise_ratio:.2f} ×",
            show(self.old),
            show(self.new),
            f"{self.part}: {self.thing}, {self.way}",
        )


@dataclass
class Comparison:
    """What differs between two reports.

    Args:
        against: The older report.
        made: When that was made.
        machines: What differs between the machines; empty for the same one.
        compared: How many figures were compared.
        changes: Those that differ beyond the noise, the worst first.
        speeds: For each part how much longer the calibration took now.
        missing: Methods that only one of the two reports has.
    """

    against: str
    made: str = ""
    machines: list[str] = field(default_factory=list)
    compared: int = 0
    changes: list[Change] = field(default_factory=list)
    speeds: dict[str, float] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        return {
            "against": self.against,
            "made": self.made,
            "machines_differ": self.machines,
            "figures_compared": self.compared,
            "changes": [change.as_dict() for change in self.changes],
            "yardstick_ratio": self.speeds,
            "only_in_one": self.missing,
        }

    def text(self) -> str:
        """What became slower or less exact, and what the noise hides."""
        worse = [change for change in self.changes if change.worse]
        slower = sum(change.what == "time" for change in worse)
        lines = [
            f"Against {self.against} of {self.made}: of {self.compared} figures {slower} slower,"
            f" {len(worse) - slower} less exact, {len(self.changes) - len(worse)} faster or more"
            " exact; the others differ by no more than the noise of both."
        ]
        if self.changes:
            head = ("change", "by", "noise up to", "then", "now", "what")
            lines.append(table(head, [change.row() for change in self.changes], left=(0, 5)))
        lines += [f"The machines differ: {line}." for line in self.machines]
        lines += [
            f"In {key} the machine itself took {ratio:.2f} times as long for the same work."
            for key, ratio in self.speeds.items()
            if max(ratio, 1.0 / ratio) > 1.1
        ]
        return "\n".join([*lines, *(f"not compared: {line}" for line in self.missing)])


def load_report(path: str | Path) -> dict[str, Any]:
    """Read a report that ``scripts/bench`` wrote.

    Raises:
        InputError: There is no such file, or it holds no such report.
    """
    give = "give a report.json of scripts/bench"
    try:
        report = json.loads(read_text(path, what="a report.json of scripts/bench"))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: no JSON ({error}); {give}") from error
    if not isinstance(report, dict) or report.get("benchmark") != "all":
        raise InputError(f"{path}: no report of all parts; {give}")
    if report.get("format") != FORMAT:
        raise InputError(
            f"{path}: its form is {report.get('format')!r}, expected {FORMAT}; make it anew"
        )
    return report


def compare(new: Report, old: Mapping[str, Any], against: str) -> Comparison:
    """Compare a report with an older one.

    Raises:
        InputError: The older one is damaged.
    """
    try:
        return _compare(new, old, against)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{against}: damaged: {error!r}; make it anew with scripts/bench"
        ) from error


def _compare(new: Report, old: Mapping[str, Any], against: str) -> Comparison:
    machine = old["machine"]
    result = Comparison(against, old["made"])
    for key in SAME:
        if machine[key] != new.machine[key]:
            result.machines.append(f"{key}: {machine[key]} then, {new.machine[key]} now")
    before = {part["part"]: part for part in old["parts"]}
    for part in new.parts:
        then = before.pop(part.key, None)
        if then is None:
            result.missing.append(f"{part.title}: only now")
            continue
        assert part.calibration is not None
        speed = part.calibration.median / Timing.from_dict(then["yardstick"]).median
        result.speeds[part.key] = speed
        old_methods = {(m.thing, m.title): m for m in map(Method.from_dict, then["ways"])}
        for method in part.methods:
            was = old_methods.pop((method.thing, method.title), None)
            if was is None:
                result.missing.append(f"{part.title}: {method.thing}, {method.title}: only now")
                continue
            result.compared += 2
            result.changes += _changes(part.title, was, method, speed)
        result.missing += [
            f"{part.title}: {method.thing}, {method.title}: only then"
            for method in old_methods.values()
        ]
    result.missing += [f"{part['title']}: only then" for part in before.values()]
    result.changes.sort(key=lambda change: (not change.worse, -change.size))
    return result


def _changes(part: str, was: Method, now: Method, speed: float) -> list[Change]:
    """The time and the error of one method, as far as they differ beyond the noise."""
    found = []
    scatter = _scatter(was.time) * _scatter(now.time) * max(speed, 1.0 / speed)
    noise = max(LEAST, scatter)
    ratio = now.time.median / was.time.median
    if max(ratio, 1.0 / ratio) > noise:
        times = was.time.median, now.time.median
        found.append(Change(part, now.thing, now.title, "time", *times, noise))
    worse = now.least_error > was.largest_error * (1.0 + ROUNDED)
    better = now.largest_error < was.least_error * (1.0 - ROUNDED)
    if worse or better:
        spread = 1.0
        for method in (was, now):
            if method.least_error > 0.0:
                spread *= method.largest_error / method.least_error
        found.append(Change(part, now.thing, now.title, "error", was.error, now.error, spread))
    return found


def _scatter(timing: Timing) -> float:
    """By what ratio a time scatters: between its quartiles, or twofold where it was taken once."""
    return timing.high / timing.low if timing.calls > 1 and timing.low > 0.0 else 2.0
