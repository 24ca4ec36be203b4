"""The figure of ``bench map``: error and time over what is varied, by size, with what maps take.

In go points that a study has measured; a matplotlib figure leaves, and a picture file where a
path is given.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from lrf3d.render.chart import HEAD, Sheet, say_where_empty
from lrf3d.render.map_benchmark_panels import (
    COLOURS,
    PairPoint,
    SettingPoint,
    SizePoint,
    StorePoint,
    draw_error_by_time,
    draw_line,
    draw_pairs,
    draw_sizes,
    draw_stores,
    tell_times,
)
from lrf3d.render.page import FAINT, INK

WORDS = {
    "merge_distance": "merge distance R [m]",
    "merge_length": "merge length T [m]",
    "gap": "gap between clusters [m]",
    "beams": "beams over 180°",
    "sigma": "noise σ at 80 m [m]",
}
"""What is varied, as the axes name it."""

DASHES = (0, (4, 2))
"""Dashes of what stands beside the main line."""

WIDTH, LEFT, BETWEEN, RIGHT = 15.6, 0.85, 0.42, 0.3
"""Width of the sheet, and room left of, between and right of the small panels [inches]."""

F1_TALL, TIME_TALL, LOWER_TALL = 2.35, 1.45, 3.1
"""Heights of the rows of panels [inches]."""

FOOT, MIDDLE, SEAM, TITLES = 0.72, 1.12, 0.14, 0.16
"""Room below all, between the halves, within the upper half and below the headline [inches]."""

LOWER_GAP = 0.88
"""Room between lower panels [inches]."""

LEAST_APART = 0.11
"""Labels of values nearer to the next than this part of an axis would run into each other."""


def draw_map_benchmark_figure(
    points: Sequence[SettingPoint],
    sizes: Sequence[SizePoint],
    stores: Sequence[StorePoint],
    pairs: Sequence[PairPoint],
    path: str | Path | None = None,
    *,
    titles: tuple[str, str],
) -> Figure:
    """Draw what was measured of maps; panels of what was not say so.

    Raises:
        OutputError: The picture cannot be written.
    """
    low = FOOT + LOWER_TALL + MIDDLE
    sheet = Sheet(WIDTH, low + TIME_TALL + SEAM + F1_TALL + TITLES + HEAD, titles)
    varied = list(WORDS)
    wide = (WIDTH - LEFT - RIGHT - BETWEEN * (len(varied) - 1)) / len(varied)
    for column, name in enumerate(varied):
        left = LEFT + column * (wide + BETWEEN)
        mine = [point for point in points if point.varied == name]
        scores = sheet.panel(left, low + TIME_TALL + SEAM, wide, F1_TALL)
        times = sheet.panel(left, low, wide, TIME_TALL)
        _scores(scores, mine, first=column == 0)
        _times(times, mine, points, first=column == 0)
        _values(scores, times, mine, WORDS[name])
    across = (WIDTH - LEFT - RIGHT - 3 * LOWER_GAP) / 4
    lower = [
        sheet.panel(LEFT + k * (across + LOWER_GAP), FOOT, across, LOWER_TALL) for k in range(4)
    ]
    draw_error_by_time(lower[0], points)
    draw_sizes(lower[1], sizes)
    draw_stores(lower[2], stores)
    draw_pairs(lower[3], pairs)
    for axes in sheet.figure.axes:
        say_where_empty(axes)
    sheet.figure.legend(
        handles=_signs(), loc="upper right", ncols=4, frameon=False, fontsize=9, labelcolor=INK,
        bbox_to_anchor=(1.0 - RIGHT / WIDTH, 1.0 - 0.25 * HEAD / sheet.size[1]),
        borderaxespad=0.0, handlelength=2.4, columnspacing=2.2,
    )  # fmt: skip
    return sheet.save(path)


def _scores(axes: Axes, points: Sequence[SettingPoint], *, first: bool) -> None:
    """F1 over what is varied: segments drawn through, length dashed."""
    for mode, colour in COLOURS.items():
        mine = [point for point in points if point.mode == mode]
        x = [point.value for point in mine]
        axes.plot(x, [p.length_f1 for p in mine], color=colour, lw=1.1, ls=DASHES, zorder=3)
        draw_line(axes, x, [p.segment_f1 for p in mine], colour)
    axes.set_ylim(0.0, 1.04)
    _name_rows(axes, "F1", first=first)


def _times(
    axes: Axes, points: Sequence[SettingPoint], everything: Sequence[SettingPoint], *, first: bool
) -> None:
    """Time of an update over what is varied, at one scale for all panels of the row."""
    axes.set_yscale("log")
    for mode, colour in COLOURS.items():
        mine = [point for point in points if point.mode == mode]
        draw_line(axes, [point.value for point in mine], [point.seconds for point in mine], colour)
    if everything:
        seconds = [point.seconds for point in everything]
        axes.set_ylim(min(seconds) / 1.7, max(seconds) * 1.7)
    tell_times(axes, "y")
    _name_rows(axes, "time of an update", first=first)


def _name_rows(axes: Axes, name: str, *, first: bool) -> None:
    """Only the first panel of a row says what its heights are."""
    if first:
        axes.set_ylabel(name, color=FAINT, fontsize=9)
    else:
        axes.tick_params(labelleft=False)


def _values(scores: Axes, times: Axes, points: Sequence[SettingPoint], name: str) -> None:
    """One logarithmic axis below two panels, with a label at each value that was tried."""
    values = sorted({point.value for point in points})
    for axes in (scores, times):
        axes.set_xscale("log")
        if values:
            axes.set_xlim(values[0] / 1.45, values[-1] * 1.45)
        axes.xaxis.set_major_locator(FixedLocator(values))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_ticklabels(_labels(values))
    scores.tick_params(labelbottom=False)
    times.set_xlabel(name, color=INK, fontsize=9.5)


def _labels(values: Sequence[float]) -> list[str]:
    """A label for each rising value, empty where it would run into that of the next."""
    labels: list[str] = []
    room, last = LEAST_APART * np.log(values[-1] / values[0]) if values else 0.0, np.inf
    for value in reversed(values):
        free = np.log(last / value) >= room
        labels.insert(0, f"{value:g}" if free else "")
        last = value if free else last
    return labels


def _signs() -> list[Line2D]:
    """What colours and dashes mean."""
    marks = {"marker": "o", "markersize": 6.0, "markeredgecolor": "white", "markeredgewidth": 0.8}
    signs = [
        Line2D([], [], color=colour, linewidth=1.8, label=f"{mode} mode", **marks)  # type: ignore[arg-type]
        for mode, colour in COLOURS.items()
    ]
    signs.append(Line2D([], [], color=FAINT, linewidth=1.8, label="segment F1"))
    signs.append(Line2D([], [], color=FAINT, linewidth=1.1, linestyle=DASHES, label="length F1"))
    return signs
