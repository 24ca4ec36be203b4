"""Benchmarks measure what they say; how fast anything is, no test asks."""

import json
import math
import os
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.chart import draw, scatter
from benchmarks.result import Result, duration
from benchmarks.scan import benchmark as scan_module
from benchmarks.scan.accuracy import ONE_BEAM, corner_trial, judge, scan_trial
from benchmarks.scan.baselines import (
    Determinants,
    Embree,
    Location,
    Planar,
    RawEmbree,
    cast_determinants,
)
from benchmarks.scan.benchmark import (
    CASTER_COLOURS,
    ENTRIES,
    bench_scan,
    measure_city,
    missing,
    promise,
)
from benchmarks.scan.processes import BATCH, probe
from benchmarks.scan.savings import ablate
from benchmarks.timing import Timing, take_turns
from lrf3d import LaserRangeFinder, PlanarCaster
from lrf3d.errors import InputError
from lrf3d.world.generators import city_crossings, generate_city

LRF = LaserRangeFinder()


@pytest.fixture
def no_peers(monkeypatch):
    """Baselines that every machine has."""
    monkeypatch.setattr("benchmarks.scan.benchmark.BASELINES", (Determinants, Planar, RawEmbree))


@pytest.fixture
def no_processes(monkeypatch):
    """Probes without processes."""
    times = {"import_s": 0.1, "first_scan_s": 0.1, "second_scan_s": 1e-5, "until_first_scan_s": 0.2}
    sizes = {"output_bytes": 100, "peak_bytes": 110}
    for module in ("benchmark", "savings"):
        monkeypatch.setattr(
            f"benchmarks.scan.{module}.probe",
            lambda what, caster, walls: times if what == "first_call" else sizes,
        )


@pytest.mark.parametrize("walls", [4, 40, 400, 1000])
def test_a_city_has_its_walls_at_one_density_and_clear_crossings(walls):
    world = generate_city(walls)
    assert len(world.segments) == walls
    assert (generate_city(walls).segments == world.segments).all()
    poses = city_crossings(walls, 200)
    assert PlanarCaster(world).cast_batch(LRF, poses).min() > 1.0


def test_methods_take_turns_with_the_same_numbers():
    heard = {"a": [], "b": []}
    timed = take_turns({name: heard[name].append for name in heard}, seconds=0.01)
    assert set(timed) == {"a", "b"}
    for name, timing in timed.items():
        assert 0.0 < timing.low <= timing.median <= timing.high
        assert timing.calls == len(heard[name]) - 2 >= 3


@pytest.mark.parametrize("kind", [Determinants, Planar, RawEmbree, Location, Embree])
def test_every_baseline_sees_the_same_scan(kind):
    world, poses = generate_city(40), city_crossings(40, 5)
    baseline = kind(world, LRF)
    exact = PlanarCaster(world).cast_batch(LRF, poses)
    ranges, walls = baseline.answers(LRF, poses)
    assert ranges.shape == walls.shape == exact.shape
    assert np.nanmax(np.abs(np.clip(ranges, 0, 80) - np.clip(exact, 0, 80))) < 1e-2
    assert baseline.single(LRF, poses[0])() is not None
    assert baseline.scans(LRF, poses)() is not None


def test_determinants_see_the_nearest_wall():
    walls = np.array([[5.0, -1, 5, 1], [3, -1, 3, 1]])
    distances, hit = cast_determinants(walls, np.zeros(2), np.array([[1.0, 0], [0, 1], [-1, 0]]))
    assert distances.tolist() == [3.0, math.inf, math.inf] and hit.tolist() == [1, -1, -1]


def test_bare_embree_hits_wrong_walls_at_corners_and_ours_does_not():
    world = generate_city(100)
    caster = PlanarCaster(world)
    trial = corner_trial(caster, world, city_crossings(100, 2000))
    bare, ours = (judge(kind(world, ONE_BEAM), trial, seconds=9) for kind in (RawEmbree, Embree))
    assert bare["wrong_wall_share"] > 0 and bare["over_1_cm_share"] > 0
    assert bare["largest_error_m"] > 1.0
    assert ours["wrong_wall_share"] == ours["over_1_cm_share"] == 0
    assert ours["largest_error_m"] == 0.0
    plain = scan_trial(caster, LRF, trial.poses[:9])
    assert judge(Planar(world, LRF), plain, seconds=9)["wrong_wall_share"] == 0


@pytest.mark.usefixtures("no_peers")
def test_a_city_brings_a_row_for_each_baseline():
    steps = []
    rows, _ = measure_city(40, 0.05, missing(), lambda: steps.append(1))
    assert [row["caster"] for row in rows] == ["numpy", "planar", "raw"]
    assert len(steps) == 3
    planar = rows[1]
    assert planar["largest_error_m"] == 0.0 and planar["batch_one_core"] is not None
    assert planar["index_bytes_per_wall"] > 0
    result = Result("scan", tables={ENTRIES: rows})
    promise(result)
    assert result.as_dict()["ratios"] == []


@pytest.mark.usefixtures("no_peers", "no_processes")
def test_the_benchmark_reports_ratios_and_leaves_out_what_takes_too_long(monkeypatch):
    heard = []
    result = bench_scan([40, 400], seconds=0.5, progress=lambda done, total: heard.append(done))
    assert heard == sorted(heard)
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    entry = report["entries"][0]
    assert {"caster", "walls", "scan", "largest_error_m", "at_corners", "batch"} <= set(entry)
    names = " ".join(ratio["ratio"] for ratio in report["ratios"])
    assert "memory of a batch" in names and "fresh process" in names
    assert "PlanarCaster" in result.text()
    monkeypatch.setattr(scan_module, "measure_city", lambda *_: ([], 1.0))
    assert "do not suffice" in bench_scan([40, 400], seconds=0.0).skipped[-1]


@pytest.mark.usefixtures("no_processes")
def test_the_ablation_times_each_piece_on_and_off():
    result = Result("scan")
    ablate(result, seconds=0.2, huge=400)
    savings = result.as_dict()["savings"]
    names = " ".join(saving["skipped_work"] for saving in savings)
    for piece in ("mesh", "beyond", "noise", "static", "tree"):
        assert piece in names
    assert all(saving["skipped_s"] > 0.0 and saving["done_s"] > 0.0 for saving in savings)


@pytest.mark.skipif(
    not os.access("/proc/self/clear_refs", os.W_OK),
    reason="the system does not show the peak of memory",
)
@pytest.mark.parametrize("caster", ["planar", "embree"])
def test_a_batch_needs_little_more_memory_than_its_output(caster):
    report = probe("memory", caster, 40)
    output = report["output_bytes"]
    assert output == BATCH * 181 * 8
    assert 0.9 * output < report["peak_bytes"] < 1.3 * output


def test_the_figure_places_what_is_exact_and_what_is_not():
    rows = [
        {"title": title, "scan": Timing(t, 0.9 * t, 1.1 * t, 9), "error": error, "walls": walls}
        for title, time, error in (
            ("PlanarCaster", 1e-5, 0.0),
            ("EmbreeCaster", 2e-5, 0.0),
            ("Embree float32", 1.5e-5, 1e-4),
            ("NumPy determinants", 1e-3, 1e-13),
        )
        for walls in (40, 10_000)
        for t in (time * walls**0.1,)
    ]
    panel = partial(
        scatter, rows=rows, x="scan", y="error", by="title", note="walls", colours=CASTER_COLOURS
    )
    figure = draw([[panel]], ("Scans", "time and error"))
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert "exact" in labels


@pytest.mark.usefixtures("no_peers", "no_processes")
def test_the_picture_of_a_result_is_drawn_with_rates_of_batches(tmp_path):
    bench_scan([40, 400], seconds=0.5).draw(tmp_path / "scan.png")
    assert (tmp_path / "scan.png").stat().st_size > 20_000


def test_the_command_prints_one_object(monkeypatch, tmp_path):
    empty = Result("scan", took_s=1.0)
    monkeypatch.setattr(scan_module, "bench_scan", lambda *args, **kwargs: empty)
    done = CliRunner().invoke(app, ["scan", "--json"])
    assert done.exit_code == 0 and json.loads(done.stdout)["benchmark"] == "scan"
    wrong = CliRunner().invoke(app, ["scan", "--walls", "many"])
    assert isinstance(wrong.exception, InputError)


def test_durations_read_well():
    said = [duration(seconds) for seconds in (2.0, 3.2e-2, 1.5e-5, 4e-8)]
    assert said == ["2 s", "32 ms", "15 µs", "40 ns"]
