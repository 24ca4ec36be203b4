"""The estimate in films and figures."""

from dataclasses import replace

import numpy as np
import pytest
from estimates import estimated
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from test_render import city_run, drawn, needs_gl

from lrf3d.studio.figures.figures import draw_map
from lrf3d.studio.figures.plot import CLOSED, ESTIMATE, HIT, estimate

RENDERERS = [pytest.param("gl", marks=needs_gl), "embree"]


def shown(run, **options):
    """Which pixels show the estimate, and which the trail of the truth."""
    trails = (), ("trail", "estimate")
    pictures = [drawn(run, 3.9, size=(480, 270), layers=layers, **options) for layers in trails]
    red, green, blue = np.moveaxis(pictures[1], 2, 0)
    changed = np.abs(pictures[1] - pictures[0]).max(axis=2) > 20
    return changed & (green > red + 40) & (blue > red + 60), changed & (green > blue + 50)


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("view", [pytest.param("chase", marks=pytest.mark.slow), "top"])
def test_the_film_shows_truth_and_estimate_in_two_colours(renderer, view):
    run = city_run()
    believed, true = shown(run, view=view, renderer=renderer)
    assert not believed.any() and true.any()
    believed, true = shown(estimated(run), view=view, renderer=renderer)
    assert believed.sum() > 50 and true.sum() > 15
    # Of a recorded drive the truth is not known.
    believed, true = shown(estimated(run, (0.0, 0.0, 0.0)), view=view, renderer=renderer)
    assert believed.sum() > 50 and not true.any()


def lines(figure, colour):
    """The segments of all lines of a colour."""
    return [
        segment
        for each in figure.axes[0].collections
        if isinstance(each, LineCollection) and np.allclose(each.get_color()[0][:3], to_rgb(colour))
        for segment in each.get_segments()
    ]


def test_the_map_shows_both_paths_and_the_ellipses_and_loops_where_they_are_asked_for():
    run = estimated(city_run())
    figure = draw_map(run)
    names = {text.get_text() for text in figure.findobj(Text)}
    assert {"truth", "estimate, ellipses of 95 %"} <= names and not {
        "path",
        "loop closures",
    } & names
    assert not lines(figure, CLOSED)
    estimate(run.estimate, figure.axes[0])
    places = run.estimate.poses[:, :2]
    (closed,), (dropped,) = lines(figure, CLOSED), lines(figure, HIT)
    assert closed == pytest.approx(places[[0, -1]]) and dropped == pytest.approx(places[[1, 2]])
    ellipses = [each for each in figure.axes[0].collections if isinstance(each, PolyCollection)]
    rings = [
        each for each in ellipses if np.allclose(each.get_edgecolor()[0][:3], to_rgb(ESTIMATE))
    ]
    assert rings and all(not len(each.get_facecolor()) and each.get_paths() for each in rings)


def test_the_map_of_a_recorded_drive_names_no_truth():
    run = estimated(city_run(), (0.0, 0.0, 0.0))
    names = {text.get_text() for text in draw_map(run).findobj(Text)}
    assert "truth" not in names and "estimate, ellipses of 95 %" in names
    without = replace(run, estimate=None)
    assert "path" in {text.get_text() for text in draw_map(without).findobj(Text)}
