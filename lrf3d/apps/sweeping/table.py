"""The table of a sweep: a row for each run, means over the seeds with intervals, and figures."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.apps.sweeping.plan import Row, SweepPlan
from lrf3d.base.errors import one_line
from lrf3d.base.files import folder_name, write_text
from lrf3d.base.text import counted, table
from lrf3d.geometry.lines import CONFIDENCE

# The measures that are averaged: their headings, the factors of their values, their decimals.
MEASURES = {
    "length_f1": ("length F1", 1.0, 3),
    "segment_f1": ("segment F1", 1.0, 3),
    "segment_ratio": ("segments", 1.0, 2),
    "perpendicular_rms": ("RMS [mm]", 1000, 1),
    "object_purity": ("purity", 1.0, 3),
    "object_ratio": ("objects", 1.0, 2),
}

# Labels of the axes of figures.
AXIS_LABELS = {"sigma_m": "noise σ at range_max [m]", "beams": "beams"}


def mean_of(values: Sequence[float | None]) -> dict[str, float | int | None]:
    """The mean over seeds with the ends of its interval by Student's t, in JSON's types.

    None stands for a run without the figure, for the mean of none, and for the interval of one.
    """
    from scipy.stats import t

    known = np.array([value for value in values if value is not None])
    count = len(known)
    if not count:
        return {"mean": None, "low": None, "high": None, "runs": 0}
    mean = float(known.mean())
    if count == 1:
        return {"mean": mean, "low": None, "high": None, "runs": 1}
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1) * known.std(ddof=1) / np.sqrt(count))
    return {"mean": mean, "low": mean - half, "high": mean + half, "runs": count}


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
        >>> table.means[0]["mapper"], table.means[0]["length_f1"]["mean"] > 0.9
        ('robust', True)
        >>> table.to_csv("means.csv")
    """

    plan: SweepPlan
    rows: list[Row] = field(repr=False)
    made: int = 0

    @cached_property
    def means(self) -> list[Row]:
        """The columns of each combination, and of each measure the mean over the seeds.

        A mean is a dict: ``mean``, ``low`` and ``high``, the ends of its interval, and ``runs``.
        """
        groups: dict[tuple[Any, ...], list[Row]] = {}
        for row in self.rows:
            groups.setdefault(tuple(row[name] for name in self.plan.columns), []).append(row)
        return [
            dict(zip(self.plan.columns, values, strict=True))
            | {name: mean_of([row[name] for row in rows]) for name in MEASURES}
            for values, rows in groups.items()
        ]

    def __repr__(self) -> str:
        return f"SweepTable({len(self.rows)} runs of {len(self.means)} settings)"

    def __str__(self) -> str:
        seeds = counted(self.plan.seeds, "seed")
        return (
            f"{table(*self._cells(' ± '))}\nMean of {seeds} ± half of its {100 * CONFIDENCE:g} %"
            " interval. segments: per visible wall; objects: per visible\nobject; 1 is ideal."
        )

    def summary(self) -> dict[str, Any]:
        """The means with their intervals, in JSON's types: the same for the same rows."""
        varied = {name: list(values) for name, values in self.plan.varied.items()}
        return {
            "sweep": {"worlds": self.plan.worlds, **varied, "seeds": self.plan.seeds},
            "runs": len(self.rows),
            "confidence": CONFIDENCE,
            "combinations": self.means,
        }

    def to_csv(self, path: str | Path) -> None:
        """Write the means as CSV: for each measure its mean and the ends of its interval."""
        ends = {"mean": "", "low": "_low", "high": "_high"}
        flat = [
            {name: each[name] for name in self.plan.columns}
            | {f"{name}{end}": each[name][key] for name in MEASURES for key, end in ends.items()}
            for each in self.means
        ]
        _write_csv(flat, path)

    def runs_to_csv(self, path: str | Path) -> None:
        """Write a row for each run as CSV, in the order of the plan."""
        _write_csv(self.rows, path)

    def to_latex(self, path: str | Path) -> None:
        """Write the means as a LaTeX table, each with half of the width of its interval."""
        head, lines = self._cells(r" \pm ")
        known = len(head) - len(MEASURES)
        columns = "l" * known + "r" * len(MEASURES)
        text = [rf"\begin{{tabular}}{{{columns}}}", r"\hline"]
        text += [" & ".join(map(_in_latex, head)) + r" \\", r"\hline"]
        for line in lines:
            figures = [f"${cell}$" if cell != "–" else "--" for cell in line[known:]]
            text.append(" & ".join([*map(_in_latex, line[:known]), *figures]) + r" \\")
        write_text(path, "\n".join([*text, r"\hline", r"\end{tabular}", ""]))

    def _cells(self, sign: str) -> tuple[list[str], list[list[str]]]:
        varied = [name for name, values in self.plan.varied.items() if len(values) > 1]
        shown = list(dict.fromkeys(["world", "mapper", *varied, "sigma_m"]))
        lines = []
        for row in self.means:
            values = [row[name] for name in shown]
            line = [f"{each:g}" if isinstance(each, float) else str(each) for each in values]
            for name, (_, factor, digits) in MEASURES.items():
                line.append(_scaled(row[name]["mean"], row[name]["high"], factor, digits, sign))
            lines.append(line)
        head = [name.removesuffix("_m") for name in shown]
        return head + [heading for heading, *_ in MEASURES.values()], lines


def _scaled(mean: float | None, high: float | None, factor: float, digits: int, sign: str) -> str:
    """A mean and half of its interval in other units, as far as they are known."""
    values = () if mean is None else (mean,) if high is None else (mean, high - mean)
    return sign.join(f"{factor * each:.{digits}f}" for each in values) or "–"


def _in_latex(words: str) -> str:
    """Words that a file may have given, as LaTeX prints them: none of them is a command."""
    return one_line(words, len(words)).translate(_LATEX)


# The characters that mean something to LaTeX, and what prints them.
_LATEX = str.maketrans(
    {each: rf"\{each}" for each in "&%$#_{}"}
    | {each: f"{{{each}}}" for each in "[]*"}  # Behind a row's end they are an argument.
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)


def _write_csv(lines: Sequence[Row], path: str | Path) -> None:
    def cell(value: Any) -> Any:
        # Spreadsheets run a text that begins like a formula.
        formula = isinstance(value, str) and value.lstrip()[:1] in tuple("=+-@|%＝＋－＠")
        return f"'{value}" if formula else value

    text = StringIO()
    writer = csv.DictWriter(text, lines[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: cell(each) for key, each in row.items()} for row in lines)
    write_text(path, text.getvalue())


def figures_of(result: SweepTable) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """The figures by their titles: their files, and what draws them.

    They have a curve for each mapper and each value of the first other axis; further axes have
    their first value.
    """
    from lrf3d.studio.figures.sweep_figure import draw_sweep

    figures: dict[str, tuple[str, Callable[[Path], object]]] = {}
    plan = result.plan
    varied = {name: each for name, each in plan.varied.items() if len(each) > 1}
    seeds = f"{plan.seeds} seeds  ·  mean and its {100 * CONFIDENCE:g} % interval"
    numbers = [name for name in varied if not isinstance(varied[name][0], str | bool)]
    for world, column in product(plan.worlds, numbers):
        others = [name for name in varied if name not in (column, "mapper")]
        fixed = {"world": world, **{other: varied[other][0] for other in others[1:]}}
        name = column.removesuffix("_m").replace(".", "_")
        draw = partial(
            draw_sweep,
            [mean for mean in result.means if fixed.items() <= mean.items()],
            column=column,
            choices=others[:1],
            axis=AXIS_LABELS.get(column, column),
            titles=(f"{world}: maps over {name}", seeds),
        )
        figures[f"{world} over {name}"] = f"{folder_name(world)}_{folder_name(name)}.png", draw
    return figures
