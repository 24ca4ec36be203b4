"""Trade-offs: time against error of the ways to do one thing, with the way that is the default.

In go points that a study has measured; a matplotlib figure leaves, and a picture file where a
path is given.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter

from lrf3d.render.chart import HEAD, SPINE, Name, Sheet, write_names
from lrf3d.render.map_benchmark_panels import tell_times
from lrf3d.render.page import FAINT, INK

OWN = "#d6361f"
"""Colour of the family that the default is of."""

COLOURS = ("#2f6fb3", "#2a9187", "#7a3fb0", "#e8890c", "#b25fa8", "#68727f", "#8a6d1f")
"""Colours of the others, in their order."""

PANEL, TALL, GAP, FOOT, TITLES = 4.6, 3.5, 0.9, 0.95, 0.3
"""Width and height of a panel, room left of it, below and above all [inches]."""

SHELF, SEAM = 0.13, 0.03
"""Height of the shelf for what has no error, and of its upper margin, as parts of the axis."""

WIDE = 5.0
"""Powers of ten from which on errors are written as such."""

EXACT_BAND = "#fdf1e3"
"""Colour of that shelf."""


@dataclass(frozen=True, slots=True)
class Way:
    """One way to do a thing.

    Args:
        family: Its kind: the ways of one kind are joined by a line.
        setting: What tells it from others of its kind; may be empty.
        seconds: Time [s]: lower quartile, median, upper quartile.
        error: Error in the unit of the panel; 0 for none.
        chosen: Whether it is the default.
    """

    family: str
    setting: str
    seconds: tuple[float, float, float]
    error: float
    chosen: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """Ways that compete, with words for what is done, its time and its error."""

    title: str
    time: str
    error: str
    ways: tuple[Way, ...]


def draw_trade_offs(
    panels: Sequence[Panel], path: str | Path | None = None, *, titles: tuple[str, str]
) -> Figure:
    """Draw panels beside each other: time to the right, error upwards, both by powers of ten.

    Raises:
        OutputError: The picture cannot be written.
    """
    wide = len(panels) * (GAP + PANEL) + 0.3
    # Under a headline of its page a figure has none.
    head = HEAD if any(titles) else 0.0
    sheet = Sheet(wide, head + TITLES + TALL + FOOT, titles)
    for column, panel in enumerate(panels):
        axes = sheet.panel(GAP + column * (GAP + PANEL), FOOT, PANEL, TALL)
        axes.set_title(panel.title, loc="left", color=INK, fontsize=11, weight="bold")
        _draw(axes, panel)
    ring = Line2D(
        [], [], marker="o", markersize=12, markerfacecolor="none", markeredgecolor=INK,
        markeredgewidth=1.4, linestyle="none", label="what lrf3d does by default",
    )  # fmt: skip
    sheet.figure.legend(
        handles=[ring], loc="lower center", frameon=False, fontsize=9, labelcolor=INK,
        bbox_to_anchor=(0.5, 0.12 / sheet.size[1]), borderaxespad=0.0,
    )  # fmt: skip
    return sheet.save(path)


def _draw(axes: Axes, panel: Panel) -> None:
    ways = panel.ways
    axes.set_xlabel(panel.time, color=FAINT, fontsize=9)
    axes.set_ylabel(panel.error, color=FAINT, fontsize=9)
    if not ways:
        return
    axes.set_xscale("log")
    times = [second for way in ways for second in way.seconds]
    axes.set_xlim(min(times) / 2.0, max(times) * 2.6)
    height = _error_axis(axes, [way.error for way in ways])
    families = list(dict.fromkeys(way.family for way in ways))
    own = next((way.family for way in ways if way.chosen), None)
    others = iter(COLOURS * len(families))
    names, notes = [], []
    for family in families:
        mine = sorted((way for way in ways if way.family == family), key=lambda way: way.seconds[1])
        colour = OWN if family == own else next(others)
        x = [way.seconds[1] for way in mine]
        y = [height(way.error) for way in mine]
        wide = 1.8 if family == own else 1.1
        axes.plot(x, y, color=colour, linewidth=wide, alpha=0.7, zorder=3)
        for way, level in zip(mine, y, strict=True):
            axes.plot(
                way.seconds[::2], [level] * 2, color=colour, linewidth=3.2, alpha=0.3, zorder=4
            )
        axes.scatter(x, y, s=42, color=colour, edgecolor="white", linewidths=0.9, zorder=5)
        chosen = [k for k, way in enumerate(mine) if way.chosen]
        axes.scatter(
            [x[k] for k in chosen], [y[k] for k in chosen], s=150, facecolor="none",
            edgecolor=INK, linewidths=1.4, zorder=6,
        )  # fmt: skip
        notes += [
            Name(way.setting, x[k], y[k], FAINT, note=True)
            for k, way in enumerate(mine)
            if way.setting
        ]
        at = chosen[0] if chosen else int(np.argmin(y))
        names.append(Name(family, x[at], y[at], colour, bold=family == own))
    tell_times(axes, "x")
    write_names(axes, names + notes)


def _error_axis(axes: Axes, errors: Sequence[float]) -> Callable[[float], float]:
    """Set up a logarithmic axis with a shelf for 0, and give what maps errors to heights."""
    some = [np.log10(error) for error in errors if error > 0.0] or [-1.0, 0.0]
    low, high = min(some), max(some)
    room = 0.12 * max(high - low, 1.0)
    bottom, top = low - room, high + 2.0 * room
    shelf = SHELF * (top - bottom)
    exact = min(errors) <= 0.0
    axes.set_ylim(bottom - (shelf if exact else 0.0), top)
    step = max(1, int(np.ceil((top - bottom) / 8.0)))
    powers = [float(power) for power in range(int(np.ceil(bottom)), int(top) + 1, step)]
    if len(powers) < 2:
        # Less than two powers of ten: labels at 1, 2 and 5 of each.
        finer = np.log10(np.outer(10.0 ** np.arange(-15, 9), [1.0, 2.0, 5.0])).ravel()
        powers = [float(power) for power in finer if bottom <= power <= top]
    middle = bottom - 0.5 * shelf
    if exact:
        edge = bottom - SEAM * shelf
        axes.axhspan(bottom - shelf, edge, color=EXACT_BAND, linewidth=0, zorder=0.5)
        axes.axhline(edge, color=SPINE, linewidth=0.8, zorder=0.6)
        powers = [middle, *powers]
    axes.yaxis.set_major_locator(FixedLocator(powers))
    axes.yaxis.set_major_formatter(
        FuncFormatter(
            lambda y, _: "none" if exact and y < bottom else _power(y, wide=top - bottom > WIDE)
        )
    )
    return lambda error: float(np.log10(error)) if error > 0.0 else middle


def _power(y: float, *, wide: bool) -> str:
    return f"$10^{{{round(y)}}}$" if wide else f"{10.0**y:.3g}"
