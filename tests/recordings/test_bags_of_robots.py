"""Bags as robots write them: several robots and lasers, clocks that differ, files that are cut."""

import dataclasses
import json
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from bags import STORE, header, mounted, odometry, of_scan, scan, scans, transform, wheels, write
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import lrf3d
from lrf3d import InputError, load_log
from lrf3d.laser import Stamp
from lrf3d.recordings.formats.bags.contents import ECHOES, ODOMETRY, SCAN, TRANSFORMS
from lrf3d.recordings.formats.bags.writer import made

RISING = np.linspace(1.0, 5.0, 41)

HALF = (0, 0, 1, 0)
"""The quaternion of half a turn."""


def driven(topic, child, y, times=range(3), received=None):
    """Odometry of a robot that drives a metre a second along x."""
    for k, t in enumerate(times):
        arrived = t if received is None else received[k]
        yield topic, arrived, ODOMETRY, odometry(float(t), (t, y, 0.0), child)


def test_of_two_robots_each_has_its_own_odometry(tmp_path):
    bag = write(
        tmp_path / "bag",
        mounted((0.2, 0, 0), base="a/base", laser="a/laser"),
        mounted((0.5, 0, 0), base="b/base", laser="b/laser"),
        *driven("/a/odom", "a/base", 0.0),
        *driven("/b/odom", "b/base", 7.0),
        *scans(0.5, topic="/a/scan", frame="a/laser"),
        *scans(0.5, topic="/b/scan", frame="b/laser"),
    )
    first, second = load_log(bag), load_log(bag, scan_topic="/b/scan")
    assert first.source == "/a/odom" and first.poses == pytest.approx(np.array([[0.7, 0, 0]]))
    assert second.source == "/b/odom" and second.poses == pytest.approx(np.array([[1.0, 7, 0]]))
    assert first.notes == ("left out: 1 scan of /b/scan (b/laser); see --scan-topic",)
    # Another robot's odometry is none.
    alone = write(
        tmp_path / "alone",
        mounted((0.2, 0, 0), base="a/base", laser="a/laser"),
        mounted((0.2, 0, 0), base="b/base", laser="b/laser"),
        *driven("/b/odom", "b/base", 7.0),
        *scans(0.5, topic="/a/scan", frame="a/laser"),
    )
    assert not load_log(alone).placed


def test_robots_may_have_frames_of_the_same_names_in_their_namespaces(tmp_path):
    def robot(name, y):
        for t in range(3):
            moved = transform(float(t), "odom", "base_link", (t, y, 0))
            yield f"/{name}/tf", t, TRANSFORMS, moved
        yield f"/{name}/tf_static", 0, TRANSFORMS, transform(0.0, "base_link", "laser")
        yield from scans(0.5, topic=f"/{name}/scan")

    bag = write(tmp_path / "bag", *robot("a", 1.0), *robot("b", 2.0))
    for name, y in (("a", 1.0), ("b", 2.0)):
        log = load_log(bag, scan_topic=f"/{name}/scan")
        assert log.poses == pytest.approx(np.array([[0.5, y, 0]]))


@pytest.mark.parametrize("topics", [("/scan", "/scan"), ("/front", "/rear")])
def test_each_scan_has_the_mount_of_its_own_frame(topics, tmp_path):
    bag = write(
        tmp_path / "bag",
        mounted((0.4, 0, 0), laser="front"),
        mounted((-0.4, 0, 0), HALF, laser="rear"),
        *driven("/odom", "base_link", 0.0),
        *scans(0.5, 1.5, topic=topics[0], frame="front"),
        *scans(1.0, topic=topics[1], frame="rear"),
    )
    log = load_log(bag)
    assert log.poses == pytest.approx(np.array([[0.9, 0, 0], [0.6, 0, np.pi], [1.9, 0, 0]]))
    assert [scan.laser for scan in log.scans] == [
        "front",
        "rear",
        "front",
    ] and log.is_odd.tolist() == [False, False, True]
    assert "lasers: 2 scans of" in log.notes[0]
    # Another topic of the same frame has the same scans, filtered.
    again = write(tmp_path / "again", *wheels(3), *scans(0.5), *scans(0.5, topic="/filtered"))
    assert len(load_log(again)) == 1 and "/filtered" in load_log(again).notes[0]


def test_stamps_that_go_back_split_the_recording(tmp_path):
    times, received = [5, 6, 7, 5, 6], [300, 301, 302, 303, 304]
    # The odometry starts again a message later than the scans.
    late = [5, 6, 7, 8, 5, 6]
    bag = write(
        tmp_path / "bag",
        *scans(*times, received=received),
        *driven("/odom", "base_link", 0.0, late, [299.9, 300.9, 301.9, 302.95, 303.05, 304.05]),
    )
    log, second = load_log(bag), load_log(bag, part=2)
    assert log.times.tolist() == [5, 6, 7] and second.times.tolist() == [5, 6]
    assert log.poses[:, 0].tolist() == [5, 6, 7]
    [note] = log.notes
    assert "go back at message" in note and "from 7 to 5 s: part 1 of 2 was read, 3 of 5" in note
    with pytest.raises(InputError, match="no part 3"):
        load_log(bag, part=3)


@pytest.mark.parametrize("clock", [lambda t: 0.0, lambda t: 100.0 + t, lambda t: float(t > 1.6)])
def test_by_other_clocks_the_times_of_receipt_count(clock, tmp_path):
    times = [0.5, 1.0, 1.25, 1.5, 1.75]
    stamps = [*map(clock, times)]
    bag = write(tmp_path / "bag", *wheels(3), *scans(*stamps, received=times))
    log = load_log(bag)
    assert log.times == pytest.approx(times) and log.poses[:, 0] == pytest.approx(times)
    note, *_ = log.notes
    assert "stamps" in note and "of /scan" in note and note.endswith("times of receipt count")


def test_readings_just_below_range_max_are_no_return(tmp_path):
    rng, messages = np.random.default_rng(0), list(wheels(10))
    for t in np.linspace(0.0, 9.0, 60):
        ranges = np.where(np.arange(40) < 10, 9.99, rng.uniform(1.0, 6.0, 40))
        message = of_scan(lrf3d.LaserScan((0, 0, 0), np.linspace(-1, 1, 40), ranges, time=t))
        message.range_max = 10.0
        messages.append(("/scan", t, SCAN, message))
    bag = write(tmp_path / "bag", *messages)
    log, kept, near = load_log(bag), load_log(bag, largest_range=20), load_log(bag, largest_range=3)
    assert np.isinf([scan.ranges[:10] for scan in log.scans]).all() and "9.99 m" in str(log.notes)
    assert np.isfinite([scan.ranges for scan in kept.scans]).all()
    assert max(scan.ranges[scan.hits].max() for scan in near.scans) < 3.0


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_folder_that_a_killed_recorder_left_is_read(storage, tmp_path):
    bag = write(tmp_path / "bag", *wheels(3), *scans(0.5), storage=storage)
    (bag / "metadata.yaml").unlink()
    log = load_log(bag)
    assert log.poses[:, 0] == pytest.approx([0.5])


@pytest.mark.parametrize("share", [0.7, 0.9, 0.9999])
@pytest.mark.parametrize("packed", [None, "STORAGE", "FILE"])
def test_what_is_whole_in_a_file_that_was_cut_short_is_read(packed, share, tmp_path):
    rng = np.random.default_rng(0)
    beams = rng.uniform(1.0, 6.0, (300, 720))
    fans = [lrf3d.LaserScan((0, 0, 0), np.linspace(-1, 1, 720), row) for row in beams]
    times = np.linspace(0.0, 9.0, len(fans))
    messages = [("/scan", t, SCAN, of_scan(s.at_time(t))) for t, s in zip(times, fans, strict=True)]
    in_turn = sorted([*wheels(10), *messages], key=lambda message: message[1])
    bag = write(tmp_path / "bag", *in_turn, packed=packed)
    [file] = bag.glob("*.mcap*")
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    for path in (file, bag):
        log = load_log(path)
        # The drive ends with the last odometry that is whole.
        assert 0.5 * share * 300 < len(log) <= 300 and log.bad_count < 40
        assert any("was cut short" in note for note in log.notes)
        read = np.array([scan.ranges for scan in log.scans])
        assert np.allclose(read, beams[: len(read)], rtol=1e-6, atol=0.0)


def test_bags_of_ros_1_are_read(written, tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    with Writer(tmp_path / "drive.bag") as bag:
        topics = {}
        for topic, time, kind, message in [
            mounted((0.2, 0, 0), base="/base_link", laser="/laser"),
            *wheels(3),
            *scans(0.5),
        ]:
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=store)
            data = STORE.cdr_to_ros1(STORE.serialize_cdr(message, kind), kind)
            bag.write(topics[topic], Stamp.of(time).nanoseconds, data)
    log = load_log(tmp_path / "drive.bag")
    assert log.source == "/odom" and log.poses[:, 0] == pytest.approx([0.7]) and not log.notes
    cut = written("cut.bag", (tmp_path / "drive.bag").read_bytes()[:9900])
    assert "cut.bag was cut short" in load_log(cut).notes[0]


def test_of_several_echoes_the_first_counts(tmp_path):
    ranges = [{"echoes": np.array(echoes, np.float32)} for echoes in ([1.0, 3.0], [2.0], [])]
    fan = {"angle_min": -1.0, "angle_max": 1.0, "angle_increment": 1.0, "range_max": 9.0}
    fields = {"header": header(0.5, "laser"), **fan, "ranges": ranges}
    message = "/echoes", 0.5, ECHOES, made(STORE, ECHOES, fields)
    [found] = load_log(write(tmp_path / "bag", *wheels(3), message)).scans
    assert found.ranges.tolist() == [1.0, 2.0, np.inf]


@pytest.mark.parametrize("step", [-0.05, 0.0, np.nan, 3.0, 0.025])
def test_a_step_that_contradicts_the_ends_of_the_beams_is_noted(step, tmp_path):
    def message(t):
        sent = of_scan(lrf3d.LaserScan((0, 0, 0), np.linspace(-1, 1, 41), RISING, time=t))
        sent.angle_increment = step
        return "/scan", t, SCAN, sent

    log = load_log(write(tmp_path / "bag", *wheels(3), message(0.5), message(1.5)))
    [note] = log.notes
    assert "angle_max" in note
    if step == 0.025:
        # Either may be right: turns decide.
        assert log.fans == ((-1.0, 1.0),) and np.ptp(log.scans[0].angles) == pytest.approx(1.0)
    else:
        assert log.scans[0].angles == pytest.approx(np.linspace(-1, 1, 41))


def test_a_mount_that_is_published_once_holds_at_all_times(tmp_path):
    stamp = "/tf", 0.1, TRANSFORMS, transform(0.0, "base_link", "laser", (0.2, 0, 0))
    for storage in ("MCAP", "SQLITE3"):
        bag = write(tmp_path / storage, stamp, *wheels(2003), *scans(2000.5), storage=storage)
        assert load_log(bag).poses == pytest.approx(np.array([[2000.7, 0, 0]]))


def test_filtered_odometry_comes_before_that_of_wheels(tmp_path):
    drifting = driven("/drive/odom", "base_link", 5.0)
    right = driven("/odometry/filtered", "base_link", 1.0)
    log = load_log(write(tmp_path / "bag", *drifting, *right, *scans(0.5)))
    assert log.poses[:, 1].tolist() == [1.0]
    assert log.notes == ("poses from /odometry/filtered, not from /drive/odom",)


def test_what_a_recorder_did_not_move_from_its_journal_is_read(tmp_path):
    bag = write(tmp_path / "bag", *wheels(3), *scans(0.5, 1.5), storage="SQLITE3")
    left = tmp_path / "left"
    with closing(sqlite3.connect(bag / "bag.db3", isolation_level=None)) as database:
        for line in (
            "PRAGMA journal_mode=wal",
            "CREATE TABLE later AS SELECT * FROM messages",
            "DELETE FROM messages",
            "PRAGMA wal_checkpoint(truncate)",
            "INSERT INTO messages SELECT * FROM later",
        ):
            database.execute(line)
        shutil.copytree(bag, left)
    before = sorted(path.name for path in left.iterdir())
    log = load_log(left)
    assert len(log) == 2 and "bag.db3-wal" in log.notes[0]
    assert sorted(path.name for path in left.iterdir()) == before


def test_of_several_files_damaged_ones_are_left_out(tmp_path):
    bag = write(tmp_path / "bag", *wheels(3), *scans(0.5))
    for name in ("bag_0.mcap", "z.mcap"):
        (bag / name).write_bytes(b"")
    log = load_log(bag)
    assert len(log) == 1 and [note.split()[0] for note in log.notes] == ["z.mcap", "bag_0.mcap"]


def test_odometry_that_comes_seldom_is_said_to_be_interpolated(tmp_path):
    bag = write(tmp_path / "bag", *wheels(4), *scans(*np.arange(0.1, 2.9, 0.1)))
    assert "1 s apart: interpolated" in load_log(bag).notes[0]


def test_robots_that_publish_on_one_topic_have_tracks_of_their_own(tmp_path):
    bag = write(
        tmp_path / "bag",
        mounted((0.2, 0, 0), base="a/base", laser="a/laser"),
        mounted((0.2, 0, 0), base="b/base", laser="b/laser"),
        *driven("/odom", "a/base", 0.0),
        *driven("/odom", "b/base", 7.0, [0.1, 1.1, 2.1]),
        *scans(0.5, frame="a/laser"),
    )
    assert load_log(bag).poses == pytest.approx(np.array([[0.7, 0, 0]]))


def test_poses_are_unknown_in_a_gap_of_a_moving_frame(tmp_path):
    times = [0, 0.4, 0.8, 4.0, 4.4]
    moves = [
        ("/tf", t, TRANSFORMS, transform(t, "odom", "base_link", (t * t, 0, 0))) for t in times
    ]
    bag = write(
        tmp_path / "bag",
        mounted((0.2, 0, 0)),
        *moves,
        *scans(0.6, 2.0, 4.0, 4.2),
    )
    log = load_log(bag)
    assert log.times.tolist() == [0.6, 4.0, 4.2] and "or in a gap" in str(log.bad_lines[0])


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE topics SET name = substr(name, 2)",
        "UPDATE messages SET timestamp = NULL",
        "UPDATE messages SET timestamp = timestamp + 0.5",
    ],
)
def test_names_without_a_slash_and_odd_times_of_receipt_are_read(change, tmp_path):
    bag = write(tmp_path / "bag", *scans(0.0, 1.0), *wheels(3), storage="SQLITE3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as file:
        schema = "id INTEGER, topic_id INTEGER, timestamp, data BLOB"
        file.execute(f"CREATE TABLE loose ({schema})")
        file.execute("INSERT INTO loose SELECT * FROM messages")
        file.execute("DROP TABLE messages")
        file.execute("ALTER TABLE loose RENAME TO messages")
        file.execute(change)
    assert load_log(bag).poses[:, 0] == pytest.approx([0.0, 1.0])


def text_of(wrap, *messages):
    """Messages (topic, time, kind, message) as lines of JSON, by a function that wraps each."""

    def plain(value):
        if dataclasses.is_dataclass(value):
            names = [field.name for field in dataclasses.fields(value)]
            return {name: plain(getattr(value, name)) for name in names if name[:2] != "__"}
        if isinstance(value, np.ndarray):
            return [None if each == np.inf else each for each in value.tolist()]
        return [plain(each) for each in value] if isinstance(value, list) else value

    lines = [json.dumps(wrap(topic, time, plain(message))) for topic, time, _, message in messages]
    return "\n".join(lines)


def stampless(message):
    """A message of a driver without a clock."""
    return (
        {**message, "header": {**message["header"], "stamp": None}}
        if "ranges" in message
        else (message)
    )


def test_an_array_of_messages_may_be_indented(written):
    lines = text_of(lambda topic, _, message: {"topic": topic, "msg": message}, *scans(1.0, 2.0))
    path = written(
        "log.json", json.dumps([json.loads(line) for line in lines.split("\n")], indent=1)
    )
    assert load_log(path).times == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize(
    "wrap",
    [
        lambda topic, _, message: {"op": "publish", "topic": topic, "msg": message},
        lambda topic, time, message: {"topic": topic, "log_time": time + 0.5, "data": message},
        lambda topic, time, message: {
            "topic": topic,
            "log_time": str(round(1e9 * time) + 10**18),
            "data": message,
        },
        lambda topic, time, message: {
            "topic": topic,
            "log_time": time + 1,
            "msg": stampless(message),
        },
    ],
)
def test_lines_of_json_of_several_topics_are_read_as_bags_are(wrap, written):
    drive = [*scans(0.0, 1.0), *wheels(3), mounted((0.5, 0, 0))]
    seen = ("/scan", 2.0, SCAN, scan(2.0, ranges=(1.0, np.inf, 2.0)))
    path = written(
        "log.jsonl", text_of(wrap, *drive, seen) + '\n{"op": "subscribe", "topic": "/x"}\n{"topic"'
    )
    log = load_log(path)
    assert log.poses[:, 0] == pytest.approx([0.5, 1.5, 2.5]) and log.bad_count == 1
    assert log.scans[2].ranges.tolist() == [1.0, np.inf, 2.0] and log.source.startswith("/odom")


def record(fields, data):
    """A record of a bag of ROS 1."""
    pairs = [name.encode() + b"=" + value for name, value in fields.items()]
    head = b"".join(len(each).to_bytes(4, "little") + each for each in pairs)
    return b"".join(len(each).to_bytes(4, "little") + each for each in (head, data))


def test_bags_of_version_1_2_are_read_in_spite_of_wrong_lengths_of_their_index(written):
    parts = [b"#ROSBAG V1.2\n", record({"op": b"\3", "index_pos": b"\x20"}, b" " * 50)]
    for topic, time, kind, message in [*wheels(3), *scans(0.5, 1.5)]:
        data = STORE.cdr_to_ros1(STORE.serialize_cdr(message, kind), kind)
        stamp = Stamp.of(time)
        times = {
            "sec": stamp.sec.to_bytes(4, "little"),
            "nsec": stamp.nanosec.to_bytes(4, "little"),
        }
        name = kind.replace("/msg/", "/").encode()
        parts.append(record({"op": b"\2", "topic": topic.encode(), "type": name, **times}, data))
    index = {"op": b"\4", "ver": bytes(4), "count": (2).to_bytes(4, "little")}
    wrong = record(index, bytes(32)).replace((32).to_bytes(4, "little"), (7).to_bytes(4, "little"))
    log = load_log(written("old.bag", b"".join([*parts[:4], wrong, *parts[4:]])))
    assert log.poses[:, 0] == pytest.approx([0.5, 1.5]) and not log.notes


@pytest.mark.parametrize("poses", ["odometry", "transforms"])
def test_a_later_part_without_the_mount_of_its_laser_is_refused(poses, tmp_path):
    moved = [
        ("/tf", t, TRANSFORMS, transform(float(t), "odom", "base_link", (t, 0, 0)))
        for t in range(3)
    ]
    driven = wheels(3) if poses == "odometry" else moved
    bag = write(tmp_path / "bag", *scans(0.0, 1.0), *driven, storage="SQLITE3")
    part = shutil.copy(next(bag.glob("*.db3")), tmp_path / "bag_1.db3")
    with pytest.raises(InputError, match="tf_static"):
        load_log(part)
