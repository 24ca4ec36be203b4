"""Each benchmark at a tiny size: its rows have finite figures, and its command prints one value."""

import json
import math

import pytest
from typer.testing import CliRunner

from benchmarks import drive, light, line_pairs, maps, ranges, robots, slam
from benchmarks.__main__ import PARTS, program
from benchmarks.report import Report, duration, written
from benchmarks.score import bench as score
from lrf3d.errors import InputError


def finite(rows):
    return all(
        math.isfinite(value) for row in rows for value in row.values() if isinstance(value, float)
    )


def test_casters_are_exact_and_bare_embree_is_not():
    report = Report("")
    ranges.measure(report, 40, 0.2)
    errors = {row["method"]: row["error_m"] for row in report.tables["ranges"]}
    assert errors["PlanarCaster"] == errors["EmbreeCaster"] == 0.0
    assert errors["bare Embree"] > 1e-9 and errors["NumPy determinants"] < 1e-6
    assert finite(report.tables["ranges"])


def test_exact_arcs_end_where_the_reference_does():
    rows = drive.bench(seconds=30.0).tables["integrators"]
    arcs = next(row for row in rows if row["integrator"] == "exact arcs")
    euler = next(row for row in rows if row["integrator"] == "Euler")
    assert arcs["off_m"] < 1e-12 < 1e-3 < euler["off_m"]


def test_data_sheets_are_compared_by_reflectance():
    rows = light.bench("paper_room", poses=3).tables
    assert all(0.5 < row["ratio"] < 2.0 for row in rows["data sheets"])
    assert len(rows["cost of glass"]) == 2 and rows["glass"][0]["images"] == 0


def test_robots_cast_their_beams():
    [row] = robots.bench("corridor", robots=16, seconds=0.1).tables["robots"]
    assert row["beams"] == 361
    assert row["beams_a_second"] == pytest.approx(361 * row["scans_a_second"])


def test_both_strategies_find_the_same_pairs():
    city = maps.load_scenario("city")
    rows = line_pairs.pair_drive(city.world, city.trajectory().poses[:6], city.lrf)
    assert rows["seen-objects-first"]["comparisons"] < rows["all"]["comparisons"]


@pytest.mark.slow
def test_a_door_that_closes_is_mapped_and_obstacles_are_not():
    report = Report("")
    maps.obstacles(report, 1, 2)
    rows = {row["obstacles"]: row for row in report.tables["dynamic obstacles"]}
    assert rows["none"]["length_f1"] > 0.95 and rows[maps.DOOR_CLOSES]["door_share"] > 0.5


@pytest.mark.slow
def test_a_simulated_drive_is_solved():
    report = Report("")
    slam.simulated(report, 0.5, 60)
    assert [row["step"] for row in report.tables["slam"]] == ["online", "finished"]
    assert all(row["error_m"] < 0.1 for row in report.tables["slam"])


def test_own_mappers_and_ours_see_the_same_scans(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scored.py").write_text(
        "import lrf3d\nclass Mine(lrf3d.LineMapper):\n    pass\n"
        "def robust():\n    return lrf3d.LineMapper(sigma=0.04)\n"
    )
    rows = score("city", "robust,scored.py:Mine", seeds=1, poses=3, beams="61").tables["maps"]
    assert [row["mapper"] for row in rows] == ["robust", "scored.py:Mine"]
    with pytest.raises(InputError, match="--mapper rubust: expected"):
        score("city", "rubust")


def test_every_part_is_a_command_with_an_example():
    run = CliRunner().invoke(program(PARTS), ["robots", "corridor", "--robots", "4", "--seconds",
                                              "0.1", "--json"])  # fmt: skip
    assert json.loads(run.stdout)["robots"][0]["robots"] == 4
    for part, example in PARTS.items():
        assert example.startswith(f"scripts/bench {part}")


def test_figures_are_written_in_the_unit_of_their_name():
    assert duration(0.0123) == "12.3 ms" and duration(480.0, 2) == "480 s"
    assert written("scan_s", 2e-5) == "20 µs" and written("error_m", 0.0) == "exact"
    assert written("wrong_share", 0.5) == "50 %" and written("walls", 12345) == "12,345"
    report = Report("What?")
    report.save("work", 1.0, 3.0)
    assert report.tables["skipped work"][0]["saves"] == 3.0
    assert "3 s" in report.text() and report.as_dict()["question"] == "What?"
