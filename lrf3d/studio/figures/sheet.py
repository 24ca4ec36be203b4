"""Sheets: figures with a headline, panels in one look, and a legend below all of them."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from lrf3d.base.errors import OutputError
from lrf3d.base.files import as_path, replacing

# Colour of titles and walls.
INK = "#20262e"

# Colour of small text.
FAINT = "#68727f"

# Colour of the grid.
GRID = "#e8ebef"

# Colour of the frame around axes.
SPINE = "#c9ced6"

# Colours of the modes of the mapper: the default is warm.
MODE_COLOURS = {"robust": "#d6361f", "paper": "#2f6fb3"}

# Widths of fine lines and of others, and diameter of dots [points].
HAIRLINE = 0.7
LINE = 1.2
DOT = 4

# Sharp on screens and in print, at some 1500 pixels across.
DOTS_PER_INCH = 150

# Free border inside axes, as a part of their size.
MARGIN = 0.04

# Room around panels, headline and legend [inches].
PAD = 0.1

# Width of a letter of the headline [inches].
LETTER = 0.115

# Width of an entry of the legend [inches].
ENTRY = 2.75


def sheet(width: float, height: float, title: str = "", words: str = "") -> Figure:
    """A white figure [inches] with a headline and a line below it; its layout is constrained."""
    layout = ConstrainedLayoutEngine(h_pad=PAD, w_pad=PAD)
    figure = Figure((width, height), dpi=DOTS_PER_INCH, facecolor="white", layout=layout)
    FigureCanvasAgg(figure)
    lines = [fill(plain(line), int(width / LETTER)) for line in (title, words) if line]
    if lines:
        figure.suptitle("\n".join(lines), color=INK, fontsize=11)
    return figure


def add_legend(figure: Figure, axes: Sequence[Axes]) -> None:
    """Name what the axes show, each mark once, below all of them."""
    named: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    columns = max(1, min(len(named), int(figure.get_figwidth() / ENTRY)))
    figure.legend(
        list(named.values()), list(named), loc="outside lower center", ncols=columns,
        frameon=False, fontsize=9, labelcolor=INK,
    )  # fmt: skip


def dressed(ax: Axes) -> Axes:
    """Axes in metres, as long in x as in y, with the look of all figures."""
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(MARGIN)
    for axis, name in ((ax.xaxis, "x"), (ax.yaxis, "y")):
        axis.set_label_text(f"{name} [m]", color=FAINT, fontsize=9)
    return quiet(ax)


def quiet(ax: Axes) -> Axes:
    """Axes with a light grid below all marks, and no strong lines."""
    ax.tick_params(which="both", colors=FAINT, labelsize=8, length=0)
    ax.grid(color=GRID, linewidth=HAIRLINE)
    ax.set_axisbelow(True)
    for spine in ax.spines.values():
        spine.set(color=SPINE, linewidth=HAIRLINE)
    return ax


def plain(words: str) -> str:
    """Words that a user may have chosen, such as a name, as a figure shows them.

    They are not read as maths, and invalid letters, of a file's name that is not UTF-8, have
    a question mark in their place.
    """
    return words.encode("utf-8", "replace").decode("utf-8").replace("$", r"\$")


def save_figure(figure: Figure, path: str | Path | None) -> Figure:
    """Write a figure, if there is a path, and return it."""
    if path is not None:
        if as_path(path).suffix[1:].lower() not in figure.canvas.get_supported_filetypes():
            raise OutputError(f"{path}: no picture format of that ending; use .png or .pdf")
        with replacing(path) as unfinished:
            if as_path(path).suffix.lower() == ".png":
                # The layout is computed while drawing; `savefig` would draw another time for it.
                FigureCanvasAgg(figure).print_png(unfinished)  # type: ignore[no-untyped-call]
            else:
                figure.savefig(unfinished, dpi=DOTS_PER_INCH)
    return figure
