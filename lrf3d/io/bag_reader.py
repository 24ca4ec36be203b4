"""Reading ROS bags: the scans of a recorded drive, with their poses.

The poses come from the first of these sources that the bag has, or from the one that is chosen:

========  ==================================================================================
truth     a topic with ``ground_truth`` in its name: Odometry or PoseStamped
tf        the transforms from the frame of the laser up to the root of its tree, ``map`` where
          a SLAM ran
odom      a topic of Odometry, ``/odom`` before others; where there is none, the transforms up
          to the frame ``odom``
========  ==================================================================================

Only what belongs to the robot of the laser counts: odometry of a frame that carries the laser.
Each scan has the mounting of its own frame, by the transforms: position, heading, and whether it is
upside down. The pose of a scan is interpolated at its stamp, which is that of its first beam. Scans
before the first pose or after the last are left out and counted. Where stamps go back, another part
of the recording begins, of which one is read; where they are useless, the times of receipt count.

The files, a .mcap, .db3 or .bag, or a folder of them, are read by rosbags (extra ``ros``), and only
messages of the types named here, by rosbags' own definitions.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, MissingLibraryError, missing_extra, one_line
from lrf3d.files import check_ordinary
from lrf3d.interrupts import check
from lrf3d.io.bag_contents import OLD_TRANSFORMS, SCAN, TRANSFORMS, TYPES, Contents
from lrf3d.io.bag_poses import log_of
from lrf3d.io.cut_mcap import whole_part
from lrf3d.io.laser_log import MOST_READINGS, LaserLog
from lrf3d.io.unpacking import bounded_bags

FILES = (".mcap", ".db3", ".bag")
"""Endings of the files of bags; the last one is that of ROS 1."""

METADATA, LARGEST_METADATA = "metadata.yaml", 1 << 19
"""What describes a bag of several files, and its largest size [bytes], for some thousand of them:
rosbags needs seconds to read it."""


def load_bag(
    path: str | Path,
    *,
    largest_range: float | None = None,
    poses: str = "auto",
    scan_topic: str | None = None,
    part: int | None = None,
) -> LaserLog:
    """Read the scans of a ROS bag; see `load_log`."""
    path = Path(path)
    contents = Contents()
    with _opened(path, contents) as (readers, deserialized):
        connections = [each for reader in readers for each in reader.connections]
        topics = {
            each.topic: each.msgtype
            for each in connections
            if each.msgtype in TYPES and getattr(each.ext, "serialization_format", "cdr") == "cdr"
        }
        others = sorted({f"{each.topic} ({each.msgtype})" for each in connections})
        scans = sorted(
            (topic for topic in topics if topics[topic] == SCAN),
            key=lambda topic: (topic != "/scan", topic),
        )
        _check_topics(path, scans, scan_topic, others)
        contents.scan_topics = scans
        unwanted = {topic for topic in scans if scan_topic not in (None, topic)}
        wanted = set(topics) - unwanted
        for number, (connection, received, data) in enumerate(
            _messages(readers, wanted, contents), 1
        ):
            try:
                message = deserialized(data, connection.msgtype)
                contents.take(connection.topic, connection.msgtype, message, received, number)
            except InputError as error:
                contents.refuse(number, str(error), "message")
            except Exception as error:
                # A damaged message may raise any exception.
                contents.refuse(number, _short(error), "message")
            if contents.readings > MOST_READINGS:
                raise InputError(f"{path}: more than {MOST_READINGS:,} readings; cut it into parts")
    if not contents.streams:
        why = "; ".join([f"first {bad}" for bad in contents.bad[:1]] + contents.notes)
        topic = scan_topic or scans[0]
        raise InputError(f"{path}: no scan on {topic} that can be used" + (why and f"; {why}"))
    return log_of(path, contents, poses, largest_range, part)


def _check_topics(path: Path, scans: list[str], wanted: str | None, others: list[str]) -> None:
    """Check that there are scans, and those that are wanted."""
    if not scans:
        there = f"; there are {one_line(', '.join(others), 300)}" if others else ""
        raise InputError(f"{path}: no topic of {SCAN} in it{there}")
    if wanted is not None and wanted not in scans:
        raise InputError(f"{path}: no scans on {wanted}; there are {', '.join(scans)}")


@contextmanager
def _opened(path: Path, contents: Contents) -> Iterator[tuple[list[Any], Callable[..., Any]]]:
    """Readers of the files of a bag, and what unpacks their messages."""
    try:
        from rosbags.rosbag1 import Reader as OldReader
        from rosbags.rosbag2 import Reader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise missing_rosbags(path) from None
    files = _files(path)
    is_old = files[0].suffix.lower() == FILES[-1]
    store = get_typestore(Stores.ROS1_NOETIC if is_old else Stores.ROS2_HUMBLE)
    kind: Any = OldReader if is_old else Reader
    if is_old:
        for name in (TRANSFORMS, OLD_TRANSFORMS):
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    with bounded_bags(), ExitStack() as stack:
        try:
            readers = [_reader(kind, path if path.is_dir() else files[0], stack, contents)]
        except InputError:
            if not path.is_dir():
                raise
            # A recorder that is killed leaves no metadata, and a file without its end.
            readers = [_reader(kind, file, stack, contents) for file in files]
            names = ", ".join(file.name for file in files)
            state = "useless" if (path / METADATA).exists() else "missing"
            contents.notes.append(f"{METADATA} is {state}: {names} read alone")
        readers.sort(key=lambda reader: reader.start_time)
        yield readers, store.deserialize_ros1 if is_old else store.deserialize_cdr


def _reader(kind: Any, file: Path, stack: ExitStack, contents: Contents) -> Any:
    """The open reader of a file, or of what is whole in it."""
    try:
        try:
            reader = kind(file)
            reader.open()
        except InputError:
            raise
        except Exception:
            whole = whole_part(file, stack) if file.suffix.lower() == ".mcap" else None
            if whole is None:
                raise
            reader = kind(whole)
            reader.open()
            contents.notes.append(f"{file.name} was cut short: what is whole in it was read")
    except Exception as error:
        # A damaged file may raise any exception in the reader.
        raise _damaged(file, error) from None
    stack.callback(reader.close)
    return reader


def _files(path: Path) -> list[Path]:
    """The files of a bag."""
    if not path.is_dir():
        check_ordinary(path, what="a ROS bag")
        return [path]
    parts = sorted(part for part in path.iterdir() if not part.is_dir())
    for part in parts:
        largest = LARGEST_METADATA if part.name == METADATA else None
        check_ordinary(part, what="a file of a ROS bag", largest=largest)
    for ending in FILES:
        if files := [part for part in parts if ending in part.suffixes[-2:]]:
            return files
    known = ", ".join(FILES)
    raise InputError(f"{path}: a folder without {METADATA}, {known} or run.npz, expected a log")


def _messages(
    readers: list[Any], topics: set[str], contents: Contents
) -> Iterator[tuple[Any, int, bytes]]:
    """Connections, times of receipt [ns] and packed messages, in the order of the bag."""
    for reader in readers:
        wanted = [each for each in reader.connections if each.topic in topics]
        try:
            for connection, received, data in reader.messages(wanted) if wanted else ():
                check()
                yield connection, received, data
        except InputError as error:
            raise _damaged(reader.path, error) from None
        except Exception as error:
            # What comes before the damage is whole.
            contents.notes.append(
                f"{reader.path.name} is damaged ({_short(error)}): read up to there"
            )


def missing_rosbags(path: Path) -> MissingLibraryError:
    """The error that explains how to install rosbags."""
    return missing_extra(f"{path}: ROS bags need rosbags", "ros")


def _damaged(path: Path, error: Exception) -> InputError:
    if isinstance(error, InputError):
        return InputError(f"{path}: {error}")
    hint = "; rosbag reindex may repair it" if "not indexed" in str(error) else ""
    return InputError(f"{path}: not a ROS bag or damaged ({_short(error)}){hint}")


def _short(error: Exception) -> str:
    """The message of a library's error in one line."""
    return one_line(" ".join(str(error).split()) or type(error).__name__, 90)
