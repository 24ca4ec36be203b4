"""The messages of a ROS 2 bag: a .mcap or .db3 file, or the folder of a bag with its metadata.

The files are read by rosbags (extra ``ros``). Only messages of the types named here are read, by
rosbags' own definitions: definitions in a file are ignored. The unpacked size of a bag is limited,
because a few kilobytes can unpack to gigabytes of zeros.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from lrf3d.errors import InputError, Lrf3dError, MissingLibraryError, missing_extra
from lrf3d.input import check_ordinary
from lrf3d.io.laser_log import BadLine
from lrf3d.io.packed import BLOCK_BYTES, LARGEST_RATIO, SMALL_LOG

SCAN = "sensor_msgs/msg/LaserScan"
ECHOES = "sensor_msgs/msg/MultiEchoLaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
UNSURE_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TYPES = (SCAN, ECHOES, ODOMETRY, POSE, UNSURE_POSE, TRANSFORMS)
"""The types of messages that are read."""

ECHOES_TOPIC = "/echoes"
"""The topic of the echoes of scans, as drivers of range finders with several name it."""

STATIC_FRAMES = "/tf_static"
"""The topic of constant transforms."""

LONGEST_REASON = 90
"""Characters of a library's error message that are reported."""

LARGEST_CHUNK = 1 << 27
"""Largest unpacked chunk of an MCAP file [bytes]: recorders write chunks of some megabytes."""

LONGEST_METADATA = 1 << 17
"""Largest metadata that are read [bytes]: those of a bag of a thousand files, in two seconds."""


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
    """Open a bag for reading.

    Raises:
        InputError: There is no such bag, or it is damaged.
        MissingLibraryError: rosbags is not installed.
    """
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
    # A damaged file may raise any exception in the reader.
    with bounded_unpacking():
        try:
            check_metadata(path)
            check_packed_files(path)
            reader = Reader(path)
            reader.open()
        except Lrf3dError:
            raise
        except Exception as error:
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
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 1] + "…"


@contextmanager
def bounded_unpacking() -> Iterator[None]:
    """Limit what rosbags unpacks of a chunk to the size that the file declares.

    rosbags checks the size only after it has unpacked everything. Within the block its
    decompressors are replaced by ones that stop at the declared size.
    """
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    before = dict(DECOMPRESSORS)
    DECOMPRESSORS.update({kind: _unpack_lz4 for kind in before if kind == "lz4"})
    DECOMPRESSORS.update({kind: _unpack_zstd for kind in before if kind == "zstd"})
    try:
        yield
    finally:
        DECOMPRESSORS.update(before)


def check_metadata(folder: Path) -> None:
    """Check that the metadata of a bag are short enough to be read in two seconds.

    Raises:
        InputError: They are not.
    """
    path = folder / "metadata.yaml"
    if path.is_file() and path.stat().st_size > LONGEST_METADATA:
        raise InputError(
            f"{path}: longer than {LONGEST_METADATA:,} bytes; read its files one by one"
        )


def check_packed_files(folder: Path) -> None:
    """Check that compressed files of a bag do not unpack to far more than their size.

    Raises:
        InputError: One of them does.
    """
    for path in sorted(folder.glob("*.zstd")):
        allowed, total = max(SMALL_LOG, LARGEST_RATIO * path.stat().st_size), 0
        with _zstd().open(path, "rb") as stream:
            while block := stream.read(BLOCK_BYTES):
                total += len(block)
                if total > allowed:
                    raise InputError(
                        f"{path}: unpacks to over {LARGEST_RATIO} times its size, which no bag"
                        " does; unpack it first if it is one"
                    )


def _unpack_lz4(data: bytes, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    return _unpack(LZ4FrameDecompressor(), data, size)


def _unpack_zstd(data: bytes, size: int) -> bytes:
    return _unpack(_zstd().ZstdDecompressor(), data, size)


def _unpack(decompressor: Any, data: bytes, size: int) -> bytes:
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size:,} bytes, at most {LARGEST_CHUNK:,} are read")
    # One byte more than declared is enough to detect that there are too many.
    return bytes(decompressor.decompress(data, max_length=size + 1))


def _zstd() -> Any:
    """The library that rosbags unpacks with."""
    from rosbags.rosbag2 import storage_mcap

    return vars(storage_mcap)["zstd"]
