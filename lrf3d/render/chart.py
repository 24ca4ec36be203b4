"""Sheet: a white sheet with panels placed by the inch, in the look of all figures."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lrf3d.render.page import DOTS_PER_INCH, FAINT, INK, LEFT, dress, plain, save_figure

MODE_COLOURS = {"robust": "#d6361f", "paper": "#2f6fb3"}
"""Colours of the modes of the mapper: the default is warm."""

HEAD = 0.78
"""Room that the title and the line below it take [inches]."""


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
        dress(axes)
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
