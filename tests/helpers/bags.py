"""Messages of ROS 2, and bags of them."""

import numpy as np
import pytest

from lrf3d.laser import Stamp
from lrf3d.recordings.formats.bags.contents import ODOMETRY, POSE, SCAN, TRANSFORMS
from lrf3d.recordings.formats.bags.writer import made

rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="needs pip install 'lrf3d[ros]'")
from rosbags.typesys import Stores, get_typestore  # noqa: E402

STORE = get_typestore(Stores.ROS2_HUMBLE)


def header(time, frame):
    stamp = Stamp.of(time)
    return {"stamp": {"sec": stamp.sec, "nanosec": stamp.nanosec}, "frame_id": frame}


def named(names, values):
    return dict(zip(names, map(float, values), strict=True))


def transform(time, parent, child, place=(0, 0, 0), turn=(0, 0, 0, 1)):
    moved = {"translation": named("xyz", place), "rotation": named("xyzw", turn)}
    stamped = {"header": header(time, parent), "child_frame_id": child, "transform": moved}
    return made(STORE, TRANSFORMS, {"transforms": [stamped]})


def planar(x, y, theta):
    turn = (0.0, 0.0, np.sin(theta / 2), np.cos(theta / 2))
    return {"position": named("xyz", (x, y, 0.0)), "orientation": named("xyzw", turn)}


def pose(time, frame, x, y, theta):
    return made(STORE, POSE, {"header": header(time, frame), "pose": planar(x, y, theta)})


def scan(time, frame="laser", ranges=(1.0, 2.0, 3.0)):
    fan = {"angle_min": -1.0, "angle_max": 1.0, "angle_increment": 1.0, "range_max": 10.0}
    fields = {"scan_time": 0.1, "range_min": 0.1, "ranges": np.array(ranges, dtype=np.float32)}
    return made(STORE, SCAN, {"header": header(time, frame), **fan, **fields})


def scans(*times, topic="/scan", frame="laser", received=None):
    arrived = times if received is None else received
    return [(topic, at, SCAN, scan(t, frame)) for t, at in zip(times, arrived, strict=True)]


def wheels(count):
    """Odometry of a robot that drives a metre a second along x."""
    return [("/odom", t, ODOMETRY, odometry(float(t), (t, 0.0, 0.0))) for t in range(count)]


def odometry(time, where, child="base_link"):
    fields = {"child_frame_id": child, "pose": {"pose": planar(*where)}}
    return made(STORE, ODOMETRY, {"header": header(time, "odom"), **fields})


def of_scan(scan):
    """A scan of lrf3d as a message."""
    return made(STORE, SCAN, scan.as_ros("laser"))


def write(path, *messages, storage="MCAP", packed=None):
    """Write messages (topic, time, kind, message) to a bag."""
    bag = rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin[storage])
    if packed:
        bag.set_compression(rosbag2.CompressionMode[packed], rosbag2.CompressionFormat.ZSTD)
    with bag:
        topics = {}
        for topic, time, kind, message in sorted(messages, key=lambda each: each[1]):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], Stamp.of(time).nanoseconds, STORE.serialize_cdr(message, kind))
    return path


def mounted(place=(0, 0, 0), turn=(0, 0, 0, 1), base="base_link", laser="laser"):
    return "/tf_static", 0.0, TRANSFORMS, transform(0.0, base, laser, place, turn)
