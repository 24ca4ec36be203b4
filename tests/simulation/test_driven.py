"""A body that touches something rests there, whoever drives it."""

import numpy as np
import pytest
from drives import NoMap

from lrf3d import (
    Imu,
    LaserRangeFinder,
    Pose,
    ProportionalNoise,
    Scenario,
    WheelOdometry,
    World,
    simulate_fleet,
)
from lrf3d.casting.collision import Body, CollisionChecker
from lrf3d.casting.crowd import moves_of
from lrf3d.gym import MAX_TURN_RATE, DriveVectorEnv
from lrf3d.simulation.driven import STILL, Driven, hold_all
from lrf3d.simulation.live import LiveRobot

ROOM = World([[-4, -3, 4, -3], [4, -3, 4, 3], [4, 3, -4, 3], [-4, 3, -4, -3]])
SCENARIO = Scenario(
    ROOM, LaserRangeFinder(beams=5), ProportionalNoise(0.02), start=Pose(0.0, 0.0, 0.0), speed=1.0
)  # fmt: skip
SCANS = 30
SPEED = 1.0
TURNING = 0.2


class Pressing:
    """A controller that drives on, whatever it touches."""

    def command(self, time, pose, scan):
        return SPEED, TURNING


def test_a_touch_ends_all_drives_at_the_same_pose_where_they_rest():
    settings = {"scans": SCANS, "on_collision": "stop"}
    alone = SCENARIO.simulation(drive=Pressing(), mapper=NoMap(), **settings)
    settings |= {"scan_interval": SCENARIO.scan_interval, "radius": SCENARIO.radius}
    (run,) = simulate_fleet(
        ROOM, [Pressing()], SCENARIO.lrf, starts=[SCENARIO.start], mapper=NoMap, **settings
    )
    live = LiveRobot(SCENARIO)
    commanded = [live.pose]
    for _ in range(SCANS - 1):
        live.drive(SCENARIO.scan_interval, SPEED, TURNING)
        commanded.append(live.pose)
    environment = DriveVectorEnv(1, SCENARIO)
    environment.reset(seed=0, options={"pose": SCENARIO.start, "goal": (-3.0, -2.0)})
    rewarded = [environment.poses[0]]
    while not environment.step(np.array([[SPEED, TURNING / MAX_TURN_RATE]]))[2][0]:
        rewarded.append(environment.poses[0])
    rewarded.append(environment.poses[0])
    expected = np.array([step.pose for step in alone])
    for poses in (run.trajectory.poses, np.array(commanded)):
        assert poses == pytest.approx(expected, abs=1e-9)
        assert (poses[len(rewarded) - 1 :] == poses[-1]).all()
    assert np.array(rewarded) == pytest.approx(expected[: len(rewarded)], abs=1e-9)
    assert len(rewarded) < SCANS - 5 and live.bumped and live.twist == STILL


@pytest.mark.parametrize("outline", [None, [(-0.3, -0.2), (0.4, 0.0), (-0.3, 0.2)]])
def test_arrays_of_bodies_are_driven_as_single_ones(outline):
    rng = np.random.default_rng(4)
    body = Body(0.3, outline)
    checker = CollisionChecker(ROOM)
    poses = rng.uniform((-3.5, -2.5, -3.0), (3.5, 2.5, 3.0), (60, 3))
    twists = np.column_stack([rng.uniform(-2, 2, 60), np.zeros(60), rng.uniform(-1, 1, 60)])
    twists[:5] = 0.0
    moves = moves_of(0.0, poses, twists)
    ends, touched = hold_all(checker, body, moves, np.ones(60), np.full(60, -1))
    assert 5 < touched.sum() < 55
    for pose, twist, end, hit in zip(poses, twists, ends, touched, strict=True):
        driven = Driven(Pose(*pose.tolist()), 0.0, body, checker)
        collision = driven.hold(tuple(twist.tolist()), 1.0)
        assert driven.pose == pytest.approx(end, abs=1e-12) and driven.time == 1.0
        assert (collision is not None) == hit


def test_a_body_at_a_wall_turns_and_drives_away():
    driven = Driven(Pose(0.0, 0.0, 0.0), 0.0, Body(0.5), CollisionChecker(ROOM))
    assert driven.hold((10.0, 0.0, 0.0), 1.0).time == pytest.approx(0.35)
    there = driven.pose
    assert driven.hold((1.0, 0.0, 1.0), 1.0) is not None and driven.pose == there
    assert driven.hold((0.0, 0.0, 1.0), 1.0) is None and driven.pose.theta == pytest.approx(1.0)
    assert driven.hold((-1.0, 0.0, 0.0), 1.0) is None and driven.pose.x < there.x
    assert driven.time == 4.0 and driven.collision is None


def driven_by_hand(scenario, wheels=None):
    """What a live robot scans on a drive."""
    robot = LiveRobot(scenario, rng=7, wheels=wheels)
    seen = []
    for speed in (0.5, 1.0, -0.5):
        robot.drive(0.25, speed, 0.3)
        robot.imu()
        seen.append(robot.scans()[0].ranges)
    return robot, np.array(seen)


def test_the_scans_of_a_live_robot_do_not_depend_on_its_wheels_or_its_imu():
    _, plain = driven_by_hand(SCENARIO)
    robot, wheeled = driven_by_hand(SCENARIO, WheelOdometry())
    carrying, shaken = driven_by_hand(SCENARIO.changed(imu=Imu()), WheelOdometry())
    assert np.array_equal(plain, wheeled) and np.array_equal(plain, shaken)
    assert robot.odometry == carrying.odometry != robot.pose
