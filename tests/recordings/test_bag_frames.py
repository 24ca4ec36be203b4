"""ROS bags of other robots: frames, poses and damages, as they are understood or refused."""

from itertools import chain

import numpy as np
import pytest
from bags import (
    STORE,
    mounted,
    odometry,
    of_scan,
    pose,
    rosbag2,
    scan,
    scans,
    transform,
    wheels,
    write,
)

import lrf3d
from lrf3d import InputError, load_log
from lrf3d.laser import Stamp
from lrf3d.recordings.formats.bags.contents import ODOMETRY, POSE, SCAN, TRANSFORMS

TURNS = {"upright": (0, 0, 0, 1), "upside down": (1, 0, 0, 0), "left": (0, 0, 0.5**0.5, 0.5**0.5)}


def drives(root, base, poses, topic="/tf"):
    """A transform a second."""
    for time, (x, y, theta) in enumerate(poses):
        turn = (0, 0, np.sin(theta / 2), np.cos(theta / 2))
        yield topic, time, TRANSFORMS, transform(float(time), root, base, (x, y, 0), turn)


def broken(time):
    """A scan whose bearings are no numbers."""
    message = scan(time)
    message.angle_min = np.nan
    return "/scan", time, SCAN, message


# A robot that drives a metre ahead.
AHEAD = [*drives("odom", "base_link", [(0, 0, 0), (1, 0, 0)])]


@pytest.mark.parametrize("way", ["tf", "odom", "truth"])
def test_the_laser_is_where_it_is_mounted(way, tmp_path):
    poses = [(1.0, 2.0, 0.3), (3.0, 2.0, 0.3)]
    robot = list(drives("odom", "base_link", poses)) if way == "tf" else []
    if way != "tf":
        topic = "/base_pose_ground_truth" if way == "truth" else "/pose"
        robot = [(topic, t, POSE, pose(float(t), "odom", *each)) for t, each in enumerate(poses)]
    bag = write(
        tmp_path / "bag", mounted((0.2, -0.1, 0.5), TURNS["left"]), *robot, *scans(0.0, 0.5, 1.0)
    )
    log = load_log(bag)
    shift = np.array([0.2 * np.cos(0.3) + 0.1 * np.sin(0.3), 0.2 * np.sin(0.3) - 0.1 * np.cos(0.3)])
    for number, x in enumerate([1.0, 2.0, 3.0]):
        assert log.poses[number] == pytest.approx([x + shift[0], 2 + shift[1], 0.3 + np.pi / 2])
    assert (way == "tf") == log.source.startswith("/tf")


def test_a_fixed_transform_counts_until_the_next_one(tmp_path):
    later = "/tf_static", 0.7, TRANSFORMS, transform(0.7, "base_link", "laser", (0.2, 0, 0))
    log = load_log(write(tmp_path / "bag", mounted(), *AHEAD, later, *scans(0.5, 1.0)))
    assert log.poses[:, 0] == pytest.approx([0.5, 1.2])


def test_a_laser_upside_down_has_mirrored_angles(tmp_path):
    bag = write(tmp_path / "bag", mounted(turn=TURNS["upside down"]), *AHEAD, *scans(0.0))
    seen = load_log(bag).scans[0]
    assert seen.pose == (0.0, 0.0, 0.0) and seen.angles.tolist() == [1.0, 0.0, -1.0]


def test_transforms_up_to_the_map_come_before_odometry_and_behind_the_truth(tmp_path):
    mapped = drives("map", "odom", [(10, 0, 0), (10, 0, 0)])
    drive = [("/odom", t, ODOMETRY, odometry(float(t), (7.0, 0.0, 0.0))) for t in range(2)]
    drive += [("/laser_odom", t, ODOMETRY, odometry(float(t), (9.0, 0.0, 0.0))) for t in range(2)]
    bag = write(tmp_path / "bag", mounted(), *AHEAD, *mapped, *drive, *scans(0.5))
    assert load_log(bag).scans[0].pose == pytest.approx((10.5, 0, 0))
    assert load_log(bag).source == "/tf, laser in map"
    assert load_log(bag, poses="odom").scans[0].pose == pytest.approx((7, 0, 0))
    with pytest.raises(InputError, match="no poses from truth in it; there are tf, odom"):
        load_log(bag, poses="truth")


def test_a_fixed_joint_that_is_published_repeatedly_is_no_drive(tmp_path):
    joint = drives("base_link", "laser", [(0.2, 0, 0)] * 3)
    log = load_log(write(tmp_path / "bag", *joint, *wheels(3), *scans(1.0)))
    assert log.source == "/odom" and log.poses[0] == pytest.approx([1.2, 0, 0])


def test_invalid_scans_and_scans_without_a_pose_are_counted_and_named(tmp_path):
    bag = write(tmp_path / "bag", mounted(), *AHEAD, *scans(0.5, 1.5), broken(0.6))
    log = load_log(bag)
    assert len(log) == 1 and log.bad_count == 2
    assert "expected at most a turn" in str(log.bad_lines[0])
    assert str(log.bad_lines[1]).startswith("scan 2: ")


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([mounted(), *scans(0.0, 1.0)], r"no poses in it.*lrf3d slam finds them"),
        # Frames in a circle.
        (
            [*drives("laser", "base_link", [(0, 0, 0), (1, 0, 0)]), mounted(), *scans(0.5, 1.0)],
            "no poses",
        ),
        ([mounted(), *AHEAD], "no topic of sensor_msgs/msg/LaserScan"),
        ([mounted(), *AHEAD, *scans(2.0)], "no scan within the time"),
        ([mounted(turn=(0, np.sin(0.3), 0, np.cos(0.3))), *AHEAD, *scans(0.0)], "tilted by 34°"),
        ([*wheels(3), broken(0.5)], r"no scan on /scan .*first message 2: .*at most a turn"),
    ],
)
def test_bags_without_what_a_map_needs_are_refused_with_what_is_missing(messages, words, tmp_path):
    with pytest.raises(InputError, match=words):
        lrf3d.map_log(write(tmp_path / "bag", *messages))


def test_missing_topics_and_files_are_named(tmp_path):
    with pytest.raises(InputError, match=r"no scans on /front; there are /scan"):
        load_log(write(tmp_path / "d", mounted(), *AHEAD, *scans(0.0)), scan_topic="/front")
    (tmp_path / "e").mkdir()
    with pytest.raises(InputError, match=r"without \.mcap"):
        load_log(tmp_path / "e")
    with pytest.raises(InputError, match="no such file"):
        load_log(tmp_path / "none.mcap")


def test_one_scan_alone_is_mapped_without_a_pose(tmp_path):
    room = lrf3d.load_world("paper_room")
    fan = lrf3d.PlanarCaster(room).cast(lrf3d.LaserRangeFinder(beams=361), (2.0, 2.0, 0.5))
    bag = write(tmp_path / "bag", ("/scan", 0.0, SCAN, of_scan(fan)))
    assert len(lrf3d.map_log(bag).world.segments) > 2


def test_a_mount_without_a_transform_is_reported_as_guessed(tmp_path):
    log = load_log(write(tmp_path / "bag", *wheels(2), *scans(0.5)))
    assert log.scans[0].pose == pytest.approx((0.5, 0, 0)) and "middle of base_link" in log.source


def test_the_base_is_found_from_the_laser_by_the_child_frame_of_the_odometry(tmp_path):
    mount = mounted((0.2, -0.1, 0.5), TURNS["left"])
    log = load_log(write(tmp_path / "a", mount, *wheels(2), *scans(0.5)))
    assert log.mount == pytest.approx((0.2, -0.1, np.pi / 2))
    assert log.scans[0].pose @ log.mount.inverse() == pytest.approx((0.5, 0, 0))
    # Another frame of the robot than the usual one.
    foot = [("/odom", t, ODOMETRY, odometry(float(t), (t, 0, 0), "foot")) for t in range(2)]
    static = "/tf_static", 0.0, TRANSFORMS, transform(0.0, "foot", "base_link", (0.0, 0.0, 0.1))
    lower = "/tf_static", 0.0, TRANSFORMS, transform(0.0, "base_link", "laser", (0.3, 0.0, 0.2))
    log = load_log(write(tmp_path / "b", static, lower, *foot, *scans(0.5)))
    assert log.mount == pytest.approx((0.3, 0, 0)) and log.source == "/odom"


def test_without_a_topic_of_odometry_it_is_the_transforms_up_to_its_frame(tmp_path):
    mapped = drives("map", "odom", [(10, 0, 0), (10, 0, 0)])
    bag = write(tmp_path / "bag", mounted((0.2, 0, 0)), *AHEAD, *mapped, *scans(0.5))
    log = load_log(bag, poses="odom")
    assert log.source == "/tf, laser in odom" and log.mount == pytest.approx((0.2, 0, 0))
    assert log.scans[0].pose == pytest.approx((0.7, 0, 0))


def test_a_message_that_is_cut_off_is_counted_and_named(tmp_path):
    kind = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(tmp_path / "bag", version=8, storage_plugin=kind) as bag:
        drive = bag.add_connection("/odom", ODOMETRY, typestore=STORE)
        beams = bag.add_connection("/scan", SCAN, typestore=STORE)
        for _, time, kind, message in wheels(3):
            bag.write(drive, Stamp.of(time).nanoseconds, STORE.serialize_cdr(message, kind))
        whole = STORE.serialize_cdr(scan(0.5), SCAN)
        bag.write(beams, 500_000_000, whole)
        for _ in range(7):
            bag.write(beams, 600_000_000, whole[:30])
    log = load_log(tmp_path / "bag")
    assert len(log) == 1 and log.bad_count == 7
    # The first five are named.
    assert [bad.number for bad in log.bad_lines] == [5, 6, 7, 8, 9]
    assert str(log.bad_lines[0]).startswith("message 5: ")


def test_a_transform_whose_quaternion_is_not_a_rotation_is_not_used(tmp_path):
    zero = transform(0.0, "odom", "base_link", turn=(0, 0, 0, 0))
    turned = mounted(turn=(0, 0, 0.7, 0.7))
    bag = write(tmp_path / "bag", turned, ("/tf", 0, TRANSFORMS, zero), *AHEAD, *scans(0.5))
    log = load_log(bag)
    assert log.bad_count == 1 and "unit quaternion" in str(log.bad_lines[0])
    assert log.poses[0, 2] == pytest.approx(np.pi / 2)


def test_the_first_parent_of_a_frame_counts(tmp_path):
    here = drives("odom", "base_link", [(0, 0, 0), (1, 0, 0.1)])
    there = drives("world", "base_link", [(9, 9, 0), (9, 9, 0.1)])
    moves = chain.from_iterable(zip(here, there, strict=True))
    log = load_log(write(tmp_path / "bag", mounted(), *moves, *scans(1.0)))
    assert log.source == "/tf, laser in odom"
    assert log.poses[0] == pytest.approx([1.0, 0.0, 0.1])


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
def test_a_compressed_bag_is_read(mode, tmp_path):
    drive = mounted(), *wheels(3), *scans(0.5)
    bag = write(tmp_path / "bag", *drive, storage="SQLITE3", packed=mode)
    (bag / "pictures").mkdir()  # is no part of it
    assert load_log(bag).scans[0].ranges == pytest.approx([1.0, 2.0, 3.0])
