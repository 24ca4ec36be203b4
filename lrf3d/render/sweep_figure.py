"""The figures of a sweep: scores over what is varied, with their confidence intervals.

In go curves that a study has measured; a matplotlib figure leaves, and a picture file where a
path is given.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

from lrf3d.sheet import FAINT, INK, MODE_COLOURS, add_legend, quiet, save_figure, sheet

PANELS = (
    ("length_f1", "length F1", 1.0),
    ("segment_f1", "segment F1", 1.0),
    ("object_purity", "object purity", 1.0),
    ("perpendicular_rms", "RMS distance from walls [mm]", 1e3),
    ("segment_ratio", "segments by visible walls", 1.0),
    ("object_ratio", "map objects by visible objects", 1.0),
)
"""What the panels show: a measure, its name, and what its values are multiplied by."""

SHARES = ("length_f1", "segment_f1", "object_purity")
"""Measures from 0 to 1, which have one scale in all figures."""

RATIOS = ("segment_ratio", "object_ratio")
"""Measures of which 1 is right."""

PALEST = 0.6
"""How far the last of several curves of one mode is mixed with white."""

COLUMNS, WIDE, TALL = 3, 3.6, 3.0
"""Panels of a row, and the room of each [inches]."""

LEAST_APART = 0.1
"""Labels of values nearer to the next than this part of an axis would run into each other."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Means of one mode, and of one choice of all else, over what is varied.

    Args:
        mode: Mode of the mapper, which gives the colour.
        choice: What else was chosen, in words; empty where there is no choice.
        x: The values that are varied.
        means: For each measure the means, one a value.
        halves: For each measure half of the width of the intervals; NaN where there is none.
    """

    mode: str
    choice: str
    x: tuple[float, ...]
    means: dict[str, tuple[float, ...]]
    halves: dict[str, tuple[float, ...]]


def draw_sweep(
    curves: Sequence[Curve],
    path: str | Path | None = None,
    *,
    axis: str,
    titles: tuple[str, str],
) -> Figure:
    """Draw every measure over what is varied.

    Args:
        curves: The curves.
        path: Where to write the picture; nowhere if not given.
        axis: What is varied, in words.
        titles: The headline, and the smaller line below it.

    Raises:
        OutputError: The picture cannot be written.
    """
    rows = -(-len(PANELS) // COLUMNS)
    figure = sheet(COLUMNS * WIDE, rows * TALL + 1.0, *titles)
    panels = [quiet(figure.add_subplot(rows, COLUMNS, 1 + k)) for k in range(len(PANELS))]
    colours = _colours(curves)
    for number, (axes, (measure, name, factor)) in enumerate(zip(panels, PANELS, strict=True)):
        axes.set_title(name, loc="left", color=INK, fontsize=11, weight="bold")
        # The strongest colours lie on top, and the legend has them first.
        for height, (curve, colour) in enumerate(zip(curves, colours, strict=True)):
            _curve(axes, curve, measure, factor, colour, zorder=5.0 - 0.01 * height)
        _scales(axes, curves, measure)
        if number >= len(PANELS) - COLUMNS:
            axes.set_xlabel(axis, color=FAINT, fontsize=9)
    add_legend(figure, panels)
    return save_figure(figure, path)


def _curve(
    axes: Axes, curve: Curve, measure: str, factor: float, colour: str, *, zorder: float
) -> None:
    """A curve with the band that holds the mean."""
    x = np.array(curve.x)
    mean = factor * np.array(curve.means[measure])
    half = factor * np.nan_to_num(np.array(curve.halves[measure]))
    label = curve.mode + (f", {curve.choice}" if curve.choice else "")
    axes.fill_between(x, mean - half, mean + half, color=colour, alpha=0.16, lw=0, zorder=3)
    axes.errorbar(x, mean, half, color=colour, lw=0, elinewidth=1.0, capsize=2.0, zorder=4)
    axes.plot(
        x, mean, color=colour, lw=1.8, marker="o", ms=5.0, mec="white", mew=0.8, zorder=zorder,
        label=label,
    )  # fmt: skip


def _scales(axes: Axes, curves: Sequence[Curve], measure: str) -> None:
    values = sorted({value for curve in curves for value in curve.x})
    if values[0] > 0.0 and values[-1] >= 8.0 * values[0]:
        axes.set_xscale("log")
    elif values[0] == 0.0 and len(values) > 2 and values[-1] >= 8.0 * values[1]:
        # Zero has no logarithm: it stands a step before the least value that has.
        axes.set_xscale("symlog", linthresh=values[1])
    axes.xaxis.set_major_locator(FixedLocator(values))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(values, _labels(axes, values))
    if measure in SHARES:
        axes.set_ylim(-0.02, 1.03)
        return
    if measure in RATIOS:
        axes.axhline(1.0, color=FAINT, lw=1.0, ls=(0, (4, 3)), zorder=2)
    axes.set_ylim(0.0, max(1.08 * axes.get_ylim()[1], 1e-9))
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))


def _labels(axes: Axes, values: Sequence[float]) -> list[str]:
    """A label for each rising value, empty where it would run into that of the next."""
    places = axes.transAxes.inverted().transform(
        axes.transData.transform([(value, 0.0) for value in values])
    )[:, 0]
    labels, last = [""] * len(values), np.inf
    for k in reversed(range(len(values))):
        if last - places[k] >= LEAST_APART:
            labels[k], last = f"{values[k]:g}", places[k]
    return labels


def _colours(curves: Sequence[Curve]) -> list[str]:
    """The colour of the mode, the paler the later a curve comes among those of its mode."""
    colours = []
    for number, curve in enumerate(curves):
        same = [k for k, other in enumerate(curves) if other.mode == curve.mode]
        share = PALEST * same.index(number) / max(1, len(same) - 1)
        labels = list(dict.fromkeys(each.mode for each in curves))
        usual = f"C{labels.index(curve.mode)}"
        base = np.array(to_rgb(MODE_COLOURS.get(curve.mode, usual)))
        colours.append(to_hex(tuple((base + share * (1.0 - base)).tolist())))
    return colours
