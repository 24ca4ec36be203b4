"""Results: what a benchmark measures, as rows of named figures, in tables for eyes and programs.

A row is a dict. The ending of a name is the unit of its figure: ``_s`` [s], ``_m`` [m], ``_share``
of 1, ``_bytes``. A `Table` says which figures of its rows are printed, and which of them are the
time and the error by which two methods, or two days, are compared. Tables on the terminal and on
pages, JSON, charts and comparisons are all made of the same rows.
"""

import math
import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.timing import Timing
from lrf3d.cores import core_count
from lrf3d.text import table as text_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]
Format = Callable[[Any], str]

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
"""Units of time [s]."""


BUSY = 0.5
"""Processes of others, on average, above which figures of all cores are too low to be trusted."""


@dataclass(frozen=True, eq=False)
class Table:
    """What the rows of one table hold.

    Args:
        key: Its name in JSON.
        columns: Figures that are printed, with their heads; a head may come with what writes the
            figure, where its unit does not say it. The figure ``a.b`` is b of the figure a.
        note: What else a reader needs to know.
        names: Figures that together name a row.
        time: Name of the time by which rows are compared, a Timing.
        error: Name of the error by which rows are compared.
        left: How many of the first columns hold words, aligned to the left.
    """

    key: str
    columns: Mapping[str, str | tuple[str, Format]]
    note: str = ""
    names: tuple[str, ...] = ()
    time: str = ""
    error: str = ""
    left: int = 1

    def cells(self, row: Row) -> list[str]:
        """A row in words."""
        found = []
        for name, head in self.columns.items():
            value = figure_of(row, name)
            write = written(name) if isinstance(head, str) else head[1]
            found.append("" if value is None else write(value))
        return found

    def grid(self, rows: Sequence[Row]) -> tuple[list[str], list[list[str]], int]:
        """Heads, cells, and how many columns hold words; columns without a figure are left out."""
        cells = list(map(self.cells, rows))
        kept = [k for k in range(len(self.columns)) if any(row[k] for row in cells)]
        heads = [head if isinstance(head, str) else head[0] for head in self.columns.values()]
        words = sum(k < self.left for k in kept)
        return [heads[k] for k in kept], [[row[k] for k in kept] for row in cells], words

    def text(self, rows: Sequence[Row]) -> str:
        """Rows for the terminal; nothing where there is none."""
        if not rows:
            return ""
        heads, cells, left = self.grid(rows)
        made = text_table(heads, cells, left=range(left))
        return f"{made}\n\n{self.note}" if self.note else made


SAVINGS = Table(
    "savings",
    {"skipped_work": "work that is skipped", "skipped_s": "skipped", "done_s": "done",
     "times": ("saves", lambda times: times_words(times))},
)  # fmt: skip
"""What skipping a piece of work saves: the time without it and with it."""

RATIOS = Table(
    "ratios",
    {"ratio": "ratio", "value": ("measured", "{:.2f}".format), "sense": "meant",
     "bound": ("", "{:g}".format), "kept": ("", lambda kept: "" if kept else "missed")},
)  # fmt: skip
"""Figures beside the bounds that they are meant to keep to."""


@dataclass
class Result:
    """What one benchmark measured.

    Args:
        benchmark: Its name in JSON.
        question: What it asks.
        facts: What else JSON says.
        chart: Draws its picture.
        tables: The rows of each table, in the order in which they are printed.
        skipped: What was left out, as ``WHAT: WHY``.
        load: Processes of others before the start, on average, where the system reports it.
        took_s: How long all took [s].
    """

    benchmark: str
    question: str = ""
    facts: Row = field(default_factory=dict)
    chart: Callable[["Result"], "Figure"] | None = None
    tables: dict[Table, list[Row]] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    load: float | None = field(
        default_factory=lambda: os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    )
    took_s: float = 0.0

    def add(self, table: Table, **figures: Any) -> None:
        """Add a row to a table."""
        self.tables.setdefault(table, []).append(figures)

    def save(self, name: str, skipped: float, done: float) -> None:
        """Add what skipping a piece of work saves: the time without it and with it [s]."""
        self.add(SAVINGS, skipped_work=name, skipped_s=skipped, done_s=done,
                 saved_share=1.0 - skipped / done, times=done / skipped)  # fmt: skip

    def promise(self, name: str, value: float, bound: float, *, at_least: bool = False) -> None:
        """Add a figure with the bound that it is meant to keep to."""
        kept = value >= bound if at_least else value <= bound
        sense = "at least" if at_least else "at most"
        self.add(RATIOS, ratio=name, value=value, bound=bound, sense=sense, kept=kept)

    def __getitem__(self, table: Table) -> list[Row]:
        return self.tables.get(table, [])

    def as_dict(self) -> dict[str, Any]:
        """The result in JSON's types."""
        found: dict[str, Any] = as_json(
            {
                "benchmark": self.benchmark,
                "machine": {**this_machine(), "load": self.load},
                **self.facts,
                "ratios": self[RATIOS],
                "savings": self[SAVINGS],
                **{table.key: rows for table, rows in self.tables.items()},
                "skipped": self.skipped,
                "took_s": self.took_s,
            }
        )
        return found

    def text(self) -> str:
        """The result for people."""
        parts = [table.text(rows) for table, rows in self.tables.items()]
        parts.append("\n".join(f"left out: {line}" for line in left_out_lines(self.skipped)))
        if self.load is not None and self.load > BUSY:
            parts.append(
                f"Others used this machine (load {self.load:.1f} before the start): the rates on"
                " all cores are too low."
            )
        return "\n\n".join([part for part in parts if part] + [f"took {self.took_s:.0f} s"])


def figure_of(row: Row, name: str) -> Any:
    """A figure of a row by its name; a name with dots goes into figures that are rows."""
    value: Any = row
    for part in name.split("."):
        if value is not None:
            value = value.get(part) if isinstance(value, Mapping) else getattr(value, part)
    return value


def written(name: str) -> Format:
    """What writes a figure with the unit that its name ends with."""
    units: dict[str, Format] = {
        "s": duration, "m": metres, "share": percent, "bytes": megabytes,
    }  # fmt: skip
    return units.get(name.rpartition("_")[2], words)


def words(value: Any) -> str:
    """A figure without a unit, a time, a span of times, or a word."""
    if isinstance(value, Timing):
        return duration(value.median)
    if isinstance(value, tuple):
        return "–".join(map(duration, value))
    if isinstance(value, bool):
        return "default" if value else ""
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    return "none" if value == 0.0 else value if isinstance(value, str) else f"{value:.3g}"


def duration(seconds: float, digits: int = 3) -> str:
    """A time with some digits, in the unit that suits it."""
    # A little less than a unit is one: ticks of logarithmic axes are rounded.
    unit, name = next((u for u in UNITS if seconds >= 0.999 * u[0]), UNITS[-1])
    value = seconds / unit
    # Rounded by hand: %g would write 480 with two digits as 4.8e+02.
    value = round(value, digits - 1 - math.floor(math.log10(value))) if value > 0.0 else value
    return f"{value:g} {name}"


def metres(length: float) -> str:
    """An error [m] with two digits."""
    return "exact" if length == 0.0 else f"{length:.1e} m"


def percent(share: float) -> str:
    """A share in percent; none is a plain 0."""
    return "0" if share == 0.0 else f"{100.0 * share:.4g} %"


def megabytes(size: float) -> str:
    """A size of memory."""
    return f"{size / 1e6:.1f} MB"


def times_words(ratio: float) -> str:
    """How many times as much, with three digits."""
    return f"{ratio:,.0f} ×" if ratio >= 100.0 else f"{ratio:.3g} ×"


def left_out_lines(lines: Iterable[str]) -> list[str]:
    """What was left out, as ``WHAT: WHY``, with all that one reason holds for in one line."""
    whys: dict[str, list[str]] = {}
    for line in lines:
        what, _, why = line.rpartition(": ")
        whys.setdefault(why, []).append(what)
    return [f"{', '.join(dict.fromkeys(whats))}: {why}" for why, whats in whys.items()]


def as_json(value: Any) -> Any:
    """A value in JSON's types: the fields of a dataclass by their names, None where NaN stands."""
    if hasattr(value, "as_dict"):
        return as_json(value.as_dict())
    if is_dataclass(value):
        return {each.name: as_json(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {name: as_json(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(each) for each in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and math.isnan(value) else value


def this_machine() -> dict[str, Any]:
    """What a comparison should know of the machine."""
    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": core_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _processor() -> str:
    """The processor's name, where the system reports it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
