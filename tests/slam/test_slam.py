import copy
import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from scipy.interpolate import Akima1DInterpolator

import lrf3d
from lrf3d.errors import InputError
from lrf3d.slam.frames import between, compose
from lrf3d.slam.lag import WheelPath
from lrf3d.slam.log import line_poses, solve_log
from lrf3d.slam.repair import rising, without_jumps
from lrf3d.slam.violation import seen_through
from lrf3d.slam.wheels import Wheels

SCANNER = lrf3d.LaserRangeFinder(beams=181, range_max=15.0)


class NoMap:
    def update(self, scan):
        """Nothing."""


def drive(world, route, *, seed=0, position=0.01, heading=0.004, bias=0.03, lrf=SCANNER):
    """A drive, its scans, and what wheels with noise and a bias [rad/m] say of it."""
    way = lrf3d.follow_route(np.array(route, dtype=float), speed=0.8, dt=0.25)
    noise = lrf3d.ProportionalNoise(0.02)
    run = lrf3d.simulate(world, way, lrf, noise=noise, rng=seed, mapper=NoMap())
    true = lrf3d.odometry_increments(run.trajectory.poses)
    steps = lrf3d.OdometryNoise(position, heading)(true, np.random.default_rng(seed))
    steps[:, 2] += bias * true[:, 0]
    wheels = [run.trajectory.poses[0]]
    for step in steps:
        wheels.append(compose(wheels[-1], step))
    return list(run.scans), np.array(wheels), run.trajectory.poses


def errors(true, found):
    apart = between(true, found)
    return np.hypot(apart[:, 0], apart[:, 1])


def rooms(count):
    """A corridor of identical rooms of 5 m, each with a door in the middle."""
    walls = [[0, 0, 5 * count, 0], [0, 0, 0, 2.4], [5 * count, 0, 5 * count, 6]]
    for x in range(0, 5 * count, 5):
        walls += [[x, 2.4, x + 2, 2.4], [x + 3, 2.4, x + 5, 2.4], [x, 2.4, x, 6], [x, 6, x + 5, 6]]
        walls += [[x + 1, 5, x + 2, 5], [x + 1, 5, x + 1, 6], [x + 2, 5, x + 2, 6]]
    return lrf3d.World(walls)


def through(count):
    route = [(1.0, 1.2)]
    for x in range(0, 5 * count, 5):
        route += [(x + 2.5, 1.2), (x + 2.5, 4.2), (x + 3.5, 4.4), (x + 2.5, 3.8), (x + 2.5, 1.2)]
    return [*route, (5 * count - 1.5, 1.2), (1.0, 1.0)]


@pytest.fixture(scope="module")
def identical_rooms():
    scans, wheels, true = drive(rooms(4), through(4))
    return solve_log(scans, wheels, np.arange(len(scans))), wheels, true


def test_a_drive_through_identical_rooms_is_followed_to_centimetres(identical_rooms):
    solution, wheels, true = identical_rooms
    assert errors(true, wheels).max() > 1.0
    assert errors(true, solution.scan_poses).max() < 0.1


def test_no_closure_takes_one_room_for_another(identical_rooms):
    solution, _, true = identical_rooms
    assert len(solution.closures) > 10
    keys = true[solution.slam.key_scans]
    for closure in solution.closures:
        off = closure.relative - between(keys[closure.old], keys[closure.new])
        off[2] = np.angle(np.exp(1j * off[2]))
        assert off @ closure.information @ off < 30.0


def test_the_turn_that_wheels_of_unequal_size_add_is_found(identical_rooms):
    solution, _, _ = identical_rooms
    assert solution.slam.wheels.biases[1] == pytest.approx(-0.03, abs=0.006)


def test_in_a_corridor_the_way_along_it_is_left_to_the_odometry_and_reported():
    world = lrf3d.World([[-100, 0, 200, 0], [-100, 2, 200, 2]])
    scans, wheels, true = drive(world, [(0, 1), (30, 1)], bias=0.0)
    solution = solve_log(scans, wheels, np.arange(len(scans)))
    last = solution.slam.tracked[-1]
    assert last.weak and abs(last.weakest[0][0]) > 0.99
    assert np.abs(solution.scan_poses[:, 1] - true[:, 1]).max() < 0.02
    assert errors(true, solution.scan_poses).max() < 1.0


def test_pose_and_map_are_current_after_every_scan():
    world = lrf3d.World([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 2.5, 4], [2.5, 4, 0, 3], [0, 3, 0, 0]])
    scans, wheels, true = drive(world, [(1, 1), (5, 1), (5, 3)])
    slam = lrf3d.Slam(SCANNER, start=true[0])
    assert slam.pose == tuple(true[0]) and len(slam.map) == 0
    steps = [np.zeros(3), *lrf3d.odometry_increments(wheels)]
    for number, (scan, step) in enumerate(zip(scans, steps, strict=True)):
        slam.update(scan, step)
        assert np.hypot(*(np.array(slam.pose) - true[number])[:2]) < 0.05
    assert len(slam.trajectory()) == len(scans)
    assert slam.trajectory()[-1] == pytest.approx(np.array(slam.pose), abs=1e-6)
    ends = shapely.points(slam.map.segments.reshape(-1, 2))
    walls = shapely.linestrings(world.segments.reshape(-1, 2, 2))
    distances = shapely.distance(ends[:, None], walls)
    assert len(slam.map) >= 5 and distances.min(axis=1).max() < 0.1


def test_the_covariance_is_that_of_the_errors():
    squares = []
    for seed in range(6):
        scans, wheels, true = drive(rooms(2), through(2), seed=seed)
        slam = lrf3d.Slam(start=true[0])
        steps = [np.zeros(3), *lrf3d.odometry_increments(wheels)]
        for number, (scan, step) in enumerate(zip(scans, steps, strict=True)):
            slam.update(scan, step)
            if number % 50 == 49:
                error = np.array(slam.pose) - true[number]
                error[2] = np.angle(np.exp(1j * error[2]))
                squares.append(error @ np.linalg.solve(slam.covariance(), error) / 3.0)
    assert len(squares) > 15
    assert 0.2 < np.mean(squares) < 3.0


def test_the_covariance_of_a_relative_pose_does_not_depend_on_the_way_to_it(identical_rooms):
    slam = identical_rooms[0].slam
    last = len(slam.key_scans) - 1
    near, far = slam.relative_covariance(last - 1, last), slam.relative_covariance(0, last)
    assert (np.linalg.eigvalsh(near) > 0.0).all()
    assert np.trace(near[:2, :2]) < np.trace(far[:2, :2])
    assert slam.relative_covariance(3, 3).tolist() == np.zeros((3, 3)).tolist()
    with pytest.raises(InputError, match="key scan"):
        slam.relative_covariance(0, last + 1)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda slam: pickle.loads(pickle.dumps(slam))])
def test_a_copy_goes_on_by_itself(copied):
    scans, wheels, _ = drive(rooms(1), [(1, 1), (4, 1)])
    steps, half = [np.zeros(3), *lrf3d.odometry_increments(wheels)], len(scans) // 2
    slam = lrf3d.Slam()
    for scan, step in zip(scans[:half], steps[:half], strict=True):
        slam.update(scan, step)
    other = copied(slam)
    for scan, step in zip(scans[half:], steps[half:], strict=True):
        other.update(scan, step)
    shown = other.map.segments.tolist()
    assert len(slam.trajectory()) == half
    for scan, step in zip(scans[half:], steps[half:], strict=True):
        slam.update(scan, step)
    assert other.trajectory().tolist() == slam.trajectory().tolist()
    assert shown == slam.map.segments.tolist()


def test_all_scans_are_refined_or_none():
    slam, scans = lrf3d.Slam(), drive(rooms(1), [(1, 1), (2, 1)])[0][:3]
    assert slam.refined([]).shape == (0, 3)
    for scan in scans:
        slam.update(scan, (0.1, 0, 0))
    with pytest.raises(InputError, match="2 scans to refine; expected all 3"):
        slam.refined(scans[:2])


def test_robots_that_start_with_the_same_wheels_learn_their_own():
    scans, wheels, _ = drive(rooms(1), [(1, 1), (4, 1)], bias=0.1)
    known, steps = Wheels(), [np.zeros(3), *lrf3d.odometry_increments(wheels)]
    found = []
    for _ in range(2):
        slam = lrf3d.Slam(wheels=known)
        for scan, step in zip(scans, steps, strict=True):
            slam.update(scan, step)
        found.append(slam.trajectory().tolist())
    assert found[0] == found[1]
    assert not known.biases.any()
    assert slam.wheels.biases.any()


@pytest.mark.parametrize("wrong", [[-1], [1], [0.5], [[0]], [np.nan]])
def test_covariances_of_key_scans_that_are_not_there_are_refused(wrong):
    slam = lrf3d.Slam()
    assert slam.covariances([]).shape == (0, 3, 3)
    with pytest.raises(InputError, match="none before the first scan"):
        slam.covariances([0])
    with pytest.raises(InputError, match="none before the first scan"):
        slam.relative_covariance(0, 0)
    slam.update(drive(rooms(1), [(1, 1), (1.5, 1)])[0][0], (0, 0, 0))
    assert slam.covariances([0]).tolist() == np.zeros((1, 3, 3)).tolist()
    with pytest.raises(InputError, match=r"key scan .*: expected a whole number from 0 to 0"):
        slam.covariances(wrong)
    with pytest.raises(InputError, match=r"key scan .*: expected a whole number from 0 to 0"):
        slam.relative_covariance(0, *wrong)


def test_a_scan_without_beams_is_refused():
    slam = lrf3d.Slam()
    with pytest.raises(InputError, match="scan of 0 beams"):
        slam.update(lrf3d.LaserScan((0, 0, 0), [], []), (0, 0, 0))
    assert slam.trajectory().shape == (0, 3)


def test_updates_refuse_what_is_no_scan_of_this_laser_and_no_odometry():
    scan = lrf3d.LaserScan((0, 0, 0), [0.0, 0.1], [1.0, 1.0])
    with pytest.raises(InputError, match="2 beams"):
        lrf3d.Slam(SCANNER).update(scan, (0, 0, 0))
    with pytest.raises(InputError, match="finite"):
        lrf3d.Slam().update(scan, (0, np.nan, 0))
    with pytest.raises(InputError, match="positive"):
        lrf3d.Slam(key_distance=0.0)


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


def test_poses_of_more_key_scans_than_there_is_room_for_at_first_are_kept():
    scans, wheels, true = drive(rooms(1), [(1, 1), (4, 1)])
    found = []
    for room in (256, 1):
        slam = lrf3d.Slam(start=true[0])
        slam._room = slam._room[:room]
        for scan, step in zip(scans[1:], lrf3d.odometry_increments(wheels), strict=True):
            slam.update(scan, step)
        found.append(slam.trajectory())
    assert len(slam.key_scans) > 4
    assert found[0].tolist() == found[1].tolist()


def test_the_lag_of_the_laser_is_found():
    scans, wheels, _ = drive(rooms(2), through(2) * 2, bias=0.0, heading=0.001)
    # Lines lie twice as dense as scans, and a scan was taken 0.6 lines before its place.
    lines = WheelPath(wheels).at(np.arange(0.0, len(wheels) - 0.5, 0.5))
    places = np.arange(0, len(lines), 2)
    shifted = WheelPath(lines).at(np.arange(len(lines)) + 0.6)
    solution = solve_log(scans, shifted, places)
    assert solution.lag == pytest.approx(0.6, abs=0.1)


def test_between_lines_a_turning_robot_is_where_it_is():
    """A robot that turns ever faster, at lines a fifth of a second apart."""
    times = np.arange(0.0, 4.0, 0.2)
    path = WheelPath(np.column_stack([times, 0 * times, 0.5 * times**2]))
    fine = np.arange(1.0, 18.0, 0.25)
    assert path.at(fine)[:, 2] == pytest.approx(0.5 * (0.2 * fine) ** 2, abs=1e-3)
    straight = np.interp(fine, np.arange(len(times)), 0.5 * times**2)
    assert np.abs(straight - 0.5 * (0.2 * fine) ** 2).max() > 4e-3


@pytest.mark.parametrize("count", [2, 3, 4, 50])
def test_the_way_between_lines_is_that_of_scipys_akima_curves(count):
    rng = np.random.default_rng(count)
    poses = 0.1 * rng.normal(size=(count, 3)).cumsum(axis=0)
    poses[10:20] = poses[10:11]
    places = rng.uniform(0.0, count - 1.0, 100)
    curve = Akima1DInterpolator(np.arange(count), poses)
    assert WheelPath(poses).at(places) == pytest.approx(curve(places), abs=1e-12)


@pytest.mark.parametrize("beams", [11, 30])
def test_a_laser_of_few_beams_maps_with_many_scans(beams):
    few = lrf3d.LaserRangeFinder(beams=beams, range_max=15.0)
    scans, wheels, true = drive(rooms(2), through(2) * 2, lrf=few)
    assert errors(true, wheels).max() > 0.5
    solution = solve_log(scans, wheels, np.arange(len(scans)))
    assert errors(true, solution.scan_poses).max() < 0.15
    assert len(solution.closures) > 10


def test_two_halves_of_the_scans_give_the_same_poses():
    scans, wheels, true = drive(rooms(2), through(2) * 2)
    first, second = (
        solve_log(scans[half::2], wheels, np.arange(half, len(scans), 2)).line_poses
        for half in (0, 1)
    )
    assert errors(true, first).mean() < 0.013
    # The second half begins a scan later, so that only its shape can be compared.
    spans = [np.hypot(*(half[40:, :2] - half[:-40, :2]).T) for half in (first, second)]
    assert np.abs(spans[0] - spans[1]).mean() < 0.013


def test_encoders_that_know_no_sign_are_no_systematic_error():
    wheels = Wheels()
    for _ in range(20):
        wheels.learn(np.array([0.5, 0.0, 0.0]), np.array([0.51, 0.0, 0.0]), True)
    for _ in range(10):
        wheels.learn(np.array([0.5, 0.0, 0.0]), np.array([-0.5, 0.0, 0.0]), True)
    assert wheels.biases[2] == pytest.approx(0.02, abs=0.005)


def test_a_robot_that_drives_backwards_with_such_encoders_is_followed():
    world = lrf3d.World([[0, 0, 9, 0], [9, 0, 9, 4], [9, 4, 2.5, 4], [2.5, 4, 0, 3], [0, 3, 0, 0]])
    scans, wheels, true = drive(world, [(1, 1), (7, 2)], bias=0.0)
    steps = lrf3d.odometry_increments(wheels)
    there = [np.zeros(3), *steps]
    # Back on the same way: the wheels turn backwards, and the encoders count on.
    back = [np.abs(step) * [1, 0, 0] + step * [0, 0, -1] for step in steps[::-1]]
    way = [wheels[0]]
    for step in [*there[1:], *back]:
        way.append(compose(way[-1], step))
    end = scans[-1].time
    everything = [*scans, *(scan.at_time(2.0 * end - scan.time) for scan in scans[-2::-1])]
    solution = solve_log(everything, np.array(way), np.arange(len(everything)))
    assert errors(np.vstack([true, true[-2::-1]]), solution.scan_poses).max() < 0.1


def test_an_odometry_that_jumps_is_mended_and_reported():
    scans, wheels, true = drive(rooms(2), through(2))
    jumped = wheels.copy()
    jumped[60:, 0] += 10.0
    solution = solve_log(scans, jumped, np.arange(len(scans)))
    assert solution.repairs.jumps == (60,)
    assert errors(true, solution.scan_poses).max() < 0.1
    same, none = without_jumps(wheels)
    assert none == () and same is wheels


def test_lines_between_scans_follow_the_odometry():
    wheels = np.column_stack([np.arange(9.0), np.zeros(9), np.zeros(9)])
    places = np.array([0, 4, 8])
    known = np.array([[0.0, 1.0, 0.0], [4.0, 1.0, 0.0], [8.4, 1.0, 0.0]])
    poses = line_poses(WheelPath(wheels), places, 0.0, known)
    assert poses[places] == pytest.approx(known)
    assert poses[2] == pytest.approx([2.0, 1.0, 0.0])
    assert poses[6] == pytest.approx([6.2, 1.0, 0.0])


def test_stamps_that_run_backwards_become_times_that_rise():
    times, wrong = rising(np.array([0.0, 1.0, 0.9, 1.1, 1.1]))
    assert wrong == 2
    assert (np.diff(times) > 0.0).all()
    assert times[[0, 1, 3]].tolist() == [0.0, 1.0, 1.1]


def test_beams_that_pass_through_what_the_other_saw_are_counted():
    angles = np.linspace(-0.5, 0.5, 11)
    ranges = np.full(11, 4.0)
    points = np.array([[2.0, 0.0], [4.1, 0.0], [3.8, 0.3], [2.0, 30.0]])
    assert seen_through(points, np.zeros(2), angles, ranges) == (1, 3)


@pytest.fixture
def short_log():
    scans, wheels, _ = drive(rooms(1), [(1, 1), (3, 1)])
    scans = [replace(scan, time=0.1 * number) for number, scan in enumerate(scans)]
    mount = lrf3d.Pose(0.0, 0.0, 0.0)
    return SimpleNamespace(name="short", scans=scans, poses=wheels, wheels=None, mount=mount)


def test_a_log_whose_driver_gives_no_largest_range_is_solved(short_log):
    short_log.scans = [replace(scan, range_max=np.inf) for scan in short_log.scans]
    assert lrf3d.slam(short_log).lrf.range_max == lrf3d.LaserRangeFinder().range_max


def test_a_laser_that_turns_clockwise_sees_the_same_drive(short_log):
    run = lrf3d.slam(short_log)
    short_log.scans = [
        replace(scan, angles=scan.angles[::-1], ranges=scan.ranges[::-1])
        for scan in short_log.scans
    ]
    other = lrf3d.slam(short_log)
    assert np.array_equal(other.lrf.angles, run.lrf.angles)
    assert np.array_equal(other.ranges, run.ranges)
    assert other.trajectory.poses == pytest.approx(run.trajectory.poses, abs=0.002)


def test_odometry_that_is_not_finite_is_refused(short_log):
    short_log.poses[4, 1] = np.nan
    with pytest.raises(InputError, match=r"odometry line 4 at 0\.4 s"):
        lrf3d.slam(short_log)


def test_a_log_of_too_little_is_refused():
    scan = lrf3d.LaserScan((0, 0, 0), [0.0, 0.1], [1.0, 1.0])
    with pytest.raises(InputError, match="at least two"):
        solve_log([scan], np.zeros((1, 3)), np.zeros(1, np.int64))
    other = lrf3d.LaserScan((0, 0, 0), [0.0, 0.2], [1.0, 1.0])
    with pytest.raises(InputError, match="scan 1 has 2 beams"):
        solve_log([scan, other], np.zeros((2, 3)), np.arange(2))
