"""Sheet: a white sheet with panels placed by the inch, in the look of all figures.

On its panels names stand beside the points that they name, clear of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from lrf3d.render.page import DOTS_PER_INCH, FAINT, GRID, INK, LEFT, plain, save_figure

SPINE = "#c9ced6"
"""Colour of the frame around a panel."""

MODE_COLOURS = {"robust": "#d6361f", "paper": "#2f6fb3"}
"""Colours of the modes of the mapper: the default is warm."""

HEAD = 0.78
"""Room that the title and the line below it take [inches]."""

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


class Sheet:
    """A figure whose panels are placed in inches from its lower left corner.

    Args:
        width: Width [inches].
        height: Height [inches].
        title: The headline, and the smaller line below it.
    """

    def __init__(self, width: float, height: float, title: tuple[str, str]) -> None:
        self.size = (width, height)
        self.figure = Figure(figsize=self.size, facecolor="white", dpi=DOTS_PER_INCH)
        FigureCanvasAgg(self.figure)
        self.text(LEFT, height - 0.22, title[0], size=14, weight="bold", colour=INK)
        self.text(LEFT, height - 0.56, title[1], size=9.5)

    def panel(self, left: float, bottom: float, width: float, height: float) -> Axes:
        """Axes at a place, with a light grid below all marks."""
        across, up = self.size
        axes = self.figure.add_axes((left / across, bottom / up, width / across, height / up))
        axes.tick_params(which="both", colors=FAINT, labelsize=8, length=0)
        axes.grid(color=GRID, linewidth=0.7)
        axes.set_axisbelow(True)
        for spine in axes.spines.values():
            spine.set(color=SPINE, linewidth=0.8)
        return axes

    def text(
        self,
        x: float,
        y: float,
        words: str,
        *,
        size: float = 9.0,
        weight: str = "normal",
        colour: str = FAINT,
    ) -> None:
        """Write words whose upper left corner is at a place."""
        place = x / self.size[0], y / self.size[1]
        self.figure.text(*place, plain(words), fontsize=size, weight=weight, color=colour, va="top")

    def save(self, path: str | Path | None) -> Figure:
        """Write the figure, if there is a path, and give it back.

        Raises:
            OutputError: It cannot be written there, or the ending names no known format.
        """
        return save_figure(self.figure, path)


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
