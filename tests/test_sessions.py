import json
from dataclasses import replace

import numpy as np
import pytest
from drives import drive, recorded
from program import lrf3d as program

import lrf3d
from lrf3d.geometry import wrap_angle
from lrf3d.pose import between, compose

ROOMS = lrf3d.World(
    [
        *[[0, 0, 14, 0], [14, 0, 14, 9], [14, 9, 0, 9], [0, 9, 0, 0]],
        *[[6, 0, 6, 2.5], [6, 4, 6, 9], [9, 9, 9, 6], [6, 6, 7.5, 6]],
        *[[2, 5, 3, 5], [3, 5, 3, 6], [11, 2, 12, 3], [0, 7, 1.5, 7], [4, 0, 4, 1]],
    ],
    name="rooms",
)
ROUTE = [(1.5, 1.5), (5, 3.2), (8, 3.2), (10, 5), (12.5, 5), (12.5, 7.5)]
BACK = [(12, 7), (12, 5), (10, 4), (8, 3.2), (5, 3.2), (2, 3), (1.5, 6)]
ELSEWHERE = lrf3d.World(
    [[0, 0, 5, 0], [5, 0, 7, 8], [7, 8, 3, 11], [3, 11, 3, 6], [3, 6, 0, 5], [0, 5, 0, 0]],
    name="elsewhere",
)


def log_of(*parts):
    """The log of drives one after another: the robot is carried, and its wheels do not notice."""
    scans, wheels = list(parts[0][0]), parts[0][1]
    for others, turned, _ in parts[1:]:
        step, start = 0.25, scans[-1].time + 0.25
        scans += [replace(scan, time=start + step * k) for k, scan in enumerate(others)]
        wheels = np.vstack([wheels, compose(wheels[-1], between(turned[0], turned))])
    return recorded(scans, wheels)


def errors(found, *parts):
    """How far the poses are off [m], [rad], where they are known."""
    off = found.poses - np.concatenate([true for _, _, true in parts])
    return np.hypot(off[:, 0], off[:, 1])[found.known], np.abs(wrap_angle(off[:, 2]))[found.known]


@pytest.mark.parametrize("kind", ["world", "run"])
def test_a_drive_is_found_on_a_plan_and_on_a_map_without_a_first_pose(kind):
    known = ROOMS
    if kind == "run":
        path = lrf3d.follow_route(np.array([*ROUTE, *BACK]), dt=0.5)
        known = lrf3d.simulate(ROOMS, path, rng=0)
    part = drive(ROOMS, BACK, seed=3)
    found = lrf3d.localise_log(known, log_of(part))
    apart, turned = errors(found, part)
    (stretch,) = found.stretches
    assert stretch.first < 20 and stretch.last > len(found.poses) - 20 and not stretch.carried
    assert stretch.probability >= 0.99
    assert apart.max() < 0.2 and turned.max() < 0.05


def test_a_robot_that_is_not_on_the_map_is_found_nowhere():
    part = drive(ELSEWHERE, [(1, 1), (4, 3), (5.5, 7)], seed=1)
    found = lrf3d.localise_log(ROOMS, log_of(part))
    assert found.stretches == () and not found.known.any() and found.probability < 0.9


def test_a_robot_that_is_carried_away_is_found_again():
    parts = drive(ROOMS, BACK, seed=3), drive(ROOMS, ROUTE[2:], seed=4)
    found = lrf3d.localise_log(ROOMS, log_of(*parts))
    first, second = found.stretches
    count = len(parts[0][0])
    assert first.last < count <= second.first < count + 20
    assert second.carried and not first.carried
    assert errors(found, *parts)[0].max() < 0.2


def test_localise_writes_poses_and_a_picture(tmp_path):
    path, world = tmp_path / "drive.log", tmp_path / "rooms.toml"
    run = lrf3d.simulate(ROOMS, lrf3d.follow_route(np.array(BACK), dt=0.25), rng=0)
    lrf3d.export_run(run, "carmen", path)
    lrf3d.save_world(ROOMS, world)
    done = program("localise", world, path, "--out", tmp_path / "out", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    summary = json.loads(done.stdout)
    assert summary["stretches"][0]["probability"] >= 0.99
    table = np.loadtxt(tmp_path / "out/trajectory.tum")
    assert len(table) == summary["scans_localised"] > 0.8 * len(run)
    assert np.hypot(*(table[-1, 1:3] - run.trajectory.poses[-1, :2])) < 0.1
    assert (tmp_path / "out/map.png").exists()
