"""A window shows pictures where there is a screen, and says so where there is none."""

import matplotlib
import matplotlib.pyplot as pyplot
import numpy as np
import pytest

from lrf3d.errors import MissingLibraryError
from lrf3d.render.window import Window


def test_without_a_screen_the_mend_is_told(monkeypatch):
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "agg")
    with pytest.raises(MissingLibraryError, match=r"draws with agg; .* python3-tk.*rgb_array"):
        Window("title")


def test_pictures_are_shown_one_after_the_other_and_a_closed_window_stays_closed(monkeypatch):
    pyplot.switch_backend("agg")
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "screen")
    monkeypatch.setattr(pyplot, "show", lambda *, block: None)
    window = Window("robot")
    for grey in (50, 200):
        window.show(np.full((40, 60, 3), grey, np.uint8), 0.0)
        figure = pyplot.figure("robot")
        figure.canvas.draw()
        drawn = np.asarray(figure.canvas.buffer_rgba())
        assert drawn.shape == (40, 60, 4) and (drawn[:, :, :3] == grey).all()
    pyplot.close("robot")
    window.show(np.zeros((40, 60, 3), np.uint8), 0.0)
    assert not pyplot.fignum_exists("robot")
    window.close()
    window.close()
