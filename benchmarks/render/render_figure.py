"""The figure of ``bench render``: time against error, time by size, and what layers cost.

In go points that a study has measured; a matplotlib figure leaves, and a picture file where a
path is given.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from lrf3d.render.chart import HEAD, Name, Sheet, write_names
from lrf3d.render.page import FAINT, INK

OWN, STOCK, FLOOR = "#d6361f", "#2f6fb3", "#68727f"
"""Colours of lrf3d, of stock pyrender, and of what neither can go below."""

PANEL, TALL, GAP, FOOT = 4.6, 3.9, 0.9, 0.62
"""Width and height of a panel, room to its left and below it [inches]."""

NAMES = 0.75
"""Room for the names of layers [inches]."""

TIMES = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
"""Times that axes name [ms]."""


@dataclass(frozen=True, slots=True)
class DrawnPoint:
    """One way to draw one world.

    Args:
        title: What draws it.
        samples: Samples a pixel.
        usual: Whether it is the city that all ways are measured in.
        buildings: How many buildings there are.
        seconds: Time of a frame [s].
        error: Root mean square error, of 255; None where it was not measured.
    """

    title: str
    samples: int
    usual: bool
    buildings: int
    seconds: float
    error: float | None


def draw_render_benchmark_figure(
    points: Sequence[DrawnPoint],
    layers: Mapping[str, float],
    path: str | Path | None = None,
    *,
    titles: tuple[str, str],
) -> Figure:
    """Draw what was measured of pictures.

    Raises:
        OutputError: The picture cannot be written.
    """
    sheet = Sheet(3 * (GAP + PANEL) + NAMES + 0.3, HEAD + 0.3 + TALL + FOOT, titles)
    lefts = [GAP, GAP + PANEL + GAP, 2 * (GAP + PANEL) + GAP + NAMES]
    axes = [sheet.panel(left, FOOT, PANEL, TALL) for left in lefts]
    for panel, name in zip(
        axes, ("time and error, city", "time by buildings", "layers, city"), strict=True
    ):
        panel.set_title(name, loc="left", fontsize=10, color=INK, weight="bold")
    _errors(axes[0], [point for point in points if point.usual])
    _sizes(axes[1], [point for point in points if not point.usual])
    _layers(axes[2], layers)
    return sheet.save(path)


def _errors(axes: Axes, points: Sequence[DrawnPoint]) -> None:
    measured = [point for point in points if point.error is not None]
    if not measured:
        return
    times = np.array([1e3 * point.seconds for point in points])
    axes.set_xscale("log")
    axes.set_xlim(times.min() / 1.6, times.max() * 2.2)
    axes.set_ylim(0.0, 1.35 * max(point.error or 0.0 for point in measured))
    _time_ticks(axes)
    names = []
    for point in measured:
        colour = OWN if point.title.startswith("lrf3d") else STOCK
        x, y = 1e3 * point.seconds, point.error or 0.0
        axes.scatter([x], [y], color=colour, s=46, zorder=5, edgecolors="white", linewidths=0.8)
        samples = f", {point.samples} samples" if point.samples else ""
        names.append(Name(f"{point.title}{samples}", x, y, colour, bold=colour == OWN))
    for point in points:
        if point.title.startswith("floor"):
            axes.axvline(1e3 * point.seconds, color=FLOOR, linewidth=1.0, linestyle=(0, (4, 2)))
            axes.text(
                1e3 * point.seconds, axes.get_ylim()[1] * 0.98,
                f" floor{f', {point.samples} samples' if point.samples else ''}",
                rotation=90, va="top", ha="right", fontsize=8, color=FLOOR,
            )  # fmt: skip
    axes.set_xlabel("time per frame [ms]", color=FAINT, fontsize=9)
    axes.set_ylabel("root mean square error [of 255]", color=FAINT, fontsize=9)
    write_names(axes, names)


def _sizes(axes: Axes, points: Sequence[DrawnPoint]) -> None:
    if not points:
        return
    points = sorted(points, key=lambda point: point.buildings)
    x = [point.buildings for point in points]
    y = [1e3 * point.seconds for point in points]
    axes.plot(x, y, color=OWN, linewidth=1.6, marker="o", markersize=6)
    for buildings, time in zip(x, y, strict=True):
        axes.annotate(
            f"{time:.1f} ms", (buildings, time), (0, 9), textcoords="offset points", fontsize=9,
            color=OWN, ha="center",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(x[0] / 2.0, x[-1] * 2.0)
    axes.set_ylim(0.0, 1.5 * max(y))
    axes.xaxis.set_major_locator(FixedLocator(x))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axes.set_xlabel("buildings", color=FAINT, fontsize=9)
    axes.set_ylabel("time per frame [ms]", color=FAINT, fontsize=9)


def _layers(axes: Axes, layers: Mapping[str, float]) -> None:
    names = list(layers)[::-1]
    times = [1e3 * layers[name] for name in names]
    axes.barh(range(len(names)), times, color=OWN, height=0.62)
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="y", labelsize=9, labelcolor=INK)
    axes.set_xlim(min(0.0, *times), 1.2 * max([*times, 1e-3]))
    for row, time in enumerate(times):
        axes.text(max(time, 0.0), row, f" {time:.1f}", va="center", fontsize=8.5, color=FAINT)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("time per frame [ms]", color=FAINT, fontsize=9)


def _time_ticks(axes: Axes) -> None:
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(FixedLocator([time for time in TIMES if low <= time <= high]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
