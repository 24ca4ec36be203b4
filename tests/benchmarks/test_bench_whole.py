"""The whole benchmark: parts, drives against their true ends, pages and comparisons."""

import base64
import json
import re
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import whole
from benchmarks.__main__ import app
from benchmarks.chart import draw, scatter
from benchmarks.comparison import CHANGES, compare, comparison_text, load_report
from benchmarks.drive import ENTRIES, bench_drive, integrators
from benchmarks.drive_inputs import held_inputs, smooth_inputs
from benchmarks.map.benchmark import SETTINGS, bench_map
from benchmarks.map.settings import NO_NOISE
from benchmarks.result import Result, Table
from benchmarks.scan import benchmark as scan
from benchmarks.timing import Timing
from benchmarks.whole import Report, bench_all
from lrf3d.errors import InputError, MissingLibraryError

WAYS = Table(
    "ways", {"name": "method", "time": "time"}, names=("name",), time="time", error="error"
)


def ends(hour, seconds):
    return {
        f"{family}, {setting}": end() - hour.end
        for family, setting, end, _ in integrators(hour, seconds)
    }


def test_exact_arcs_and_tight_tolerances_reach_the_true_end():
    held, smooth = held_inputs(seconds=30), smooth_inputs(seconds=30.0)
    off = {title: np.abs(gap).max() for title, gap in ends(held, 30.0).items()}
    assert off["exact arcs, "] < 1e-13
    assert off["Euler, 0.01 s"] < 0.2 * off["Euler, 0.1 s"] < off["Euler, 1 s"]
    off = {title: np.abs(gap).max() for title, gap in ends(smooth, 30.0).items()}
    assert off["RK45, 1e-12"] < 1e-9 and off["RK4, 0.01 s"] < 1e-11
    # Of second order: a step ten times shorter errs a hundred times less.
    assert 50.0 < off["arcs, 0.1 s"] / off["arcs, 0.01 s"] < 200.0


def test_a_drive_benchmark_marks_one_default_for_each_kind_of_inputs():
    result = bench_drive(seconds=1.0, driven=5.0)
    chosen = [row["inputs"] for row in result[ENTRIES] if row["default"]]
    assert len(chosen) == len(set(chosen)) == 2
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert report["benchmark"] == "drive" and len(report["entries"]) == len(result[ENTRIES])
    assert "exact arcs" in result.text() and len(report["savings"]) == 1


def timing(median, scatter=1.02, calls=9):
    return Timing(median, median / scatter, median * scatter, calls)


def way(name="a", median=1.0, error=0.5, spread=0.0, chosen=False):
    return {
        "name": name, "time": timing(median), "error": error, "least_error": error - spread,
        "largest_error": error + spread, "default": chosen,
    }  # fmt: skip


def plot(result):
    panel = partial(scatter, rows=result[WAYS], x="time", y="error", by="name")
    return draw([[panel]])


def made(*ways, pace=1e-3):
    result = Result("scan", "How?", chart=plot, tables={WAYS: list(ways)}, took_s=1.0)
    result.save("<work>", 1.0, 2.0)
    paces = {"ranges": timing(pace)}
    return Report({"ranges": result}, paces, {"frames": "no OpenGL"}, 0.0, "2030-01-01", 2.0)


def changes(new, old):
    told = json.loads(json.dumps(old.as_dict(), allow_nan=False))
    return compare(new, told, "old.json")


def test_the_same_report_has_not_changed():
    report = made(way("a"), way("b", error=0.0), way("c", 1e-6))
    same = changes(report, report)
    assert not same[CHANGES] and same.facts["rows_compared"] == 3
    assert not same.facts["machines_differ"] and not same.facts["only_in_one"]


def test_what_is_slower_beyond_the_noise_is_named_with_its_ratio():
    same = changes(made(way(median=1.08)), made(way()))
    assert not same[CHANGES]  # Within the quartiles of both.
    (change,) = changes(made(way(median=2.0)), made(way()))[CHANGES]
    assert change["change"] == "slower" and change["ratio"] == 2.0
    assert 1.0 < change["noise_ratio"] < 1.1
    (change,) = changes(made(way(median=0.5)), made(way()))[CHANGES]
    assert change["change"] == "faster"


def test_a_machine_that_was_slower_itself_excuses_as_much():
    old, new = made(way()), made(way(median=1.8), pace=2e-3)
    comparison = changes(new, old)
    assert not comparison[CHANGES]
    assert comparison.facts["calibration_ratio"] == {"ranges": 2.0}
    assert "2.00 times" in comparison_text(comparison)


def test_a_time_taken_once_is_no_measure_of_its_noise():
    once = way() | {"time": timing(1.9, 1.0, calls=1)}
    assert not changes(made(once), made(way()))[CHANGES]


def test_errors_are_compared_by_their_ranges_and_from_none():
    assert not changes(made(way(error=0.6, spread=0.2)), made(way(spread=0.2)))[CHANGES]
    (change,) = changes(made(way(error=0.9, spread=0.1)), made(way(spread=0.1)))[CHANGES]
    assert change["change"] == "less exact"
    (change,) = changes(made(way(error=1e-9)), made(way(error=0.0)))[CHANGES]
    assert change["change"] == "less exact" and change["ratio"] is None
    comparison = changes(made(way(error=1e-9)), made(way(error=0.0)))
    assert "from none" in comparison_text(comparison)


def test_other_machines_and_missing_ways_are_named():
    old = json.loads(json.dumps(made(way("a")).as_dict(), allow_nan=False))
    cores = old["machine"]["cores"]
    old["machine"]["cores"] = 999
    facts = compare(made(way("b")), old, "old.json").facts
    assert facts["machines_differ"] == [f"cores: 999 then, {cores} now"]
    assert facts["only_in_one"] == ["ranges: b: only now", "ranges: a: only then"]


@pytest.mark.parametrize("text", ["{", "[]", '{"benchmark": "scan"}', '{"benchmark": "all"}'])
def test_what_is_no_report_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "old.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"old\.json"):
        load_report(path)
    with pytest.raises(InputError, match="damaged"):
        compare(made(way()), {"benchmark": "all", "format": 2}, "old.json")


def test_the_page_holds_its_plots_and_loads_nothing():
    report = made(way("a", chosen=True), way("b", 2.0, 0.0), way("<c>", 3.0, 1e-9))
    page = report.page()
    pictures = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', page)
    assert len(pictures) == 1 and base64.b64decode(pictures[0]).startswith(b"<?xml")
    assert "&lt;c&gt;" in page and "<c>" not in page and "&lt;work&gt;" in page
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert "no OpenGL" in page
    assert "slower" in comparison_text(changes(report, made(way("a", 0.1))))
    assert "no OpenGL" in report.text()


def missing(seconds, progress):
    raise MissingLibraryError("no OpenGL")


def fast(seconds, progress):
    progress(1, 2)
    return made(way("a", chosen=True), way("b"), way("c")).parts["ranges"]


@pytest.fixture
def two_parts(monkeypatch):
    chosen = {"ranges": (fast, 0.5), "frames": (missing, 0.5)}
    monkeypatch.setattr(whole, "PARTS", chosen)


def test_what_cannot_run_is_named_and_the_others_go_on(two_parts):
    heard = []
    report = bench_all(seconds=10, chosen=("ranges", "frames"), progress=lambda *s: heard.append(s))
    assert list(report.parts) == ["ranges"]
    assert report.left_out == {"frames": "no OpenGL"}
    assert heard == [(250, 1000), (500, 1000), (1000, 1000)]
    assert report.calibration["ranges"].calls == 2 * whole.PACES


def test_the_command_writes_both_reports_and_compares(two_parts, tmp_path):
    out = tmp_path / "bench"
    for more in ([], ["--compare", str(out / "report.json")]):
        done = CliRunner().invoke(app, ["whole", "--out", str(out), "--json", *more])
        assert done.exit_code == 0, done.output
        assert json.loads(done.stdout) == json.loads((out / "report.json").read_text())
        assert (out / "report.html").read_text().endswith("</html>\n")
    assert json.loads(done.stdout)["comparison"]["rows_compared"] == 3
    done = CliRunner().invoke(app, ["whole", "--part", "nothing"])
    assert isinstance(done.exception, InputError) and "nothing" in str(done.exception)


@pytest.mark.slow
def test_a_short_benchmark_of_maps_and_ranges_has_one_default_a_thing(monkeypatch):
    # Fresh processes take seconds, and have a test of their own.
    monkeypatch.setattr(scan, "_probe", lambda result, caster: None)
    ranges = scan.bench_scan((40,), seconds=2.0)
    sweeps = {"beams": (91, 181), NO_NOISE: (91, 181)}
    maps = bench_map(seeds=1, seconds=100.0, sweeps=sweeps, every=60, sizes=(), towns=(), scans=4)
    defaults = [row["title"] for row in ranges[scan.ENTRIES] if row["default"]]
    assert defaults == ["EmbreeCaster"]
    defaults = [row["varied"] for row in maps[SETTINGS] if row["default"]]
    assert defaults == ["beams", NO_NOISE]
    report = Report({"ranges": ranges, "maps": maps}, {"ranges": timing(1), "maps": timing(1)})
    json.dumps(report.as_dict(), allow_nan=False)
    assert {"EmbreeCaster, 40", "beams, 181, robust"} <= {row["name"] for row in report.defaults()}
