"""``scripts/bench``: run time against error for everything that lrf3d does, in one report.

The parts run one after the other, each with its share of the time. Before and after each a fixed
piece of work is timed, the calibration: it shows how fast the machine was just then, which is what
two reports of the same code differ by.
"""

import math
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.page import Html, figures, note, page, result_section, section
from benchmarks.result import (
    SAVINGS,
    Result,
    Row,
    Table,
    as_json,
    figure_of,
    left_out_lines,
    this_machine,
    words,
)
from benchmarks.timing import Timing, timed
from lrf3d.errors import MissingLibraryError
from lrf3d.progress import Progress, silent

SECONDS = 510.0
"""Time for all [s], if none is given: with what has begun then, all is done in ten
minutes, also where others work on the machine."""

FORMAT = 2
"""Version of the form of the report."""

PACES = 16
"""Times that the calibration is done before a part, and after it."""

DEFAULTS = Table(
    "defaults",
    {"part": "part", "name": "default", "time": "time", "time.quartiles": "quartiles",
     "error": ("error", words), "unit": "which error"},
    left=2,
)  # fmt: skip
"""The methods that lrf3d uses by default."""


def _part(module: str, name: str, **how: Any) -> Callable[[float, Progress], Result]:
    """A benchmark whose module is imported when it runs."""

    def measure(seconds: float, progress: Progress) -> Result:
        bench = getattr(import_module(f"benchmarks.{module}"), name)
        result: Result = bench(seconds=seconds, progress=progress, **how)
        return result

    return measure


def _frames(seconds: float, progress: Progress) -> Result:
    """Frames of films; without OpenGL an error says what is missing."""
    from lrf3d.render.gl import require_gl

    require_gl()
    return _part("render.benchmark", "bench_render", with_ablation=True)(seconds, progress)


PARTS: dict[str, tuple[Callable[[float, Progress], Result], float]] = {
    "ranges": (_part("scan.benchmark", "bench_scan", with_ablation=True), 0.25),
    "maps": (_part("map.benchmark", "bench_map", sizes=(100, 1_000, 10_000), towns=(1_000,)), 0.36),
    "poses": (_part("drive", "bench_drive"), 0.15),
    "frames": (_frames, 0.24),
}
"""The parts in their order, each with its share of the time."""


@dataclass
class Report:
    """What all parts measured.

    Args:
        parts: The results of the parts that ran, in their order, by their names.
        calibration: For each of them, the time of a fixed piece of work around it.
        left_out: For each part that could not run, why.
        load: Processes of others before the start, on average.
        made: When, as ISO 8601.
        took: How long all took [s].
    """

    parts: dict[str, Result] = field(default_factory=dict)
    calibration: dict[str, Timing] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    load: float | None = None
    made: str = ""
    took: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """The report in JSON's types."""
        found: dict[str, Any] = as_json(
            {
                "benchmark": "all",
                "format": FORMAT,
                "made": self.made,
                "machine": {**this_machine(), "load": self.load},
                "parts": [
                    {"part": key, "calibration": self.calibration[key], **result.as_dict()}
                    for key, result in self.parts.items()
                ],
                "left_out": self.left_out,
                "took_s": self.took,
            }
        )
        return found

    def defaults(self) -> list[Row]:
        """The methods that lrf3d uses by default, each with its time and its error."""
        return [
            {
                "part": key,
                "name": name_of(table, row),
                "time": row[table.time],
                "error": figure_of(row, table.error),
                "unit": re.sub("_m$", " [m]", table.error).replace("_", " "),
            }
            for key, result in self.parts.items()
            for table, rows in result.tables.items()
            for row in rows
            if row.get("default") and table.time
        ]

    def text(self) -> str:
        """The methods that lrf3d uses by default, what is skipped, and what was left out."""
        savings = [row for result in self.parts.values() for row in result[SAVINGS]]
        left_out = [f"left out: {key}: {why}" for key, why in self.left_out.items()] + [
            f"left out: {key}: {line}"
            for key, result in self.parts.items()
            for line in left_out_lines(result.skipped)
        ]
        parts = [DEFAULTS.text(self.defaults()), SAVINGS.text(savings), "\n".join(left_out)]
        return "\n\n".join([part for part in parts if part] + [f"took {self.took:.0f} s"])

    def page(self) -> str:
        """The report as a page."""
        machine = this_machine()
        busy = "" if self.load is None else f" · {self.load:.1f} processes of others at the start"
        return page(
            "Run time against error",
            "scripts/bench",
            "Whatever lrf3d does is timed, and compared with what is exact. A ring, and a row in"
            " bold, is what it does by default.",
            [
                note(
                    f"{machine['processor']} · {machine['cores']} cores · {machine['system']} ·"
                    f" Python {machine['python']}, NumPy {machine['numpy']}{busy}"
                ),
                section("defaults", "Defaults", figures(DEFAULTS, self.defaults())),
                *(result_section(key, result) for key, result in self.parts.items()),
                *(
                    section(key, key.capitalize(), note(f"Left out: {why}"))
                    for key, why in self.left_out.items()
                ),
            ],
            Html(
                f"Made {self.made} in {self.took:.0f} s. Times are medians of calls that the"
                " methods make in turn, so that what slows the machine slows all alike; bars are"
                " quartiles. All figures stand in <code>report.json</code>;"
                " <code>scripts/bench --compare report.json</code> prints what has changed since."
            ),
        )


def name_of(table: Table, row: Row) -> str:
    """What a row measured, in words."""
    named = (figure_of(row, name) for name in table.names)
    return ", ".join(str(name) for name in named if name not in ("", None))


def bench_all(
    *,
    seconds: float = SECONDS,
    chosen: Sequence[str] = tuple(PARTS),
    progress: Progress = silent,
) -> Report:
    """Run parts one after the other; what the machine lacks is left out and named.

    Args:
        seconds: Time for all [s]; what has begun is finished.
        chosen: Names of the parts.
        progress: Called with the thousandths of all that are done, and 1000.
    """
    begin = time.monotonic()
    report = Report(load=Result("all").load, made=datetime.now(UTC).isoformat(timespec="seconds"))
    shares = {key: share for key, (_, share) in PARTS.items() if key in chosen}
    done, total = 0.0, sum(shares.values())

    def step(share: float, steps: int, of: int) -> None:
        progress(round(1000 * (done + share * steps / max(1, of)) / total), 1000)

    for key, share in shares.items():
        # What a part left over, or used too much, is shared by those that follow.
        left = seconds - (time.monotonic() - begin)
        before = _paces()
        try:
            given = max(1.0, left * share / (total - done))
            result = PARTS[key][0](given, partial(step, share))
            report.parts[key] = result
            report.calibration[key] = Timing.of(before + _paces())
        except MissingLibraryError as error:
            report.left_out[key] = str(error)
        step(share, 1, 1)
        done += share
    report.took = time.monotonic() - begin
    return report


def _paces() -> list[float]:
    """Times [s] of a fixed piece of work, half of it Python's and half of it NumPy's."""
    numbers = np.random.default_rng(0).random(60_000)

    def work() -> None:
        math.fsum(math.sin(number) for number in range(20_000))
        np.sort(numbers)

    return [timed(work) for _ in range(PACES)]
