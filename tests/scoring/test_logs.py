"""Scores of maps against recorded scans, where no truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import as_map, box, make_run, make_world, ring

from lrf3d import LaserRangeFinder, LaserScan, LineMap, Pose
from lrf3d.scoring import score_log

ROUND = LaserRangeFinder(-np.pi, np.pi, 721)
ROOM = ring([(0, 0), (12, 0), (12, 8), (0, 8)])


def test_a_perfect_map_explains_all_and_is_never_violated():
    world = make_world(ROOM)
    run = make_run(world, np.array([[3.0, 3.0, 0.2], [8.0, 5.0, 2.0]]), ROUND)
    score = score_log(as_map(world.segments), run.scans)
    assert (score.explained, score.violation) == (1.0, 0.0)
    assert score.median_range_error == pytest.approx(0.0, abs=1e-9)
    assert (score.segments, score.scans, score.returns) == (4, 2, 2 * 721)
    assert score.length == pytest.approx(40.0)


def test_a_wall_in_mid_room_violates_the_beams_that_pass_it():
    world = make_world(ROOM)
    lrf = LaserRangeFinder(-np.pi / 2, np.pi / 2, 181)
    run = make_run(world, np.array([[6.0, 4.0, 0.0]]), lrf)
    phantom = np.vstack([world.segments, [[8.0, 2.0, 8.0, 6.0]]])
    score = score_log(as_map(phantom), run.scans)
    assert score.violation == pytest.approx(91 / 181, abs=2 / 181)
    assert score.explained == 1.0


def test_returns_that_are_too_near_or_too_far_are_not_judged():
    angles = np.zeros(6)
    ranges = np.array([0.1, 0.11, 19.95, 20.0, np.inf, -np.inf])
    scan = LaserScan(Pose(0, 0, 0), angles, ranges)
    score = score_log(as_map(np.array([[20.0, -1.0, 20.0, 1.0]])), [scan])
    assert score.returns == 2
    assert score.explained == 0.5
    assert score.violation == 0.0
    assert score.median_range_error == pytest.approx(0.5 * (0.05 + 19.89))


def test_a_log_scores_the_same_far_from_the_origin_and_by_a_laser_that_turns_clockwise():
    world = make_world(ROOM, box(4, 3, 2, 2))
    poses = np.array([[2.0, 2.0, 0.2], [9.0, 5.0, 2.0]])
    scans = list(make_run(world, poses, LaserRangeFinder(-1.0, 2.0, 91), sigma=0.5).scans)
    here = score_log(as_map(world.segments), scans).as_dict()
    x, y = away = np.array([85000.0, 447500.0])
    moved = [replace(s, pose=Pose(s.pose.x + x, s.pose.y + y, s.pose.theta)) for s in scans]
    there = score_log(as_map(world.segments + np.tile(away, 2)), moved).as_dict()
    assert there == pytest.approx(here, abs=1e-9)
    turned = [replace(s, angles=s.angles[::-1], ranges=s.ranges[::-1]) for s in scans]
    other = score_log(as_map(world.segments), turned).as_dict()
    assert other == pytest.approx(here, abs=1e-12)


def test_a_log_without_map_or_returns_has_no_figures():
    scan = LaserScan(Pose(0, 0, 0), np.zeros(1), np.array([5.0]))
    empty = score_log(LineMap.empty(), [scan]).as_dict()
    assert (empty["explained"], empty["violation"], empty["median_range_error"]) == (0.0, 0.0, None)
    assert score_log(LineMap.empty(), []).as_dict()["explained"] is None


def test_uneven_beams_are_judged_one_by_one():
    scan = LaserScan(Pose(0, 0, 0), np.array([0.0, 0.1, 0.5]), np.array([1.0, 1.5, 1.0]))
    score = score_log(as_map(np.array([[1.0, -1.0, 1.0, 1.0]])), [scan])
    assert (score.explained, score.violation) == (1 / 3, 1 / 3)
