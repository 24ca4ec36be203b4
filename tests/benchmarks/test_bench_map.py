"""The benchmark of maps measures what it says; how fast anything is, no test asks."""

import json
import time

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.map import benchmark as map_module
from benchmarks.map.benchmark import MEMORY, SETTINGS, bench_map, chart, measure_memory
from benchmarks.map.drives import OBSTACLES, ROUNDS
from benchmarks.map.pairs import PAIRS, measure_town
from benchmarks.map.settings import NO_NOISE, SCORES, SWEEPS, CityDrive, Setting, settings
from benchmarks.map.sizes import (
    SIZES,
    UPDATES_BY_SIZE,
    measure_sizes,
    prefilled,
    surveyed,
)
from benchmarks.result import Result
from lrf3d.casting import PlanarCaster
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.world.generators import generate_city

TINY = {
    "sweeps": {"beams": (91, 181), NO_NOISE: (181,), "gap": (2.5,)},
    "every": 40,
    "sizes": (40,),
    "towns": (100,),
    "scans": 10,
}


@pytest.fixture(scope="module")
def benchmark():
    """A tiny benchmark, and the steps that it reported."""
    heard = []
    result = bench_map(seeds=2, seconds=60.0, **TINY, progress=lambda *step: heard.append(step))
    return result, heard


def test_the_city_is_driven_round_and_the_corridor_with_obstacles_in_it(benchmark):
    result, _ = benchmark
    assert [(row["beams"], row["scans"]) for row in result[ROUNDS]] == [(181, 10), (721, 10)]
    for row in result[ROUNDS]:
        assert 0.0 < row["median_s"] <= row["slowest_s"] and row["segments"] > 4
        # There is no second thousand to compare the last with.
        assert row["early_s"] is row["late_s"] is row["memory_bytes"] is None
    rows = {row["obstacles"]: row for row in result[OBSTACLES]}
    assert len(rows) == 8 and all(row["seeds"] == 2 for row in rows.values())
    assert rows["none"]["segments"] > 3 and rows["none"]["false_segments"] <= 2


def test_every_setting_is_measured_with_every_seed(benchmark):
    result, heard = benchmark
    rows = result[SETTINGS]
    assert [(row["varied"], row["value"], row["mode"]) for row in rows] == [
        (each.varied, each.value, each.mode) for each in settings(TINY["sweeps"])
    ]
    assert all(row["seeds"] == len(row["scores_of_seeds"]["segment_f1"]) == 2 for row in rows)
    for row in rows:
        assert row["update"].calls == result.facts["scans_of_each_setting"]
        assert row["scan_to_map"].calls == 2 * row["update"].calls
        assert row["least_error"] <= row["missed"] <= row["largest_error"]
    defaults = [row["varied"] for row in rows if row["default"]]
    assert defaults == ["beams", NO_NOISE]
    assert not result.skipped
    total = heard[-1][1]
    assert heard == [(done, total) for done in range(1, total + 1)]


def test_the_report_is_json_and_the_tables_hold_every_part(benchmark):
    result, _ = benchmark
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert report["benchmark"] == "map"
    assert set(SCORES) | {"mode", "varied", "value", "update"} <= set(report["settings"][0])
    assert {entry["strategy"] for entry in report["line_pairs"]} == {"all", "seen-objects-first"}
    text = result.text()
    for part in ("segment F1", "walls of a town", "polylines", "seen-objects-first", "took"):
        assert part in text


def test_the_figure_shows_what_was_measured_and_bears_what_was_not(benchmark, tmp_path):
    result, _ = benchmark
    empty = Result("map", facts={"scans_of_each_setting": 0}, chart=chart)
    for number, each in enumerate((result, empty)):
        path = tmp_path / f"map{number}.png"
        each.draw(path)
        assert path.read_bytes().startswith(b"\x89PNG")


def test_the_usual_settings_span_what_is_asked():
    assert SWEEPS["beams"][0] == 91 and SWEEPS["beams"][-1] == 1441
    assert SWEEPS["sigma"][0] == 0.01 and SWEEPS["sigma"][-1] == 0.63
    assert SIZES == (100, 1_000, 10_000, 100_000)


def test_a_setting_is_measured_alike_each_time():
    drive = CityDrive(every=60)
    first, second = (Setting("sigma", 0.07, "robust") for _ in range(2))
    for setting in (first, second):
        setting.measure(drive, 3)
    assert first.scores == second.scores
    assert 0.0 < first.row()["segment_f1"] <= 1.0


def test_what_the_time_does_not_suffice_for_is_named():
    skipped = bench_map(seeds=1, seconds=0.0, **TINY).skipped
    assert "gap 2.5, robust mode: the time does not suffice" in skipped
    assert any("a map of 40 segments" in line for line in skipped)


def test_a_surveyed_town_and_a_prefilled_one_hold_its_walls():
    world = generate_city(40)
    for mapper in (surveyed(PlanarCaster(world), 40), prefilled(world)):
        assert len(mapper.map) == 40
        middles = 0.5 * (mapper.map.segments[:, :2] + mapper.map.segments[:, 2:])
        true = 0.5 * (world.segments[:, :2] + world.segments[:, 2:])
        apart = np.linalg.norm(middles[:, None] - true[None], axis=2)
        assert np.median(apart.min(axis=1)) < 0.1


def test_a_prefilled_map_merges_what_it_sees_with_what_it_holds():
    world = generate_city(40)
    mapper, scan = prefilled(world), PlanarCaster(world).cast(LaserRangeFinder(), (10.0, 10.0, 0.0))
    alone = LineMapper("paper").local_map(scan)
    mapper.update(ProportionalNoise(0.0)(scan, np.random.default_rng(0)))
    assert len(mapper.map) < 40 + len(alone)


def test_sizes_come_in_both_modes():
    result = Result("map")
    measure_sizes(result, (40,), seconds=0.01, until=time.monotonic() + 60.0)
    assert [(row["mode"], row["map_segments"]) for row in result[UPDATES_BY_SIZE]] == [
        ("robust", 40),
        ("paper", 40),
    ]


def test_seen_objects_first_finds_the_pairs_of_all_with_fewer_comparisons():
    result = Result("map")
    measure_town(result, 400, scans=40)
    every, seen_objects_first = result[PAIRS]
    assert (every["strategy"], seen_objects_first["strategy"]) == ("all", "seen-objects-first")
    assert every["scans_with_the_pairs_of_all"] == 1.0
    assert seen_objects_first["scans_with_the_pairs_of_all"] > 0.9
    assert seen_objects_first["comparisons_a_scan"] < every["comparisons_a_scan"] / 3
    assert every["pairs_a_scan"] == pytest.approx(seen_objects_first["pairs_a_scan"], rel=0.05)


def test_unions_take_fewer_numbers_than_a_grid():
    result = Result("map")
    measure_memory(result, "robust", CityDrive(scans=10))
    (count,) = result[MEMORY]
    assert 0 < count["union_numbers"] < count["grid_cells"]


def test_the_command_prints_one_object(monkeypatch):
    asked = {}

    def measured(**choice):
        asked.update(choice)
        return Result("map", took_s=1.0)

    monkeypatch.setattr(map_module, "bench_map", measured)
    done = CliRunner().invoke(app, ["map", "--json", "--seeds", "4", "--seconds", "9"])
    assert done.exit_code == 0 and json.loads(done.stdout)["benchmark"] == "map"
    assert asked["seeds"] == 4 and asked["seconds"] == 9.0
    assert CliRunner().invoke(app, ["map", "--seeds", "0"]).exit_code == 2
