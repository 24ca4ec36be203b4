import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
import shapely
from drives import SCANNER, drive, errors, followed, recorded, rooms, solved, through

import lrf3d
from lrf3d.geometry.pose import between
from lrf3d.recordings.repair.repairs import SOLVING, repair
from lrf3d.recordings.repair.wheel_path import WheelPath
from lrf3d.slam.front_end import weakest_direction
from lrf3d.slam.motion import Wheels
from lrf3d.slam.slam import REDRAWN_PER_SCAN
from lrf3d.slam.solution import rising


@pytest.fixture(scope="module")
def identical_rooms():
    scans, wheels, true = drive(rooms(4), through(4))
    return solved(scans, wheels), wheels, true


@pytest.mark.slow
def test_a_drive_through_identical_rooms_is_followed_to_centimetres(identical_rooms):
    solution, wheels, true = identical_rooms
    assert errors(true, wheels).max() > 1.0
    assert errors(true, solution.poses).max() < 0.1


def test_no_closure_takes_one_room_for_another(identical_rooms):
    solution, _, true = identical_rooms
    assert len(solution.slam.closures) > 10
    keys = true[solution.slam.key_scans]
    for closure in solution.slam.closures:
        off = closure.relative - between(keys[closure.old], keys[closure.new])
        off[2] = np.angle(np.exp(1j * off[2]))
        assert off @ closure.information @ off < 30.0


def test_the_turn_per_metre_of_unequal_wheels_is_estimated(identical_rooms):
    solution, _, _ = identical_rooms
    assert solution.slam.wheels.biases[1] == pytest.approx(-0.03, abs=0.006)


@pytest.mark.slow
def test_in_a_corridor_the_distance_along_it_is_left_to_the_odometry_and_reported():
    world = lrf3d.World([[-100, 0, 200, 0], [-100, 2, 200, 2]])
    scans, wheels, true = drive(world, [(0, 1), (30, 1)], bias=0.0)
    solution = solved(scans, wheels)
    last = solution.slam.tracked[-1]
    assert last.weak and abs(weakest_direction(last.information)[0][0]) > 0.99
    assert np.abs(solution.poses[:, 1] - true[:, 1]).max() < 0.02
    assert errors(true, solution.poses).max() < 1.0


def test_pose_and_map_are_current_after_every_scan():
    world = lrf3d.World([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 2.5, 4], [2.5, 4, 0, 3], [0, 3, 0, 0]])
    scans, wheels, true = drive(world, [(1, 1), (5, 1), (5, 3)])
    slam = lrf3d.Slam(SCANNER, start=true[0])
    assert slam.pose == tuple(true[0]) and len(slam.map) == 0
    assert repr(slam) == "Slam(0 scans, 0 key scans, 0 closures)"
    for number, _ in enumerate(followed(slam, scans, wheels)):
        assert np.hypot(*(np.array(slam.pose) - true[number])[:2]) < 0.05
    assert len(slam.trajectory()) == len(scans)
    assert slam.trajectory()[-1] == pytest.approx(np.array(slam.pose), abs=1e-6)
    ends = shapely.points(slam.map.segments.reshape(-1, 2))
    walls = shapely.linestrings(world.segments.reshape(-1, 2, 2))
    distances = shapely.distance(ends[:, None], walls)
    assert len(slam.map) >= 5 and distances.min(axis=1).max() < 0.1


def test_the_map_does_not_depend_on_when_it_is_read_and_is_not_drawn_too_often(monkeypatch):
    updates = []

    class Counted(lrf3d.LineMapper):
        def update(self, scan):
            updates.append(scan)
            super().update(scan)

    monkeypatch.setattr("lrf3d.slam.slam.LineMapper", Counted)
    scans, wheels, true = drive(rooms(1), [(1, 1), (4, 1), (4, 1.2), (1, 1.2), (1, 1)])
    for slam in followed(lrf3d.Slam(start=true[0]), scans, wheels):
        assert slam.map is not None
    assert len(updates) <= REDRAWN_PER_SCAN * len(scans) + len(slam.key_scans)
    [*_, seldom] = followed(lrf3d.Slam(start=true[0]), scans, wheels)
    assert np.array_equal(seldom.map.segments, slam.map.segments)


@pytest.mark.slow
def test_the_covariance_is_that_of_the_errors():
    squares = []
    for seed in range(6):
        scans, wheels, true = drive(rooms(2), through(2), seed=seed)
        for number, slam in enumerate(followed(lrf3d.Slam(start=true[0]), scans, wheels)):
            if number % 50 == 49:
                error = np.array(slam.pose) - true[number]
                error[2] = np.angle(np.exp(1j * error[2]))
                squares.append(error @ np.linalg.solve(slam.covariance(), error) / 3.0)
    assert len(squares) > 15
    assert 0.2 < np.mean(squares) < 3.0


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda slam: pickle.loads(pickle.dumps(slam))])
def test_a_copy_goes_on_by_itself(copied):
    scans, wheels, _ = drive(rooms(1), [(1, 1), (4, 1)])
    steps, half = [np.zeros(3), *lrf3d.odometry_increments(wheels)], len(scans) // 2
    slam = lrf3d.Slam(SCANNER)
    for scan, step in zip(scans[:half], steps[:half], strict=True):
        slam.update(scan, step)
    other = copied(slam)
    for each in (other, slam):
        assert len(each.tracked) == half
        for scan, step in zip(scans[half:], steps[half:], strict=True):
            each.update(scan, step)
    assert np.array_equal(other.trajectory(), slam.trajectory())
    assert np.array_equal(other.map.segments, slam.map.segments)


def test_all_scans_are_refined_or_none():
    scans, wheels, _ = drive(rooms(1), [(1, 1), (2, 1)])
    assert lrf3d.Slam().refined([]).shape == (0, 3)
    [*_, slam] = followed(lrf3d.Slam(), scans[:3], wheels[:3])
    with pytest.raises(lrf3d.InputError, match="2 scans to refine; expected all 3"):
        slam.refined(scans[:2])


def test_robots_that_start_with_the_same_wheels_learn_their_own():
    scans, wheels, _ = drive(rooms(1), [(1, 1), (4, 1)], bias=0.1)
    known, found = Wheels(), []
    for _ in range(2):
        [*_, slam] = followed(lrf3d.Slam(wheels=known), scans, wheels)
        found.append(slam.trajectory().tolist())
    assert found[0] == found[1]
    assert not known.biases.any()
    assert slam.wheels.biases.any()


@pytest.mark.parametrize("wrong", [[-1], [1], [0.5], [np.nan]])
def test_covariances_of_key_scans_that_are_not_there_are_refused(wrong):
    slam = lrf3d.Slam()
    assert slam.covariances([]).shape == (0, 3, 3)
    with pytest.raises(lrf3d.InputError, match="key scan"):
        slam.covariances([0])
    slam.update(drive(rooms(1), [(1, 1), (1.5, 1)])[0][0], (0, 0, 0))
    assert slam.covariances([0]).tolist() == np.zeros((1, 3, 3)).tolist()
    with pytest.raises(lrf3d.InputError, match=r"key scan .*: expected a whole number from 0 to 0"):
        slam.covariances(wrong)


TWO_BEAMS = lrf3d.LaserScan((0, 0, 0), [0.0, 0.1], [1.0, 1.0])
REFUSED_UPDATES = {
    "no scan": (None, (0, 0, 0), "expected a LaserScan"),
    "no beams": (lrf3d.LaserScan((0, 0, 0), [], []), (0, 0, 0), "scan of 0 beams"),
    "another laser": (TWO_BEAMS, (0, 0, 0), "2 beams"),
    "NaN": (TWO_BEAMS, (0, np.nan, 0), "finite"),
    "far": (TWO_BEAMS, (1e5, 0.0, 0.0), "at most 1000 m"),
    "texts": (TWO_BEAMS, (0.0, 0.0, "a"), "three numbers"),
    "two numbers": (TWO_BEAMS, (1.0, 2.0), "three numbers"),
}


@pytest.mark.parametrize("case", REFUSED_UPDATES)
def test_updates_refuse_invalid_scans_and_odometry(case):
    scan, step, reason = REFUSED_UPDATES[case]
    slam = lrf3d.Slam(SCANNER if case == "another laser" else None)
    with pytest.raises(lrf3d.InputError, match=reason):
        slam.update(scan, step)
    assert slam.trajectory().shape == (0, 3)


@pytest.mark.parametrize("wrong", [{"key_distance": 0.0}, {"laser_offset": "a"}])
def test_invalid_settings_are_refused(wrong):
    with pytest.raises(lrf3d.InputError, match=r"expected finite numbers.*positive"):
        lrf3d.Slam(**wrong)


def test_a_scan_without_any_return_leaves_the_robot_to_the_odometry():
    slam = lrf3d.Slam()
    empty = lrf3d.LaserScan((0, 0, 0), SCANNER.angles, np.full(181, np.inf))
    for count in range(1, 4):
        slam.update(empty, (0.5, 0.0, 0.1))
        before = slam.trajectory()
        slam.finish()
        assert slam.trajectory() == pytest.approx(before)
        assert slam.refined([empty] * count) == pytest.approx(before)
    assert slam.pose.x > 0.9
    assert len(slam.map) == 0


@pytest.mark.slow
def test_the_lag_of_the_laser_is_found():
    scans, wheels, _ = drive(rooms(2), through(2) * 2, bias=0.0, heading=0.001)
    # Lines lie twice as dense as scans, and a scan was taken 0.6 lines before its place.
    lines = WheelPath(wheels).at(np.arange(0.0, len(wheels) - 0.5, 0.5))
    places = np.arange(0, len(lines), 2)
    shifted = WheelPath(lines).at(np.arange(len(lines)) + 0.6)
    solution = solved(scans, shifted, places)
    assert solution.recording.lags.mean() == pytest.approx(0.6, abs=0.1)


def test_stamps_that_run_backwards_become_times_that_rise():
    times = rising(np.array([0.0, 1.0, 0.9, 1.1, 1.1]))
    assert (np.diff(times) > 0.0).all()
    assert times[[0, 1, 3]].tolist() == [0.0, 1.0, 1.1]


@pytest.fixture
def short():
    scans, wheels, _ = drive(rooms(1), [(1, 1), (3, 1)])
    return [replace(scan, time=0.1 * number) for number, scan in enumerate(scans)], wheels


def test_a_log_whose_driver_gives_no_largest_range_is_solved(short):
    scans, wheels = short
    run = lrf3d.slam_log(recorded([replace(scan, range_max=np.inf) for scan in scans], wheels))
    assert run.lrf.range_max == lrf3d.LaserRangeFinder().range_max


def test_a_laser_that_turns_clockwise_and_says_so_sees_the_same_drive(short):
    scans, wheels = short
    run = lrf3d.slam_log(recorded(scans, wheels))
    turned = [replace(s, angles=s.angles[::-1], ranges=s.ranges[::-1]) for s in scans]
    other = lrf3d.slam_log(recorded(turned, wheels))
    assert np.array_equal(other.lrf.angles, run.lrf.angles)
    assert np.array_equal(other.ranges, run.ranges)
    assert other.trajectory.poses == pytest.approx(run.trajectory.poses, abs=0.002)


def test_angles_that_jitter_by_rounding_are_those_of_one_laser(short):
    scans, wheels = short
    rng = np.random.default_rng(0)
    jittered = [replace(s, angles=s.angles + 1e-6 * rng.normal(size=len(s.angles))) for s in scans]
    found = solved(jittered, wheels).poses
    assert found == pytest.approx(solved(scans, wheels).poses, abs=1e-3)


def test_a_fan_that_ends_just_beyond_a_turn_is_one(short):
    """Drivers of lasers that turn round have their step in float32."""
    scans, wheels = short
    turned = [replace(s, angles=s.angles - s.angles[-1] + 6.2833) for s in scans]
    assert len(repair(recorded(turned, wheels), SOLVING)[0].scans) == len(scans)


REFUSED = {
    "no scans": (lambda s, w: ([], w), "without scans"),
    "one scan": (lambda s, w: (s[:1], w), "at least two"),
    "one moment": (lambda s, w: (s[:1] * 4, w[:4]), "one scan, 4 times"),
    "one beam": (
        lambda s, w: ([lrf3d.LaserScan((0, 0, 0), [0.0], [1.0]) for _ in s], w),
        "scans of 1 beams",
    ),
    "no returns": (lambda s, w: ([replace(x, ranges=0 * x.ranges) for x in s], w), "too few"),
    "millimetres": (
        lambda s, w: ([replace(x, ranges=1e3 * x.ranges, range_max=np.inf) for x in s], w),
        "millimetres by 1000",
    ),
    "a beam at 50 rad": (
        lambda s, w: ([replace(x, angles=x.angles + 50.0) for x in s], w),
        "a beam at [0-9.]+ rad",
    ),
    "nanoseconds": (lambda s, w: ([replace(x, time=1e18) for x in s], w), "expected seconds"),
    "odometry that is not finite": (
        lambda s, w: (s, np.where(np.arange(len(w))[:, None] == 4, np.nan, w)),
        "odometry line 4 at 4.0 s",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_log_that_no_slam_can_solve_is_refused_in_one_line_that_names_it(short, case):
    change, reason = REFUSED[case]
    scans, wheels = change(*short)
    with pytest.raises(lrf3d.InputError, match=f"hall: .*{reason}") as refused:
        solved(scans, wheels, name="hall")
    assert "\n" not in str(refused.value)
    if case == "millimetres":
        with pytest.raises(lrf3d.InputError, match=reason):
            lrf3d.map_log(recorded(scans, wheels))
