"""The figures of a sweep: one for each world and each axis of numbers."""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

from lrf3d.render.sweep_figure import Curve, draw_sweep
from lrf3d.sweeping.table import INTERVAL_CONFIDENCE, MEASURES, SweepTable

AXIS_LABELS = {"sigma_m": "noise σ at range_max [m]", "beams": "beams"}
"""Labels of the axes of figures."""


def figures_of(result: SweepTable) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """The figures by their titles: their files, and what draws them."""
    figures: dict[str, tuple[str, Callable[[Path], object]]] = {}
    for world, (column, values) in product(result.plan.worlds, result.plan.varied.items()):
        if len(values) < 2 or isinstance(values[0], str | bool):
            continue
        name, interval = column.removesuffix("_m").replace(".", "_"), 100.0 * INTERVAL_CONFIDENCE
        draw = partial(
            draw_sweep,
            curves_of(result, world, column),
            axis=AXIS_LABELS.get(column, column),
            titles=(
                f"{world}: maps over {name}",
                f"{result.plan.seeds} seeds  ·  mean and its {interval:g} % interval",
            ),
        )
        figures[f"{world} over {name}"] = f"{world}_{name}.png", draw
    return figures


def curves_of(result: SweepTable, world: str, column: str) -> list[Curve]:
    """Curves over a column: one for each mapper and each value of the first other axis.

    Further axes have their first value.
    """
    axes = {name: values for name, values in result.plan.varied.items() if name != column}
    others = [name for name, values in axes.items() if len(values) > 1 and name != "mapper"][:1]
    free, curves = ["mapper", *others], []
    first = {"world": world, **{name: values[0] for name, values in axes.items()}}
    for choice in product(*(axes[name] for name in free)):
        wanted = first | dict(zip(free, choice, strict=True))
        mine = [each for each in result.means if wanted.items() <= each.columns.items()]
        mine.sort(key=lambda each: float(each.columns[column]))
        words = "".join(f"{name.removesuffix('_m')} {wanted[name]}" for name in others)
        x = tuple(float(each.columns[column]) for each in mine)
        means = {name: [each.measures[name][:2] for each in mine] for name in MEASURES}
        curves.append(Curve(str(choice[0]), words, x, means))
    return curves
