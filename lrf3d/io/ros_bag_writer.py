"""ROS 2 bags out: a run as slam_toolbox, rviz, Foxglove and ``ros2 bag play`` replay it.

A run enters; an MCAP file leaves, or the folder with its metadata that rosbag2 keeps a bag in::

    /clock         rosgraph_msgs/Clock    at each scan
    /scan          sensor_msgs/LaserScan  in laser, stamped with its first beam, float32
    /echoes        sensor_msgs/MultiEchoLaserScan the echoes, if the laser reports several
    /odom          nav_msgs/Odometry      base_link in odom, with its speeds: as the wheels
                                          measured it where the run knows that, else without drift
    /ground_truth  nav_msgs/Odometry      base_link in odom, float64
    /tf            odom → base_link       at each scan, as in /odom; map → odom, if the run has an
                                          estimate of the poses
    /tf_static     base_link → laser      latched, the height of the laser; else also map → odom
    /map           nav_msgs/OccupancyGrid the finished map, latched, at the start
    /map_objects   visualization_msgs/MarkerArray the map as it grows, a colour for each object

Without a map the last two are left out. Stamps are the run's own times, which begin at 0 where
nothing else was said; the frames map and odom are the world's.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lrf3d.errors import InputError, OutputError
from lrf3d.io.bag_messages import (
    ECHOES,
    ECHOES_TOPIC,
    ODOMETRY,
    SCAN,
    STATIC_FRAMES,
    TRANSFORMS,
    missing_rosbags,
)
from lrf3d.io.ros_map_messages import MAP_TOPIC, OBJECTS_TOPIC, MapMessages
from lrf3d.io.ros_messages import BASE, LASER, MAP, WORLD, Messages
from lrf3d.laser import Stamp
from lrf3d.output import replacing, unfinished_folder
from lrf3d.pose import Pose
from lrf3d.run import Run

CLOCK = "/clock"
"""The topic that programs which run on the bag's own time listen to."""

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
        try:
            if path.exists():
                path.rename(old)
            folder.rename(path)
        except BaseException:
            # Until the new bag is in its place, the older one is kept.
            if old.exists() and not path.exists():
                old.rename(path)
            raise


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
        reason = error.strerror or str(error)
        raise OutputError(f"{path}: cannot be written: {reason}; choose another place") from error


def _fill(run: Run, folder: Path) -> None:
    try:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise missing_rosbags(folder) from None
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    messages = Messages(typestore.types)
    maps = MapMessages(messages, run, folder)
    bag = Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag:
        topics = {
            topic: bag.add_connection(
                topic, kind, typestore=typestore, offered_qos_profiles=quality
            )
            for topic, kind, quality in (
                (STATIC_FRAMES, TRANSFORMS, [_latched()]),
                *((topic, kind, [_latched()]) for topic, kind in maps.topics),
                (CLOCK, "rosgraph_msgs/msg/Clock", []),
                ("/tf", TRANSFORMS, []),
                ("/odom", ODOMETRY, []),
                ("/ground_truth", ODOMETRY, []),
                ("/scan", SCAN, []),
                *([] if run.echoes is None else [(ECHOES_TOPIC, ECHOES, [])]),
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
        here = Pose(0.0, 0.0, 0.0)
        start = Stamp.of(float(times[0]))
        mount = messages.transform(start, BASE, LASER, here, run.lrf.height)
        fixed = [mount]
        if run.estimate is None:
            fixed.append(messages.transform(start, MAP, WORLD, here))
        write(STATIC_FRAMES, start, messages.transforms(*fixed))
        for message in maps.finished(start):
            write(MAP_TOPIC, start, message)
        rows = zip(run.scans, run.odometry, run.trajectory.speeds, steps.tolist(), strict=True)
        for number, (scan, wheels, speed, step) in enumerate(rows):
            stamp, measured = Stamp.of(scan.time), Pose(*wheels.tolist())
            write(CLOCK, stamp, messages.clock(stamp))
            # The pose of the laser comes before what it measured from there.
            moved = [messages.transform(stamp, WORLD, BASE, measured)]
            if run.estimate is not None:
                estimated = Pose(*run.estimate.poses[number].tolist())
                drift = estimated @ measured.inverse()
                moved.append(messages.transform(stamp, MAP, WORLD, drift))
            write("/tf", stamp, messages.transforms(*moved))
            write("/odom", stamp, messages.odometry(stamp, measured, speed))
            write("/ground_truth", stamp, messages.odometry(stamp, scan.pose, speed))
            write("/scan", stamp, messages.scan(scan, step))
            if scan.echoes is not None:
                write(ECHOES_TOPIC, stamp, messages.echoes(scan, step))
            for message in maps.after(number, stamp):
                write(OBJECTS_TOPIC, stamp, message)


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
