"""A drive by hand: what the robot does."""

import numpy as np
import pytest
from yard import OBSTACLE, YARD, hand

from lrf3d import Pose, Scenario, World
from lrf3d.studio.page.hand_drive import HandDrive


def test_a_hand_drives_stops_before_walls_and_starts_again_alike(tmp_path):
    drive = hand(YARD, tmp_path, rng=4)
    first = drive.latest[0].ranges
    assert drive.step(0.05) and len(drive.maps[0])
    speeds, bumped = [], False
    for _ in range(200):
        drive.step(0.05, forward=1.0)
        speeds.append(drive.robot.speed)
        bumped |= drive.robot.bumped
    assert max(speeds) == pytest.approx(2.0)
    # Ten seconds at 2 m/s would lead through the wall at x = 16.
    assert bumped and 15.0 < drive.robot.pose.x < 15.65 + 1e-9
    assert drive.robot.pose.y == 3.0
    assert np.array_equal(hand(YARD, tmp_path, rng=4).latest[0].ranges, first)


def test_a_hand_cannot_ask_for_more_than_the_robot_can_or_for_a_long_step(tmp_path):
    drive = hand(YARD, tmp_path)
    drive.step(1e6, forward=1.0)
    assert drive.robot.pose.x < 2.0 + 2.0 * 0.1 + 1e-9


def test_what_moves_is_seen_by_the_laser(tmp_path):
    drive, plain = hand(YARD + OBSTACLE, tmp_path), hand(YARD, tmp_path)
    nearer = 0
    for _ in range(60):
        drive.step(0.1)
        nearer += int(np.sum(drive.latest[0].ranges < plain.latest[0].ranges - 1.0))
    assert nearer > 60


def test_the_noise_of_the_scenario_is_that_of_the_drive(tmp_path):
    drive = hand(YARD + "\n[noise]\nsigma = 0\nresolution = 0.5\n", tmp_path)
    hits = drive.latest[0].ranges[drive.latest[0].hits]
    assert np.array_equal(hits, np.round(2.0 * hits) / 2.0)


def test_a_robot_is_sent_to_a_place_through_a_door_and_turns_there_until_a_hand_takes_over():
    walls = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0], [4, 0, 4, 4.5]]
    drive = HandDrive(Scenario(World(walls), start=Pose(1.0, 1.0, 0.0), route=[[1, 1], [2, 1]]))
    drive.go_to(np.array([7.0, 1.0]), heading=np.pi / 2)
    while drive.step(0.1) and drive.robot.time < 60.0:
        assert not drive.robot.bumped
    assert np.array(drive.robot.pose) == pytest.approx([7.0, 1.0, np.pi / 2], abs=0.15)
    drive.go_to(np.array([20.0, 1.0]))
    assert "no way" in drive.obstruction
    drive.go_to(np.array([1.0, 1.0]))
    drive.step(0.1, turn=0.5)
    assert drive.obstruction == ""
    pose = drive.robot.pose
    for _ in range(10):
        drive.step(0.1)
    assert np.hypot(pose.x - drive.robot.pose.x, pose.y - drive.robot.pose.y) < 0.1
