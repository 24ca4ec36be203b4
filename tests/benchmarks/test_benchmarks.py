"""Each benchmark at a tiny size: its figures are right, and its command prints one value."""

import json
import math

import numpy as np
import pytest
from program import lrf3d
from synthetic_run import ring

from benchmarks import maps, slam
from benchmarks.__main__ import PARTS, bench
from benchmarks.glass import found_glass, images
from benchmarks.report import Report
from benchmarks.score import bench as score
from benchmarks.slam_consistency import Drive, consistency, simulated
from lrf3d import InputError, LaserRangeFinder, World, load_world, simulate

ROUND = LaserRangeFinder(-np.pi, np.pi, 361)


def exact_ranges(report):
    rows = report["ranges"]
    errors = {row["method"]: row["error_m"] for row in rows}
    assert errors["PlanarCaster"] == errors["EmbreeCaster"] == 0.0
    assert errors["bare Embree"] > 1e-9 and errors["NumPy determinants"] < 1e-6
    figures = [value for row in rows for value in row.values() if isinstance(value, float)]
    assert all(map(math.isfinite, figures))


def exact_arcs(report):
    rows = report["integrators"]
    arcs = next(row for row in rows if row["integrator"] == "exact arcs")
    euler = next(row for row in rows if row["integrator"] == "Euler")
    assert arcs["off_m"] < 1e-12 < 1e-3 < euler["off_m"]


def data_sheets_by_reflectance(report):
    assert all(0.5 < row["ratio"] < 2.0 for row in report["data sheets"])
    assert len(report["cost of glass"]) == 2 and report["glass"][0]["images"] == 0


# What the figures of a part in its short form must be.
FIGURES = {"ranges": exact_ranges, "drive": exact_arcs, "light": data_sheets_by_reflectance}


@pytest.mark.parametrize(
    "part",
    [
        pytest.param("frames", marks=[pytest.mark.slow, pytest.mark.gl]),
        pytest.param("maps", marks=pytest.mark.slow),
        pytest.param("warnings", marks=pytest.mark.slow),
        *(part for part in PARTS if part not in ("frames", "maps", "warnings")),
    ],
)
def test_each_part_has_figures_within_seconds(part, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bench([part, "--quick", "--json"])
    report = json.loads(capsys.readouterr().out)
    tables = [rows for name, rows in report.items() if name not in ("machine", "notes", "question")]
    assert tables and all(rows for rows in tables)
    FIGURES.get(part, lambda _: None)(report)


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
        "import lrf3d\nclass Mine:  # its map is what update returns\n"
        "    def __init__(self):\n        self.mapper = lrf3d.LineMapper(sigma=0.04)\n"
        "    def update(self, scan):\n        self.mapper.update(scan)\n"
        "        return self.mapper.map\n"
    )
    report = score("city", mapper="robust,scored.py:Mine", seeds=1, poses=3, beams="61")
    ours, theirs = report.tables["maps"]
    assert (ours.pop("mapper"), theirs.pop("mapper")) == ("robust", "scored.py:Mine")
    assert ours.pop("update_s") and theirs.pop("update_s")
    assert ours == theirs
    with pytest.raises(InputError, match="--mapper rubust: expected"):
        score("city", mapper="rubust")


def test_every_part_is_a_command_with_an_example():
    words = ["robots", "corridor", "--robots", "4", "--seconds", "0.1", "--json"]
    report = json.loads(lrf3d(*words, program=bench).stdout)
    [row], [scene, *_] = report["robots"], report["moving scenes"]
    assert row["robots"] == 4 and row["beams"] == 361
    assert scene["library"] == "lrf3d" and scene["error_m"] == scene["wrong_share"] == 0.0
    wrong = lrf3d("robots", "--robots", "0", program=bench)
    assert wrong.returncode == 2 and "'0': expected a whole number from 1" in wrong.stderr
    assert row["beams_a_second"] == pytest.approx(361 * row["scans_a_second"])
    for part, example in PARTS.items():
        assert example.startswith(f"scripts/bench {part}")


@pytest.mark.slow
def test_what_a_mirror_shows_is_an_image():
    walls = ring([(0, 0), (8, 0), (8, 6), (0, 6)])
    world = World(walls, range(4), materials=["plaster", "mirror", "plaster", "brick"])
    # One pose is too few to tell a mirror from a room.
    assert images(simulate(world, [(2.0, 3.0, 0.0)] * 2, ROUND, rng=0)) > 0


@pytest.mark.slow
def test_glass_of_the_city_is_found_from_few_random_poses_and_no_image_is_mapped():
    rows = [found_glass(load_world("city"), seed, ROUND, 40, 0.1) for seed in range(6)]
    assert sum(row["seen"] * row["found_share"] for row in rows) > 0.4 * sum(
        row["seen"] for row in rows
    )
    assert all(row["found_share"] > 0.25 and row["right_share"] > 0.9 for row in rows)
    assert all(row["images"] == 0 and row["segments"] > 50 for row in rows)


def drives_of(scale, false=0):
    """Drives with errors as large as their covariances, times a scale."""
    rng = np.random.default_rng(1)
    covariance = np.array([[4e-4, 1e-4, 0.0], [1e-4, 1e-4, 0.0], [0.0, 0.0, 1e-6]])
    errors = scale * rng.normal(size=(50, 40, 3)) @ np.linalg.cholesky(covariance).T
    return [Drive(each, np.tile(covariance, (40, 1, 1)), 1.0, 2, false) for each in errors]


def test_errors_as_large_as_their_covariances_are_within_the_bounds():
    figures = consistency(drives_of(1.0))
    assert figures["nees_over_3"] == pytest.approx(1.0, abs=0.1)
    assert figures["scans_within_bounds"] > 0.85
    assert figures["places_within_95_percent_ellipse"] == pytest.approx(0.95, abs=0.02)
    larger = consistency(drives_of(1.5, false=1))
    assert larger["scans_too_confident"] > 0.9 and larger["false_closures"] == 50


@pytest.mark.slow
def test_no_loop_is_closed_between_any_two_of_twenty_identical_rooms():
    drive = simulated("identical rooms", 3)
    assert drive.closures > 100 and drive.false == 0
    assert np.hypot(*drive.errors[:, :2].T).max() < 0.5


@pytest.mark.slow
def test_in_a_corridor_without_end_the_error_stays_within_its_ellipse():
    figures = consistency([simulated("endless corridor", seed) for seed in range(3)])
    assert figures["closures"] == 0 and figures["scans_too_confident"] == 0.0
    assert figures["weak_direction_reported"] == 1.0
    assert figures["places_within_95_percent_ellipse"] > 0.9
    assert figures["largest_error_m"] > 0.05
