"""The whole benchmark: parts, drives against their true ends, pages and comparisons."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import parts as parts_module
from benchmarks import whole
from benchmarks.__main__ import app
from benchmarks.comparison import compare, load_report
from benchmarks.drive.benchmark import bench_drive
from benchmarks.drive.inputs import held_inputs, smooth_inputs
from benchmarks.drive.integrators import integrators
from benchmarks.parts import Part
from benchmarks.report_page import page_text
from benchmarks.results import Saving, as_json
from benchmarks.scan import benchmark as scan
from benchmarks.timing import Method, Timing
from benchmarks.whole import Report, bench_all
from lrf3d.errors import InputError, MissingLibraryError


def ends(hour, seconds):
    return {one.title: one.end() - hour.end for one in integrators(hour, seconds)}


def test_exact_arcs_and_tight_tolerances_reach_the_true_end():
    held, smooth = held_inputs(seconds=30), smooth_inputs(seconds=30.0)
    off = {title: np.abs(gap).max() for title, gap in ends(held, 30.0).items()}
    assert off["exact arcs"] < 1e-13
    assert off["Euler, 0.01 s"] < 0.2 * off["Euler, 0.1 s"] < off["Euler, 1 s"]
    off = {title: np.abs(gap).max() for title, gap in ends(smooth, 30.0).items()}
    assert off["RK45, 1e-12"] < 1e-9 and off["RK4, 0.01 s"] < 1e-11
    # Of second order: a step ten times shorter errs a hundred times less.
    assert 50.0 < off["arcs, 0.1 s"] / off["arcs, 0.01 s"] < 200.0


def test_a_drive_benchmark_marks_one_default_for_each_kind_of_inputs():
    result = bench_drive(seconds=1.0, driven=5.0)
    chosen = [entry.inputs for entry in result.entries if entry.default]
    assert len(chosen) == len(set(chosen)) == 2
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert report["benchmark"] == "drive" and len(report["entries"]) == len(result.entries)
    assert "exact arcs" in result.text() and len(result.savings) == 1


def timing(median, scatter=1.02, calls=9):
    return Timing(median, median / scatter, median * scatter, calls)


def way(name="a", median=1.0, error=0.5, spread=0.0, chosen=False):
    errors = error, error - spread, error + spread
    return Method("thing", name, "", timing(median), *errors, chosen)


def made(*ways, pace=1e-3, **machine):
    part = Part(
        "ranges", "Ranges", "How?", "time", "error [m]", ways,
        (Saving("<work>", 1.0, 2.0),), calibration=timing(pace), took=1.0,
    )  # fmt: skip
    same = {"system": "s", "processor": "p", "cores": 4, "python": "3", "numpy": "2", "load": 0.0}
    return Report([part], {"frames": "no OpenGL"}, {**same, **machine}, "2030-01-01", 2.0)


def changes(new, old):
    told = json.loads(json.dumps(old.as_dict(), allow_nan=False))
    return compare(new, told, "old.json")


def test_the_same_report_has_not_changed():
    report = made(way("a"), way("b", error=0.0), way("c", 1e-6))
    same = changes(report, report)
    assert not same.changes and same.compared == 6 and not same.machines and not same.missing


def test_what_is_slower_beyond_the_noise_is_named_with_its_ratio():
    same = changes(made(way(median=1.08)), made(way()))
    assert not same.changes  # Within the quartiles of both.
    (change,) = changes(made(way(median=2.0)), made(way())).changes
    assert change.words == "slower" and change.ratio == 2.0 and 1.0 < change.noise_ratio < 1.1
    (change,) = changes(made(way(median=0.5)), made(way())).changes
    assert change.words == "faster"


def test_a_machine_that_was_slower_itself_excuses_as_much():
    old, new = made(way()), made(way(median=1.8), pace=2e-3)
    comparison = changes(new, old)
    assert not comparison.changes and comparison.speeds == {"ranges": 2.0}
    assert "2.00 times" in comparison.text()


def test_a_time_taken_once_is_no_measure_of_its_noise():
    once = replace(way(median=1.9), time=timing(1.9, 1.0, calls=1))
    assert not changes(made(once), made(way())).changes


def test_errors_are_compared_by_their_ranges_and_from_none():
    assert not changes(made(way(error=0.6, spread=0.2)), made(way(spread=0.2))).changes
    (change,) = changes(made(way(error=0.9, spread=0.1)), made(way(spread=0.1))).changes
    assert change.words == "less exact"
    (change,) = changes(made(way(error=1e-9)), made(way(error=0.0))).changes
    assert change.words == "less exact" and change.ratio is None
    assert "from none" in changes(made(way(error=1e-9)), made(way(error=0.0))).text()


def test_other_machines_and_missing_ways_are_named():
    comparison = changes(made(way("b"), cores=8), made(way("a")))
    assert comparison.machines == ["cores: 4 then, 8 now"]
    assert comparison.missing == ["Ranges: thing, b: only now", "Ranges: thing, a: only then"]


@pytest.mark.parametrize("text", ["{", "[]", '{"benchmark": "scan"}', '{"benchmark": "all"}'])
def test_what_is_no_report_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "old.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"old\.json"):
        load_report(path)
    with pytest.raises(InputError, match="damaged"):
        compare(made(way()), {"benchmark": "all", "format": 1}, "old.json")


def test_the_page_holds_its_plots_and_loads_nothing():
    report = made(way("a", chosen=True), way("b", 2.0, 0.0), way("<c>", 3.0, 1e-9))
    page = page_text(report)
    pictures = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)
    assert len(pictures) == 1 and base64.b64decode(pictures[0]).startswith(b"<?xml")
    assert "&lt;c&gt;" in page and "<c>" not in page and "&lt;work&gt;" in page
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert "no OpenGL" in page
    assert "slower" in changes(report, made(way("a", 0.1))).text()
    assert "no OpenGL" in report.text()


def missing(seconds, extent, progress):
    raise MissingLibraryError("no OpenGL")


def fast(seconds, extent, progress):
    progress(1, 2)
    return made(way("a", chosen=True), way("b"), way("c")).parts[0]


@pytest.fixture
def two_parts(monkeypatch):
    chosen = {"ranges": (fast, 0.5), "frames": (missing, 0.5)}
    monkeypatch.setattr(whole, "PARTS", chosen)
    monkeypatch.setattr(parts_module, "PARTS", chosen)


def test_what_cannot_run_is_named_and_the_others_go_on(two_parts):
    heard = []
    report = bench_all(seconds=10, chosen=("ranges", "frames"), progress=lambda *s: heard.append(s))
    assert [part.key for part in report.parts] == ["ranges"]
    assert report.left_out == {"frames": "no OpenGL"}
    assert heard == [(250, 1000), (500, 1000), (1000, 1000)]
    assert report.parts[0].calibration.calls == 2 * whole.PACES


def test_the_command_writes_both_reports_and_compares(two_parts, tmp_path):
    out = tmp_path / "bench"
    for more in ([], ["--compare", str(out / "report.json")]):
        done = CliRunner().invoke(app, ["whole", "--out", str(out), "--json", *more])
        assert done.exit_code == 0, done.output
        assert json.loads(done.stdout) == json.loads((out / "report.json").read_text())
        assert (out / "report.html").read_text().endswith("</html>\n")
    assert json.loads(done.stdout)["comparison"]["figures_compared"] == 6
    done = CliRunner().invoke(app, ["whole", "--part", "nothing"])
    assert isinstance(done.exception, InputError) and "nothing" in str(done.exception)


def test_a_short_benchmark_of_maps_and_ranges_has_one_default_a_thing(monkeypatch):
    # Fresh processes take seconds, and have a test of their own.
    monkeypatch.setattr(scan, "_probe", lambda result, caster: None)
    extent = parts_module.Extent(walls=(40,), every=60, seeds=1, driven=5.0, whole=False)
    parts = [
        measure(seconds, extent, lambda done, total: None)
        for measure, seconds in ((parts_module.ranges, 2.0), (parts_module.maps, 100.0))
    ]
    for part in parts:
        for thing in {way.thing for way in part.methods}:
            assert sum(way.default for way in part.methods if way.thing == thing) == 1, thing
        json.dumps(as_json(part), allow_nan=False)
    assert {way.thing for way in parts[1].methods} == {"no noise", "σ = 0.04 m"}
