"""The benchmark of drawing measures what it says; how fast anything is, no test asks."""

import json

import numpy as np
import pytest
from test_render import needs_gl
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.result import Result


@pytest.fixture(scope="module")
def benchmark():
    """A tiny benchmark, and the steps that it reported."""
    from benchmarks.render.benchmark import bench_render

    heard = []
    result = bench_render(
        (12, 60),
        seconds=2.0,
        size=(160, 90),
        scans=10,
        progress=lambda *step: heard.append(step),
    )
    return result, heard


@pytest.mark.slow
@needs_gl
def test_all_ways_to_draw_are_timed_and_the_clean_ones_err_less(benchmark):
    from benchmarks.render.benchmark import ENTRIES

    result, heard = benchmark
    entries, report = result[ENTRIES], result.as_dict()
    city = {(row["title"], row["samples"]): row for row in entries if row["world"] == "city"}
    assert {"lrf3d", "stock pyrender", "floor: clear and read"} <= {title for title, _ in city}
    assert [row["buildings"] for row in entries if row["world"] != "city"] == [12, 60]
    plain, smooth = city["lrf3d", 0]["error_rms"], city["lrf3d", 4]["error_rms"]
    assert 0.0 < city["lrf3d, twice the size", 0]["error_rms"] < plain
    assert 0.0 < smooth < plain
    assert all(row["frame"].median > 0.0 for row in entries)
    assert {row["layer"] for row in report["layers"]} >= {"fan", "beams", "hud", "inset"}
    total = heard[-1][1]
    assert [done for done, _ in heard] == sorted(done for done, _ in heard)
    assert heard[-1] == (total, total)


@pytest.mark.slow
@needs_gl
def test_the_report_is_json_and_the_tables_and_the_picture_hold_all(benchmark, tmp_path):
    result, _ = benchmark
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert report["benchmark"] == "render"
    assert {"world", "samples", "frame", "error_rms"} <= set(report["entries"][0])
    text = result.text()
    for word in ("stock pyrender", "floor", "fan", "frame of 60 buildings / of 12"):
        assert word in text
    result.draw(tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 20_000


@needs_gl
def test_stock_pyrender_draws_the_same_city_in_sun_and_shadow():
    from benchmarks.render.scenes import generated_run
    from benchmarks.render.stock import StockFilm
    from lrf3d.render.film import Film

    run = generated_run(30, scans=8)
    pictures = {}
    for shadows in (True, False):
        film = StockFilm(run, size=(160, 90), shadows=shadows)
        pictures[shadows] = film.draw(1.0).astype(int)
        film.close()
    assert np.abs(pictures[True] - pictures[False]).mean() > 2.0
    ours = Film(run, size=(160, 90), view="chase", samples=0, layers=())
    sky = ours.draw(1.0).astype(int)[:, :, 2] > 200
    theirs = pictures[True]
    # Both see the sky at the same places.
    same = (theirs[:, :, 2] > 225) == sky
    assert same.mean() > 0.9
    ours.close()


@pytest.mark.slow
@needs_gl
def test_each_piece_of_skipped_work_can_be_done_again():
    from benchmarks.render import savings as render_savings
    from benchmarks.render.scenes import generated_run

    run = generated_run(30, scans=8)
    result = Result("render")
    render_savings.ablate_render(
        result, run, np.linspace(0.0, 1.0, 4), size=(96, 54), seconds=1.0, buildings=60
    )
    savings = result.as_dict()["savings"]
    assert len({saving["skipped_work"] for saving in savings}) == len(savings) == 7
    assert all(saving["skipped_s"] > 0.0 and saving["done_s"] > 0.0 for saving in savings)


def test_wrong_sizes_are_refused_in_one_line():
    answer = CliRunner().invoke(app, ["render", "--buildings", "many"])
    assert answer.exit_code != 0
