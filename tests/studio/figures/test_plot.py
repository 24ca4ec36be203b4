"""Plots on matplotlib axes, and what a notebook shows of a value."""

import sys
from base64 import b64decode
from dataclasses import replace
from io import BytesIO

import av
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from PIL import Image
from synthetic_run import around, make_run, street

import lrf3d


@pytest.fixture(scope="module")
def run():
    return make_run(street(), around(11, 3, 20, 12), lrf3d.LaserRangeFinder(beams=91), sigma=0.1)


@pytest.fixture
def axes():
    return Figure().add_subplot()


def picture(value):
    return np.asarray(Image.open(BytesIO(value._repr_png_())).convert("RGB"))


def test_a_plot_is_drawn_on_the_axes_that_are_given(run, axes):
    scan, before = run.scan(0), pyplot.get_fignums()
    assert lrf3d.plot.world(run.world, axes) is axes
    assert lrf3d.plot.map(run.map, axes) is axes
    assert lrf3d.plot.scan(scan, axes, lrf=run.lrf) is axes
    assert lrf3d.plot.trajectory(run.trajectory, axes) is axes
    assert lrf3d.plot.run(run, axes) is axes
    assert pyplot.get_fignums() == before


def test_the_view_grows_with_what_is_drawn_and_a_metre_is_a_metre(axes):
    lrf3d.plot.world(street(), axes)
    lrf3d.plot.world(street(40.0), axes)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert left < 0.0 and right > 62.0 and bottom < 0.0 and top > 6.0
    assert axes.get_aspect() == 1.0
    axes.set(xlim=(2, 5), ylim=(1, 3))
    lrf3d.plot.world(street(80.0), axes)
    assert axes.get_xlim() == (2, 5) and axes.get_ylim() == (1, 3)


def test_lines_take_the_keywords_of_matplotlib(run, axes):
    lrf3d.plot.world(run.world, axes, color="green", lw=3.0, label="walls")
    lrf3d.plot.map(run.map, axes, color="red", label="found")
    lrf3d.plot.trajectory(run.trajectory, axes, color="black", linestyle=":")
    walls, found = (c for c in axes.collections if isinstance(c, LineCollection))
    assert walls.get_linewidth() == [3.0] and np.allclose(walls.get_color(), to_rgba("green"))
    assert len(found.get_color()) == 1 and found.get_label() == "found"
    names = {text.get_text() for text in axes.legend().get_texts()}
    assert {"walls", "found", "robot"} <= names


def test_beams_that_met_nothing_do_not_widen_the_view(axes):
    lrf = lrf3d.LaserRangeFinder(beams=3, range_max=500.0)
    scan = lrf3d.PlanarCaster(lrf3d.World([[3, -5, 3, 5]])).cast(lrf, (0, 0, 0))
    lrf3d.plot.scan(scan, axes, lrf=lrf)
    assert axes.get_ylim()[1] < 10.0


def test_without_axes_there_is_a_new_figure_which_pyplot_knows(run):
    try:
        axes = lrf3d.plot.trajectory(run.trajectory.poses)
        assert pyplot.gcf() is axes.figure
    finally:
        pyplot.close("all")


@pytest.mark.slow
def test_a_value_has_a_small_picture_of_its_own(run):
    before = pyplot.get_fignums()
    for value in (run.world, run.map, run.scan(0), run):
        height, width, _ = picture(value).shape
        assert 100 < min(width, height) and max(width, height) < 700
        assert len(value._repr_png_()) < 200_000
    assert pyplot.get_fignums() == before


def test_empty_values_and_runs_without_a_map_have_pictures(run):
    bare = replace(run, maps=(), snapshot_scans=())
    for value in (lrf3d.World(np.empty((0, 4))), lrf3d.LineMap.empty(), bare):
        assert picture(value).size
    assert picture(lrf3d.World([[0, 0, 4, 0]], name="$x^")).size


@pytest.mark.slow
def test_a_notebook_plays_the_film_of_a_run_in_its_page(run, monkeypatch):
    video = run.video(size=(64, 36), fps=1, renderer="embree", workers=1)
    shown = video._repr_html_()
    assert 'width="64"' in shown and "data:video/mp4;base64," in shown
    with av.open(BytesIO(b64decode(shown.split("base64,")[1].split('"')[0]))) as film:
        assert next(film.decode(video=0)).width == 64
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    with pytest.raises(lrf3d.MissingLibraryError, match=r"run\.video\(\) .*pip install ipython"):
        run.video()
