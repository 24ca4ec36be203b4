"""The figure of a sweep: scores over what is varied, with their confidence intervals."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from lrf3d.studio.figures.sheet import (
    DOT,
    FAINT,
    INK,
    LINE,
    MARGIN,
    MODE_COLOURS,
    add_legend,
    quiet,
    save_figure,
    sheet,
)

# What the panels show: a measure, its name, and what its values are multiplied by.
PANELS = (
    ("length_f1", "length F1", 1.0),
    ("segment_f1", "segment F1", 1.0),
    ("object_purity", "object purity", 1.0),
    ("perpendicular_rms", "RMS distance from walls [mm]", 1e3),
    ("segment_ratio", "segments by visible walls", 1.0),
    ("object_ratio", "map objects by visible objects", 1.0),
)

# Line styles for the values of the other varied setting, as colours stand for mappers.
STYLES = ("-", "--", ":", "-.")

# Ratio of values from which on their axis is logarithmic.
WIDE_RATIO = 8.0

# Panels of a row.
COLUMNS = 3

# Width of a panel [inches].
WIDE = 3.6

# Height of a panel [inches].
TALL = 3.0


def draw_sweep(
    means: Sequence[Mapping[str, Any]],
    path: str | Path | None = None,
    *,
    column: str,
    choices: Sequence[str] = (),
    axis: str,
    titles: tuple[str, str],
) -> Figure:
    """Draw every measure over a column that is varied, a curve for each mapper and each choice.

    The means are those of `SweepTable.means`; choices are columns whose values have curves of their
    own. The axis is named in words; titles are the headline and the smaller line below it.
    """
    curves: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for mean in sorted(means, key=lambda each: float(each[column])):
        choice = ", ".join(f"{name.removesuffix('_m')} {mean[name]}" for name in choices)
        curves.setdefault((str(mean["mapper"]), choice), []).append(mean)
    rows = -(-len(PANELS) // COLUMNS)
    figure = sheet(COLUMNS * WIDE, rows * TALL + 1.0, *titles)
    panels = [quiet(figure.add_subplot(rows, COLUMNS, 1 + k)) for k in range(len(PANELS))]
    for axes, (measure, name, factor) in zip(panels, PANELS, strict=True):
        axes.set_title(name, loc="left", color=INK, fontsize=11, weight="bold")
        _draw_curves(axes, curves, column, measure, factor)
        _scales(axes, sorted({float(mean[column]) for mean in means}), measure)
    for axes in panels[-COLUMNS:]:
        axes.set_xlabel(axis, color=FAINT, fontsize=9)
    add_legend(figure, panels)
    return save_figure(figure, path)


def _draw_curves(
    axes: Axes,
    curves: Mapping[tuple[str, str], Sequence[Mapping[str, Any]]],
    column: str,
    measure: str,
    factor: float,
) -> None:
    """Draw a measure over a column, a curve with its interval for each mapper and choice."""
    mappers, chosen = (list(dict.fromkeys(names)) for names in zip(*curves, strict=True))
    for (mapper, choice), points in curves.items():
        x = [float(point[column]) for point in points]
        ends = [[point[measure][end] for end in ("mean", "low", "high")] for point in points]
        # A figure that no run has is None, and NaN here.
        mean, low, high = factor * np.array(ends, dtype=np.float64).T
        colour = MODE_COLOURS.get(mapper, f"C{mappers.index(mapper)}")
        low, high = (np.where(np.isnan(end), mean, end) for end in (low, high))
        axes.fill_between(x, low, high, color=colour, alpha=0.16, lw=0)
        style = STYLES[chosen.index(choice) % len(STYLES)]
        label = ", ".join(filter(None, (mapper, choice)))
        axes.plot(x, mean, style, color=colour, marker="o", ms=DOT, label=label)


def _scales(axes: Axes, values: Sequence[float], measure: str) -> None:
    if values[0] > 0.0 and values[-1] >= WIDE_RATIO * values[0]:
        axes.set_xscale("log")
    elif values[0] == 0.0 and len(values) > 2 and values[-1] >= WIDE_RATIO * values[1]:
        # Zero has no logarithm: it stands a step before the least value that has.
        axes.set_xscale("symlog", linthresh=values[1])
    axes.xaxis.set_major_locator(FixedLocator(values))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(values, [f"{value:g}" for value in values], rotation=45 * (len(values) > 5))
    if measure.endswith(("_f1", "_purity")):
        # Shares have one scale; chance gives a purity of 0, so that one may be worse.
        axes.set_ylim(min(-MARGIN, axes.get_ylim()[0]), 1.0 + MARGIN)
        return
    if measure.endswith("_ratio"):
        axes.axhline(1.0, color=FAINT, lw=LINE, ls="dashed", zorder=2)
    axes.set_ylim(bottom=0.0)
