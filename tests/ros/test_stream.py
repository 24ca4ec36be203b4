"""What a live robot publishes, without any middleware."""

import math
from xml.etree import ElementTree

import pytest

from lrf3d import InputError, LaserRangeFinder, Pose, ProportionalNoise, Scenario, World
from lrf3d.messages import ros
from lrf3d.ros.stream import Settings, Stream

ROOM = World([[-3, -2, 3, -2], [3, -2, 3, 2], [3, 2, -3, 2], [-3, 2, -3, -2]])


def stream(lasers=(), **settings):
    said = []
    scenario = Scenario(
        ROOM, scan_interval=0.1, start=Pose(0.0, 0.0, 0.0), route=[[0, 0], [1.8, 0]]
    )
    if lasers:
        (lrf, noise), *further = [(lrf, ProportionalNoise(0.0)) for lrf in lasers]
        scenario = scenario.changed(lrf=lrf, noise=noise, further=tuple(further))
    made = Stream(scenario, Settings(**settings), lambda level, text: said.append((level, text)))
    return made, said


def by_name(messages):
    return {topic.name: fields for topic, fields in messages}


def nanoseconds(stamp):
    return stamp["sec"] * 10**9 + stamp["nanosec"]


def test_stamps_are_multiples_of_the_interval_and_transforms_come_before_scans():
    made, _ = stream(rate=3.0)
    messages = [message for _ in range(3) for message in made.step()]
    clock = [nanoseconds(fields["clock"]) for topic, fields in messages if topic.name == "/clock"]
    # In ROS a stamp of 0 is none.
    assert clock == [1, *(round(count * 1e9 / 51) for count in range(1, 51))]
    scans = [k for k, (topic, _) in enumerate(messages) if topic.name == "scan"]
    assert len(scans) == 3
    for k in scans:
        stamp = messages[k][1]["header"]["stamp"]
        moved = [fields["transforms"][0]["header"]["stamp"] for topic, fields in messages[:k]
                 if topic.name == "tf"]  # fmt: skip
        assert stamp in moved


def test_the_robot_drives_an_exact_arc_and_stops_without_commands():
    made, said = stream(cmd_timeout=0.5)
    [*made.tick()]
    made.robots[0].command(0.5, 0.8)
    while made.robots[0].robot.time < 0.5 - 1e-9:
        [*made.tick()]
    x, y, theta = made.robots[0].robot.pose
    assert theta == pytest.approx(0.4)
    assert (x, y) == pytest.approx((0.625 * math.sin(0.4), 0.625 * (1 - math.cos(0.4))))
    [*made.step()]
    assert made.robots[0].robot.pose == (x, y, theta) and said[0][0] == "warning"


def test_invalid_commands_and_poses_are_reported_and_change_nothing():
    made, said = stream()
    made.robots[0].command(math.nan, 0.0)
    made.robots[0].command(0.1, 0.0, 0.2)
    for frame, pose in [("laser", (0, 0, 0)), ("map", (math.inf, 0, 0)), ("map", (3.0, 0, 0))]:
        made.robots[0].set_pose(frame, pose)
    assert [level for level, _ in said] == ["warning", *3 * ["error"]]
    assert "wall" in said[-1][1] and made.robots[0].robot.pose == (0, 0, 0)
    made.robots[0].set_pose("", (1.0, 0.5, 0.0))
    made.reset()
    assert made.robots[0].robot.pose == (0, 0, 0)
    for wrong in ({"give": "all"}, {"rate": 0.0}, {"cmd_timeout": -1.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            Settings(**wrong)


def test_settings_choose_what_topics_give_of_the_truth():
    given, _ = stream(wheels=True, lines=True, rng=3)
    hidden, _ = stream(give="none", clock=False)
    optional = {"map", "/clock", "map_objects"}
    assert optional <= {topic.name for topic in given.topics}
    assert not optional & {topic.name for topic in hidden.topics}
    given.robots[0].command(0.5, 0.3)
    seen = by_name(message for _ in range(4) for message in given.step())
    odometry = seen["odom"]["pose"]["pose"]["position"]
    assert (odometry["x"], odometry["y"]) != given.robots[0].robot.pose[:2]
    assert seen["tf"]["transforms"][1]["child_frame_id"] == "odom"
    assert {0, 100} <= set(by_name(given.first())["map"]["data"].tolist())
    children = [each["child_frame_id"] for each in by_name(hidden.tick())["tf"]["transforms"]]
    assert children == ["base_link", "left_wheel", "right_wheel"]
    own, _ = stream(odom_tf=False)
    assert len(by_name(own.tick())["tf"]["transforms"]) == 2


def test_each_laser_has_its_topic_and_its_frame():
    lasers = [
        LaserRangeFinder(beams=3, name="front", mount=(0.2, 0.1, 0.0)),
        LaserRangeFinder(beams=5, name="rear", mount=(-0.2, 0.0, math.pi)),
    ]
    made, _ = stream(lasers)
    seen = by_name((*made.first(), *made.tick()))
    fixed = seen["tf_static"]["transforms"]
    assert [each["child_frame_id"] for each in fixed] == ["front", "rear", "base_footprint"]
    assert fixed[0]["transform"]["translation"] == {"x": 0.2, "y": 0.1, "z": 0.5}
    assert seen["scan_rear"]["header"]["frame_id"] == "rear"
    assert [seen["scan_front"]["ranges"][1], seen["scan_rear"]["ranges"][2]] == pytest.approx(
        [2.8, 2.8]
    )


def test_robots_of_a_fleet_have_names_and_see_and_touch_each_other():
    made, _ = stream(robots=2, cmd_timeout=0.0)
    first, second = made.robots
    distance = second.robot.pose.x - first.robot.pose.x
    seen = by_name((*made.first(), *made.tick()))
    assert {"robot1/scan", "robot2/scan", "robot2/odom", "map", "/clock"} <= set(seen)
    assert seen["robot2/scan"]["header"]["frame_id"] == "robot2/laser"
    ahead = seen["robot1/scan"]["ranges"]
    assert ahead[len(ahead) // 2] == pytest.approx(distance - 0.35, abs=0.01)
    first.command(0.5, 0.0)
    for _ in range(60):
        [*made.step()]
    assert first.robot.bumped
    assert second.robot.pose.x - first.robot.pose.x == pytest.approx(0.7, abs=1e-3)
    with pytest.raises(InputError, match="9 robots: they would stand"):
        stream(robots=9)


def test_covariances_are_those_of_the_wheels_and_large_for_what_is_not_measured():
    exact, _ = stream()
    slipping, _ = stream(wheels=True, rng=1)
    diagonals = []
    for made in (exact, slipping):
        made.robots[0].command(0.5, 0.3)
        seen = by_name(message for _ in range(5) for message in made.step())
        for each in (seen["odom"], seen["ground_truth"]):
            diagonals += [each[name]["covariance"].reshape(6, 6).diagonal() for name in
                          ("pose", "twist")]  # fmt: skip
    assert all((each[2:5] == ros.UNKNOWN).all() for each in diagonals)
    for each in (*diagonals[:4], *diagonals[6:]):
        assert each[[0, 1, 5]] == pytest.approx(ros.EXACT)
    assert (diagonals[4][[0, 5]] > 2 * ros.EXACT).all()
    assert (diagonals[5][[0, 5]] > 10 * ros.EXACT).all()


def test_odometry_does_not_jump_where_the_robot_is_put_elsewhere():
    made, _ = stream()
    robot = made.robots[0]
    [*made.tick()]
    robot.command(0.5, 0.5)
    [*made.step()]
    before = robot.robot.odometry
    robot.set_pose("map", (1.0, -0.5, 2.0))
    assert robot.robot.odometry == before and robot.robot.pose == (1.0, -0.5, 2.0)
    made.reset()
    seen = by_name(made.tick())
    assert seen["odom"]["pose"]["pose"]["position"]["x"] == pytest.approx(before.x)
    drift = seen["tf"]["transforms"][1]["transform"]["translation"]
    assert math.hypot(drift["x"], drift["y"]) > 0.01
    robot.command(0.0, 0.4)
    [*made.step()]
    turned = robot.robot.odometry.theta - before.theta
    assert turned == pytest.approx(robot.robot.pose.theta)


def test_the_model_of_the_robot_has_the_frames_that_are_published():
    lasers = [LaserRangeFinder(beams=3, name="front"), LaserRangeFinder(beams=3, name="rear")]
    made, _ = stream(lasers)
    seen = by_name((*made.first(), *made.tick()))
    model = ElementTree.fromstring(seen["robot_description"]["data"])
    assert len([*made.encoded(made.first()), *made.encoded(made.step())]) > 10
    links = {each.get("name") for each in model.iter("link")}
    children = {each.get("link") for each in model.iter("child")}
    assert links == children | {"base_link"}
    frames = {each["child_frame_id"] for name in ("tf", "tf_static") for each in
              seen[name]["transforms"]}  # fmt: skip
    assert links == frames - {"odom"}
    made.robots[0].command(0.4, 0.0)
    for _ in range(3):
        seen = by_name(made.step())
    left, right = seen["joint_states"]["position"]
    moved = seen["odom"]["pose"]["pose"]["position"]["x"]
    assert left == right == pytest.approx(moved / (0.25 * 0.35))
    start = seen.get("start_pose") or by_name(made.first())["start_pose"]
    assert start["header"]["frame_id"] == "map"
