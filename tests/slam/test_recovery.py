"""Drives whose odometry or scans fail for a while."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from drives import HALL, drive, errors, path_of, rooms, solved, through

import lrf3d
from lrf3d.geometry.pose import between, compose
from lrf3d.recordings import LaserLog
from lrf3d.recordings.repair.repairs import figures_of
from lrf3d.slam.offline import solve_log


@pytest.mark.parametrize("first, last", [(50, 80), pytest.param(0, None, marks=pytest.mark.slow)])
def test_the_robot_is_followed_where_its_encoders_stand_still(first, last):
    scans, wheels, true = drive(rooms(2), through(2))
    steps = between(wheels[:-1], wheels[1:])
    steps[first:last] = 0.0
    wheels = path_of(wheels[0], steps)
    assert errors(true, wheels).max() > 3.0
    solution = solved(scans, wheels)
    # Where the drive begins nothing but encoders can tell how far the robot is along the corridor.
    assert errors(true, solution.poses)[10:].max() < 0.1


def test_glass_in_a_corridor_is_not_taken_for_a_robot_that_drives_backwards():
    """Most beams that meet glass go through it, so that little of a scan is explained."""
    world = rooms(8)
    scans, wheels, true = drive(world, [(1.0, 1.2), (38.0, 1.2)], seed=3)
    rng = np.random.default_rng(3)
    glass = rng.random(len(world.segments)) < 0.5
    seen = []
    for scan in scans:
        lost = (scan.walls >= 0) & glass[scan.walls] & (rng.random(len(scan.ranges)) < 0.85)
        seen.append(replace(scan, ranges=np.where(lost, np.inf, scan.ranges)))
    solution = solved(seen, wheels)
    poses = np.array([scan.pose for scan in solution.slam.tracked])
    wrong = np.abs(between(poses[:-1], poses[1:]) - between(true[:-1], true[1:]))
    assert wrong.max() < 0.15


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_few_beams_reveal_reversed_encoders_over_several_scans(seed):
    """Encoders without a direction report that a robot drives ahead that drives back."""
    lrf = lrf3d.LaserRangeFinder(beams=61, range_max=8.0)
    scans, wheels, true = drive(rooms(3), through(3), seed=seed, bias=0.0, lrf=lrf)
    back = [*range(90), *range(90, 82, -1), *range(82, 200)]
    steps = between(wheels[back][:-1], wheels[back][1:])
    steps[89:98, 0] = 0.3 * np.abs(steps[89:98, 0])
    moved = [replace(scans[k], time=0.1 * number) for number, k in enumerate(back)]
    assert errors(true[back], solved(moved, path_of(wheels[0], steps)).poses).max() < 0.2


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_robot_that_drives_backwards_is_not_held_where_it_was(seed):
    """It sees walls for the first time: the place of the last scan explains more of them."""
    lrf = lrf3d.LaserRangeFinder(beams=181, range_max=5.0)
    scans, wheels, true = drive(rooms(4), through(4), seed=seed, bias=0.0, lrf=lrf)
    scans, wheels, true = scans[::-4], wheels[::-4], true[::-4]
    wheels = path_of(true[0], between(wheels[:-1], wheels[1:]))
    assert errors(true, solved(scans, wheels).poses).max() < 0.2


@pytest.mark.slow
def test_around_a_block_of_corridors_the_wheels_are_learned_while_driving(monkeypatch):
    """The first corridors show nothing along them, and a loop closes at any scale."""
    monkeypatch.setattr("lrf3d.slam.offline.CALIBRATED", 100)
    rng = np.random.default_rng(4)
    bare = [[0, 0, 30, 0], [30, 0, 30, 20], [30, 20, 0, 20], [0, 20, 0, 0]]
    block = [[2.4, 2.4, 27.6, 2.4], [27.6, 2.4, 27.6, 17.6], [27.6, 17.6, 2.4, 17.6]]
    niches = [[x, 20.0, x, 19.0 - rng.uniform(0.0, 0.4)] for x in np.arange(4.0, 27.0, 3.0)]
    world = lrf3d.World([*bare, *block, [2.4, 17.6, 2.4, 2.4], *niches])
    route = [(1.2, 0.8), (28.8, 0.8), (28.8, 18.8), (1.2, 18.8), (1.2, 1.8), (10.0, 1.8)]
    scans, wheels, true = drive(world, route, bias=0.0, lrf=lrf3d.LaserRangeFinder(range_max=10.0))
    steps = between(wheels[:-1], wheels[1:]) * [1.06, 1.06, 1.0]
    solution = solved(scans, path_of(wheels[0], steps))
    assert solution.passes == 2
    assert errors(true, solution.poses).max() < 0.5


def slipping(wheels, count, rng):
    """The odometry where the wheels slip a number of times, and turn the robot by 15° unnoticed."""
    steps = between(wheels[:-1], wheels[1:])
    for slip in rng.choice(np.arange(5, len(steps)), count, replace=False):
        turn = np.array([0.0, 0.0, np.radians(15) * rng.choice([-1, 1])])
        steps[slip] = compose(turn, steps[slip])
    return path_of(wheels[0], steps)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_slam_survives_wheels_that_slip_between_scans_far_apart(seed):
    """The slip turns what is left of the step; along the corridor only its turn shows that."""
    scans, wheels, true = drive(rooms(4), [*through(4), *through(4)[1:]])
    scans, wheels, true = scans[::6], wheels[::6], true[::6]
    solution = solved(scans, slipping(wheels, 8, np.random.default_rng(seed)))
    assert errors(true, solution.poses).max() < 0.15


@pytest.mark.slow
def test_loops_close_in_a_wood():
    """Among trunks hardly half of a scan is explained at the right place."""
    rng, route = np.random.default_rng(1), [(10, 10), (30, 10), (30, 30), (10, 30)]
    path, trunks = shapely.LinearRing(route), []
    for x, y, radius in rng.uniform([0, 0, 0.12], [40, 40, 0.3], (110, 3)):
        trunk = shapely.Point(x, y).buffer(radius, quad_segs=2)
        if trunk.distance(path) > 1.2:
            corners = shapely.get_coordinates(trunk)
            trunks.append(np.hstack([corners[:-1], corners[1:]]))
    lrf = lrf3d.LaserRangeFinder(-np.pi, np.pi * 359 / 360, beams=360, range_max=30.0)
    world = lrf3d.World(np.concatenate(trunks))
    scans, wheels, true = drive(world, [*route, *route, route[0]], seed=1, lrf=lrf)
    scans, wheels, true = scans[::6], wheels[::6], true[::6]
    solution = solved(scans, slipping(wheels, 6, rng))
    keys, closures = true[solution.slam.key_scans], solution.slam.closures
    found = [compose(keys[closure.old], closure.relative) for closure in closures]
    assert len(found) > 40
    assert errors(np.array(found), keys[[closure.new for closure in closures]]).max() < 0.5
    assert errors(true, solution.poses).max() < 0.15


ROUND = lrf3d.LaserRangeFinder(-np.pi, np.pi * 359 / 360, beams=360, range_max=8.0)


def alone(scans):
    """A log without odometry."""
    return LaserLog("alone", scans, placed=False)


@pytest.mark.slow
def test_the_laser_alone_is_enough_and_reports_where_it_is_least_certain(monkeypatch):
    scans, _, true = drive(rooms(3), through(3), lrf=ROUND)
    solution = solve_log(alone(scans))
    assert errors(true, solution.poses).max() < 0.1
    assert solution.warnings == []
    monkeypatch.setattr("lrf3d.slam.solution.MOST_UNSURE", 0.0)
    [said] = solution.warnings
    assert "by the laser alone the position at scan" in said


@pytest.mark.slow
@pytest.mark.parametrize(("reach", "known"), [(3.0, False), (9.0, True)])
def test_a_drive_beyond_all_walls_by_rough_wheels_is_uncertain(reach, known):
    """No loop is closed, so that nothing contradicts a map that is bent at its start."""
    corners = [(0, 0), (20, 0), (20, 16), (0, 16), (0, 0)]
    walls = [[*one, *other] for one, other in pairwise(corners)]
    hall = lrf3d.World([*walls, [9, 8, 9.3, 8], [11, 8, 11.3, 8.2]])
    lrf = lrf3d.LaserRangeFinder(-2.1, 2.1, beams=341, range_max=reach)
    route = [(2, 2), (6, 2), (10, 8), (14, 6), (18, 8), (18, 14), (12, 14), (8, 9), (3, 9), (3, 14)]
    scans, wheels, true = drive(hall, route, seed=2, heading=0.03, lrf=lrf)
    solution = solved(scans, wheels)
    assert solution.check.passed != bool(solution.check.unjudged)
    assert (errors(true, solution.poses).max() < 0.1) == known
    assert ["the map may be bent" in said for said in solution.warnings] == [True] * (not known)


@pytest.mark.slow
def test_distances_that_the_laser_alone_does_not_see_are_reported():
    """It sees nothing but two walls for eight metres."""
    bare = lrf3d.World([[0, 0, 20, 0], [20, 0, 20, 2], [20, 2, 0, 2], [0, 2, 0, 0]])
    lrf = replace(ROUND, range_max=5.0)
    scans, _, _ = drive(bare, [(2, 1), (18, 1)], lrf=lrf)
    [said] = solve_log(alone(scans)).warnings
    assert "see bare walls and not how far the robot moved" in said


def test_a_scan_after_a_quick_turn_is_placed_by_the_laser_alone():
    scans, _, true = drive(HALL, [(2, 3.5), (8, 3.5)], lrf=replace(ROUND, beams=361))
    turned = [replace(s, angles=s.angles - 1.4 * (k >= 15)) for k, s in enumerate(scans)]
    moved = between(true[14], true[15:])
    found = solve_log(alone(turned)).poses
    assert np.hypot(*(moved - between(found[14], found[15:]))[:, :2].T).max() < 0.05


@pytest.mark.slow
def test_scans_too_far_apart_to_follow_without_odometry_are_refused():
    scans, _, _ = drive(rooms(3), through(3), lrf=ROUND)
    with pytest.raises(lrf3d.InputError, match=r"alone: .* of \d+ scans match nothing .* odometry"):
        solve_log(alone(scans[::12]))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_slam_survives_odometry_that_scans_contradict(seed):
    """It is out and back within a line, and jumps, by less than a robot drives in a second."""
    scans, wheels, true = drive(rooms(2), through(2), lrf=ROUND, bias=0.0)
    steps, rng = between(wheels[:-1], wheels[1:]), np.random.default_rng(seed)
    steps[60, 2] += np.radians(80)
    steps[90, 0] += 2.4
    corrupt = path_of(wheels[0], steps)
    for line in rng.choice(np.arange(10, 60), 4, replace=False):
        corrupt[line] += rng.uniform([1.0, -1.0, 0.6], [2.0, 1.0, 1.2]) * rng.choice([-1, 1], 3)
    solution = solved(scans, corrupt)
    assert errors(true, solution.poses).max() < 0.1
    # A line that is out and back makes two wrong increments.
    # A summary is written as JSON, which has no numbers of NumPy.
    assert 6 <= json.loads(json.dumps(figures_of(solution.recording)))["odometry_jumps"] <= 10


@pytest.mark.slow
def test_along_bare_walls_odometry_that_scans_contradict_is_not_used():
    """The recorded pose of one scan is off; beside bare walls a scan shows a part of that."""
    world = lrf3d.World([[0, 0, 40, 0], [0, 2, 40, 2], [40, 0, 40, 2], [0, 0, 0, 2]])
    scans, wheels, true = drive(world, [(5.0, 1.0), (35.0, 1.0)])
    # The ends are out of sight here.
    wheels[70] += [-0.6, -0.4, -0.2]
    solution = solved([scan.at_time(0.25 * number) for number, scan in enumerate(scans)], wheels)
    assert errors(true, solution.poses)[60:80].max() < 0.3


@pytest.mark.slow
def test_broken_scans_are_not_searched_and_become_no_key_scans():
    """A few beams that are left of a scan fit in many places."""
    scans, wheels, true = drive(rooms(2), through(2), lrf=ROUND, bias=0.0)
    for number in range(20, len(scans), 15):
        ranges = np.where(np.arange(360) // 20 == number % 18, scans[number].ranges, np.inf)
        scans[number] = replace(scans[number], ranges=ranges)
    solution = solved(scans, wheels)
    assert not set(range(20, len(scans), 15)) & set(solution.slam.key_scans.tolist())
    assert errors(true, solution.poses).max() < 0.1
