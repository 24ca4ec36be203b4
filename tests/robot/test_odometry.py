"""Wheels and IMUs: what a robot measures of its own motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lrf3d
from lrf3d.robot.odometry import InertialUnit, Odometer, increment_of, twist_of
from lrf3d.simulation.mappers import OptionalParts
from lrf3d.slam import SlamMapper

EXACT = lrf3d.WheelOdometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SILENT = lrf3d.Imu(100.0, 0.0, 0.0, 0.0, 0.0)
ROOM = lrf3d.load_world("paper_room")
LAPS = lrf3d.follow_route([[1, 1], [4, 1], [4, 2.5], [1, 2.5], [1, 1]], speed=1.0)
FEW = lrf3d.LaserRangeFinder(beams=61, range_max=20.0)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_an_increment_is_the_arc_of_its_twist(ahead, left, turn):
    twist = np.array([ahead, left, turn])
    assert np.allclose(twist_of(increment_of(twist)), twist, atol=1e-9)


def test_wheels_without_errors_measure_the_path_exactly():
    odometer = Odometer(EXACT, np.random.default_rng(0))
    measured = np.array([odometer.drive(pose) for pose in LAPS.poses])
    assert np.abs(measured[:, :2] - LAPS.poses[:, :2]).max() < 1e-12


def test_usual_wheels_are_some_hundredths_of_the_path_off():
    off = []
    for seed in range(30):
        odometer = Odometer(lrf3d.WheelOdometry(), np.random.default_rng(seed))
        errors = [odometer.drive(pose) - pose for pose in LAPS.poses]
        off.append(np.hypot(*errors[-1][:2]) / LAPS.length)
    assert 0.003 < np.median(off) < 0.03


def test_random_errors_do_not_depend_on_how_often_the_wheels_are_read():
    wheels = lrf3d.WheelOdometry(0.0, 0.0, 0.0, slip=0.1, swerve=0.0, skid=0.0)
    spreads = []
    for steps in (1, 16):
        path = np.column_stack([np.linspace(0, 4, steps + 1), np.zeros((steps + 1, 2))])
        ends = []
        for seed in range(300):
            odometer = Odometer(wheels, np.random.default_rng(seed))
            ends.append([odometer.drive(pose) for pose in path][-1][0])
        spreads.append(np.std(ends))
    assert spreads == pytest.approx([0.2, 0.2], rel=0.15)


def test_the_gyro_adds_up_to_the_turn_and_the_accelerometers_to_the_speed():
    unit = InertialUnit(SILENT, np.random.default_rng(0))
    path = lrf3d.drive((0, 0, 0), [1.0, 2.0], [0.5, -1.0], duration=1.0, dt=0.1)
    rows = np.concatenate([unit.drive(*each) for each in zip(path.times, path.poses, strict=True)])
    assert np.allclose(np.diff(rows[:, 0]), 0.01) and len(rows) == 200
    assert rows[:, 1].sum() / 100.0 == pytest.approx(path.poses[-1, 2])
    assert rows[:, 2].sum() / 100.0 == pytest.approx(2.0)
    assert rows[150, 3] == pytest.approx(2.0 * -1.0)


def test_a_run_keeps_its_odometry_and_imu_and_its_scans_stay_the_same(tmp_path):
    def simulation(**sensors):
        noise = lrf3d.ProportionalNoise(0.02)
        return lrf3d.Simulation(ROOM, LAPS, FEW, noise=noise, rng=1, **sensors)

    asked = {"odometry": lrf3d.WheelOdometry(), "imu": lrf3d.Imu(rate=30.0)}
    plain = lrf3d.record(simulation(), tmp_path / "plain.npz")
    run = lrf3d.record(simulation(**asked), tmp_path / "run.npz")
    assert np.array_equal(plain.ranges, run.ranges) and plain.imu is None
    assert run.wheels.shape == (len(run), 3) and not np.array_equal(run.wheels, plain.odometry)
    assert len(run.imu.times) == int(run.trajectory.duration * 30.0 + 1e-9)


def test_slam_drives_by_the_measured_odometry():
    mapper = SlamMapper(rng=0)
    wheels = lrf3d.WheelOdometry(scale=0.1)
    run = lrf3d.simulate(ROOM, LAPS, FEW, rng=1, odometry=wheels, mapper=mapper)
    assert np.allclose(run.estimate.odometry, run.wheels)
    assert mapper.errors().max() < 0.1 and OptionalParts(mapper).report == mapper.report


def test_a_world_file_asks_for_odometry_and_an_imu(tmp_path):
    text = "[[object]]\npoints = [[0, 0], [5, 0]]\n[odometry]\n[imu]\nrate = 50\n"
    (tmp_path / "a.toml").write_text(text)
    scenario = lrf3d.load_scenario(tmp_path / "a.toml", ["odometry.scale=0.2"])
    assert scenario.odometry == lrf3d.WheelOdometry(scale=0.2)
    assert scenario.imu == lrf3d.Imu(rate=50)
    with pytest.raises(lrf3d.InputError, match="imu: rate 0"):
        lrf3d.load_scenario(tmp_path / "a.toml", ["imu.rate=0"])
    with pytest.raises(lrf3d.InputError, match="deviations"):
        lrf3d.WheelOdometry(slip=-1.0)
