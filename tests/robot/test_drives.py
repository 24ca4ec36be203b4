"""Drives with wheels: exact arcs of their commands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lrf3d

SPEEDS = st.floats(-3.0, 3.0)
ROBOTS = {
    lrf3d.DifferentialDrive(0.5): 2, lrf3d.AckermannDrive(1.2): 2, lrf3d.OmniDrive(): 3,
    lrf3d.Unicycle(): 2,
}  # fmt: skip


@given(st.sampled_from(list(ROBOTS)), SPEEDS, SPEEDS, SPEEDS, st.floats(0.0, 4.0))
def test_a_command_that_is_held_twice_as_long_is_held_twice(robot, a, b, c, seconds):
    command = (a, b, c)[: ROBOTS[robot]]
    half = robot.move((1.0, 2.0, 0.3), *command, seconds)
    assert robot.move(half, *command, seconds) == pytest.approx(
        robot.move((1.0, 2.0, 0.3), *command, 2.0 * seconds), abs=1e-9
    )


def test_the_twists_are_those_of_the_wheels():
    assert lrf3d.DifferentialDrive(0.4, radius=0.1).twist(5.0, 9.0) == pytest.approx((0.7, 0, 1.0))
    # The wheels of a car stand on circles about one point on the line of the rear axle.
    _, _, turn = lrf3d.AckermannDrive(2.0).twist(1.0, 0.3)
    assert np.hypot(2.0, 1.0 / turn) * np.sin(0.3) == pytest.approx(2.0)
    assert lrf3d.OmniDrive().move((0, 0, np.pi / 2), 0, 1, 0, 2) == pytest.approx(
        (-2, 0, np.pi / 2)
    )


def test_a_controller_commands_the_wheels_of_its_robot():
    class Wheels:
        def command(self, time, pose, scan):
            return (1.0, 1.5) if time < 2.0 else None

    room, robot = lrf3d.load_world("paper_room"), lrf3d.DifferentialDrive(0.5)
    settings = {"start": (2, 2, 0), "scan_interval": 1.0, "robot": robot}
    steps = list(lrf3d.Simulation(room, Wheels(), **settings))
    assert steps[-1].pose == pytest.approx(robot.move((2, 2, 0), 1.0, 1.5, 2.0))
    settings["robot"] = lrf3d.OmniDrive()
    with pytest.raises(lrf3d.InputError, match="ahead and to the left"):
        list(lrf3d.Simulation(room, Wheels(), **settings))


@pytest.mark.parametrize("track", [0.0, -1.0, np.nan])
def test_wheels_without_a_track_are_reported(track):
    with pytest.raises(lrf3d.InputError, match="differential drive: track"):
        lrf3d.DifferentialDrive(track)
