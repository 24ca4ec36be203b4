"""What benchmarks measure, in one set of types: methods, savings, ratios, and results of them.

The names of fields are those in JSON.
"""

import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from benchmarks.panels import Rows, draw_panels
from benchmarks.text import duration, times_words
from lrf3d.cores import core_count
from lrf3d.tables import table


@dataclass(frozen=True, slots=True)
class Saving:
    """What skipping one piece of work saves: the time without it and with it [s]."""

    name: str
    skipped: float
    done: float

    def as_dict(self) -> dict[str, Any]:
        return {
            "skipped_work": self.name,
            "skipped_s": self.skipped,
            "done_s": self.done,
            "saved_share": 1.0 - self.skipped / self.done,
        }


@dataclass(frozen=True, slots=True)
class Ratio:
    """A ratio of two measured figures, beside the bound that it is meant to keep to.

    Args:
        name: What is divided by what.
        value: The ratio.
        bound: What it is meant to keep to.
        at_least: Whether the bound is the least that it may be, else the most.
    """

    name: str
    value: float
    bound: float
    at_least: bool = False

    @property
    def kept(self) -> bool:
        """Whether the ratio keeps to its bound."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    def as_dict(self) -> dict[str, Any]:
        return {
            "ratio": self.name,
            "value": self.value,
            "bound": self.bound,
            "sense": "at least" if self.at_least else "at most",
            "kept": self.kept,
        }


def system_load() -> float | None:
    """Processes that ran or waited in the last minute, where the system reports it."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


@dataclass(kw_only=True)
class Result:
    """What one benchmark measured; each benchmark adds fields, tables, and a picture.

    Args:
        ratios: What is promised, as far as it was measured.
        savings: What each piece of skipped work saves.
        skipped: What was left out, and why.
        load: Processes of others before the start, on average.
        took_s: How long all took [s].
    """

    benchmark: ClassVar[str]
    ratios: list[Ratio] = field(default_factory=list)
    savings: list[Saving] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    load: float | None = field(default_factory=system_load)
    took_s: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        found = {each.name: as_json(getattr(self, each.name)) for each in fields(self)}
        machine = {**this_machine(), "load": found.pop("load")}
        return {"benchmark": self.benchmark, "machine": machine, **self.facts(), **found}

    def facts(self) -> dict[str, Any]:
        """What else the JSON says."""
        return {}

    def tables(self) -> Iterable[str]:
        """Tables with what each column means, as far as there is something in them."""
        return ()

    def panels(self) -> tuple[Rows, tuple[str, str]]:
        """Rows of panels of its picture, with a headline and the line below it."""
        raise NotImplementedError

    def text(self) -> str:
        """The result for people."""
        parts = [*self.tables(), ratio_table(self.ratios), saving_table(self.savings)]
        parts.append("\n".join(f"left out: {line}" for line in self.skipped))
        return "\n\n".join([part for part in parts if part] + [f"took {self.took_s:.0f} s"])

    def draw(self, path: Path) -> None:
        """Draw the picture.

        Raises:
            OutputError: It cannot be written.
        """
        rows, titles = self.panels()
        draw_panels(rows, path, titles=titles)


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


def ratio_table(ratios: Sequence[Ratio]) -> str:
    """What a benchmark promises, as measured; nothing where it promises nothing."""
    rows = [
        (
            ratio.name,
            f"{ratio.value:.2f}",
            f"{'≥' if ratio.at_least else '≤'} {ratio.bound:g}",
            "" if ratio.kept else "missed",
        )
        for ratio in ratios
    ]
    return table(("ratio", "measured", "meant", ""), rows) if rows else ""


def saving_table(savings: Sequence[Saving]) -> str:
    """What skipping work saves; nothing where nothing was measured."""
    rows = [
        (each.name, duration(each.skipped), duration(each.done),
         times_words(each.done / each.skipped))
        for each in savings
    ]  # fmt: skip
    return table(("work that is skipped", "skipped", "done", "saves"), rows) if rows else ""
