"""Comparing two reports of ``scripts/bench``: what became slower or less exact, beyond the noise.

A time is only called another when it differs by more than both measurements scatter and by more
than the machine's own speed, which the calibration measures, may have changed in between.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.result import Result, Row, Table, duration, figure_of, words
from benchmarks.timing import Timing
from benchmarks.whole import FORMAT, Report, name_of
from lrf3d.errors import InputError
from lrf3d.input import read_text

SAME = ("system", "processor", "cores")
"""What makes two machines the same."""

LEAST = 1.05
"""Ratio of times below which no difference is named, however quiet the machine was: where code
and data come to lie in memory alone moves times by some percent."""

ROUNDED = 1e-3
"""Relative difference of errors that other orders of summation may bring."""


CHANGES = Table(
    "changes",
    {
        "change": "change",
        "by": "by",
        "noise_ratio": ("noise up to", "{:.2f} ×".format),
        "then": "then",
        "now": "now",
        "name": "what",
    },
)
"""What differs: a time or an error of one row, then and now."""


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


def compare(new: Report, old: Mapping[str, Any], against: str) -> Result:
    """Compare a report with an older one.

    Raises:
        InputError: The older one is damaged.
    """
    try:
        return _compare(new, old, against)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{against}: damaged: {error!r}; make it anew with scripts/bench"
        ) from error


def _compare(new: Report, old: Mapping[str, Any], against: str) -> Result:
    machine, here = old["machine"], new.as_dict()["machine"]
    differ = [
        f"{key}: {machine[key]} then, {here[key]} now" for key in SAME if machine[key] != here[key]
    ]
    speeds: dict[str, float] = {}
    missing: list[str] = []
    changes: list[Row] = []
    compared = 0
    before = {part["part"]: part for part in old["parts"]}
    for key, result in new.parts.items():
        then = before.pop(key, None)
        if then is None:
            missing.append(f"{key}: only now")
            continue
        calibration = Timing.from_dict(then["calibration"])
        speed = speeds[key] = new.calibration[key].median / calibration.median
        for table, rows in result.tables.items():
            if not (table.time or table.error):
                continue
            was = {name_of(table, row): row for row in then.get(table.key, [])}
            for row in rows:
                name = name_of(table, row)
                if name not in was:
                    missing.append(f"{key}: {name}: only now")
                    continue
                compared += 1
                changes += _changes(table, was.pop(name), row, speed, f"{key}: {name}")
            missing += [f"{key}: {name}: only then" for name in was]
    missing += [f"{key}: only then" for key in before]
    changes.sort(key=lambda row: (not row["worse"], -_size(row)))
    result = Result("comparison", facts={
        "against": against,
        "made": old["made"],
        "machines_differ": differ,
        "rows_compared": compared,
        "calibration_ratio": speeds,
        "only_in_one": missing,
    })  # fmt: skip
    result.tables[CHANGES] = changes
    return result


def _changes(table: Table, was: Row, now: Row, speed: float, name: str) -> Iterator[Row]:
    """The time and the error of one row, as far as they differ beyond the noise."""
    if table.time:
        old, new = Timing.from_dict(was[table.time]), now[table.time]
        noise = max(LEAST, old.scatter * new.scatter * max(speed, 1.0 / speed))
        if not 1.0 / noise <= new.median / old.median <= noise:
            yield _change(name, "time", old.median, new.median, noise)
    then, value = figure_of(was, table.error), figure_of(now, table.error)
    if then is None or value is None:
        return
    spans = [(row.get("least_error", e), row.get("largest_error", e))
             for row, e in ((was, then), (now, value))]  # fmt: skip
    (old_least, old_largest), (least, largest) = spans
    if least > old_largest * (1.0 + ROUNDED) or largest < old_least * (1.0 - ROUNDED):
        spread = 1.0
        for low, high in spans:
            spread *= high / low if low > 0.0 else 1.0
        yield _change(name, "error", then, value, spread)


def _change(name: str, what: str, old: float, new: float, noise: float) -> Row:
    kinds = {"time": ("slower", "faster"), "error": ("less exact", "more exact")}
    show = duration if what == "time" else words
    ratio = new / old if old > 0.0 else None
    return {
        "change": kinds[what][new < old],
        "worse": new > old,
        "name": name,
        "old": old,
        "new": new,
        "ratio": ratio,
        "by": "from none" if ratio is None else f"{ratio:.3g} ×",
        "noise_ratio": noise,
        "then": show(old),
        "now": show(new),
    }


def _size(row: Row) -> float:
    """By what ratio a figure changed, in either direction."""
    ratio: float | None = row["ratio"]
    return max(ratio, 1.0 / ratio) if ratio else float("inf")


def comparison_text(comparison: Result) -> str:
    """What became slower or less exact, and what the noise hides."""
    facts, changes = comparison.facts, comparison[CHANGES]
    counts = [
        sum(row["change"] == change for row in changes) for change in ("slower", "less exact")
    ]
    lines = [
        f"Against {facts['against']} of {facts['made']}: of {facts['rows_compared']} rows"
        f" {counts[0]} slower, {counts[1]} less exact, {len(changes) - sum(counts)} faster or more"
        " exact; the others differ by no more than the noise of both."
    ]
    lines += [CHANGES.text(changes)] if changes else []
    lines += [f"The machines differ: {line}." for line in facts["machines_differ"]]
    lines += [
        f"In {key} the machine itself took {ratio:.2f} times as long for the same work."
        for key, ratio in facts["calibration_ratio"].items()
        if max(ratio, 1.0 / ratio) > 1.1
    ]
    return "\n".join([*lines, *(f"not compared: {line}" for line in facts["only_in_one"])])
