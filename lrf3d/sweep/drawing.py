"""The results of a sweep as figures and as a table."""

import itertools
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from lrf3d.output import Drawing
from lrf3d.render.sweep_figure import Curve, draw_sweep
from lrf3d.sweep.plan import Plan
from lrf3d.sweep.summary import INTERVAL_CONFIDENCE, MEASURES, CellMean, Mean, cell_means
from lrf3d.sweep.task import Row
from lrf3d.text import table

AXIS_LABELS = {"sigma_m": "noise σ at range_max [m]", "beams": "beams"}
"""Labels of the axes of figures."""

MOST_CURVES = 8
"""Largest number of curves in a figure; with more, further axes are averaged over."""

MOST_LINES = 60
"""Largest number of lines of a printed table; the summary has all."""

TABLE_COLUMNS = {
    "length_f1": (1.0, 3),
    "segment_f1": (1.0, 3),
    "segment_ratio": (1.0, 2),
    "perpendicular_rms": (1e3, 1),
    "object_purity": (1.0, 3),
    "object_ratio": (1.0, 2),
}
"""Measures of the printed table, with the factor of their values and the number of decimals."""


def figures_of(plan: Plan, rows: Sequence[Row], folder: Path) -> dict[str, Drawing]:
    """The figures by their titles: one for each world and each axis of numbers."""
    figures: dict[str, Drawing] = {}
    means = cell_means(plan, rows)
    for world in dict.fromkeys(cell.world for cell in plan.cells):
        mine = [mean for mean in means if mean.world == world]
        for column, values in plan.axes.items():
            if len(values) < 2 or isinstance(values[0], str | bool):
                continue
            curves, averaged = curves_of(mine, column, plan)
            words = f"{_scans(plan, world)}  ·  {plan.grid.seeds} seeds"
            words += f"  ·  mean and its {100.0 * INTERVAL_CONFIDENCE:g} % interval"
            words += (
                f"  ·  averaged over {', '.join(each.removesuffix('_m') for each in averaged)}"
                if averaged
                else ""
            )
            name = column.removesuffix("_m").replace(".", "_")
            path = folder / f"{world}_{name}.png"
            axis = AXIS_LABELS.get(column, column)
            titles = f"{world}: maps over {name}", words
            draw = partial(draw_sweep, curves, axis=axis, titles=titles)
            figures[f"{world} over {name}"] = path, draw
    return figures


def curves_of(means: Sequence[CellMean], column: str, plan: Plan) -> tuple[list[Curve], list[str]]:
    """Curves of one world over a column, and the columns that they are averaged over."""
    others = [
        name
        for name, values in plan.axes.items()
        if name not in (column, "mode") and len(values) > 1
    ]
    modes = list(dict.fromkeys(str(mean.columns["mode"]) for mean in means))
    averaged: list[str] = []
    while others and len(modes) * np.prod([len(plan.axes[name]) for name in others]) > MOST_CURVES:
        averaged.append(others.pop())
    curves = []
    for mode, *choice in itertools.product(modes, *(plan.axes[name] for name in others)):
        chosen = {"mode": mode, **dict(zip(others, choice, strict=True))}
        mine = [m for m in means if all(m.columns[name] == v for name, v in chosen.items())]
        words = ", ".join(f"{name.removesuffix('_m')} {value}" for name, value in
                          zip(others, choice, strict=True))  # fmt: skip
        curves.append(_curve(mine, column, str(mode), words))
    return curves, averaged


def _curve(means: Sequence[CellMean], column: str, mode: str, choice: str) -> Curve:
    x = sorted({float(mean.columns[column]) for mean in means})
    groups = [[mean for mean in means if mean.columns[column] == value] for value in x]
    joined = {name: [_joined([m.measures[name] for m in g]) for g in groups] for name in MEASURES}
    return Curve(
        mode,
        choice,
        tuple(x),
        {name: tuple(each.mean for each in points) for name, points in joined.items()},
        {name: tuple(each.half for each in points) for name, points in joined.items()},
    )


def _joined(means: Sequence[Mean]) -> Mean:
    """The mean of independent means."""
    if len(means) == 1:
        return means[0]
    halves = np.array([mean.half for mean in means])
    return Mean(
        float(np.mean([mean.mean for mean in means])),
        float(np.sqrt((halves**2).sum()) / len(means)),
        sum(mean.runs for mean in means),
    )


def _scans(plan: Plan, world: str) -> str:
    place = plan.places[next(cell.place for cell in plan.cells if cell.world == world)]
    count = len(place.trajectory)
    words = f"{count} scan" + ("" if count == 1 else "s")
    return f"{words} along its drive" if place.scenario.poses is None else words


def table_text(plan: Plan, rows: Sequence[Row]) -> str:
    """The means as a table: each with half of the width of its interval."""
    means = cell_means(plan, rows)
    columns = [name for name in plan.cells[0].columns if name == "mode" or name in plan.axes]
    head = (
        "world", *(name.removesuffix("_m") for name in columns), "length F1", "segment F1",
        "segments", "RMS [mm]", "purity", "objects",
    )  # fmt: skip
    lines = [
        (
            mean.world,
            *(_word(mean.columns[name]) for name in columns),
            *(_figure(mean.measures[name], *form) for name, form in TABLE_COLUMNS.items()),
        )
        for mean in means
    ]
    text = table(head, lines[:MOST_LINES])
    if len(lines) > MOST_LINES:
        text += f"\n… and {len(lines) - MOST_LINES} more in summary.json"
    return (
        f"{text}\nMean of {plan.grid.seeds} seeds ± half of its"
        f" {100.0 * INTERVAL_CONFIDENCE:g} % interval. segments: per visible wall;"
        " objects: per visible\nobject; 1 is ideal."
    )


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _figure(mean: Mean, factor: float, digits: int) -> str:
    if not np.isfinite(mean.mean):
        return "–"
    text = f"{factor * mean.mean:.{digits}f}"
    return f"{text} ± {factor * mean.half:.{digits}f}" if np.isfinite(mean.half) else text
