"""Summary: means over seeds with their confidence intervals, for each combination of a sweep."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.sweep.plan import Plan
from lrf3d.sweep.task import Row

INTERVAL_CONFIDENCE = 0.95
"""Probability that an interval contains the mean."""

MEASURES = (
    "length_f1", "segment_f1", "segment_ratio", "perpendicular_rms", "object_purity",
    "object_ratio",
)  # fmt: skip
"""The figures that are averaged."""


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean over seeds.

    Args:
        mean: The mean; NaN if no run has the figure.
        half: Half of the width of its confidence interval, by Student's t; NaN for fewer than two
            runs.
        runs: Runs that have the figure.
    """

    mean: float
    half: float
    runs: int

    @classmethod
    def of(cls, values: Sequence[float | None]) -> "Mean":
        """The mean of values, with its confidence interval."""
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
        low, high = self.mean - self.half, self.mean + self.half
        figures = {"mean": self.mean, "low": low, "high": high}
        known = {name: value if np.isfinite(value) else None for name, value in figures.items()}
        return {**known, "runs": self.runs}


@dataclass(frozen=True, slots=True)
class CellMean:
    """The means of a combination of settings.

    Args:
        world: Name of the world.
        columns: The settings, by column.
        measures: The means by figure.
    """

    world: str
    columns: dict[str, Any]
    measures: dict[str, Mean]


def cell_means(plan: Plan, rows: Sequence[Row]) -> list[CellMean]:
    """The means of each combination; rows are in the order of the plan."""
    rows_of: list[list[Row]] = [[] for _ in plan.cells]
    for run, row in zip(plan.runs, rows, strict=True):
        rows_of[run.cell].append(row)
    return [
        CellMean(
            cell.world,
            dict(cell.columns),
            {name: Mean.of([row[name] for row in mine]) for name in MEASURES},
        )
        for cell, mine in zip(plan.cells, rows_of, strict=True)
    ]


def summarise(plan: Plan, rows: Sequence[Row]) -> dict[str, Any]:
    """The summary in JSON's types: the same for the same rows."""
    return {
        "sweep": {**plan.grid.as_dict(), "worlds": plan.worlds},
        "runs": len(rows),
        "confidence": INTERVAL_CONFIDENCE,
        "combinations": [
            {
                "world": mean.world,
                **mean.columns,
                **{name: each.as_dict() for name, each in mean.measures.items()},
            }
            for mean in cell_means(plan, rows)
        ],
    }
