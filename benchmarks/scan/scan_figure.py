"""Benchmark figures: run time against error, and what a batch makes of all cores.

In go points that a study has measured; a matplotlib figure leaves, and a picture file where a
path is given.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from lrf3d.geometry import Float
from lrf3d.render.chart import HEAD, SPINE, Name, Sheet, write_names
from lrf3d.render.page import FAINT, INK

COLOURS = {
    "planar": "#d6361f",
    "embree": "#e8890c",
    "raw": "#7a3fb0",
    "location": "#b25fa8",
    "open3d": "#2f6fb3",
    "mujoco": "#2a9187",
    "numpy": "#68727f",
}
"""Colours of casters by their key: lrf3d's own are warm."""

OWN = ("planar", "embree")
"""Casters of lrf3d, which lines and names bring to the fore."""

PANEL, TALL, GAP, FOOT = 4.7, 4.3, 0.85, 1.05
"""Width and height of a panel, room to its left and below all panels [inches]."""

EXACT_BAND = "#fdf1e3"
"""Colour of the shelf on which exact casters stand, below all that has a logarithm."""

STEP = 3
"""Powers of ten between two labels of the axis of errors."""

SHELF = 2.2
"""Height of the shelf in powers of ten."""


@dataclass(frozen=True, slots=True)
class TimeAndError:
    """A caster in a world.

    Args:
        key: Which caster, for its colour.
        title: Its name.
        walls: Size of the world.
        seconds: Time of a scan [s].
        scan_error: Largest error [m] of beams of plain scans.
        corner_error: Largest error [m] of beams aimed at corners.
        batch_rate: Rays a second of a batch on all its cores; None where it has none.
        single_core_rate: The same on one core.
    """

    key: str
    title: str
    walls: int
    seconds: float
    scan_error: float
    corner_error: float
    batch_rate: float | None = None
    single_core_rate: float | None = None


def draw_time_and_error(
    points: Sequence[TimeAndError], path: str | Path | None = None, *, titles: tuple[str, str]
) -> Figure:
    """Draw time per scan against largest error, of plain scans and at corners, and batch rates.

    Raises:
        OutputError: The picture cannot be written.
    """
    sheet = Sheet(3 * (GAP + PANEL) + 0.3, HEAD + 0.3 + TALL + FOOT, titles)
    axes = [sheet.panel(GAP + k * (GAP + PANEL), FOOT, PANEL, TALL) for k in range(3)]
    smallest = [e for p in points for e in (p.scan_error, p.corner_error) if e > 0.0]
    floor = STEP * np.floor(np.log10(min(smallest, default=1e-12)) / STEP)
    for panel, name, errors in (
        (axes[0], "beams of plain scans", [p.scan_error for p in points]),
        (axes[1], "beams aimed at corners", [p.corner_error for p in points]),
    ):
        _time_and_error(panel, points, errors, float(floor))
        _head(panel, name)
    _rates(axes[2], points)
    _head(axes[2], "batches")
    sheet.figure.legend(
        handles=_signs(points), loc="lower center", ncols=9, frameon=False, fontsize=9,
        labelcolor=INK, bbox_to_anchor=(0.5, 0.1 / sheet.size[1]), borderaxespad=0.0,
    )  # fmt: skip
    return sheet.save(path)


def _time_and_error(
    axes: Axes, points: Sequence[TimeAndError], errors: Sequence[float], floor: float
) -> None:
    """One panel; the logarithms of the errors are drawn, so that 0 can have a place of its own."""
    axes.set_xscale("log")
    times = np.array([point.seconds for point in points])
    axes.set(xlim=(times.min() / 2.2, times.max() * 3.5), ylim=(floor - SHELF, 2.9))
    axes.axhspan(floor - SHELF, floor - 0.35, color=EXACT_BAND, linewidth=0, zorder=0.5)
    axes.axhline(floor - 0.35, color=SPINE, linewidth=0.8, zorder=0.6)
    powers = np.arange(floor, 3.0, STEP)
    axes.yaxis.set_major_locator(FixedLocator([floor - 0.5 * (SHELF + 0.35), *powers]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: _power(y, floor)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: _time(x)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("time per scan", color=FAINT, fontsize=9)
    axes.set_ylabel("largest error [m]", color=FAINT, fontsize=9)
    names = []
    rows = [key for key in COLOURS if any(p.key == key for p in points)]
    for key in rows:
        mine = [k for k, point in enumerate(points) if point.key == key]
        x = times[mine]
        # Casters that are all exact stand one above the other, or they would hide each other.
        shelf = floor - 0.35 - (SHELF - 0.35) * (0.3 if key == OWN[0] else 0.72)
        y = [np.log10(errors[k]) if errors[k] > 0.0 else shelf for k in mine]
        _line(axes, x, np.array(y), key, [points[k].walls for k in mine])
        names.append(_named(key, points[mine[0]].title, x[-1], y[-1]))
    write_names(axes, names)


def _rates(axes: Axes, points: Sequence[TimeAndError]) -> None:
    """Rays a second of batches by the size of the world."""
    axes.set(xscale="log", yscale="log")
    names = []
    for key in COLOURS:
        mine = [p for p in points if p.key == key and p.batch_rate]
        if not mine:
            continue
        x = np.array([p.walls for p in mine], dtype=float)
        y = np.array([p.batch_rate for p in mine], dtype=float)
        _line(axes, x, y, key, [p.walls for p in mine])
        alone = [p.single_core_rate for p in mine]
        if all(alone):
            axes.plot(x, np.array(alone, float), color=COLOURS[key], lw=1.1, ls=(0, (4, 2)))
        names.append(_named(key, mine[0].title, x[-1], y[-1]))
    if not names:
        return
    sizes = sorted({point.walls for point in points})
    # Names stand to the right of the last points.
    axes.set_xlim(0.5 * sizes[0], sizes[-1] * max(4.0, (sizes[-1] / sizes[0]) ** 0.45))
    axes.xaxis.set_major_locator(FixedLocator(sizes))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y / 1e6:g} M"))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: _count(x)))
    axes.set_xlabel("walls of the world, at one density", color=FAINT, fontsize=9)
    axes.set_ylabel("rays a second", color=FAINT, fontsize=9)
    write_names(axes, names)


def _line(
    axes: Axes,
    x: Float,
    y: Float,
    key: str,
    walls: Sequence[int],
) -> None:
    colour, own = COLOURS[key], key in OWN
    axes.plot(x, y, color=colour, linewidth=1.8 if own else 1.0, alpha=0.75, zorder=3)
    axes.scatter(
        x, y, s=[_area(count) for count in walls], color=colour, edgecolor="white", linewidths=0.9,
        zorder=6 if own else 5,
    )  # fmt: skip


def _named(key: str, title: str, x: float, y: float) -> Name:
    return Name(title, float(x), float(y), COLOURS[key], bold=key in OWN)


def _head(axes: Axes, name: str) -> None:
    axes.set_title(name, loc="left", color=INK, fontsize=11, weight="bold")


def _signs(points: Sequence[TimeAndError]) -> list[Line2D]:
    """What the sizes of the points mean, and the dashes."""
    sizes = sorted({point.walls for point in points})
    signs = [
        Line2D(
            [],
            [],
            color=FAINT,
            marker="o",
            linestyle="none",
            markeredgecolor="white",
            markersize=np.sqrt(_area(size)),
            label=f"{_count(size)} walls",
        )
        for size in sizes
    ]
    dashes = Line2D([], [], color=FAINT, linewidth=1.1, linestyle=(0, (4, 2)), label="on one core")
    return [*signs, dashes] if any(point.single_core_rate for point in points) else signs


def _area(walls: int) -> float:
    """Area of a point [points²]: larger for larger worlds."""
    return float(np.interp(np.log10(walls), [1.5, 6.0], [22.0, 130.0]))


def _power(y: float, floor: float) -> str:
    return "exact" if y < floor else f"$10^{{{y:.0f}}}$"


def _time(seconds: float) -> str:
    for unit, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= 0.999 * unit:
            return f"{seconds / unit:g} {name}"
    return f"{seconds * 1e9:g} ns"


def _count(number: float) -> str:
    return f"{number:,.0f}"
