"""The figures of a sweep: one for each world and each axis of numbers."""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

from lrf3d.render.sweep_figure import draw_sweep
from lrf3d.sweeping.table import INTERVAL_CONFIDENCE, SweepTable

AXIS_LABELS = {"sigma_m": "noise σ at range_max [m]", "beams": "beams"}
"""Labels of the axes of figures."""


def figures_of(result: SweepTable) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """The figures by their titles: their files, and what draws them.

    They have a curve for each mapper and each value of the first other axis; further axes have
    their first value.
    """
    figures: dict[str, tuple[str, Callable[[Path], object]]] = {}
    varied = {name: each for name, each in result.plan.varied.items() if len(each) > 1}
    seeds = f"{result.plan.seeds} seeds  ·  mean and its {100.0 * INTERVAL_CONFIDENCE:g} % interval"
    for world, (column, values) in product(result.plan.worlds, varied.items()):
        if isinstance(values[0], str | bool):
            continue
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
        figures[f"{world} over {name}"] = f"{world}_{name}.png", draw
    return figures
