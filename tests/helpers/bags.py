"""Messages of ROS 2, and bags of them."""

import numpy as np
import pytest

from lrf3d.io.bag_reader import ODOMETRY, POSE, SCAN, TRANSFORMS
from lrf3d.laser import Stamp

rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="needs pip install 'lrf3d[ros]'")
from rosbags.typesys import Stores, get_typestore  # noqa: E402

STORE = get_typestore(Stores.ROS2_HUMBLE)


def make(kind, *values):
    return STORE.types[kind](*values)


def header(time, frame):
    stamp = Stamp.of(time)
    return make(
        "std_msgs/msg/Header", make("builtin_interfaces/msg/Time", stamp.sec, stamp.nanosec), frame
    )


def transform(time, parent, child, place=(0, 0, 0), turn=(0, 0, 0, 1)):
    moved = make(
        "geometry_msgs/msg/Transform",
        make("geometry_msgs/msg/Vector3", *map(float, place)),
        make("geometry_msgs/msg/Quaternion", *map(float, turn)),
    )
    stamped = make("geometry_msgs/msg/TransformStamped", header(time, parent), child, moved)
    return make(TRANSFORMS, [stamped])


def pose(time, frame, x, y, theta):
    place = make("geometry_msgs/msg/Point", float(x), float(y), 0.0)
    turn = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(theta / 2), np.cos(theta / 2))
    return make(POSE, header(time, frame), make("geometry_msgs/msg/Pose", place, turn))


def scan(time, frame="laser", ranges=(1.0, 2.0, 3.0)):
    values = np.array(ranges, dtype=np.float32)
    return make(
        SCAN, header(time, frame), -1.0, 1.0, 1.0, 0.0, 0.1, 0.1, 10.0, values, np.float32([])
    )


def write(path, *messages):
    """Write messages (topic, time, kind, message) to a bag."""
    with rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin.MCAP) as bag:
        topics = {}
        for topic, time, kind, message in messages:
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], Stamp.of(time).nanoseconds, STORE.serialize_cdr(message, kind))
    return path


def mounted(place=(0, 0, 0), turn=(0, 0, 0, 1)):
    static = transform(0.0, "base_link", "laser", place, turn)
    return "/tf_static", 0.0, TRANSFORMS, static


def odometry(time, where, child="base_link"):
    told = pose(time, "odom", *where)
    speed = make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    return make(
        ODOMETRY,
        told.header,
        child,
        make("geometry_msgs/msg/PoseWithCovariance", told.pose, np.zeros(36)),
        make(
            "geometry_msgs/msg/TwistWithCovariance",
            make("geometry_msgs/msg/Twist", speed, speed),
            np.zeros(36),
        ),
    )


def of_scan(scan):
    """A scan of lrf3d as a message."""
    _, *fields = scan.as_ros("laser").values()
    return make(SCAN, header(scan.time, "laser"), *fields)
