import numpy as np
import pytest
from drives import drive, errors, followed, path_of, rooms, solved

import lrf3d
from lrf3d.geometry.pose import between
from lrf3d.recordings.repair.lag import fitted_lag
from lrf3d.recordings.repair.wheel_path import WheelPath
from lrf3d.slam.motion import Wheels


def measured(found, a=0.2, b=0.1, c=0.25):
    """What wheels measure that turn by (1 + a) too little, and so on, of motions (n, 3)."""
    ahead, left, turn = found.T
    return np.column_stack([ahead / (1 + c), left, (turn - b * ahead) / (1 + a)])


def test_corrected_increments_are_the_motions_of_the_robot():
    rng = np.random.default_rng(0)
    found = np.column_stack([rng.uniform(0.3, 0.6, 200), np.zeros(200), rng.normal(0, 0.3, 200)])
    wheels = Wheels()
    for raw, motion in zip(measured(found), found, strict=True):
        wheels.learn(raw, motion, True)
    assert wheels.biases == pytest.approx([0.2, 0.1, 0.25], abs=0.02)
    corrected = np.array([wheels.predict(raw).step for raw in measured(found)])
    assert np.abs(corrected - found).max() < 0.03


def test_noise_of_a_drive_straight_ahead_is_not_taken_for_turns():
    rng = np.random.default_rng(0)
    wheels = Wheels()
    for _ in range(400):
        wheels.learn(np.array([0.5, 0.0, rng.normal(0, 0.03)]), np.array([0.5, 0.0, 0.0]), True)
    assert abs(wheels.biases[0]) < 0.03


def test_the_noise_of_odometry_is_no_lag():
    rng = np.random.default_rng(0)
    turns = np.repeat([0.0, 0.4, 0.0, -0.4], 25) * (np.arange(100) % 5 == 0)
    lines = np.cumsum(turns + rng.normal(0.0, 0.05, 100))
    path = WheelPath(np.column_stack([np.arange(100.0) / 5.0, np.zeros(100), lines]))
    places = np.arange(100)
    assert not fitted_lag(turns[1:], path, places).any()
    late = WheelPath(np.column_stack([np.zeros((100, 2)), np.cumsum(turns)]))
    found = fitted_lag(np.diff(late.at(places - 0.5)[:, 2]), late, places)
    assert found == pytest.approx(np.full(100, 0.5), abs=1e-3)


@pytest.mark.slow
def test_a_drive_is_right_from_its_beginning_whatever_its_wheels_measure():
    """Where the corridor is bare only wheels know the distance, and they say a fifth too much."""
    world = rooms(6)
    scans, wheels, true = drive(world, [(1.0, 1.2), (28.0, 1.2)])
    steps = between(wheels[:-1], wheels[1:])
    steps[:, 0] *= 1.2
    wheels = path_of(wheels[0], steps)
    solution = solved(scans, wheels)
    assert errors(true, wheels).max() > 4.0
    assert errors(true, solution.poses).max() < 0.6


def test_the_first_scans_do_not_follow_wheels_that_turn_as_they_drive():
    corridor = lrf3d.World([[-5, 0, 30, 0], [-5, 2.4, 30, 2.4]])
    true = np.column_stack([np.arange(0.0, 3.0, 0.25), np.full(12, 1.2), np.zeros(12)])
    scans = [step.scan for step in lrf3d.Simulation(corridor, true)]
    steps = lrf3d.odometry_increments(true)
    steps[:, 2] += 0.05 * steps[:, 0]
    [*_, slam] = followed(lrf3d.Slam(start=true[0]), scans, path_of(true[0], steps))
    assert abs(slam.pose.theta) < 5e-4


@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_the_noise_of_the_heading_is_learnt(noise):
    """Small robots err by several times more than good ones do, and that is no turn per metre."""
    rng, wheels = np.random.default_rng(0), Wheels()
    for _ in range(400):
        turn = noise * rng.normal(0, 0.013)
        wheels.learn(np.array([0.5, 0.0, turn]), np.array([0.5, 0.0, 0.0]), True)
    raw = np.array([0.5, 0.0, 0.0])
    assert np.sqrt(wheels.predict(raw).covariance[2, 2]) == pytest.approx(0.013 * noise, rel=0.25)
    assert abs(wheels.biases[1]) < 0.012 * noise / 3.0
