"""A drive by hand: what the robot does, and what the page is told."""

import numpy as np
import pytest
from yard import OBSTACLE, YARD

from lrf3d.pose import Pose
from lrf3d.scenario import load_scenario
from lrf3d.view.hand_drive import HandDrive, Wish


def hand(text, tmp_path, **settings):
    path = tmp_path / "world.toml"
    path.write_text(text)
    scenario = load_scenario(path)
    return HandDrive(scenario, Pose(2.0, 3.0, 0.0), **settings)


def test_a_hand_drives_stops_before_walls_and_starts_again(tmp_path):
    drive = hand(YARD, tmp_path, rng=4)
    first = drive.step(0.05)
    assert first["fresh"] and first["map"] is not None
    drive.wish = Wish(forward=1.0)
    news = [drive.step(0.05) for _ in range(200)]
    speeds = np.array([each["pose"]["speed"] for each in news])
    assert speeds.max() == pytest.approx(2.0) and not any(each["fresh"] for each in news)
    # Ten seconds at 2 m/s would lead through the wall at x = 16.
    assert any(each["bumped"] for each in news) and 15.0 < drive.pose.x < 15.65 + 1e-9
    assert drive.pose.y == 3.0
    drive.restart()
    drive.wish = Wish()
    again = drive.step(0.05)
    assert again == first


def test_a_hand_cannot_ask_for_more_than_the_robot_can_or_for_a_long_step(tmp_path):
    drive = hand(YARD, tmp_path)
    drive.wish = Wish(forward=1.0)
    drive.step(1e6)
    assert drive.pose.x < 2.0 + 2.0 * 0.1 + 1e-9


def test_what_moves_is_seen_by_the_laser_and_told_to_the_page(tmp_path):
    drive = hand(YARD + OBSTACLE, tmp_path)
    without = hand(YARD, tmp_path)
    origin = load_scenario(tmp_path / "world.toml").world.origin
    nearer, plain = 0, None
    for _ in range(60):
        news, plain = drive.step(0.1), without.step(0.1) or plain
        x, y = np.array(news["obstacles"][:2]) + origin
        assert x == pytest.approx(9.0) and 2.0 <= y <= 7.0
        nearer += sum(a < b - 1.0 for a, b in zip(news["ranges"], plain["ranges"], strict=True))
    assert plain["obstacles"] == [] and nearer > 60


def test_while_nothing_changes_nothing_is_told(tmp_path):
    drive = hand(YARD, tmp_path)
    assert drive.step(0.05)["fresh"]
    assert [drive.step(0.05) for _ in range(3)] == [None] * 3
    drive.wish = Wish(turn=1.0)
    assert drive.step(0.05)["pose"]["turning"] > 0.0


def test_the_noise_of_the_scenario_is_that_of_the_drive(tmp_path):
    drive = hand(YARD + "\n[noise]\nsigma = 0\nresolution = 0.5\n", tmp_path)
    ranges = np.array(drive.step(0.05)["ranges"], float)
    assert np.array_equal(ranges, np.round(2.0 * ranges) / 2.0)


def test_a_beam_without_return_is_told_as_none(tmp_path):
    drive = hand(YARD.replace("range_max = 30.0", "range_max = 4.0"), tmp_path)
    ranges = drive.step(0.05)["ranges"]
    assert None in ranges and all(r is None or 0.0 < r < 4.5 for r in ranges)
