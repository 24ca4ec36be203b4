"""Users' own mappers, controllers and noises."""

import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from drives import Holds, NoMap
from program import lrf3d as program
from program import refused, told
from test_cli import ROOM

import lrf3d
from lrf3d import InputError, LaserRangeFinder, Simulation, World
from lrf3d.apps.cli.inputs import load_plugin
from lrf3d.laser.unrolling import unrolled

EXAMPLES = Path(__file__).parents[3] / "examples"
BOX = World(np.array([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]))
LRF = LaserRangeFinder(beams=61, range_max=20.0)

MODULE = """
import numpy as np
from dataclasses import replace

class Points:
    def __init__(self):
        self.count = 0
    def update(self, scan):
        self.count += int(scan.hits.sum())
    def report(self, run, folder):
        (folder / "points.txt").write_text(str(self.count))
        return {"points": self.count, "mean_length_m": self.count / 3e3}

class Straight:
    def command(self, time, pose, scan):
        return (1.0, 0.0) if scan.ranges[30] > 1.5 else None

def longer(scan, rng):
    return replace(scan, ranges=scan.ranges + 0.25)

class Reporting(Points):
    def report(self, run, folder):
        return {"points": np.int64(self.count)}

straight = Straight()
number = 3
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "own_parts.py").write_text(MODULE)
    (tmp_path / "box.toml").write_text(ROOM)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    sys.modules.pop("own_parts", None)


def run(folder, *arguments):
    return told("run", "box.toml", "--no-video", *arguments, cwd=folder)


def test_a_mapper_a_controller_and_a_noise_are_named_on_the_command_line(folder):
    named = ["--mapper", "own_parts:Points", "--controller", "own_parts:straight"]
    summary = run(folder, *named, "--noise", "own_parts:longer", "--scans", "50")
    # 8 m to the wall, half a metre a step, a quarter of a metre added to what is seen.
    assert summary["drive"]["scans"] == 15
    assert summary["mapper"] == "own_parts:Points" and summary["mode"] is None
    assert summary["map"] is summary["score"] is summary["buildings"] is None
    assert summary["report"] == {"points": 15 * 61, "mean_length_m": 0.305}
    out = folder / "out" / "box"
    assert (out / "points.txt").read_text() == str(15 * 61)
    assert not (out / "map.geojson").exists()
    named += ["--noise", "own_parts:longer", "--scans", "50", "--resume"]
    again = program("run", "box.toml", "--no-video", *named, cwd=folder)
    assert "points           915\nmean length [m]  0.305\n" in again.stdout
    assert "\nfiles            out/box: run.npz" in again.stdout
    kept = lrf3d.load_run(out)
    assert np.allclose(kept.ranges - kept.truth, 0.25)
    assert kept.trajectory.poses[-1, 0] == pytest.approx(9.0)


def test_a_report_that_json_cannot_hold_is_refused_in_one_line(folder):
    named = ("--no-video", "--scans", "3", "--mapper", "own_parts:Reporting")
    assert "int64 is not JSON serializable; expected a dict" in refused("run", "box.toml", *named)


@pytest.mark.parametrize(
    ("kind", "name", "said"),
    [
        ("mapper", "own_parts", "module:object"),
        ("mapper", "nowhere:Points", "no module or file 'nowhere'"),
        ("mapper", "own_parts:Point", "did you mean 'Points'?"),
        ("mapper", "own_parts:Straight", "expected a method update"),
        ("controller", "own_parts:Points", "expected a method command"),
        ("noise", "own_parts:number", "expected a function"),
        ("mapper", "missing.py:Points", "missing.py:Points: no module or file 'missing.py' in "),
        ("mapper", "..:x", "no module or file '..'"),
    ],
)
def test_what_cannot_be_used_is_reported_in_one_line(folder, kind, name, said):
    with pytest.raises(InputError) as caught:
        load_plugin(kind, name)
    message = str(caught.value)
    assert said in message and message.startswith(f"--{kind} {name}") and "\n" not in message


def test_nothing_is_imported_that_the_user_does_not_name(folder):
    (folder / "own_parts.py").write_text("raise SystemExit('imported')")
    (folder / "box.toml").write_text(ROOM + '\n[mapper]\nmode = "own_parts:Points"\n')
    said = refused("run", "box.toml", "--no-video", cwd=folder)
    assert "own_parts" in said and "imported" not in said


def test_a_controller_drives_exact_arcs_for_as_long_as_the_user_looks():
    steps = []
    for step in Simulation(BOX, Holds(1.0, 0.5), LRF, start=(5, 2, 0), scan_interval=0.1):
        steps.append(step)
        if len(steps) == 127:
            break
    places = np.array([step.pose[:2] for step in steps])
    assert np.hypot(*(places - (5.0, 4.0)).T) == pytest.approx(np.full(127, 2.0))
    assert steps[-1].time == pytest.approx(12.6) and steps[-1].scan.time == steps[-1].time


@pytest.mark.parametrize("command", [3.0, (1.0,), (1.0, np.nan), "ab"])
def test_an_invalid_command_is_refused_with_its_time(command):
    controller = Holds()
    controller.held = command
    with pytest.raises(InputError, match="t = 0 s"):
        list(Simulation(BOX, controller, LRF, start=(5, 2, 0), scans=3))


def test_a_controller_decides_when_a_scan_that_takes_time_is_complete():
    asked = []

    class Turning:
        def command(self, time, pose, scan):
            asked.append((time, pose))
            return 1.0, 1.5

    lrf = LaserRangeFinder(-3.0, 3.0, 61, range_max=30.0, scan_duration=0.1)
    steps = list(Simulation(BOX, Turning(), lrf, start=(3, 3, 0), scan_interval=0.25, scans=4))
    assert [time for time, _ in asked] == pytest.approx([0.1, 0.35, 0.6, 0.85])
    # It stands during the first scan, and is on its way for 0.15 s at the second.
    assert steps[1].pose.theta == pytest.approx(1.5 * 0.15)
    assert asked[1][1].theta == pytest.approx(1.5 * 0.25)
    assert steps[2].true_scan.motion == pytest.approx([0.0998, 0.0075, 0.15], abs=1e-3)
    for step in steps:
        points = unrolled(step.true_scan).points()
        off = [np.abs(points[:, k, None] - BOX.segments[:, k::2].ravel()).min(1) for k in (0, 1)]
        assert np.minimum(*off).max() < 0.003
    with pytest.raises(InputError, match=r"longer than the 0\.25 s"):
        Simulation(BOX, Turning(), LaserRangeFinder(scan_duration=0.3), scan_interval=0.25)


@pytest.fixture
def examples(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(EXAMPLES), *sys.path])


@pytest.mark.parametrize(("world", "scans"), [("corridor", 900), ("paper_room", 450)])
def test_the_wall_follower_follows_walls_and_runs_into_none(examples, world, scans):
    from wall_follower import WallFollower

    scenario = lrf3d.load_scenario(world)
    start = scenario.start if scenario.start is not None else scenario.poses[0]
    settings = {"start": start, "scan_interval": 0.1, "scans": scans, "radius": scenario.radius}
    near, poses = [], []
    for step in Simulation(
        scenario.world, WallFollower(), scenario.lrf, mapper=NoMap(), **settings
    ):
        poses.append(step.pose)
        near.append(step.true_scan.ranges.min())
    assert len(poses) == scans
    assert np.hypot(*np.diff(np.array(poses)[:, :2], axis=0).T).sum() > 0.02 * scans
    assert np.median(near[100:]) == pytest.approx(0.8, abs=0.2)


def test_the_occupancy_grid_maps_a_room_and_reports(examples, tmp_path):
    from occupancy_grid import OccupancyGrid
    from PIL import Image

    noise = lrf3d.ProportionalNoise(0.02)
    drive = lrf3d.follow_route([[2, 2], [8, 2], [8, 6]], speed=1.0, dt=0.5)
    grid = OccupancyGrid()
    run = lrf3d.simulate(BOX, drive, LRF, noise=noise, mapper=grid, rng=0)
    report = grid.report(run, tmp_path)
    assert report["precision"] > 0.99 and report["recall"] > 0.95
    assert len(grid.cells(taken=False)) * 0.01 == pytest.approx(70.0, abs=10.0)
    with Image.open(tmp_path / "grid.png") as picture:
        assert 95 < picture.size[0] < 110 and 75 < picture.size[1] < 90


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("class Mine:\n    def update(self, scan): scan.ranges *= 0.0\n", ValueError),
        ("class Mine:\n    def __init__(self, size): pass\n    update = print\n", TypeError),
        ("def (\n", SyntaxError),
        ("import no_such_library\n", ModuleNotFoundError),
    ],
)
def test_an_error_in_a_users_own_code_keeps_its_traceback(folder, text, error):
    (folder / "mistaken.py").write_text(text)
    sys.modules.pop("mistaken", None)
    with pytest.raises(error):
        run(folder, "--mapper", "mistaken.py:Mine", "--scans", "3")


def test_what_a_noise_returns_is_checked(folder):
    (folder / "returning.py").write_text("def mine(scan, rng): pass\n")
    named = ("--noise", "returning.py:mine", "--no-video", "--scans", "3")
    said = refused("run", "box.toml", *named, cwd=folder)
    assert "returned None; expected a LaserScan of 61" in said


def test_a_noise_takes_the_place_of_the_levels_of_a_world(folder):
    named = ("--noise", "own_parts:longer", "--no-video", "--json")
    done = program("run", "paper_room", *named, cwd=folder)
    summary = json.loads(done.stdout)
    assert summary["sigma_m"] is None and "noise_levels" not in summary
    assert "paper_room: --noise takes the place of its noise levels" in done.stderr


def test_a_file_replaces_no_installed_module_and_imports_files_next_to_it(folder):
    parts = folder / "parts"
    parts.mkdir()
    text = "import statistics\nfrom beside_parts import Still as Mine\n"
    (parts / "own_mapper.py").write_text(text)
    (parts / "beside_parts.py").write_text("class Still:\n    def update(self, scan): pass\n")
    # It is never wanted: the installed module of this name comes first.
    (parts / "statistics.py").write_text("raise SystemExit('taken for another')\n")
    run(folder, "--mapper", "parts/own_mapper.py:Mine", "--scans", "3")
    found = load_plugin("mapper", "parts/own_mapper.py:Mine")
    assert pickle.loads(pickle.dumps(found)) is found
    (folder / "own_mapper.py").write_text(text)
    with pytest.raises(InputError, match="another module is called own_mapper; rename the file"):
        load_plugin("mapper", "own_mapper.py:Mine")


def test_a_controller_that_expects_one_scan_of_several_lasers_is_told(tmp_path):
    class Ahead:
        def command(self, time, pose, scan):
            return scan.ranges.min(), 0.0

    lasers = [LaserRangeFinder(name="front"), LaserRangeFinder(name="rear")]
    with pytest.raises(AttributeError) as caught:
        next(iter(Simulation(BOX, Ahead(), lasers, start=(1, 1, 0))))
    assert caught.value.__notes__ == ["controller: its scan is a tuple of 2, one of each laser"]
