"""Window: pictures on the screen, one after the other."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import MissingLibraryError

# Shortest time that a window has to answer the mouse and be drawn [s].
_LEAST_PAUSE = 1e-3

# What turns the size of pictures into that of the window, which matplotlib takes in inches.
_DOTS_PER_INCH = 100.0


class Window:
    """A window with a title that shows pictures; it opens with the first.

    MissingLibraryError is raised where there is no screen, or no library that opens windows.
    """

    def __init__(self, title: str) -> None:
        import matplotlib

        # Matplotlib chooses a backend with windows if there is one.
        import matplotlib.pyplot as pyplot

        backend = matplotlib.get_backend()
        if backend.lower() in {"agg", "cairo", "pdf", "pgf", "ps", "svg", "template"}:
            raise MissingLibraryError(
                f"no window can be opened: matplotlib draws with {backend}; on a computer with a"
                " screen install python3-tk, otherwise use render_mode='rgb_array'"
            )
        self._title = title
        self._pyplot = pyplot
        self._image: Any = None

    def show(self, picture: NDArray[np.uint8], seconds: float) -> None:
        """Show a picture (h, w, 3) uint8 for some seconds; a window that was closed stays so."""
        if self._image is None:
            height, width = picture.shape[:2]
            figure = self._pyplot.figure(
                self._title, figsize=(width / _DOTS_PER_INCH, height / _DOTS_PER_INCH)
            )
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axes.set_axis_off()
            self._image = axes.imshow(picture)
            self._pyplot.show(block=False)
        figure = self._image.figure
        if self._pyplot.fignum_exists(figure.number):
            self._image.set_data(picture)
            figure.canvas.draw_idle()
            figure.canvas.start_event_loop(max(seconds, _LEAST_PAUSE))

    def close(self) -> None:
        """Close the window."""
        if self._image is not None:
            self._pyplot.close(self._image.figure)
            self._image = None
