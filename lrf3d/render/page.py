"""Page: the white sheet that figures are drawn on, with equal metres both ways."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator, StrMethodFormatter

from lrf3d.errors import OutputError
from lrf3d.geometry import Float
from lrf3d.output import replacing

INK, FAINT, GRID, SPINE = "#20262e", "#68727f", "#e8ebef", "#c9ced6"
"""Colours of titles, of what stands back, of the grid, and of the frame around a panel."""

DOTS_PER_INCH = 150
"""Sharp on screens and in print, at some 1500 pixels across."""

AREA = 54.0
"""Area of all panels together [square inches], whatever the shape of the world."""

LEFT, RIGHT, ABOVE, BELOW = 0.72, 0.22, 0.46, 0.56
"""Room around each panel [inches]: for its title, its tick labels and its axis labels."""

HEAD, FOOT = 0.5, 0.42
"""Room above and below all panels [inches]: for the title and the legend."""

FAR = 5000.0
"""Coordinates beyond this [m] are drawn in a local frame: their tick labels would be too long."""

LONG = 6.0
"""What is longer than this many times its width is cut into strips that stand over each other."""

STRIP = 2.0
"""About how many times as long as wide all strips together are."""

LONGEST = 60.0
"""Nothing is cut as if it were longer than this many times its width: a wall has no width."""

MARGIN = 0.04
"""Free border inside a panel, as a part of its size."""


@dataclass(frozen=True, slots=True)
class Frame:
    """The box of the world that a page shows, and the origin that its axes count from.

    Args:
        origin: (2,) whole metres that the axes call 0.
        low: (2,) lower left corner of the box, from the origin [m].
        high: (2,) upper right corner of the box, from the origin [m].
    """

    origin: Float
    low: Float
    high: Float

    @classmethod
    def around(cls, places: Iterable[Float]) -> "Frame":
        """The frame around points, arrays (n, 2) [m] in the world; a metre where there are none."""
        known = [place for place in places if len(place)] or [np.zeros((1, 2))]
        low = np.min([place.min(axis=0) for place in known], axis=0)
        high = np.max([place.max(axis=0) for place in known], axis=0)
        near = np.abs([low, high]).max() <= FAR
        origin = np.zeros(2) if near else np.round(0.5 * (low + high))
        size = np.maximum(high - low, 1.0)
        # No panel is more than three times as long as it is wide, or titles would not fit.
        size = np.maximum(size, size.max() / 3.0) * (1.0 + 2.0 * MARGIN)
        middle = 0.5 * (low + high) - origin
        return cls(origin, middle - 0.5 * size, middle + 0.5 * size)

    @classmethod
    def whole(cls, places: Iterable[Float]) -> "Frame":
        """The frame around points whose axes count from the world's own origin, however far."""
        frame = cls.around(places)
        return cls(np.zeros(2), frame.low + frame.origin, frame.high + frame.origin)

    @classmethod
    def strips(cls, places: Iterable[Float]) -> "list[Frame]":
        """The frame around points; of what is long and narrow, equal parts of its length."""
        known = [place for place in places if len(place)] or [np.zeros((1, 2))]
        low = np.min([place.min(axis=0) for place in known], axis=0)
        high = np.max([place.max(axis=0) for place in known], axis=0)
        size = np.maximum(high - low, 1.0)
        axis = int(size.argmax())
        longer = min(float(size.max() / size.min()), LONGEST)
        whole = cls.around(known)
        if longer <= LONG:
            return [whole]
        count = max(2, round(np.sqrt(longer / STRIP)))
        part = size[axis] / count
        # Strips overlap by their margins, so that nothing is lost between them.
        size[1 - axis] = max(size[1 - axis], part * count / LONGEST)
        size[axis] = part
        size *= 1.0 + 2.0 * MARGIN
        middle = np.tile(0.5 * (low + high) - whole.origin, (count, 1))
        middle[:, axis] += part * (np.arange(count) - 0.5 * (count - 1))
        return [cls(whole.origin, each - 0.5 * size, each + 0.5 * size) for each in middle]

    @property
    def size(self) -> Float:
        """Width and height (2,) of the box [m]."""
        return self.high - self.low

    def local(self, points: Float) -> Float:
        """Points (n, 2) or segments (n, 4) of the world, counted from the origin."""
        return points - np.tile(self.origin, points.shape[1] // 2)


class Page:
    """A figure of equal panels in rows, each with metre axes.

    Args:
        frames: What each panel shows; all are of one size.
        title: Stands above all, with the second line smaller.
    """

    def __init__(self, frames: Sequence[Frame], title: tuple[str, str] = ("", "")) -> None:
        frame, panels = frames[0], len(frames)
        width, height = frame.size * np.sqrt(AREA / panels / frame.size.prod())
        columns = _columns(panels, width, height)
        rows = -(-panels // columns)
        # Panels under a headline have none of their own.
        above = ABOVE if not title[0] else 0.7 * ABOVE
        cell_width, cell_height = LEFT + width + RIGHT, above + height + BELOW
        head = HEAD if title[0] else 0.0
        self.size = np.array([columns * cell_width, head + rows * cell_height + FOOT])
        self.figure = Figure(figsize=tuple(self.size), facecolor="white", dpi=DOTS_PER_INCH)
        FigureCanvasAgg(self.figure)
        self.axes: list[Axes] = []
        for panel in range(panels):
            row, column = divmod(panel, columns)
            left = column * cell_width + LEFT
            bottom = FOOT + (rows - 1 - row) * cell_height + BELOW
            place = np.array([left, bottom, width, height]) / np.tile(self.size, 2)
            self.axes.append(self._panel(place, frames[panel]))
        self._title(*title)

    def _panel(self, place: Float, frame: Frame) -> Axes:
        axes = self.figure.add_axes(tuple(place))
        axes.set(xlim=(frame.low[0], frame.high[0]), ylim=(frame.low[1], frame.high[1]))
        axes.set_aspect("equal")
        # Both axes share one step, so that the grid is made of squares.
        ticks = MaxNLocator(12, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, float(frame.size.max()))
        for axis, name, origin in zip((axes.xaxis, axes.yaxis), "xy", frame.origin, strict=True):
            axis.set_major_locator(MultipleLocator(ticks[1] - ticks[0]))
            axis.set_major_formatter(StrMethodFormatter("{x:g}"))
            label = f"{name} [m]" if not frame.origin.any() else f"{name} − {origin:.0f} [m]"
            axis.set_label_text(label, color=FAINT, fontsize=9)
        dress(axes)
        return axes

    def _title(self, title: str, counts: str) -> None:
        if not title:
            return
        x, top = LEFT / self.size[0], self.size[1]
        self.figure.text(
            x, 1.0 - 0.22 / top, plain(title), color=INK, fontsize=14, weight="bold", va="top"
        )
        self.figure.text(x, 1.0 - 0.56 / top, plain(counts), color=FAINT, fontsize=9.5, va="top")

    def legend(self, signs: Sequence[Artist]) -> None:
        """Say what the signs mean, each once, below all panels."""
        handles = list({str(sign.get_label()): sign for sign in reversed(signs)}.values())[::-1]
        self.figure.legend(
            handles=handles,
            loc="lower center",
            bbox_to_anchor=(0.5, 0.08 / self.size[1]),
            ncols=max(1, min(len(handles), int(self.size[0] / 1.6))),
            frameon=False,
            fontsize=9,
            labelcolor=INK,
            handlelength=1.8,
            borderaxespad=0.0,
        )

    def save(self, path: str | Path | None) -> Figure:
        """Write the figure, if there is a path, and give it back.

        Raises:
            OutputError: It cannot be written there, or the ending names no known format.
        """
        return save_figure(self.figure, path)


def dress(axes: Axes) -> None:
    """Give axes the look of all figures: a light grid below all marks, and no strong lines."""
    axes.tick_params(which="both", colors=FAINT, labelsize=8, length=0)
    axes.grid(color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set(color=SPINE, linewidth=0.8)


def plain(words: str) -> str:
    """Words that a user may have chosen, such as a name, as a figure shows them.

    They are not read as maths, and invalid letters, of a file's name that is not UTF-8, have
    a question mark in their place.
    """
    return words.encode("utf-8", "replace").decode("utf-8").replace("$", r"\$")


def save_figure(figure: Figure, path: str | Path | None) -> Figure:
    """Write a figure, if there is a path, and give it back.

    Raises:
        OutputError: It cannot be written there, or the ending names no known format.
    """
    if path is not None:
        known = figure.canvas.get_supported_filetypes()
        if Path(path).suffix[1:].lower() not in known:
            raise OutputError(f"{path}: no picture format of that ending; use .png or .pdf")
        with replacing(path) as unfinished:
            figure.savefig(unfinished, dpi=DOTS_PER_INCH)
    return figure


def _columns(panels: int, width: float, height: float) -> int:
    """The number of columns that leaves no gap, if it can, and comes nearest to a wide sheet."""

    def badness(columns: int) -> float:
        rows = -(-panels // columns)
        shape = columns * (LEFT + width + RIGHT) / (rows * (ABOVE + height + BELOW))
        return float(abs(np.log(shape / 1.5))) + 2.0 * (rows * columns - panels)

    return min(range(1, panels + 1), key=badness)
