"""Recordings that are cut, doubled, out of order, mirrored, or whose odometry jumps."""

from dataclasses import replace

import numpy as np
import pytest
from drives import flat_drive, path_of

import lrf3d
from lrf3d.geometry.pose import between, compose
from lrf3d.recordings.log import LaserLog, WheelRecord
from lrf3d.recordings.repair.jumps import without_jumps
from lrf3d.recordings.repair.lag import fitted_lag
from lrf3d.recordings.repair.recording import recordings_of
from lrf3d.recordings.repair.repairs import SOLVING, figures_of, repair, repaired_log
from lrf3d.recordings.repair.wheel_path import WheelPath
from lrf3d.slam.checks import SelfCheck
from lrf3d.slam.offline import solve_log

COUNT = 100


@pytest.fixture(scope="module")
def recorded():
    """A recording in a flat, with the true poses of its scans."""
    scans, wheels, true = flat_drive(COUNT)
    times = np.array([scan.time for scan in scans])
    record = WheelRecord(times, wheels, np.arange(COUNT))
    return LaserLog("flat", scans, wheels=record), true


def rearranged(log, order):
    """The log with scans and lines in another order; some may come twice, some not at all."""
    wheels = log.wheels
    record = WheelRecord(wheels.times[order], wheels.poses[order], np.arange(len(order)))
    return replace(log, scans=[log.scans[k] for k in order], wheels=record)


def errors(solution, true, first=0):
    """How far each line is off [m], where the pose of one of them is given."""
    start = compose(solution.line_poses[first], between(true[first], true))
    return np.hypot(*(solution.line_poses - start)[:, :2].T)


def repairs(**found):
    """The figures of a recording in which nothing was wrong but this."""
    return {
        "doubled_scans": 0,
        "doubled_odometry_lines": 0,
        "put_in_order": False,
        "odometry_jumps": 0,
        "mirrored": False,
        "late": [0.0, 0.0],
        "sweep": 0.0,
        **found,
    }


EVERY = np.arange(COUNT)
HALF = COUNT // 2
ORDERS = {
    "as it is": (EVERY, repairs()),
    "each line twice": (
        np.repeat(EVERY, 2),
        repairs(doubled_scans=COUNT, doubled_odometry_lines=COUNT),
    ),
    "a part of it twice": (
        np.concatenate([EVERY[:80], EVERY[40:]]),
        repairs(doubled_scans=40, doubled_odometry_lines=40),
    ),
    "the end first": (np.concatenate([EVERY[HALF:], EVERY[:HALF]]), repairs(put_in_order=True)),
    "backwards in time": (EVERY[::-1], repairs(put_in_order=True)),
}


# Two of the orders are enough for fast tests.
FAST = ("a part of it twice", "backwards in time")


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[pytest.mark.slow] * (each not in FAST)) for each in ORDERS]
)
def test_a_log_that_is_doubled_or_out_of_order_is_solved_as_if_it_were_not(recorded, name):
    log, true = recorded
    order, found = ORDERS[name]
    solution = solve_log(rearranged(log, order))
    assert figures_of(solution.recording) == found
    assert len(solution.line_poses) == len(order)
    assert errors(solution, true[order], int(np.argmin(order))).max() < 0.05
    assert len(solution.recording.sentences) == (name != "as it is")


@pytest.mark.parametrize("lines", [[60], pytest.param([60, 61], marks=pytest.mark.slow)])
def test_odometry_that_jumps_goes_on_as_before(recorded, lines):
    log, true = recorded
    wheels = log.wheels.poses.copy()
    wheels[60:, 0] += 10.0
    if len(lines) == 2:
        wheels[61:, 0] -= 10.0
    jumping = replace(log, wheels=replace(log.wheels, poses=wheels))
    solution = solve_log(jumping)
    # A line that is out and back is one.
    assert figures_of(solution.recording)["odometry_jumps"] == 1
    assert errors(solution, true).max() < 0.05
    assert "jump" in solution.recording.sentences[0]


def test_corrupt_lines_leave_the_others_as_they_were():
    """One is out and back in a turn that is no jump in a second, one has a corrupt stamp, too."""
    times, lines = 0.1 * np.arange(60), np.zeros((60, 3))
    lines[:, 0] = 0.05 * np.arange(60)
    corrupt, wrong = lines.copy(), times.copy()
    corrupt[20, 2], corrupt[40, :2], wrong[40] = 2.4, (8.9, 4.0), 400.0
    found, jumps = without_jumps(corrupt, wrong)
    assert jumps.tolist() == [20, 40]
    assert found == pytest.approx(lines, abs=1e-9)


def test_a_robot_that_drove_on_unrecorded_has_not_jumped(recorded):
    log, true = recorded
    kept = np.concatenate([EVERY[:24], EVERY[44:]])
    solution = solve_log(rearranged(log, kept))
    assert np.hypot(*(true[44] - true[23])[:2]) > 3.0
    assert figures_of(solution.recording) == repairs()


def test_lines_far_apart_are_no_jumps_but_what_is_far_beyond_them_is():
    lines = np.column_stack([4.0 * np.arange(30), np.zeros(30), np.zeros(30)])
    for times in (2.0 * np.arange(30), np.arange(30.0)):
        assert not len(without_jumps(lines, times)[1])
        jumped = lines.copy()
        jumped[12:, 1] += 20.0
        assert without_jumps(jumped, times)[1].tolist() == [12]


@pytest.mark.slow
def test_a_laser_that_turns_clockwise_unsaid_is_found_out(recorded):
    log, true = recorded
    scans = [replace(scan, ranges=scan.ranges[::-1]) for scan in log.scans]
    solution = solve_log(replace(log, scans=scans))
    assert figures_of(solution.recording) == repairs(mirrored=True)
    assert "clockwise" in solution.warnings[0]
    assert errors(solution, true).max() < 0.05
    assert "mirror" not in solve_log(log).recording.found


def in_degrees(poses):
    return np.column_stack([poses[:, :2], np.degrees(np.unwrap(poses[:, 2]))])


def jumping(poses):
    return np.random.default_rng(0).normal(0.0, 1000.0, poses.shape)


@pytest.mark.parametrize(
    "change, said",
    [
        (in_degrees, "degrees|radians"),
        (jumping, r"jumps at \d+ of 100 lines, first at line 1; exp"),
    ],
)
def test_odometry_in_degrees_or_that_jumps_everywhere_is_refused(change, said, recorded):
    log, _ = recorded
    wheels = replace(log.wheels, poses=change(log.wheels.poses))
    with pytest.raises(lrf3d.InputError, match=said):
        solve_log(replace(log, wheels=wheels))


def test_stamps_that_fall_now_and_then_do_not_change_the_order(recorded):
    log, true = recorded
    times = log.wheels.times.copy()
    times[50:60] -= 4.0
    scans = [replace(s, time=float(t)) for s, t in zip(log.scans, times, strict=True)]
    solution = solve_log(replace(log, scans=scans, wheels=replace(log.wheels, times=times)))
    assert figures_of(solution.recording) == repairs()
    assert errors(solution, true).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("turn", [1.0, 2.0])
def test_odometry_that_measures_twice_the_distance_is_found_out(recorded, turn):
    log, true = recorded
    steps = between(log.wheels.poses[:-1], log.wheels.poses[1:]) * [2.0, 2.0, turn]
    doubled = path_of(log.wheels.poses[0], steps)
    solution = solve_log(replace(log, wheels=replace(log.wheels, poses=doubled)))
    found = solution.slam.wheels.biases
    assert (1.0 + found)[[0, 2]] == pytest.approx((1.0 / turn, 0.5), abs=0.1)
    assert solution.passes > 1
    assert errors(solution, true).max() < 0.06


def test_the_lag_is_found_where_a_part_of_the_odometry_is_missing():
    """Scans without a line between them fit no lag better than another."""
    rng = np.random.default_rng(0)
    lines = np.arange(300)
    turns = 0.3 * rng.normal(size=300).cumsum()
    path = WheelPath(np.column_stack([-0.2 * lines, 0.0 * lines, turns]))
    places = np.minimum(lines, 40)
    seen = np.diff(path.at(lines - 0.5)[:, 2])
    for scans in (lines, places):
        assert fitted_lag(seen, path, scans) == pytest.approx(np.full(300, 0.5), abs=0.05)


def test_between_lines_far_apart_scans_lie_by_their_stamps(recorded):
    log, true = recorded
    lines = np.arange(0, COUNT, 3)
    places = np.arange(COUNT) // 3
    rare = WheelRecord(log.times[lines], true[lines], places)
    [recording] = recordings_of(replace(log, wheels=rare), SOLVING)
    assert recording.taken_at[:7] == pytest.approx(np.arange(7) / 3)
    late = replace(rare, times=rare.times + 100.0)
    [recording] = recordings_of(replace(log, wheels=late), SOLVING)
    assert recording.taken_at.tolist() == places.tolist()


@pytest.mark.slow
@pytest.mark.parametrize(("first", "last"), [(0.4, 0.4), (-0.2, -0.2), (0.1, 0.5)])
def test_scans_that_are_stamped_late_get_the_poses_of_when_they_were_taken(recorded, first, last):
    log, true = recorded
    poses = WheelPath(true).at(EVERY + np.linspace(first, last, COUNT) / np.diff(log.times)[0])
    scans = [replace(s, pose=tuple(p)) for s, p in zip(log.scans, poses, strict=True)]
    late = LaserLog("late", scans)
    found = repaired_log(late)
    [said] = found.notes
    assert ("late" in said) == (first > 0.0) and ("at the end" in said) == (first < last)
    assert np.abs(between(true, found.poses)).max() < 0.1 < np.abs(between(true, poses)).max()
    solution = solve_log(late)
    assert figures_of(solution.recording)["late"] == pytest.approx([first, last], abs=0.05)
    assert "scans are stamped" in solution.recording.sentences[0]
    assert repaired_log(LaserLog("true", log.scans)).notes == ()


def test_without_stamps_nothing_is_taken_for_a_copy(recorded):
    log, _ = recorded
    still = WheelRecord(np.zeros(COUNT), np.zeros((COUNT, 3)), EVERY)
    [found] = repair(replace(log, wheels=still), SOLVING)
    assert len(found.poses) == COUNT and "copies" not in found.found


@pytest.mark.parametrize(
    ("check", "parts"),
    [
        (SelfCheck(0.01, 0.1, key_scans_compared=100), []),
        (SelfCheck(), []),
        (
            SelfCheck(0.01, 0.31, (120, 180), 100),
            ["beams of scans 120 to 180 pass through 31 % of what others saw"],
        ),
        (
            SelfCheck(0.055, 0.09, (12, 80), 100, mixed_pixels=0.012),
            ["the map may be wrong: beams pass through 6 %", "1.2 % in adjacent", "scans 12 to 80"],
        ),
    ],
)
def test_a_check_names_what_is_wrong(check, parts):
    said = " ".join(check.sentences())
    assert all(part in said for part in parts) and bool(said) == bool(parts)
    assert check.passed == (not check.unjudged and check.worst_violation < 0.3)
    assert not check._replace(violation=0.05).passed or check.mixed_pixels > 0.01
