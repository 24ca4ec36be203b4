"""Several robots on one route: `lrf3d run WORLD --robots N`."""

import json

import numpy as np
import pytest
from program import lrf3d, refused

from lrf3d import DynamicObstacle, Pose, Trajectory, load_run, load_scenario
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.collision import Body, find_collision
from lrf3d.errors import InputError
from lrf3d.fleet import before_touching, drives_along, places_along
from lrf3d.mapping import load_map
from lrf3d.scene.bodies import Obstacles, robot_body
from lrf3d.world import World

BODY = Body(0.3)


def test_robots_start_evenly_spread_and_drive_the_same_path():
    path = load_scenario("corridor").trajectory(scans=200)
    places = places_along(path, 3, BODY, once=90)
    assert places == [0, 30, 60]
    for place, drive in zip(places, drives_along(path, places, 50), strict=True):
        assert drive.times[0] == 0.0 and len(drive) == 50
        assert np.array_equal(drive.poses, path.poses[place : place + 50])
    with pytest.raises(InputError, match="40 robots"):
        places_along(path, 40, BODY, once=90)


def test_drives_end_before_two_robots_touch():
    times = np.arange(0.0, 10.5, 0.5)
    there = Trajectory(times, [(t, 0.0, 0.0) for t in times])
    back = Trajectory(times, [(10.0 - t, 0.1, np.pi) for t in times])
    (first, second), text = before_touching([there, back], BODY)
    # Centres are 2 r apart, of which 0.1 m to the side.
    touch = 0.5 * (10.0 - np.sqrt(0.36 - 0.01))
    assert "robot1 and robot2 would touch after 4.7 s" in text
    assert len(first) == len(second) == np.searchsorted(times, touch)
    other = DynamicObstacle(round_outline(0.3), second)
    assert find_collision(first, World(np.empty((0, 4))), BODY, [other]) is None
    assert before_touching([there], BODY)[1] == ""


def test_another_robot_is_drawn_as_the_robot_in_another_colour():
    path = Trajectory([0.0], [Pose(1.0, 2.0, 0.5)])
    outline = round_outline(0.3)
    robot = DynamicObstacle(outline, path, 1.0, is_robot=True)
    drawn = Obstacles((robot,), np.zeros(2), indoor=True, laser_height=0.5).bodies(0.0)[0][1].faces
    own = robot_body(0.5, robot.reach)
    assert np.array_equal(drawn.corners, own.corners)
    changed = (drawn.colours != own.colours).any(axis=(1, 2))
    assert 0.05 < changed.mean() < 0.5


def test_each_robot_has_its_run_its_map_and_its_summary(tmp_path):
    done = lrf3d(
        *("run", "corridor", "--robots", "2", "--scans", "20", "--no-video", "--json"),
        *("--out", tmp_path / "out"),
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    runs = [load_run(tmp_path / "out" / name) for name in ("robot1", "robot2")]
    for number, (run, other) in enumerate(zip(runs, runs[::-1], strict=True)):
        folder = tmp_path / "out" / f"robot{number + 1}"
        own = json.loads((folder / "summary.json").read_text())
        assert own["drive"] == summary["robots"][number]["drive"]
        assert len(load_map(folder / "map.geojson")) == len(run.map)
        seen = [each for each in run.obstacles if each.is_robot]
        assert len(seen) == 1
        assert np.array_equal(seen[0].poses.poses, other.trajectory.poses)


def test_what_several_robots_cannot_do_is_refused(tmp_path):
    words = "run", "corridor", "--robots", "2", "--no-video", "--out", tmp_path
    assert "--resume" in refused(*words, "--resume")
    assert "--sigma" in refused(*words, "--sigma", "0.1,0.2")
    assert "apart on the route" in refused(*words[:3], "90", *words[4:])
