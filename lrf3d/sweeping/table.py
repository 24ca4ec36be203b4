"""The table of a sweep: a row for each run, and means over the seeds with their intervals."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lrf3d.errors import MissingLibraryError, missing_extra
from lrf3d.files import replacing, write_text
from lrf3d.sweeping.plan import Plan
from lrf3d.sweeping.rows import Row
from lrf3d.text import table

INTERVAL_CONFIDENCE = 0.95
"""Probability that an interval contains the mean."""


class Column(NamedTuple):
    """How a mean is written: its heading, the factor of its values, and its decimals."""

    heading: str
    factor: float
    digits: int


MEASURES = {
    "length_f1": Column("length F1", 1.0, 3),
    "segment_f1": Column("segment F1", 1.0, 3),
    "segment_ratio": Column("segments", 1.0, 2),
    "perpendicular_rms": Column("RMS [mm]", 1e3, 1),
    "object_purity": Column("purity", 1.0, 3),
    "object_ratio": Column("objects", 1.0, 2),
}
"""The measures that are averaged."""

MOST_LINES = 60
"""Largest number of lines of a printed table; the files have all."""


class Mean(NamedTuple):
    """A mean over seeds, half of the width of its interval by Student's t, and its runs.

    The mean is NaN if no run has the figure, and half of the width with fewer than two.
    """

    mean: float
    half: float
    runs: int

    @classmethod
    def of(cls, values: Sequence[float | None]) -> "Mean":
        """The mean of values; None stands for a run without the figure."""
        from scipy.stats import t

        known = np.array([value for value in values if value is not None], dtype=np.float64)
        count = len(known)
        if count < 2:
            return cls(float(known[0]) if count else np.nan, np.nan, count)
        spread = float(known.std(ddof=1)) / np.sqrt(count)
        half = float(t.ppf(0.5 + 0.5 * INTERVAL_CONFIDENCE, count - 1)) * spread
        return cls(float(known.mean()), half, count)

    def as_dict(self) -> dict[str, float | int | None]:
        """The mean in JSON's types."""
        bounds = {"mean": self.mean, "low": self.mean - self.half, "high": self.mean + self.half}
        known = {name: value if np.isfinite(value) else None for name, value in bounds.items()}
        return {**known, "runs": self.runs}

    def text(self, form: Column, sign: str = " ± ") -> str:
        """The mean with half of its interval."""
        if not np.isfinite(self.mean):
            return "–"
        mean = f"{form.factor * self.mean:.{form.digits}f}"
        if not np.isfinite(self.half):
            return mean
        return f"{mean}{sign}{form.factor * self.half:.{form.digits}f}"


class CellMean(NamedTuple):
    """The means of a combination: its world, its settings by column, its means by measure."""

    world: str
    columns: dict[str, Any]
    measures: dict[str, Mean]


@dataclass(frozen=True, eq=False)
class SweepTable:
    """The results of a sweep.

    Args:
        plan: The plan.
        rows: A row for each run that has been made, in the order of the plan.
        made: Number of runs made now; the others were kept before.

    Examples:
        >>> import lrf3d
        >>> table = lrf3d.sweep("paper_room", axes={"noise.sigma": (0.1,)}, seeds=2, workers=1)
        >>> table.means[0].columns["mapper"]
        'robust'
        >>> table.to_csv("means.csv")
    """

    plan: Plan
    rows: list[Row] = field(repr=False)
    made: int = 0

    @cached_property
    def means(self) -> list[CellMean]:
        """The means of each combination over its seeds."""
        rows_of: list[list[Row]] = [[] for _ in self.plan.cells]
        by_key = {row["key"]: row for row in self.rows}
        for run in self.plan.runs:
            if run.key in by_key:
                rows_of[run.cell].append(by_key[run.key])
        return [
            CellMean(
                cell.world,
                dict(cell.columns),
                {name: Mean.of([row[name] for row in mine]) for name in MEASURES},
            )
            for cell, mine in zip(self.plan.cells, rows_of, strict=True)
        ]

    def __repr__(self) -> str:
        return f"SweepTable({len(self.rows)} runs of {len(self.plan.cells)} settings)"

    def __str__(self) -> str:
        head, lines = self._cells(" ± ")
        text = table(head, lines[:MOST_LINES])
        if len(lines) > MOST_LINES:
            text += f"\n… and {len(lines) - MOST_LINES} more in means.csv"
        return (
            f"{text}\nMean of {self.plan.grid.seeds} seeds ± half of its"
            f" {100.0 * INTERVAL_CONFIDENCE:g} % interval. segments: per visible wall;"
            " objects: per visible\nobject; 1 is ideal."
        )

    def summary(self) -> dict[str, Any]:
        """The means with their intervals, in JSON's types: the same for the same rows."""
        return {
            "sweep": {**self.plan.grid.as_dict(), "worlds": self.plan.worlds},
            "runs": len(self.rows),
            "confidence": INTERVAL_CONFIDENCE,
            "combinations": [
                {"world": each.world, **each.columns}
                | {name: mean.as_dict() for name, mean in each.measures.items()}
                for each in self.means
            ],
        }

    def to_csv(self, path: str | Path) -> None:
        """Write the means as CSV: for each measure its mean and the ends of its interval.

        Raises:
            OutputError: The file cannot be written.
        """
        lines = []
        for each in self.means:
            line = {"world": each.world, **each.columns}
            for name, mean in each.measures.items():
                bounds = mean.as_dict()
                line |= {name: bounds["mean"], f"{name}_low": bounds["low"]}
                line |= {f"{name}_high": bounds["high"]}
            lines.append(line)
        text = StringIO()
        writer = csv.DictWriter(text, lines[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
        write_text(path, text.getvalue())

    def to_latex(self, path: str | Path) -> None:
        """Write the means as a LaTeX table, each with half of the width of its interval.

        Raises:
            OutputError: The file cannot be written.
        """
        head, lines = self._cells(r" \pm ")
        known = len(head) - len(MEASURES)
        escaped = [text.replace("_", r"\_").replace("%", r"\%") for text in head]
        rows = [
            [cell.replace("_", r"\_") for cell in line[:known]]
            + [f"${cell}$" if cell != "–" else "--" for cell in line[known:]]
            for line in lines
        ]
        body = "\n".join(" & ".join(cells) + r" \\" for cells in rows)
        write_text(
            path,
            f"\\begin{{tabular}}{{{'l' * known}{'r' * len(MEASURES)}}}\n\\hline\n"
            f"{' & '.join(escaped)} \\\\\n\\hline\n{body}\n\\hline\n\\end{{tabular}}\n",
        )

    def to_parquet(self, path: str | Path) -> None:
        """Write a row for each run as Parquet.

        Raises:
            MissingLibraryError: PyArrow is not installed.
            OutputError: The file cannot be written.
        """
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError as error:
            raise missing_parquet() from error
        with replacing(path) as unfinished:
            parquet.write_table(pyarrow.Table.from_pylist(_typed(self.rows)), unfinished)

    def _cells(self, sign: str) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """The heading and the lines of the table of means, as text."""
        varied = [name for name, values in self.plan.grid.varied.items() if len(values) > 1]
        shown = ["mapper", *(name for name in varied if name != "mapper")]
        if "sigma_m" not in shown:
            shown.append("sigma_m")
        head = ("world", *(name.removesuffix("_m") for name in shown),
                *(form.heading for form in MEASURES.values()))  # fmt: skip
        lines = [
            (each.world, *(_word(each.columns[name]) for name in shown),
             *(each.measures[name].text(form, sign) for name, form in MEASURES.items()))
            for each in self.means
        ]  # fmt: skip
        return head, lines


def missing_parquet() -> MissingLibraryError:
    """The error that explains how to install PyArrow."""
    return missing_extra("sweeps need PyArrow", "sweep")


def _typed(rows: Sequence[Row]) -> list[Row]:
    """Rows whose columns have one type each: a column with any float has only floats."""
    real = {name for row in rows for name, value in row.items() if isinstance(value, float)}
    return [
        {name: float(value) if name in real and value is not None else value
         for name, value in row.items()}
        for row in rows
    ]  # fmt: skip


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
