"""Comparing two reports of ``bench``: what became slower or less exact, and what the noise hides.

A time is only called another when it differs by more than both measurements scatter and by more
than the machine's own speed, which the yardstick tells, may have moved in between.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError
from lrf3d.input import read_text
from lrf3d.study.bench.part import Way
from lrf3d.study.bench.whole import FORMAT, Report
from lrf3d.study.timing import Timing

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
        noise: Ratio up to which a difference may be noise; 1 where nothing is random.
    """

    part: str
    thing: str
    way: str
    what: str
    old: float
    new: float
    noise: float

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
        kinds = {("time", True): "slower", ("time", False): "faster", ("error", True): "less exact"}
        return kinds.get((self.what, self.worse), "more exact")

    def as_dict(self) -> dict[str, Any]:
        """The change in JSON's types."""
        return {
            "part": self.part,
            "thing": self.thing,
            "way": self.way,
            "change": self.words,
            "old": self.old,
            "new": self.new,
            "ratio": self.ratio,
            "noise_ratio": self.noise,
        }


@dataclass
class Comparison:
    """What differs between two reports.

    Args:
        against: The older report.
        made: When that was made.
        machines: What differs between the machines; empty for the same one.
        compared: How many figures were compared.
        changes: Those that differ beyond the noise, the worst first.
        speeds: For each part how much longer the yardstick took now.
        missing: Ways that only one of the two reports has.
    """

    against: str
    made: str = ""
    machines: list[str] = field(default_factory=list)
    compared: int = 0
    changes: list[Change] = field(default_factory=list)
    speeds: dict[str, float] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """The comparison in JSON's types."""
        return {
            "against": self.against,
            "made": self.made,
            "machines_differ": self.machines,
            "figures_compared": self.compared,
            "changes": [change.as_dict() for change in self.changes],
            "yardstick_ratio": self.speeds,
            "only_in_one": self.missing,
        }


def load_report(path: str | Path) -> dict[str, Any]:
    """Read a report that ``lrf3d bench`` wrote.

    Raises:
        InputError: There is no such file, or it holds no such report.
    """
    try:
        report = json.loads(read_text(path, what="a report.json of lrf3d bench"))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: no JSON ({error}); give a report.json of lrf3d bench") from error
    if not isinstance(report, dict) or report.get("benchmark") != "all":
        raise InputError(f"{path}: no report of all parts; give a report.json of lrf3d bench")
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
        raise InputError(f"{against}: damaged: {error!r}; make it anew with lrf3d bench") from error


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
        pace = _timing(then["yardstick"])
        assert part.yardstick is not None
        result.speeds[part.key] = part.yardstick.median / pace.median
        ways = {_key(way): way for way in map(Way.from_dict, then["ways"])}
        for way in part.ways:
            was = ways.pop(_key(way), None)
            if was is None:
                result.missing.append(f"{part.title}: {way.thing}, {way.title}: only now")
                continue
            result.compared += 2
            result.changes += _changes(part.title, was, way, pace, part.yardstick)
        result.missing += [
            f"{part.title}: {way.thing}, {way.title}: only then" for way in ways.values()
        ]
    result.missing += [f"{part['title']}: only then" for part in before.values()]
    result.changes.sort(key=lambda change: (not change.worse, -_size(change)))
    return result


def _changes(part: str, was: Way, now: Way, pace_then: Timing, pace_now: Timing) -> list[Change]:
    """The time and the error of one way, as far as they differ beyond the noise."""
    found = []
    moved = pace_now.median / pace_then.median
    noise = max(
        LEAST,
        _scatter(was.timing) * _scatter(now.timing) * max(moved, 1.0 / moved),
    )
    ratio = now.timing.median / was.timing.median
    if max(ratio, 1.0 / ratio) > noise:
        found.append(
            Change(part, now.thing, now.title, "time", was.timing.median, now.timing.median, noise)
        )
    (low, high), (least, largest) = was.error_range, now.error_range
    worse, better = least > high * (1.0 + ROUNDED), largest < low * (1.0 - ROUNDED)
    if worse or better:
        spread = (high / low if low > 0.0 else 1.0) * (largest / least if least > 0.0 else 1.0)
        found.append(Change(part, now.thing, now.title, "error", was.error, now.error, spread))
    return found


def _scatter(timing: Timing) -> float:
    """By what ratio a time scatters: between its quartiles, or twofold where it was taken once."""
    return timing.high / timing.low if timing.calls > 1 and timing.low > 0.0 else 2.0


def _timing(table: Mapping[str, Any]) -> Timing:
    return Timing(table["median_s"], table["low_s"], table["high_s"], table["calls"])


def _key(way: Way) -> tuple[str, str]:
    return way.thing, way.title


def _size(change: Change) -> float:
    ratio = change.ratio
    return float("inf") if ratio is None or ratio == 0.0 else max(ratio, 1.0 / ratio)
