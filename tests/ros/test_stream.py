"""What a live robot publishes, without any middleware."""

import math

import pytest

from lrf3d import LaserRangeFinder, Pose, ProportionalNoise, World
from lrf3d.errors import InputError
from lrf3d.ros.stream import CLOCK, GRID, LINES, MOVING, ODOM, Settings, Stream
from lrf3d.scenario import Scenario

ROOM = World([[-3, -2, 3, -2], [3, -2, 3, 2], [3, 2, -3, 2], [-3, 2, -3, -2]])


def stream(lasers=(), **settings):
    said = []
    scenario = Scenario(ROOM, scan_interval=0.1, start=Pose(0.0, 0.0, 0.0))
    if lasers:
        (lrf, noise), *further = [(lrf, ProportionalNoise(0.0)) for lrf in lasers]
        scenario = scenario.changed(lrf=lrf, noise=noise, further=tuple(further))
    made = Stream(scenario, Settings(**settings), lambda level, text: said.append((level, text)))
    return made, said


def nanoseconds(stamp):
    return stamp["sec"] * 10**9 + stamp["nanosec"]


def test_stamps_are_multiples_of_the_interval_and_transforms_come_before_scans():
    made, _ = stream(rate=3.0)
    messages = [message for _ in range(3) for message in made.step()]
    clock = [nanoseconds(fields["clock"]) for topic, fields in messages if topic is CLOCK]
    assert clock == [round(count * 1e9 / 51) for count in range(51)]
    scans = [k for k, (topic, _) in enumerate(messages) if topic.name == "scan"]
    assert len(scans) == 3
    for k in scans:
        stamp = messages[k][1]["header"]["stamp"]
        moved = [fields["transforms"][0]["header"]["stamp"] for topic, fields in messages[:k]
                 if topic is MOVING]  # fmt: skip
        assert stamp in moved


def test_the_robot_drives_an_exact_arc_and_stops_without_commands():
    made, said = stream(cmd_timeout=0.5)
    [*made.tick()]
    made.command(0.5, 0.8)
    while made.robot.time < 0.5 - 1e-9:
        [*made.tick()]
    x, y, theta = made.robot.pose
    assert theta == pytest.approx(0.4)
    assert (x, y) == pytest.approx((0.625 * math.sin(0.4), 0.625 * (1 - math.cos(0.4))))
    [*made.step()]
    assert made.robot.pose == (x, y, theta) and said[0][0] == "warning"


def test_a_wall_stops_the_robot_but_not_its_turn():
    made, _ = stream(cmd_timeout=0.0)
    [*made.tick()]
    made.command(2.0, 0.1)
    for _ in range(40):
        [*made.step()]
    assert made.robot.bumped and made.robot.speed == 0.0 and made.robot.turning == 0.1
    x, y, _ = made.robot.pose
    assert 2.5 < math.hypot(x, y) and x < 3.0 - 0.35 + 1e-9


def test_invalid_commands_and_poses_are_reported_and_change_nothing():
    made, said = stream()
    made.command(math.nan, 0.0)
    made.command(0.1, 0.0, 0.2)
    for frame, pose in [("laser", (0, 0, 0)), ("map", (math.inf, 0, 0)), ("map", (3.0, 0, 0))]:
        made.set_pose(frame, pose)
    assert [level for level, _ in said] == ["warning", *3 * ["error"]]
    assert "wall" in said[-1][1] and made.robot.pose == (0, 0, 0)
    made.set_pose("", (1.0, 0.5, 0.0))
    made.reset()
    assert made.robot.pose == (0, 0, 0)
    for wrong in ({"give": "all"}, {"rate": 0.0}, {"cmd_timeout": -1.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            Settings(**wrong)


def test_what_is_given_of_the_truth_is_chosen():
    given, _ = stream(wheels=True, lines=True, rng=3)
    hidden, _ = stream(give="none", clock=False)
    assert GRID in given.topics and LINES in given.topics
    assert not {GRID, CLOCK, LINES} & set(hidden.topics)
    given.command(0.5, 0.3)
    seen = dict(message for _ in range(4) for message in given.step())
    odometry = seen[ODOM]["pose"]["pose"]["position"]
    assert (odometry["x"], odometry["y"]) != given.robot.pose[:2]
    to_odom = seen[MOVING]["transforms"][1]
    assert to_odom["child_frame_id"] == "odom"
    grid = dict(given.first())[GRID]
    assert {0, 100} <= set(grid["data"].tolist())
    assert len(dict(hidden.tick())[MOVING]["transforms"]) == 1


def test_each_laser_has_its_topic_and_its_frame():
    lasers = [
        LaserRangeFinder(beams=3, name="front", mount=(0.2, 0.1, 0.0)),
        LaserRangeFinder(beams=5, name="rear", mount=(-0.2, 0.0, math.pi)),
    ]
    made, _ = stream(lasers)
    seen = {topic.name: fields for topic, fields in (*made.first(), *made.tick())}
    fixed = seen["tf_static"]["transforms"]
    assert [each["child_frame_id"] for each in fixed] == ["front", "rear"]
    assert fixed[0]["transform"]["translation"] == {"x": 0.2, "y": 0.1, "z": 0.5}
    assert seen["scan_rear"]["header"]["frame_id"] == "rear"
    assert [seen["scan_front"]["ranges"][1], seen["scan_rear"]["ranges"][2]] == pytest.approx(
        [2.8, 2.8]
    )
