"""ROS 2 bags out: a run as slam_toolbox, rviz, Foxglove and ``ros2 bag play`` replay it.

A run enters; an MCAP file leaves, or the folder with its metadata that rosbag2 keeps a bag in::

    /scan          sensor_msgs/LaserScan  in laser, stamped with its first beam, float32
    /odom          nav_msgs/Odometry      base_link in odom, with its speeds: as the wheels
                                          measured it where the run knows that, else without drift
    /ground_truth  nav_msgs/Odometry      base_link in odom, float64
    /tf            odom → base_link       at each scan, as in /odom
    /tf_static     base_link → laser      latched, the height of the laser

``map`` is left to whoever maps. Stamps are the run's own times, which begin at 0 where nothing
else was said; the frame odom is the world's.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from math import cos, sin
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lrf3d.errors import InputError, OutputError
from lrf3d.geometry import Float
from lrf3d.io.bag_messages import ODOMETRY, SCAN, STATIC_FRAMES, TRANSFORMS, missing_rosbags
from lrf3d.laser import LaserScan, Stamp
from lrf3d.output import replacing, unfinished_folder
from lrf3d.pose import Pose
from lrf3d.run import Run

WORLD, BASE, LASER = "odom", "base_link", "laser"
"""The frames: of the world, of the robot, and of its range finder."""

BAG_VERSION: Literal[8] = 8
"""The version of rosbag2's metadata that both older and newer releases of ROS 2 read."""


def write(run: Run, path: Path) -> None:
    """Write a run to an MCAP file, completely or not at all.

    Raises:
        InputError: The run has times before 0, which a bag cannot hold.
        OutputError: The file cannot be written.
        MissingLibraryError: rosbags is not installed.
    """
    with replacing(path) as unfinished, _bag_of(run, path) as folder:
        shutil.move(folder / f"{folder.name}.mcap", unfinished)


def write_folder(run: Run, path: Path) -> None:
    """Write a run to the folder of a bag; a bag in its place is replaced.

    Raises:
        InputError: The run has times before 0, which a bag cannot hold.
        OutputError: The folder cannot be written, or holds something else.
        MissingLibraryError: rosbags is not installed.
    """
    if path.exists() and not (path / "metadata.yaml").is_file():
        raise OutputError(f"{path}: exists and is not a bag; choose another place")
    with _bag_of(run, path) as folder:
        old = Path(folder.parent, "old")
        if path.exists():
            path.rename(old)
        folder.rename(path)


@contextmanager
def _bag_of(run: Run, path: Path) -> Iterator[Path]:
    """The bag of a run, in a temporary folder with the name of a path."""
    if run.trajectory.times[0] < 0.0:
        raise InputError(f"{path}: a bag cannot hold times before 0, but the run begins earlier")
    try:
        with unfinished_folder(path) as place:
            folder = place / path.stem
            _fill(run, folder)
            yield folder
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        reason = error.strerror or str(error)
        raise OutputError(f"{path}: cannot be written: {reason}; choose another place") from error


def _fill(run: Run, folder: Path) -> None:
    try:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise missing_rosbags(folder) from None
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    messages = _Messages(typestore.types)
    bag = Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag:
        topics = {
            topic: bag.add_connection(
                topic, kind, typestore=typestore, offered_qos_profiles=quality
            )
            for topic, kind, quality in (
                (STATIC_FRAMES, TRANSFORMS, [_latched()]),
                ("/tf", TRANSFORMS, []),
                ("/odom", ODOMETRY, []),
                ("/ground_truth", ODOMETRY, []),
                ("/scan", SCAN, []),
            )
        }

        def write(topic: str, stamp: Stamp, message: Any) -> None:
            connection = topics[topic]
            data = typestore.serialize_cdr(message, connection.msgtype)
            bag.write(connection, stamp.nanoseconds, data)

        times = run.trajectory.times
        steps = np.diff(times, append=times[-1])
        # The last scan is as far from a next one as the others are.
        steps[-1:] = steps[-2:-1] if len(steps) > 1 else 0.0
        mount = Pose(0.0, 0.0, 0.0)
        start = Stamp.of(float(times[0]))
        write(STATIC_FRAMES, start, messages.transform(start, BASE, LASER, mount, run.lrf.height))
        rows = zip(run.scans, run.odometry, run.trajectory.speeds, steps.tolist(), strict=True)
        for scan, wheels, speed, step in rows:
            stamp, measured = Stamp.of(scan.time), Pose(*wheels.tolist())
            # The pose of the laser comes before what it measured from there.
            write("/tf", stamp, messages.transform(stamp, WORLD, BASE, measured))
            write("/odom", stamp, messages.odometry(stamp, measured, speed))
            write("/ground_truth", stamp, messages.odometry(stamp, scan.pose, speed))
            write("/scan", stamp, messages.scan(scan, step))


class _Messages:
    """The messages of a bag, made from lrf3d's own values."""

    def __init__(self, types: dict[str, Any]) -> None:
        self._types = types

    def _make(self, kind: str, *values: Any) -> Any:
        return self._types[kind](*values)

    def _header(self, stamp: Stamp, frame: str) -> Any:
        time = self._make("builtin_interfaces/msg/Time", stamp.sec, stamp.nanosec)
        return self._make("std_msgs/msg/Header", time, frame)

    def _turn(self, theta: float) -> Any:
        return self._make(
            "geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * theta), cos(0.5 * theta)
        )

    def transform(
        self, stamp: Stamp, parent: str, child: str, pose: Pose, height: float = 0.0
    ) -> Any:
        """The transform of a frame in its parent, at a height [m] above it."""
        place = self._make("geometry_msgs/msg/Vector3", pose.x, pose.y, height)
        moved = self._make("geometry_msgs/msg/Transform", place, self._turn(pose.theta))
        header = self._header(stamp, parent)
        stamped = self._make("geometry_msgs/msg/TransformStamped", header, child, moved)
        return self._make(TRANSFORMS, [stamped])

    def odometry(self, stamp: Stamp, pose: Pose, speed: Float) -> Any:
        """The robot in the world, and its speed ahead [m/s] and about itself [rad/s]."""
        certain = np.zeros(36)
        vector = "geometry_msgs/msg/Vector3"
        place = self._make("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)
        where = self._make("geometry_msgs/msg/Pose", place, self._turn(pose.theta))
        ahead = self._make(vector, float(speed[0]), 0.0, 0.0)
        about = self._make(vector, 0.0, 0.0, float(speed[1]))
        return self._make(
            ODOMETRY,
            self._header(stamp, WORLD),
            BASE,
            self._make("geometry_msgs/msg/PoseWithCovariance", where, certain),
            self._make(
                "geometry_msgs/msg/TwistWithCovariance",
                self._make("geometry_msgs/msg/Twist", ahead, about),
                certain,
            ),
        )

    def scan(self, scan: LaserScan, scan_time: float) -> Any:
        """The scan as a ROS message."""
        told = scan.as_ros(LASER, scan_time=scan_time)
        return self._make(
            SCAN,
            self._header(told.header.stamp, told.header.frame_id),
            told.angle_min,
            told.angle_max,
            told.angle_increment,
            told.time_increment,
            told.scan_time,
            told.range_min,
            told.range_max,
            told.ranges,
            told.intensities,
        )


def _latched() -> Any:
    """The quality of service of a latched topic: late subscribers receive its last message."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    for_ever = QosTime(9223372036, 854775807)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        for_ever,
        for_ever,
        QosLiveliness.AUTOMATIC,
        for_ever,
        False,
    )
