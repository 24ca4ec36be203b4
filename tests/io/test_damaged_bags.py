"""Bags with messages that cannot be used, and bags that are too large: what is said of them."""

import math

import pytest
from bags import STORE, mounted, odometry, rosbag2, scan, transform, write

from lrf3d.errors import InputError
from lrf3d.io import bag_reader, load_log
from lrf3d.io.bag_reader import ODOMETRY, SCAN, TRANSFORMS
from lrf3d.laser import Stamp

WHEELS = [("/odom", t, ODOMETRY, odometry(float(t), (t, 0.0, 0.0))) for t in range(3)]


def scans(*times):
    return [("/scan", time, SCAN, scan(time)) for time in times]


def packed(path, mode):
    """A bag of two odometry messages and a scan, compressed."""
    bag = rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin.SQLITE3)
    bag.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with bag:
        topics = {}
        for topic, time, kind, message in [mounted(), *WHEELS, *scans(0.5)]:
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], Stamp.of(time).nanoseconds, STORE.serialize_cdr(message, kind))
    return path


def test_a_message_that_is_cut_off_is_counted_and_named(tmp_path):
    with rosbag2.Writer(
        tmp_path / "bag", version=8, storage_plugin=rosbag2.StoragePlugin.MCAP
    ) as bag:
        wheels = bag.add_connection("/odom", ODOMETRY, typestore=STORE)
        beams = bag.add_connection("/scan", SCAN, typestore=STORE)
        for _, time, kind, message in WHEELS:
            bag.write(wheels, Stamp.of(time).nanoseconds, STORE.serialize_cdr(message, kind))
        whole = STORE.serialize_cdr(scan(0.5), SCAN)
        bag.write(beams, 500_000_000, whole)
        for _ in range(7):
            bag.write(beams, 600_000_000, whole[:30])
    log = load_log(tmp_path / "bag")
    assert len(log) == 1 and log.bad_count == 7
    # The first five are named.
    assert [bad.number for bad in log.bad_lines] == [3, 4, 5, 6, 7]
    assert str(log.bad_lines[0]).startswith("message 3: ")


def test_a_bag_whose_scans_are_all_invalid_names_the_first(tmp_path):
    broken = scan(0.5)
    broken.angle_increment = 0.0
    bag = write(tmp_path / "bag", *WHEELS, ("/scan", 0.5, SCAN, broken))
    with pytest.raises(InputError, match=r"no scan on /scan .*first message 2: .*at most a turn"):
        load_log(bag)


def test_a_transform_whose_quaternion_is_not_a_rotation_is_not_used(tmp_path):
    zero = transform(0.0, "odom", "base_link", turn=(0, 0, 0, 0))
    moves = [
        ("/tf", t, TRANSFORMS, transform(float(t), "odom", "base_link", (t, 0, 0))) for t in (0, 1)
    ]
    bag = write(tmp_path / "bag", mounted(), ("/tf", 0, TRANSFORMS, zero), *moves, *scans(0.5))
    log = load_log(bag)
    assert log.bad_count == 1 and "unit quaternion" in str(log.bad_lines[0])


def test_the_first_parent_of_a_frame_counts(tmp_path):
    moves = []
    for t in range(2):
        half = 0.05 * t
        turn = (0, 0, math.sin(half), math.cos(half))
        here = transform(float(t), "odom", "base_link", (t, 0, 0), turn)
        there = transform(float(t), "world", "base_link", (9, 9, 0), turn)
        moves += [("/tf", t, TRANSFORMS, here), ("/tf", t, TRANSFORMS, there)]
    log = load_log(write(tmp_path / "bag", mounted(), *moves, *scans(1.0)))
    assert log.source == "/tf, laser in odom"
    assert log.poses[0] == pytest.approx([1.0, 0.0, 0.1])


def test_a_bag_with_too_many_readings_is_to_be_cut(tmp_path, monkeypatch):
    monkeypatch.setattr(bag_reader, "MOST_READINGS", 6)
    bag = write(tmp_path / "bag", mounted(), *WHEELS, *scans(0.5, 1.0))
    assert len(load_log(bag)) == 2
    bag = write(tmp_path / "more", mounted(), *WHEELS, *scans(0.5, 1.0, 1.5))
    with pytest.raises(InputError, match=r"more: more than 6 readings; cut it into parts"):
        load_log(bag)


def test_a_bag_of_compressed_messages_is_to_be_converted(tmp_path):
    bag = packed(tmp_path / "bag", rosbag2.CompressionMode.MESSAGE)
    with pytest.raises(InputError, match="each message is compressed; decompress it with ros2"):
        load_log(bag)


def test_a_compressed_bag_is_read(tmp_path):
    bag = packed(tmp_path / "bag", rosbag2.CompressionMode.FILE)
    # A folder within a bag is no part of it.
    (bag / "pictures").mkdir()
    assert load_log(bag).scans[0].ranges == pytest.approx([1.0, 2.0, 3.0])


def test_metadata_of_many_megabytes_are_not_parsed(tmp_path):
    bag = write(tmp_path / "bag", mounted(), *WHEELS, *scans(0.5))
    with (bag / "metadata.yaml").open("a") as file:
        file.write("#" + "x" * 1_500_000)
    with pytest.raises(InputError, match=r"metadata\.yaml: 1\.5 MB, more than the 0\.524 MB"):
        load_log(bag)
