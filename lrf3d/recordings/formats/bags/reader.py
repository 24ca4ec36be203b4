"""Reading ROS bags: the scans of a recorded drive, with their poses.

The poses come from the first of these sources that the bag has, or from the one that is chosen:

========  ==================================================================================
truth     a topic with ``ground_truth`` in its name: Odometry or PoseStamped
tf        the transforms from the frame of the laser up to the root of its tree, ``map`` where
          a SLAM ran
odom      a topic of Odometry, ``/odom`` before others; where there is none, the transforms up
          to the frame ``odom``
========  ==================================================================================

Only odometry of the laser's own robot is used: that of a frame that carries the laser.
Each scan has the mounting of its own frame, by the transforms: position, heading, and whether it is
upside down. The pose of a scan is interpolated at its stamp, which is that of its first beam. Scans
before the first pose or after the last are left out and counted. Where stamps go back, a new part
of the recording begins, and one of the parts is read; where stamps are useless, the times at which
messages were received replace them.

Point clouds are read where there are no scans, or where the user chooses them: once again from the
beginning, since their heights depend on the transforms of the whole bag; see `clouds`.

Only messages of the types in `contents.MESSAGES` are unpacked, by rosbags (extra ``ros``) and its
own definitions.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from lrf3d.base.errors import InputError, MissingLibraryError, missing_extra, one_line
from lrf3d.base.formats import ZSTD
from lrf3d.base.isolation import check_memory
from lrf3d.messages.clouds import CLOUD
from lrf3d.messages.ros import SCAN, TRANSFORMS
from lrf3d.recordings.formats.arrays import is_messages
from lrf3d.recordings.formats.bags.contents import MESSAGES, OLD_TRANSFORMS, SCANS, Contents
from lrf3d.recordings.formats.bags.files import (
    LIVOX,
    BagTopic,
    Packet,
    bag_files,
    packets,
    unpacked,
)
from lrf3d.recordings.formats.bags.json_lines import JSON, json_messages
from lrf3d.recordings.formats.bags.livox import livox_cloud
from lrf3d.recordings.formats.bags.poses import log_of
from lrf3d.recordings.log import Intake, LaserLog


def load_bag(
    intake: Intake,
    *,
    poses: str = "auto",
    scan_topic: str | None = None,
    part: int | None = None,
    height: Sequence[float] | None = None,
) -> LaserLog:
    """Read the scans of a ROS bag; see `load_log`."""
    contents = Contents(intake, height)
    topics = set[BagTopic]()
    kinds: tuple[str, ...] = SCANS

    def wanted(topic: BagTopic) -> bool:
        return topic.kind in kinds and scan_topic in (None, topic.name)

    _read(contents, topics, wanted)
    there = {topic.kind for topic in topics if scan_topic in (None, topic.name)}
    are_clouds = CLOUD in there and there.isdisjoint(SCANS)
    if height is not None or (not contents.by_frame and are_clouds):
        contents.by_frame.clear()
        kinds = (CLOUD,)
        _read(contents, topics, wanted)
        # A file that is cut short is noted both times.
        intake.notes[:] = dict.fromkeys(intake.notes)
    sizes = Counter({t.name: 0 for t in topics if t.kind in kinds})
    for stream in contents.by_frame.values():
        # The topic of most points is that of a whole cloud.
        sizes[stream.topic] += stream.clouds.balance.all if stream.clouds else 0
    scans = sorted(sizes, key=lambda name: (name != "/scan", -sizes[name], name))
    if scan_topic not in (None, *scans) or not contents.by_frame:
        raise InputError(f"{intake.path}: {_lacking(intake, topics, scans, scan_topic)}")
    contents.scan_topics = scans
    return log_of(contents, poses, part)


def _read(contents: Contents, topics: set[BagTopic], wanted: Callable[[BagTopic], bool]) -> None:
    """Read the messages of the wanted topics of scans; the first time all other ones, too."""
    intake = contents.intake
    path = intake.path
    again = bool(topics)
    messages = json_messages(intake) if is_messages(path) else _of_files(intake)
    unpack = dict[str, Callable[[Any, str], Any]]()
    for number, (topic, received, data) in enumerate(_known(messages, topics), 1):
        if not (wanted(topic) if topic.kind in (*SCANS, CLOUD) else not again):
            continue
        try:
            if topic.packing not in unpack:
                unpack[topic.packing] = _deserializer(topic.packing)
            message = unpack[topic.packing](data, topic.kind)
            MESSAGES[topic.kind](contents, topic.name, message, received, number)
        except ImportError:
            raise missing_rosbags(path) from None
        except Exception as error:
            # A damaged message may raise any exception.
            intake.refuse(number, _short(error), "message")


def _deserializer(packing: str) -> Callable[[Any, str], Any]:
    """What unpacks the messages of a bag that are packed in this way; raises ImportError."""
    if packing == JSON:
        return lambda message, _: message
    if packing.startswith(LIVOX):
        return partial(livox_cloud, aligned=packing == f"{LIVOX} cdr")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if packing == "cdr":
        return get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
    store = get_typestore(Stores.ROS1_NOETIC)
    for name in (TRANSFORMS, OLD_TRANSFORMS):
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return store.deserialize_ros1


def _lacking(
    intake: Intake, topics: set[BagTopic], scans: list[str], scan_topic: str | None
) -> str:
    """Why there is no scan that can be used."""
    why = "".join(f"; {note}" for note in intake.notes)
    if scans and scan_topic not in (None, *scans):
        return f"no scans on {scan_topic}; there are {', '.join(scans)}"
    if scans:
        used = "that can be used" if intake.bad else "though the topic exists"
        return f"no scan on {scan_topic or scans[0]} {used}{intake.first_bad}{why}"
    there = ", ".join(sorted(f"{topic.name} ({topic.kind})" for topic in topics))
    there = there and f"; there are {one_line(there, 300)}"
    return f"no topic of {SCAN} or {CLOUD} in it{there}{why}"


def _known(messages: Iterable[Packet], topics: set[BagTopic]) -> Iterator[Packet]:
    """The messages of the types that are read; all topics are noted."""
    for topic, received, data in messages:
        topics.add(topic)
        if data is not None and topic.kind in MESSAGES:
            yield topic, received, data


def _of_files(intake: Intake) -> Iterator[Packet]:
    """The messages of the files of a bag, unpacked."""
    files = bag_files(intake.path)
    found = False
    for file in files:
        try:
            for topic, received, data in packets(file, intake.notes.append):
                found = True
                if data is not None and topic.kind in MESSAGES:
                    data = unpacked("zstd" if data.startswith(ZSTD) else "", data)
                yield topic, received, data
        except Exception as error:
            # A damaged file may raise any exception; what comes before is whole.
            if not found and file == files[-1]:
                text = f"not a ROS bag or damaged: {_short(error)}"
                raise InputError(f"{intake.path}: {text}") from None
            intake.notes.append(f"{file.name} is damaged ({_short(error)}): read up to there")


def missing_rosbags(path: Path) -> MissingLibraryError:
    """The error that explains how to install rosbags."""
    return missing_extra(f"{path}: ROS bags need rosbags", "ros")


def _short(error: Exception) -> str:
    """The text of a library's error in one line; a MemoryError does not mean a damaged file."""
    check_memory(error)
    return one_line(" ".join(str(error).split()) or type(error).__name__, 150)
