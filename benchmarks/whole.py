"""``scripts/bench``: run time against error for everything that lrf3d does, in one report.

The parts run one after the other, each with its share of the time. Before and after each a fixed
piece of work is timed, the calibration: it shows how fast the machine was just then, which is what
two reports of the same code differ by.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from benchmarks.parts import PARTS, Extent, Part, Progress
from benchmarks.results import as_json, saving_table, system_load, this_machine
from benchmarks.text import duration, error_words, left_out_lines, quartiles
from benchmarks.timing import Timing
from lrf3d.errors import MissingLibraryError
from lrf3d.tables import table

SECONDS = 510.0
"""Time for all [s], where none is given: with what has begun then, all is done in ten
minutes, also where others work on the machine."""

FORMAT = 1
"""Version of the form of the report."""

PACES = 16
"""Times that the calibration is done before a part, and after it."""


@dataclass
class Report:
    """What all parts measured.

    Args:
        parts: The parts that ran, in their order.
        left_out: For each part that could not run, why.
        machine: Where it ran.
        made: When, as ISO 8601.
        took: How long all took [s].
    """

    parts: list[Part] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=dict)
    made: str = ""
    took: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        found: dict[str, Any] = as_json(
            {
                "benchmark": "all",
                "format": FORMAT,
                "made": self.made,
                "machine": self.machine,
                "parts": self.parts,
                "left_out": self.left_out,
                "took_s": self.took,
            }
        )
        return found

    def text(self) -> str:
        """The methods that lrf3d uses by default, what is skipped, and what was left out."""
        head = ("part", "default", "time", "quartiles", "error", "unit of the error")
        rows = [
            (
                f"{part.key}: {method.thing}",
                method.title,
                duration(method.time.median),
                quartiles(method.time.low, method.time.high),
                error_words(method.error),
                part.error,
            )
            for part in self.parts
            for method in part.methods
            if method.default
        ]
        savings = [saving for part in self.parts for saving in part.savings]
        left_out = [f"left out: {key}: {why}" for key, why in self.left_out.items()]
        left_out += [
            f"left out: {part.key}: {line}"
            for part in self.parts
            for line in left_out_lines(part.skipped)
        ]
        parts = [table(head, rows), saving_table(savings), "\n".join(left_out)]
        return "\n\n".join([part for part in parts if part] + [f"took {self.took:.0f} s"])


def bench_all(
    *,
    seconds: float = SECONDS,
    chosen: Sequence[str] = tuple(PARTS),
    extent: Extent | None = None,
    progress: Progress = lambda done, total: None,
) -> Report:
    """Run parts one after the other; what the machine lacks is left out and named.

    Args:
        seconds: Time for all [s]; what has begun is finished.
        chosen: Names of the parts.
        extent: How much they measure; the usual where not given.
        progress: Called with the thousandths of all that are done, and 1000.
    """
    begin = time.monotonic()
    extent = Extent() if extent is None else extent
    machine = {**this_machine(), "load": system_load()}
    report = Report(machine=machine, made=datetime.now(UTC).isoformat(timespec="seconds"))
    shares = {key: share for key, (_, share) in PARTS.items() if key in chosen}
    done, total = 0.0, sum(shares.values())

    def step(share: float, steps: int, of: int) -> None:
        progress(round(1000 * (done + share * steps / max(1, of)) / total), 1000)

    for key, share in shares.items():
        # What a part left over, or used too much, is shared by those that follow.
        left = seconds - (time.monotonic() - begin)
        before, start = _paces(), time.monotonic()
        try:
            given = max(1.0, left * share / (total - done))
            part = PARTS[key][0](given, extent, partial(step, share))
            calibration = Timing.of(before + _paces())
            took = time.monotonic() - start
            report.parts.append(replace(part, took=took, calibration=calibration))
        except MissingLibraryError as error:
            report.left_out[key] = str(error)
        step(share, 1, 1)
        done += share
    report.took = time.monotonic() - begin
    return report


def _paces() -> list[float]:
    """Times [s] of a fixed piece of work, half of it Python's and half of it NumPy's."""
    numbers = np.random.default_rng(0).random(60_000)
    spent = []
    for _ in range(PACES):
        start = time.perf_counter()
        math.fsum(math.sin(number) for number in range(20_000))
        np.sort(numbers)
        spent.append(time.perf_counter() - start)
    return spent
