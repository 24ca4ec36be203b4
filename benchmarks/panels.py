"""Panels of the figure of ``bench map``: error by time, updates by size, storage, line pairs.

Each takes axes and the points that a study has measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from lrf3d.render.page import FAINT, INK

COLOURS = {"robust": "#d6361f", "paper": "#2f6fb3"}
"""Colours of the modes: the default is warm."""

STRATEGY_COLOURS = {"unions-first": "#2a9187", "all": "#7a3fb0"}
"""Colours of the strategies of pairing."""

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"))
"""Units of time [s]."""

BAR = 0.36
"""Width of a bar, where kinds of storage are 1 apart."""


@dataclass(frozen=True, slots=True)
class SettingPoint:
    """A map made with one thing set: its mode, what is set and what to, scores, and time [s]."""

    mode: str
    varied: str
    value: float
    segment_f1: float
    length_f1: float
    seconds: float


@dataclass(frozen=True, slots=True)
class SizePoint:
    """The time of an update [s] on a map of so many segments."""

    mode: str
    segments: int
    seconds: float


@dataclass(frozen=True, slots=True)
class StorePoint:
    """Numbers that a map takes as unions and as polylines, and cells as a grid."""

    mode: str
    unions: int
    polylines: int
    grid: int


@dataclass(frozen=True, slots=True)
class PairPoint:
    """Comparisons and time [s] a scan of a strategy of pairing among so many known lines."""

    strategy: str
    known: int
    comparisons: float
    seconds: float


def draw_error_by_time(axes: Axes, points: Sequence[SettingPoint]) -> None:
    """Every setting as a point of time and error; more beams are joined by a line."""
    _head(axes, "error against run time")
    axes.set(xscale="log", yscale="log")
    for mode, colour in COLOURS.items():
        mine = [point for point in points if point.mode == mode]
        axes.scatter(
            [p.seconds for p in mine], [1.0 - p.segment_f1 for p in mine], s=16, color=colour,
            alpha=0.35, linewidths=0, zorder=3,
        )  # fmt: skip
        beams = [point for point in mine if point.varied == "beams"]
        x, y = [p.seconds for p in beams], [1.0 - p.segment_f1 for p in beams]
        draw_line(axes, x, y, colour)
        for k, up in ((0, 11), (-1, -12)) if beams else ():
            _write(axes, f"{beams[k].value:g} beams", x[k], y[k], (0, up), colour)
    axes.margins(x=0.16, y=0.12)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    tell_times(axes, "x")
    axes.set_xlabel("time of an update", color=FAINT, fontsize=9)
    axes.set_ylabel("1 − segment F1", color=FAINT, fontsize=9)


def draw_sizes(axes: Axes, sizes: Sequence[SizePoint]) -> None:
    """Time of an update by the size of the map."""
    _head(axes, "update by size of the map")
    axes.set(xscale="log", yscale="log")
    for mode, colour in COLOURS.items():
        mine = [point for point in sizes if point.mode == mode]
        x, y = [float(p.segments) for p in mine], [p.seconds for p in mine]
        draw_line(axes, x, y, colour)
        if mine:
            _write(axes, _time(y[-1], digits=2), x[-1], y[-1], (0, 10), colour)
    axes.margins(x=0.12, y=0.16)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    tell_times(axes, "y")
    axes.set_xlabel("segments of the map, at one density", color=FAINT, fontsize=9)
    axes.set_ylabel("time of an update", color=FAINT, fontsize=9)


def draw_stores(axes: Axes, stores: Sequence[StorePoint]) -> None:
    """Bars of the numbers that a map takes."""
    _head(axes, "numbers to store the city")
    axes.set_yscale("log")
    kinds = ("unions of\nsegments", "polylines", "grid of\n0.1 m")
    for k, mode in enumerate(COLOURS):
        for store in (store for store in stores if store.mode == mode):
            for place, count in enumerate((store.unions, store.polylines)):
                _bar(axes, place + BAR * (k - 0.5), count, COLOURS[mode])
    if stores:
        # The grid spans the reflection points, whatever the mapper makes of them.
        _bar(axes, 2.0, stores[0].grid, FAINT)
    axes.set_xticks(range(len(kinds)), kinds)
    axes.tick_params(axis="x", labelsize=9, labelcolor=INK)
    axes.grid(visible=False, axis="x")
    axes.margins(y=0.1)
    if stores:
        axes.set_ylim(bottom=100.0)
    axes.yaxis.set_minor_formatter(NullFormatter())


def _bar(axes: Axes, place: float, count: int, colour: str) -> None:
    """A bar with its number above it."""
    axes.bar(place, count, 0.92 * BAR, color=colour, zorder=3)
    words = f"{count:,}" if count < 1e5 else f"{count / 1e6:.1f} M"
    _write(axes, words, place, count, (0, 7), colour)


def draw_pairs(axes: Axes, pairs: Sequence[PairPoint]) -> None:
    """Comparisons by the size of the known map, each with its time."""
    _head(axes, "line pairs for localisation")
    axes.set(xscale="log", yscale="log")
    for strategy, colour in STRATEGY_COLOURS.items():
        mine = [point for point in pairs if point.strategy == strategy]
        x, y = [float(p.known) for p in mine], [p.comparisons for p in mine]
        draw_line(axes, x, y, colour)
        axes.lines[-1].set_label(strategy)
        place = (-20, 8) if strategy == "all" else (4, -13)
        for point in mine:
            words = _time(point.seconds, digits=2)
            _write(axes, words, point.known, point.comparisons, place, colour)
    if pairs:
        axes.legend(loc="upper left", frameon=False, fontsize=9, labelcolor=INK)
    axes.margins(x=0.18, y=0.16)
    known = sorted({point.known for point in pairs})
    axes.xaxis.set_major_locator(FixedLocator(known))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:,.0f}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("lines of the known map", color=FAINT, fontsize=9)
    axes.set_ylabel("comparisons a scan", color=FAINT, fontsize=9)


def draw_line(axes: Axes, x: Sequence[float], y: Sequence[float], colour: str) -> None:
    """Marks joined by a line."""
    axes.plot(
        x, y, color=colour, lw=1.8, marker="o", ms=6.0, mec="white", mew=0.8, zorder=5,
    )  # fmt: skip


def _write(axes: Axes, words: str, x: float, y: float, place: tuple[int, int], colour: str) -> None:
    """Words at a point, moved by a place [points]."""
    text = axes.annotate(
        words, (x, y), place, textcoords="offset points", ha="center", va="center", fontsize=8.5,
        color=colour, zorder=8,
    )  # fmt: skip
    text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _head(axes: Axes, name: str) -> None:
    axes.set_title(name, loc="left", color=INK, fontsize=11, weight="bold")


def tell_times(axes: Axes, which: str) -> None:
    """Times on a logarithmic axis."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_formatter(FuncFormatter(lambda t, _: _time(t)))
    axis.set_minor_formatter(NullFormatter())


def _time(seconds: float, *, digits: int = 6) -> str:
    """A time in the unit that suits it."""
    unit, name = next((u for u in UNITS if seconds >= 0.999 * u[0]), UNITS[-1])
    value = seconds / unit
    # Rounded by hand: %g would write 480 with two digits as 4.8e+02.
    value = round(value, digits - 1 - int(np.floor(np.log10(value)))) if value > 0.0 else 0.0
    return f"{value:g} {name}"
