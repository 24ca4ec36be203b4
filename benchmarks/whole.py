"""``bench``: run time against error for everything that lrf3d does, in one report.

The parts run one after the other, each with its share of the time. Before and after each a fixed
piece of work is timed, the yardstick: it tells how fast the machine was just then, which is what
two reports of the same code differ by.
"""

import math
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from lrf3d.cores import core_count
from lrf3d.errors import MissingLibraryError
from lrf3d.study.bench.part import Part
from lrf3d.study.bench.parts import PARTS, Extent
from lrf3d.study.timing import Timing

SECONDS = 510.0
"""Time for all [s], where none is given: with what has begun then, all is done in ten
minutes, also where others work on the machine."""

FORMAT = 1
"""Version of the form of the report."""

PACES = 16
"""Times that the yardstick is laid on before a part, and after it."""


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
        """The report in JSON's types."""
        return {
            "benchmark": "all",
            "format": FORMAT,
            "made": self.made,
            "machine": self.machine,
            "parts": [part.as_dict() for part in self.parts],
            "left_out": self.left_out,
            "took_s": self.took,
        }


def bench_all(
    *,
    seconds: float = SECONDS,
    chosen: Sequence[str] = tuple(PARTS),
    extent: Extent | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
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
    report = Report(machine=this_machine(), made=datetime.now(UTC).isoformat(timespec="seconds"))
    shares = {key: share for key, (_, share) in PARTS.items() if key in chosen}
    done, total = 0.0, sum(shares.values())
    for key, share in shares.items():
        # What a part left over, or used too much, is shared by those that follow.
        left = seconds - (time.monotonic() - begin)
        step = partial(_step, progress, done / total, share / total)
        try:
            given = max(1.0, left * share / (total - done))
            report.parts.append(_run(PARTS[key][0], given, extent, step))
        except MissingLibraryError as error:
            report.left_out[key] = str(error)
        done += share
        step(1, 1)
    report.took = time.monotonic() - begin
    return report


def _run(
    measure: Callable[[float, Extent, Callable[[int, int], None]], Part],
    seconds: float,
    extent: Extent,
    step: Callable[[int, int], None],
) -> Part:
    """Measure a part, with the yardstick laid on before and after it."""
    before, start = _paces(), time.monotonic()
    part = measure(seconds, extent, step)
    took = time.monotonic() - start
    return replace(part, took=took, yardstick=Timing.of(before + _paces()))


def _step(
    progress: Callable[[int, int], None], begin: float, share: float, done: int, total: int
) -> None:
    """Tell the progress of all from that of a part."""
    progress(round(1000 * (begin + share * done / max(1, total))), 1000)


def this_machine() -> dict[str, Any]:
    """What a comparison should know of the machine, and of what others did on it."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": core_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def _processor() -> str:
    """The processor's name, where the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


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
