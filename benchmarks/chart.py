"""Charts of results: rows of panels, each drawn from the rows of a table by the names of figures.

`scatter` shows rows by two of their figures, such as time and error, or what is measured over what
is varied; `bars` shows one figure of each row.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator
from matplotlib.transforms import Bbox

from benchmarks.result import Row, duration, figure_of
from benchmarks.timing import Timing
from lrf3d.sheet import FAINT, INK, SPINE, plain, quiet, sheet

OWN = "#d6361f"
"""Colour of what lrf3d does by default."""

COLOURS = ("#2f6fb3", "#2a9187", "#7a3fb0", "#e8890c", "#b25fa8", "#68727f", "#8a6d1f")
"""Colours of the others, in their order."""

DASHES = (0, (4, 2))
"""Dashes of what stands beside the main line."""

PANEL, TALL, SHORT = 5.5, 4.8, 3.8
"""Width of a panel, and heights of panels in rows of up to three and of more [inches]."""

MOST_WIDE = 3
"""Panels that a picture is wide at most; more in a row are narrower."""

SHELF = 0.13
"""Height of the shelf for rows without an error, as a part of the axis."""

EXACT_BAND = "#fdf1e3"
"""Colour of that shelf."""

LEAST_APART = 0.15
"""Labels of values nearer to the next than this part of an axis would run into each other."""

RING = "ring: what lrf3d does by default"
"""What the line below a headline says where rows are marked as defaults."""

NAME_PLACES = [
    (9, 0), (-9, 0), (0, 13), (0, -13), (14, 14), (14, -14), (-14, 14), (-14, -14), (0, 26),
    (0, -26), (22, 28), (-22, 28), (22, -28), (-22, -28), (0, 40), (0, -40), (30, 42), (-30, 42),
    (0, 54),
]  # fmt: skip
"""Where a name may stand, from its point [points]; the first free place is taken."""

NOTE_PLACES = [
    (0, -12), (0, 12), (9, -9), (-9, -9), (9, 9), (-9, 9), (9, 0), (-9, 0), (0, -22), (0, 22),
]  # fmt: skip
"""Where a small note may stand, from its point [points]: below it, if there is room."""


@dataclass(frozen=True, slots=True)
class Name:
    """Words that stand beside a point (x, y) of a panel; a note is smaller, and may be left out."""

    words: str
    x: float
    y: float
    colour: str
    bold: bool = False
    note: bool = False


Panel = Callable[[Axes], None]


def draw(rows: Sequence[Sequence[Panel]], titles: tuple[str, str] = ("", "")) -> Figure:
    """Draw rows of panels under a headline and the smaller line below it."""
    # A lone panel is as wide as two, or a page would blow it up.
    columns = min(MOST_WIDE, max(2, *map(len, rows)))
    tall = [TALL if len(row) <= MOST_WIDE else SHORT for row in rows]
    figure = sheet(columns * PANEL, sum(tall) + (0.7 if any(titles) else 0.0), *titles)
    parts = figure.subfigures(len(rows), 1, height_ratios=tall, squeeze=False)[:, 0]
    panels = [
        (panel, axes)
        for row, part in zip(rows, parts, strict=True)
        for panel, axes in zip(row, part.subplots(1, len(row), squeeze=False)[0], strict=True)
    ]
    for panel, axes in panels:
        panel(quiet(axes))
    # Names find free places on axes that stay where they are: the layout comes before them.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel, axes in panels:
        axes.clear()
        panel(quiet(axes))
        say_where_empty(axes)
    return figure


def scatter(
    axes: Axes,
    rows: Sequence[Row],
    *,
    x: str,
    y: str,
    by: str,
    title: str = "",
    labels: tuple[str, str] = ("", ""),
    note: str | Callable[[Row], str] = "",
    dashed: str = "",
    colours: Mapping[str, str] | None = None,
    floors: Mapping[str, float] | None = None,
    top: float | None = None,
) -> None:
    """Show rows by two figures, on logarithmic axes; the rows of one family are joined by a line.

    Rows whose y is 0 stand on a shelf below the axis, which says "exact". Bars of a time are its
    quartiles. A ring is what lrf3d does by default.

    Args:
        axes: Where to draw.
        rows: The rows; those that lack a figure are left out.
        x: Name of the figure to the right.
        y: Name of the figure upwards.
        by: Name of the figure that says which family a row is of.
        title: What the panel shows.
        labels: What the axes show.
        note: What small words stand beside each point: the name of a figure, or what writes it.
        dashed: Name of another figure upwards, drawn dashed.
        colours: Colours of families.
        floors: Values of x that no row goes below, by their names.
        top: Height of a linear y axis from 0.
    """
    axes.set_title(title, loc="left", color=INK, fontsize=11, weight="bold")
    axes.set_xlabel(labels[0], color=FAINT, fontsize=9)
    axes.set_ylabel(labels[1], color=FAINT, fontsize=9)
    whole, rows = rows, [row for row in rows if _has(row, x) and _has(row, y)]
    if not rows:
        return
    _x_axis(axes, [figure_of(row, x) for row in rows], list((floors or {}).values()))
    others = [row for row in whole if dashed and _has(row, dashed)]
    heights = [_number(row, y) for row in rows] + [_number(row, dashed) for row in others]
    height = _y_axis(axes, heights, isinstance(figure_of(rows[0], y), Timing), top)
    own = next((row[by] for row in rows if row.get("default")), None)
    free = iter(COLOURS * len(rows))
    names, notes = [], []
    for family in dict.fromkeys(row[by] for row in rows):
        colour = (colours or {}).get(family) or (OWN if family == own else next(free))
        mine = [row for row in rows if row[by] == family]
        places = [(_number(row, x), height(_number(row, y))) for row in mine]
        across, above = zip(*places, strict=True)
        wide = 1.8 if family == own else 1.1
        axes.plot(across, above, color=colour, lw=wide, alpha=0.7, zorder=3)
        axes.scatter(across, above, s=42, color=colour, edgecolor="white", lw=0.9,
                     zorder=5)  # fmt: skip
        for row, (right, up) in zip(mine, places, strict=True):
            if isinstance(time := figure_of(row, x), Timing):
                axes.plot([time.low, time.high], [up] * 2, color=colour, lw=3.2, alpha=0.3)
            if row.get("default"):
                axes.scatter([right], [up], s=150, facecolor="none", edgecolor=INK, lw=1.4)
            if note:
                beside = note(row) if callable(note) else f"{figure_of(row, note)}"
                notes.append(Name(beside, right, up, FAINT, note=True))
        more = sorted((_number(row, x), height(_number(row, dashed)))
                      for row in others if row[by] == family)  # fmt: skip
        axes.plot([x for x, _ in more], [y for _, y in more], color=colour, lw=1.1, ls=DASHES)
        at = next((k for k, row in enumerate(mine) if row.get("default")), -1)
        names.append(Name(family, *places[at], colour, bold=family == own))
    for words, value in (floors or {}).items():
        axes.axvline(value, color=FAINT, lw=1.0, ls=DASHES)
        axes.text(value, axes.get_ylim()[1], f"{words} ", rotation=90, va="top", ha="right",
                  fontsize=8, color=FAINT)  # fmt: skip
    write_names(axes, names + notes)


def bars(
    axes: Axes,
    rows: Sequence[Row],
    *,
    name: Callable[[Row], str],
    value: str,
    title: str = "",
    label: str = "",
    scale: float = 1.0,
    log: bool = False,
    colour: Callable[[Row], str] = lambda row: OWN,
) -> None:
    """Show one figure of each row, multiplied by a scale, as bars one above the other."""
    axes.set_title(title, loc="left", color=INK, fontsize=11, weight="bold")
    axes.set_xlabel(label, color=FAINT, fontsize=9)
    if not rows:
        return
    values = [scale * figure_of(row, value) for row in rows]
    for place, (row, number) in enumerate(zip(rows, values, strict=True)):
        axes.barh(place, number, 0.65, color=colour(row), zorder=3)
        words = f" {number:,.0f}" if log else f" {number:.2g}"
        axes.text(max(number, 0.0), place, words, va="center", fontsize=8.5, color=FAINT)
    # Long names would run into the panel beside this one.
    names = [name(row).replace(", ", ",\n") for row in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=8.5)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    if log:
        axes.set(xscale="log", xlim=(0.4 * min(values), 8.0 * max(values)))
    else:
        axes.set_xlim(min(0.0, *values), 1.2 * max(*values, 1e-3))


def trade_offs(rows: Sequence[Row], *, things: str, **how: Any) -> list[Panel]:
    """A panel of time and error for each thing that methods compete in."""
    return [
        partial(scatter, rows=[row for row in rows if row[things] == thing], title=thing, **how)
        for thing in dict.fromkeys(row[things] for row in rows)
    ]


def _has(row: Row, name: str) -> bool:
    return figure_of(row, name) is not None


def _number(row: Row, name: str) -> float:
    value = figure_of(row, name)
    return value.median if isinstance(value, Timing) else float(value)


def _x_axis(axes: Axes, values: Sequence[float | Timing], floors: Sequence[float]) -> None:
    """Set up the axis of a time, or of values that are varied, with a label at each."""
    times = [value for value in values if isinstance(value, Timing)]
    axes.set_xscale("log")
    if times:
        low = min([*(time.low for time in times), *floors])
        axes.set_xlim(low / 2.0, 2.6 * max([*(time.high for time in times), *floors]))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda time, _: duration(time, 6)))
        axes.xaxis.set_minor_formatter(NullFormatter())
        return
    varied = sorted({float(value) for value in values})  # type: ignore[arg-type]
    axes.set_xlim(varied[0] / 1.45, 2.2 * varied[-1])
    axes.xaxis.set_major_locator(FixedLocator(varied))
    axes.xaxis.set_minor_locator(NullLocator())
    labels: list[str] = []
    last = np.inf
    for value in reversed(varied):
        apart = np.log(last / value) >= LEAST_APART * np.log(varied[-1] / varied[0])
        labels.insert(0, f"{value:,.6g}" if apart else "")
        last = value if apart else last
    axes.xaxis.set_ticklabels(labels)


def _y_axis(
    axes: Axes, values: Sequence[float], times: bool, top: float | None
) -> Callable[[float], float]:
    """Set up the axis, with a shelf where a value is 0, and return what places values on it."""
    if top is not None:
        axes.set_ylim(0.0, top)
        return lambda value: value
    some = [value for value in values if value > 0.0] or [0.1, 1.0]
    low, high = np.log10(min(some)), np.log10(max(some))
    room = 0.12 * max(high - low, 1.0)
    exact = min(values) <= 0.0
    shelf = SHELF * (high - low + 3.0 * room) if exact else 0.0
    bottom, end = low - room, high + 2.0 * room
    axes.set_ylim(bottom - shelf, end)
    step = max(1, int(np.ceil((end - bottom) / 8.0)))
    powers = [float(power) for power in range(int(np.ceil(bottom)), int(end) + 1, step)]
    if len(powers) < 2:
        # Less than two powers of ten: labels at 1, 2 and 5 of each.
        finer = np.log10(np.outer(10.0 ** np.arange(-15, 12), [1.0, 2.0, 5.0])).ravel()
        powers = [float(power) for power in finer if bottom <= power <= end]
    middle = bottom - 0.5 * shelf
    if exact:
        axes.axhspan(bottom - shelf, bottom, color=EXACT_BAND, lw=0, zorder=0.5)
        axes.axhline(bottom, color=SPINE, lw=0.8, zorder=0.6)
        powers = [middle, *powers]

    def label(y: float, _: object) -> str:
        if exact and y < bottom:
            return "exact"
        if times:
            return duration(10.0**y, 6)
        if end - bottom > 5.0:
            return f"$10^{{{round(y)}}}$"
        return f"{10.0**y:,.3g}" if y < 6.0 else f"{10.0 ** (y - 6.0):.3g} M"

    axes.yaxis.set_major_locator(FixedLocator(powers))
    axes.yaxis.set_major_formatter(FuncFormatter(label))
    return lambda value: float(np.log10(value)) if value > 0.0 else middle


def say_where_empty(axes: Axes) -> None:
    """On a panel without a point, say so instead of showing a scale of nothing."""
    if np.isfinite(axes.dataLim.get_points()).all():
        return
    axes.grid(visible=False)
    axes.tick_params(labelleft=False, labelbottom=False)
    axes.text(
        0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", va="center", fontsize=9,
        color=FAINT,
    )  # fmt: skip


def write_names(axes: Axes, names: Sequence[Name]) -> None:
    """Write names beside their points, each where no point and no other name stands yet."""
    dots = axes.transData.transform(
        np.vstack([np.asarray(marks.get_offsets()) for marks in axes.collections])
    )
    frame = axes.get_window_extent()
    taken: list[Bbox] = []
    for name in names:
        places = NOTE_PLACES if name.note else NAME_PLACES
        for right, up in places:
            text = axes.annotate(
                plain(name.words), (name.x, name.y), (right, up), textcoords="offset points",
                fontsize=7.5 if name.note else 9, color=name.colour,
                weight="bold" if name.bold else "normal",
                ha="left" if right > 0 else "right" if right < 0 else "center", va="center",
                zorder=8,
            )  # fmt: skip
            text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
            box = text.get_window_extent().padded(2.0)
            inside = frame.containsx(box.x0) and frame.containsx(box.x1)
            inside &= frame.containsy(box.y0) and frame.containsy(box.y1)
            if inside and not box.count_overlaps(taken) and not any(box.contains(*d) for d in dots):
                taken.append(box)
                break
            if name.note or (right, up) != places[-1]:
                text.remove()
