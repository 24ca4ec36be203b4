"""Pictures of benchmarks: rows of panels of three kinds, in the look of all figures.

A `TradeOff` shows methods by time and error, `Curves` what is measured over what is varied, and
`Bars` numbers beside each other.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from benchmarks.text import duration
from benchmarks.timing import Method
from lrf3d.render.chart import HEAD, SPINE, Name, Sheet, say_where_empty, write_names
from lrf3d.render.page import FAINT, INK

OWN = "#d6361f"
"""Colour of what lrf3d does by default."""

COLOURS = ("#2f6fb3", "#2a9187", "#7a3fb0", "#e8890c", "#b25fa8", "#68727f", "#8a6d1f")
"""Colours of the others, in their order."""

DASHES = (0, (4, 2))
"""Dashes of what stands beside the main line."""

PANEL, TALL, SHORT = 4.6, 3.5, 2.5
"""Width of a panel, and heights of panels in rows of up to three and of more [inches]."""

GAP, FOOT, TITLES = 0.9, 0.95, 0.35
"""Room left of a panel, below a row and above it [inches]."""

MOST_WIDE = 3
"""Panels that a picture is wide at most; more in a row are narrower."""

SHELF, SEAM = 0.13, 0.03
"""Height of the shelf for what has no error, and of its upper margin, as parts of the axis."""

WIDE = 5.0
"""Powers of ten from which on errors are written as such."""

EXACT_BAND = "#fdf1e3"
"""Colour of that shelf."""

LEAST_APART = 0.15
"""Labels of values nearer to the next than this part of an axis would run into each other."""

BAR = 0.72
"""Width of the bars at one place together, where places are 1 apart."""


@dataclass(frozen=True, slots=True)
class TradeOff:
    """Methods that compete, by time and error; `floors` are times [s] that none goes below."""

    title: str
    time: str
    error: str
    methods: Sequence[Method]
    colours: Mapping[str, str] = field(default_factory=dict)
    floors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Curve:
    """Points joined by a line, each with a label where there are labels."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    colour: str
    dashed: bool = False
    labels: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Curves:
    """Curves over one thing that is varied, with a label at each of its values.

    Args:
        title: What the panel shows.
        x: What is varied.
        y: What is measured.
        curves: The curves.
        times: Whether what is measured are times [s], which have a logarithmic axis.
        top: The height of the axis where it begins at 0; logarithmic where None.
        legend: Whether a legend names the curves, instead of a name beside the last point of each.
    """

    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    times: bool = False
    top: float | None = None
    legend: bool = False


@dataclass(frozen=True, slots=True)
class Bars:
    """Numbers of some groups at some places; None where a group has no bar.

    Args:
        title: What the panel shows.
        axis: What the numbers are.
        places: Names of the places.
        groups: For each group its colour and a number for each place.
        lying: Whether bars lie one above the other, from 0; else they stand on a logarithmic axis.
    """

    title: str
    axis: str
    places: Sequence[str]
    groups: Mapping[str, tuple[str, Sequence[float | None]]]
    lying: bool = False


Rows = Sequence[Sequence[TradeOff | Curves | Bars]]


def draw_panels(
    rows: Rows, path: str | Path | None = None, *, titles: tuple[str, str] = ("", "")
) -> Figure:
    """Draw rows of panels; under a headline of its page a picture has none of its own.

    Raises:
        OutputError: The picture cannot be written.
    """
    # A lone panel is as wide as two, or a page would blow it up.
    columns = min(MOST_WIDE, max(2, *map(len, rows)))
    wide = columns * (GAP + PANEL) + 0.3
    tall = [TALL if len(row) <= MOST_WIDE else SHORT for row in rows]
    offs = [panel for row in rows for panel in row if isinstance(panel, TradeOff)]
    rings = any(method.default for panel in offs for method in panel.methods)
    foot = 0.2 if rings else 0.0
    head = HEAD if any(titles) else 0.0
    # Rows whose axes say nothing below them stand closer to the next.
    feet = [FOOT if any(getattr(p, "x", "x") for p in row) else 0.5 * FOOT for row in rows]
    height = head + sum(tall) + sum(feet) + TITLES * len(rows) + foot - 0.25
    sheet = Sheet(wide, height, titles)
    top = sheet.size[1] - head
    for row, height, below in zip(rows, tall, feet, strict=True):
        each = (wide - 0.3) / len(row)
        for column, panel in enumerate(row):
            left, bottom = GAP + column * each, top - TITLES - height
            axes = sheet.panel(left, bottom, each - GAP, height)
            axes.set_title(panel.title, loc="left", color=INK, fontsize=11, weight="bold")
            draw = {TradeOff: _trade_off, Curves: _curves, Bars: _bars}[type(panel)]
            draw(axes, panel)  # type: ignore[operator]
            say_where_empty(axes)
        top -= TITLES + height + below
    if rings:
        ring = Line2D(
            [], [], marker="o", markersize=12, markerfacecolor="none", markeredgecolor=INK,
            markeredgewidth=1.4, linestyle="none", label="what lrf3d does by default",
        )  # fmt: skip
        sheet.figure.legend(
            handles=[ring], loc="lower center", frameon=False, fontsize=9, labelcolor=INK,
            bbox_to_anchor=(0.5, 0.08 / sheet.size[1]), borderaxespad=0.0,
        )  # fmt: skip
    return sheet.save(path)


def _trade_off(axes: Axes, panel: TradeOff) -> None:
    """Time to the right, error upwards, both by powers of ten."""
    methods = panel.methods
    axes.set_xlabel(panel.time, color=FAINT, fontsize=9)
    axes.set_ylabel(panel.error, color=FAINT, fontsize=9)
    if not methods:
        return
    axes.set_xscale("log")
    times = [second for each in methods for second in (each.time.low, each.time.high)]
    times += panel.floors.values()
    axes.set_xlim(min(times) / 2.0, max(times) * 2.6)
    height = _error_axis(axes, [method.error for method in methods])
    families = list(dict.fromkeys(method.family for method in methods))
    own = next((method.family for method in methods if method.default), None)
    others = iter(COLOURS * len(families))
    names, notes = [], []
    for family in families:
        mine = sorted((m for m in methods if m.family == family), key=lambda m: m.time.median)
        colour = panel.colours.get(family) or (OWN if family == own else next(others))
        x = [method.time.median for method in mine]
        y = [height(method.error) for method in mine]
        wide = 1.8 if family == own else 1.1
        axes.plot(x, y, color=colour, linewidth=wide, alpha=0.7, zorder=3)
        for method, level in zip(mine, y, strict=True):
            span = [method.time.low, method.time.high]
            axes.plot(span, [level] * 2, color=colour, linewidth=3.2, alpha=0.3, zorder=4)
        axes.scatter(x, y, s=42, color=colour, edgecolor="white", linewidths=0.9, zorder=5)
        chosen = [k for k, method in enumerate(mine) if method.default]
        axes.scatter(
            [x[k] for k in chosen], [y[k] for k in chosen], s=150, facecolor="none",
            edgecolor=INK, linewidths=1.4, zorder=6,
        )  # fmt: skip
        notes += [
            Name(method.setting, x[k], y[k], FAINT, note=True)
            for k, method in enumerate(mine)
            if method.setting
        ]
        at = chosen[0] if chosen else int(np.argmin(y))
        names.append(Name(family, x[at], y[at], colour, bold=family == own))
    for words, time in panel.floors.items():
        axes.axvline(time, color=FAINT, linewidth=1.0, linestyle=DASHES)
        axes.text(time, axes.get_ylim()[1], f"{words} ", rotation=90, va="top", ha="right",
                  fontsize=8, color=FAINT)  # fmt: skip
    _name_times(axes, "x")
    write_names(axes, names + notes)


def _error_axis(axes: Axes, errors: Sequence[float]) -> Callable[[float], float]:
    """Set up a logarithmic axis with a shelf for 0, and return what maps errors to heights."""
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
    wide = top - bottom > WIDE

    def words(y: float, _: object) -> str:
        if exact and y < bottom:
            return "exact"
        return f"$10^{{{round(y)}}}$" if wide else f"{10.0**y:.3g}"

    axes.yaxis.set_major_locator(FixedLocator(powers))
    axes.yaxis.set_major_formatter(FuncFormatter(words))
    return lambda error: float(np.log10(error)) if error > 0.0 else middle


def _curves(axes: Axes, panel: Curves) -> None:
    axes.set_xlabel(panel.x, color=FAINT, fontsize=9)
    axes.set_ylabel(panel.y, color=FAINT, fontsize=9)
    drawn = [curve for curve in panel.curves if len(curve.x)]
    if not drawn:
        return
    values = sorted({float(x) for curve in drawn for x in curve.x})
    named = any(curve.name for curve in drawn) and not panel.legend
    room = 2.5 if named else 1.45
    axes.set(xscale="log", xlim=(values[0] / 1.45, values[-1] * room))
    axes.xaxis.set_major_locator(FixedLocator(values))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_ticklabels(_value_labels(values))
    heights = [float(y) for curve in drawn for y in curve.y]
    if panel.top is not None:
        axes.set_ylim(0.0, panel.top)
    elif min(heights) > 0.0:
        axes.set(yscale="log", ylim=(min(heights) / 2.0, max(heights) * 2.0))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: _number(y)))
    if panel.times:
        _name_times(axes, "y")
    names = []
    for curve in drawn:
        style = {"lw": 1.1, "ls": DASHES} if curve.dashed else {"lw": 1.8}
        axes.plot(curve.x, curve.y, color=curve.colour, label=curve.name, zorder=3, **style)
        axes.scatter(
            curve.x, curve.y, s=16 if curve.dashed else 36, color=curve.colour,
            edgecolor="white", linewidths=0.8, zorder=5,
        )  # fmt: skip
        if curve.name and not panel.legend:
            names.append(Name(curve.name, curve.x[-1], curve.y[-1], curve.colour, bold=True))
        for x, y, label in zip(curve.x, curve.y, curve.labels, strict=False):
            names.append(Name(label, x, y, curve.colour, note=True))
    if panel.legend:
        axes.legend(loc="best", frameon=False, fontsize=8, labelcolor=INK, handlelength=2.4)
    write_names(axes, names)


def _value_labels(values: Sequence[float]) -> list[str]:
    """A label for each rising value, empty where it would run into that of the next."""
    labels: list[str] = []
    room, last = LEAST_APART * np.log(values[-1] / values[0]), np.inf
    for value in reversed(values):
        free = np.log(last / value) >= room
        labels.insert(0, f"{value:,.6g}" if free else "")
        last = value if free else last
    return labels


def _bars(axes: Axes, panel: Bars) -> None:
    numbers = [n for _, row in panel.groups.values() for n in row if n is not None]
    if not numbers:
        return
    for place in range(len(panel.places)):
        here = [(c, row[place]) for c, row in panel.groups.values() if row[place] is not None]
        for k, (colour, number) in enumerate(here):
            assert number is not None
            width = BAR / max(len(here), 1 if panel.lying else 2)
            at = place + width * (k - 0.5 * (len(here) - 1))
            if panel.lying:
                axes.barh(at, number, 0.9 * width, color=colour, zorder=3)
                axes.text(max(number, 0.0), at, f" {number:.2g}", va="center", fontsize=8.5,
                          color=FAINT)  # fmt: skip
            else:
                axes.bar(at, number, 0.9 * width, color=colour, zorder=3)
                axes.annotate(_number(number), (at, number), (0, 7), textcoords="offset points",
                              ha="center", va="center", fontsize=8.5, color=colour)  # fmt: skip
    if panel.lying:
        axes.set_yticks(range(len(panel.places)), panel.places)
        axes.invert_yaxis()
        axes.set_xlim(min(0.0, *numbers), 1.2 * max(*numbers, 1e-3))
        axes.set_xlabel(panel.axis, color=FAINT, fontsize=9)
        axes.grid(axis="y", visible=False)
    else:
        axes.set_xticks(range(len(panel.places)), panel.places)
        axes.set_yscale("log")
        axes.set_ylim(10.0 ** np.floor(np.log10(min(numbers)) - 0.3), 2.5 * max(numbers))
        axes.set_ylabel(panel.axis, color=FAINT, fontsize=9)
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.grid(axis="x", visible=False)
    axes.tick_params(labelsize=8.5)


def _number(number: float) -> str:
    return f"{number:,.10g}" if number < 1e6 else f"{number / 1e6:.3g} M"


def _name_times(axes: Axes, which: str) -> None:
    """Write the times of a logarithmic axis with their units."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_formatter(FuncFormatter(lambda time, _: duration(time, 6)))
    axis.set_minor_formatter(NullFormatter())
