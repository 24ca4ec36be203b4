"""The messages of a ROS 2 bag: a .mcap or .db3 file, or the folder of a bag with its metadata.

The files are read by rosbags (extra ``ros``). Only messages of the types named here are read, by
rosbags' own definitions: definitions in a file are ignored.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from lrf3d.errors import InputError, MissingLibraryError, missing_extra, one_line
from lrf3d.files import check_ordinary
from lrf3d.io.laser_log import BadLine

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
UNSURE_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TYPES = (SCAN, ODOMETRY, POSE, UNSURE_POSE, TRANSFORMS)
"""The types of messages that are read."""

STATIC_FRAMES = "/tf_static"
"""The topic of constant transforms."""


class Message(NamedTuple):
    """A message of a bag: its number from 1, its topic, its type and its contents."""

    number: int
    topic: str
    kind: str
    content: Any


class Bag:
    """An open bag."""

    def __init__(self, path: Path, reader: Any, typestore: Any) -> None:
        self.path = path
        self._reader = reader
        self._typestore = typestore
        self.topics: dict[str, str] = {
            connection.topic: connection.msgtype
            for connection in reader.connections
            if connection.msgtype in TYPES and connection.ext.serialization_format == "cdr"
        }

    def messages(self, topics: set[str]) -> Iterator[Message | BadLine]:
        """The messages of some topics in the order of the bag; a BadLine for an unreadable one."""
        wanted = [
            c for c in self._reader.connections if c.topic in topics and c.topic in self.topics
        ]
        for number, (connection, data) in enumerate(self._messages(wanted), 1):
            try:
                content = self._typestore.deserialize_cdr(data, connection.msgtype)
            except Exception as error:
                yield BadLine(number, _short(error), "message")
                continue
            yield Message(number, connection.topic, connection.msgtype, content)

    def _messages(self, wanted: list[Any]) -> Iterator[tuple[Any, bytes]]:
        try:
            for connection, _, data in self._reader.messages(wanted):
                yield connection, data
        except Exception as error:
            raise _damaged(self.path, error) from None


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag for reading."""
    try:
        from rosbags.rosbag2 import Reader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise missing_rosbags(path) from None
    if path.is_dir():
        if not (path / "metadata.yaml").exists():
            raise InputError(f"{path}: a folder without metadata.yaml or run.npz, expected a log")
        for part in path.iterdir():
            if part.name == "metadata.yaml" or not part.is_dir():
                check_ordinary(part, what="a file of a ROS 2 bag")
    else:
        check_ordinary(path, what="a ROS 2 bag")
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    try:
        reader = Reader(path)
        reader.open()
    except Exception as error:
        # A damaged file may raise any exception in the reader.
        raise _damaged(path, error) from None
    try:
        if reader.compression_mode == "message":
            raise InputError(
                f"{path}: each message is compressed; decompress it with ros2 bag convert"
            )
        yield Bag(path, reader, typestore)
    finally:
        reader.close()


def missing_rosbags(path: Path) -> MissingLibraryError:
    """The error that explains how to install rosbags."""
    return missing_extra(f"{path}: ROS bags need rosbags", "ros")


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: not a ROS 2 bag or damaged ({_short(error)})")


def _short(error: Exception) -> str:
    """The message of a library's error in one line."""
    return one_line(" ".join(str(error).split()) or type(error).__name__, 90)
