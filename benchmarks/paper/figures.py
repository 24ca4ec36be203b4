"""The figures of the page of the paper: what maps take to store, and the time of updates.

In go numbers that a study has measured; a matplotlib figure leaves.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from lrf3d.render.map_benchmark_panels import (
    COLOURS,
    PairPoint,
    StorePoint,
    draw_pairs,
    draw_stores,
    tell_times,
)
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from lrf3d.geometry import Float
from lrf3d.render.chart import HEAD, Sheet
from lrf3d.render.page import FAINT, INK

WIDE, TALL = 9.2, 3.1
"""Size of the panels of one row together [inches]."""

LEFT, RIGHT, BELOW, BETWEEN = 0.85, 0.3, 0.75, 0.95
"""Room around and between the panels [inches]."""

SMOOTHED = 25
"""Updates over which a running median is drawn."""


def draw_storage(stores: Mapping[str, Sequence[StorePoint]], titles: tuple[str, str]) -> Figure:
    """Numbers to store as unions, polylines and a grid, a panel for each place."""
    sheet = Sheet(LEFT + WIDE + RIGHT, BELOW + TALL + 0.45 + HEAD, titles)
    wide = (WIDE - BETWEEN * (len(stores) - 1)) / len(stores)
    for number, (place, points) in enumerate(stores.items()):
        axes = sheet.panel(LEFT + number * (wide + BETWEEN), BELOW, wide, TALL)
        draw_stores(axes, points)
        axes.set_title(place, loc="left", color=INK, fontsize=11, weight="bold")
        least = min(min(point.unions, point.polylines) for point in points)
        axes.set_ylim(bottom=10.0 ** np.floor(np.log10(max(least, 2)) - 0.3))
    return sheet.save(None)


def draw_updates(updates: Mapping[str, Float], interval: float, titles: tuple[str, str]) -> Figure:
    """The time of each update along a drive, beside the time between two scans.

    Args:
        updates: For each mode the times (k,) [s].
        interval: Time between two scans [s].
        titles: The headline, and the smaller line below it.
    """
    sheet = Sheet(LEFT + WIDE + RIGHT, BELOW + TALL + HEAD, titles)
    axes = sheet.panel(LEFT, BELOW, WIDE, TALL)
    axes.set_yscale("log")
    for mode, colour in COLOURS.items():
        times = np.asarray(updates[mode])
        axes.plot(times, ".", ms=2.5, color=colour, alpha=0.35, zorder=3, mew=0)
        window = min(SMOOTHED, len(times))
        runs = np.lib.stride_tricks.sliding_window_view(times, window)
        middle = np.arange(len(runs)) + 0.5 * (window - 1)
        axes.plot(middle, np.median(runs, axis=1), color=colour, lw=1.8, zorder=5,
                  label=f"{mode} mode")  # fmt: skip
    axes.axhline(interval, color=FAINT, lw=1.2, ls=(0, (4, 3)), zorder=4,
                 label="time between two scans")  # fmt: skip
    axes.set_ylim(top=2.5 * interval)
    axes.set_xlim(0, max(len(times) for times in updates.values()))
    tell_times(axes, "y")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("scan of the drive", color=FAINT, fontsize=9)
    axes.set_ylabel("time of an update", color=FAINT, fontsize=9)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False,
                fontsize=9, labelcolor=INK, borderaxespad=0.2)  # fmt: skip
    return sheet.save(None)


def draw_search(pairs: Sequence[PairPoint], titles: tuple[str, str]) -> Figure:
    """Comparisons of lines by the size of the known map."""
    sheet = Sheet(LEFT + WIDE + RIGHT, BELOW + TALL + HEAD, titles)
    axes = sheet.panel(LEFT, BELOW, WIDE, TALL)
    draw_pairs(axes, pairs)
    axes.set_title("", loc="left")  # The headline says it.
    return sheet.save(None)
