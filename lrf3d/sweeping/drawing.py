"""The figures of a sweep: one for each world and each axis of numbers."""

import itertools
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from lrf3d.render.sweep_figure import Curve, draw_sweep
from lrf3d.sweeping.table import INTERVAL_CONFIDENCE, MEASURES, CellMean, SweepTable

AXIS_LABELS = {"sigma_m": "noise σ at range_max [m]", "beams": "beams"}
"""Labels of the axes of figures."""


def figures_of(result: SweepTable) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """The figures by their titles: their files, and what draws them."""
    figures: dict[str, tuple[str, Callable[[Path], object]]] = {}
    plan = result.plan
    for world in plan.worlds:
        for column, values in plan.grid.varied.items():
            if len(values) < 2 or isinstance(values[0], str | bool):
                continue
            name = column.removesuffix("_m").replace(".", "_")
            words = f"{plan.grid.seeds} seeds  ·  mean and its {100.0 * INTERVAL_CONFIDENCE:g} %"
            draw = partial(
                draw_sweep,
                curves_of(result, world, column),
                axis=AXIS_LABELS.get(column, column),
                titles=(f"{world}: maps over {name}", f"{words} interval"),
            )
            figures[f"{world} over {name}"] = f"{world}_{name}.png", draw
    return figures


def curves_of(result: SweepTable, world: str, column: str) -> list[Curve]:
    """Curves over a column: one for each mapper and each value of the first other axis.

    Further axes have their first value.
    """
    axes = {name: each for name, each in result.plan.grid.varied.items() if name != column}
    labels = axes.pop("mapper")
    others = [name for name, values in axes.items() if len(values) > 1][:1]
    choices = list(itertools.product(labels, *(axes[name] for name in others)))
    curves = []
    for label, *choice in choices:
        wanted = {name: values[0] for name, values in axes.items()}
        wanted |= {"mapper": label, **dict(zip(others, choice, strict=True))}
        mine = [each for each in result.means if each.world == world and _has(each, wanted)]
        mine.sort(key=lambda each: float(each.columns[column]))
        words = ", ".join(f"{name.removesuffix('_m')} {value}"
                          for name, value in zip(others, choice, strict=True))  # fmt: skip
        curves.append(
            Curve(
                str(label),
                words,
                tuple(float(each.columns[column]) for each in mine),
                {name: [each.measures[name][:2] for each in mine] for name in MEASURES},
            )
        )
    return curves


def _has(each: CellMean, wanted: Mapping[str, object]) -> bool:
    return all(each.columns[name] == value for name, value in wanted.items())
