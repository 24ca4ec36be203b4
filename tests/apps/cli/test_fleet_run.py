"""Several robots on one route: `lrf3d run WORLD --robots N`."""

import json

import numpy as np
import pytest
from program import ran, refused, told

from lrf3d import DynamicObstacle, InputError, Pose, Trajectory, World, load_map, load_run
from lrf3d.casting.collision import Body, find_collision
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.simulation.fleet import APART, before_touching, giving_way, parts_of
from lrf3d.studio.scene.bodies import Obstacles, robot_body

BODY = Body(0.3)


def test_each_robot_has_its_part_of_the_route_without_the_way_back():
    there = np.array([(0.0, 0.0), (4.0, 0.0), (10.0, 0.0)])
    for route in (there, np.vstack([there, there[1::-1]])):
        parts = parts_of(route, 2, BODY)
        gap = 2.0 * BODY.reach + APART
        assert [part[0, 0] for part in parts] == pytest.approx([0.0, 5.0 + gap / 2], abs=0.6)
        assert parts[1][0, 0] - parts[0][-1, 0] == pytest.approx(gap)
        assert (4.0, 0.0) in map(tuple, parts[0]) and (parts[1][:, 1] == 0.0).all()
    with pytest.raises(InputError, match=r"9 robots: a route of 10\.00 m leaves each 0\.13 m"):
        parts_of(there, 9, BODY)


def test_a_robot_waits_until_another_has_passed():
    times = np.arange(1140.0)
    along = Trajectory(times, [(0.5 * t, 0.0, 0.0) for t in times])
    across = Trajectory(times, [(5.0, 0.5 * t - 5.0, 0.0) for t in times])
    first, second = giving_way([along, across], BODY)
    assert np.array_equal(first.poses, along.poses)
    assert (
        before_touching([along, across], BODY)[1] and not before_touching([first, second], BODY)[1]
    )
    assert 0.0 < second.length < across.length
    assert set(np.diff(second.poses[:, 1])) == {0.0, 0.5}


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
    robot = DynamicObstacle(round_outline(0.3), path, 1.0, is_robot=True)
    drawn = Obstacles((robot,), np.zeros(2), laser_height=0.5).bodies(0.0)[0][1].faces
    own = robot_body(0.5, robot.reach)
    assert np.array_equal(drawn.corners, own.corners)
    assert 0.05 < (drawn.colours != own.colours).any(axis=(1, 2)).mean() < 0.5


def test_each_robot_has_its_run_its_map_and_its_summary(tmp_path):
    words = "run", "corridor", "--robots", "2", "--scans", "20", "--no-video"
    summary = told(*words, "--out", tmp_path / "out", warns=True)
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
    assert "90 robots: a route of" in refused(*words[:3], "90", *words[4:])


@pytest.mark.slow
def test_robots_of_a_run_before_leave_no_folder(tmp_path):
    words = "run", "corridor", "--scans", "2", "--no-video", "--out", tmp_path
    ran(*words, "--robots", "2")
    (tmp_path / "robot1" / "mine.txt").write_text("kept")
    ran(*words)
    left = {str(file.relative_to(tmp_path)) for file in tmp_path.glob("robot*/*")}
    assert left == {"robot1/mine.txt"} and not (tmp_path / "robot2").exists()
