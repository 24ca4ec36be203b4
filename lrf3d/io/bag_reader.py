"""Reading ROS 2 bags: the scans of a recorded drive, with their poses.

The poses come from the first of these sources that the bag has, or from the one that is chosen:

========  ==================================================================================
truth     a topic with ``ground_truth`` in its name: Odometry or PoseStamped
tf        the transforms from the frame of the laser up to the root of its tree, ``map`` where
          a SLAM ran
odom      a topic of Odometry, ``/odom`` before others; where there is none, the transforms up
          to the frame ``odom``
========  ==================================================================================

The transforms give the mounting of the laser: its position, its heading, and whether it is upside
down. The pose of a scan is interpolated at its stamp, which is that of its first beam. Scans before
the first pose or after the last are left out and counted.

The files, a .mcap, a .db3 or the folder of a bag with its metadata, are read by rosbags (extra
``ros``), and only messages of the types named here, by rosbags' own definitions.
"""

import math
from array import array
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lrf3d.errors import InputError, MissingLibraryError, missing_extra, one_line
from lrf3d.files import check_ordinary
from lrf3d.geometry import LARGEST_COORDINATE, Float, Int
from lrf3d.interrupts import check
from lrf3d.io.laser_log import (
    A_MESSAGE,
    A_POSE,
    MOST_READINGS,
    NAMED,
    BadLine,
    LaserLog,
    log_name,
)
from lrf3d.io.unpacking import bounded_bags
from lrf3d.laser import LaserScan, Stamp
from lrf3d.pose import Pose

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
UNSURE_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TYPES = (SCAN, ODOMETRY, POSE, UNSURE_POSE, TRANSFORMS)
"""The types of messages that are read."""

STATIC_FRAMES = "/tf_static"
"""The topic of constant transforms."""

METADATA, LARGEST_METADATA = "metadata.yaml", 1 << 19
"""What describes a bag of several files, and its largest size [bytes], for some thousand of them:
rosbags needs seconds to read it."""

LEAST_UPRIGHT = np.cos(np.radians(15.0))
"""Least cosine of the tilt of a laser; one that is tilted more does not scan in the plane."""

BASE, DRIFTING = "base_link", "odom"
"""Frames of the robot, for poses that name none, and of its odometry, as REP 105 calls them."""


def load_bag(path: str | Path, *, poses: str = "auto", scan_topic: str | None = None) -> LaserLog:
    """Read the scans of a ROS 2 bag; see `load_log`."""
    path = Path(path)
    contents = _Contents()
    with _opened(path) as (reader, store):
        topics = {
            each.topic: each.msgtype
            for each in reader.connections
            if each.msgtype in TYPES and each.ext.serialization_format == "cdr"
        }
        topic = _scan_topic(path, sorted(t for t in topics if topics[t] == SCAN), scan_topic)
        wanted = [
            each
            for each in reader.connections
            if each.topic in topics and (each.msgtype != SCAN or each.topic == topic)
        ]
        for number, (connection, data) in enumerate(_messages(path, reader, wanted), 1):
            try:
                contents.take(connection, store.deserialize_cdr(data, connection.msgtype))
            except InputError as error:
                contents.refuse(number, str(error), "message")
            except Exception as error:
                # A damaged message may raise any exception.
                contents.refuse(number, _short(error), "message")
            if contents.readings > MOST_READINGS:
                raise InputError(f"{path}: more than {MOST_READINGS:,} readings; cut it into parts")
    if not contents.scans:
        why = f"; first {contents.bad[0]}" if contents.bad else ""
        raise InputError(f"{path}: no scan on {topic} that can be used{why}")
    return _log(path, contents, poses)


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """A reader of a bag, and the definitions of its messages."""
    try:
        from rosbags.rosbag2 import Reader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise missing_rosbags(path) from None
    if path.is_dir():
        if not (path / METADATA).exists():
            raise InputError(f"{path}: a folder without {METADATA} or run.npz, expected a log")
        for part in path.iterdir():
            if not part.is_dir():
                largest = LARGEST_METADATA if part.name == METADATA else None
                check_ordinary(part, what="a file of a ROS 2 bag", largest=largest)
    else:
        check_ordinary(path, what="a ROS 2 bag")
    with bounded_bags(), ExitStack() as stack:
        try:
            reader = Reader(path)
            reader.open()
        except Exception as error:
            # A damaged file may raise any exception in the reader.
            raise _damaged(path, error) from None
        stack.callback(reader.close)
        yield reader, get_typestore(Stores.ROS2_HUMBLE)


def _messages(path: Path, reader: Any, wanted: list[Any]) -> Iterator[tuple[Any, bytes]]:
    """Connections and packed messages, in the order of the bag."""
    try:
        for connection, _, data in reader.messages(wanted):
            check()
            yield connection, data
    except Exception as error:
        raise _damaged(path, error) from None


def missing_rosbags(path: Path) -> MissingLibraryError:
    """The error that explains how to install rosbags."""
    return missing_extra(f"{path}: ROS bags need rosbags", "ros")


def _damaged(path: Path, error: Exception) -> InputError:
    if isinstance(error, InputError):
        return InputError(f"{path}: {error}")
    return InputError(f"{path}: not a ROS 2 bag or damaged ({_short(error)})")


def _short(error: Exception) -> str:
    """The message of a library's error in one line."""
    return one_line(" ".join(str(error).split()) or type(error).__name__, 90)


def _scan_topic(path: Path, topics: list[str], wanted: str | None) -> str:
    if not topics:
        raise InputError(f"{path}: no topic of {SCAN} in it")
    if wanted is None:
        return "/scan" if "/scan" in topics else topics[0]
    if wanted not in topics:
        raise InputError(f"{path}: no scans on {wanted}; there are {', '.join(topics)}")
    return wanted


class _Track:
    """The stamped poses of a frame in another one, packed: a bag holds millions of transforms."""

    def __init__(self, *, is_static: bool = False) -> None:
        self._stamps, self._rows, self._is_static = array("q"), array("d"), is_static

    def add(self, stamp: int, row: Iterable[float]) -> None:
        """Add x, y, z [m] and a quaternion x, y, z, w at a stamp [ns], in any order."""
        self._stamps.append(stamp)
        self._rows.extend(row)

    @property
    def moves(self) -> bool:
        """Whether its pose ever changes; fixed joints may be published repeatedly."""
        _, places, rotations = self._sorted()
        matrices = _matrices(places, rotations)
        return not (self._is_static or (matrices == matrices[0]).all())

    def at(self, times: Int) -> Float:
        """Its poses (n, 4, 4) at times (n,) [ns], interpolated linearly between two stamps.

        They are unknown before the first stamp and after the last; those of a static frame never
        change.
        """
        stamps, places, rotations = self._sorted()
        first, last = stamps[[0, -1]]
        if self._is_static or len(stamps) == 1:
            matrices = np.tile(_matrices(places[:1], rotations[:1]), (len(times), 1, 1))
        else:
            # Seconds from the first stamp: float64 has no room for nanoseconds since 1970.
            own, asked = 1e-9 * (stamps - first), 1e-9 * (np.clip(times, first, last) - first)
            between = np.column_stack([np.interp(asked, own, column) for column in places.T])
            matrices = _matrices(between, Slerp(own, rotations)(asked))
        if not self._is_static:
            matrices[(times < first) | (times > last)] = np.nan
        return matrices

    def _sorted(self) -> tuple[Int, Float, Rotation]:
        """Ascending stamps, places and rotations; the later row of the same stamp counts."""
        rows = np.array(self._rows).reshape(-1, 7)[::-1]
        stamps, kept = np.unique(np.array(self._stamps)[::-1], return_index=True)
        return stamps, rows[kept, :3], Rotation.from_quat(rows[kept, 3:])


_Edges = Mapping[str, tuple[str, _Track]]
"""The parent of each frame, and the frame's track in it."""


def _chain(edges: _Edges, frame: str) -> list[str]:
    """The frame and its ancestors, up to the root."""
    frames = [frame]
    while frame in edges and edges[frame][0] not in frames:
        frame = edges[frame][0]
        frames.append(frame)
    return frames


def _along(edges: _Edges, frame: str, above: str, times: Int) -> Float:
    """Poses (n, 4, 4) of the frame in one of its ancestors at times (n,) [ns]."""
    result, frames = np.tile(np.eye(4), (len(times), 1, 1)), _chain(edges, frame)
    for child in frames[: frames.index(above)]:
        result = edges[child][1].at(times) @ result
    return result


def _in_the_plane(matrices: Float) -> Float:
    """Poses (n, 3) x, y, theta in the plane of frames (n, 4, 4)."""
    theta = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
    return np.column_stack([matrices[:, :2, 3], theta])


def _matrices(places: Float, rotations: Rotation) -> Float:
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = rotations.as_matrix(), places
    return matrices


@dataclass(slots=True)
class _Contents:
    """What a bag holds: scans, the poses of each topic and their frames, and transforms."""

    scans: list[LaserScan] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    frame: str = ""
    tracks: dict[str, _Track] = field(default_factory=lambda: defaultdict(_Track))
    children: dict[str, str] = field(default_factory=dict)
    edges: dict[str, tuple[str, _Track]] = field(default_factory=dict)
    bad: list[BadLine] = field(default_factory=list)
    bad_count: int = 0
    readings: int = 0

    def refuse(self, number: int, why: str, kind: str) -> None:
        """Count a message or a scan that cannot be used; the first few are kept."""
        self.bad_count += 1
        if len(self.bad) < NAMED:
            self.bad.append(BadLine(number, why, kind))

    def take(self, connection: Any, message: Any) -> None:
        """Take a message; an error says why it cannot be used."""
        topic, kind = connection.topic, connection.msgtype
        if kind == SCAN:
            self._take_scan(message)
        elif kind == TRANSFORMS:
            self.readings += A_POSE * len(message.transforms)
            for each in message.transforms:
                row = _row(each.transform.translation, each.transform.rotation)
                child, above = _frame(each.child_frame_id), _frame(each.header.frame_id)
                track = _Track(is_static=topic == STATIC_FRAMES)
                parent, track = self.edges.setdefault(child, (above, track))
                # A frame has one parent; if programs publish different ones, the first counts.
                if parent == above:
                    track.add(_stamp(each), row)
        else:
            self.readings += A_POSE
            pose = message.pose if kind == POSE else message.pose.pose
            self.tracks[topic].add(_stamp(message), _row(pose.position, pose.orientation))
            child = _frame(message.child_frame_id) if kind == ODOMETRY else ""
            self.children[topic] = child or BASE

    def _take_scan(self, message: Any) -> None:
        scan = LaserScan.from_ros(message)
        # A range finder whose range_max is infinite does not measure such ranges either.
        scan = replace(scan, ranges=np.where(scan.ranges > LARGEST_COORDINATE, np.inf, scan.ranges))
        if self.scans and np.array_equal(self.scans[-1].angles, scan.angles):
            # Scans with the same angles share one array.
            scan = replace(scan, angles=self.scans[-1].angles)
        self.frame = self.frame or _frame(message.header.frame_id)
        self.readings += len(scan.ranges) + A_MESSAGE
        self.stamps.append(_stamp(message))
        self.scans.append(scan)


def _row(place: Any, turn: Any) -> tuple[float, ...]:
    """Position x, y, z and quaternion x, y, z, w of a pose or a transform."""
    row = place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w
    # In this order the comparisons refuse NaN as well.
    if not (
        all(abs(value) <= LARGEST_COORDINATE for value in row) and 0.5 < math.hypot(*row[3:]) < 2.0
    ):
        raise InputError(f"pose {row}: expected numbers and a unit quaternion")
    return row


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return Stamp(int(stamp.sec), int(stamp.nanosec)).nanoseconds


def _frame(name: str) -> str:
    """The name of a frame in ROS 2; ROS 1 put a slash before it."""
    return name.removeprefix("/")


def _placed(path: Path, contents: _Contents, wanted: str) -> tuple[str, Float, Float]:
    """The source of the poses in words; of the laser in the world, and on the robot's base."""
    edges, tracks, frame = contents.edges, contents.tracks, contents.frame
    times: Int = np.array(contents.stamps, dtype=np.int64)
    truths = [topic for topic in sorted(tracks) if "ground_truth" in topic]
    drives = sorted(set(tracks) - set(truths), key=lambda topic: (topic != "/odom", topic))
    frames = _chain(edges, frame)
    moves = any(edges[child][1].moves for child in frames[:-1])
    sources = {"truth": truths[:1], "tf": frames[-1:] if moves else [], "odom": drives[:1]}
    if not drives and moves and DRIFTING in frames:
        sources["odom"] = [DRIFTING]
    there = [name for name, found in sources.items() if found]
    if not there:
        raise InputError(f"{path}: no poses in it: no ground truth, no transforms, no odometry")
    if wanted != "auto" and wanted not in there:
        raise InputError(f"{path}: no poses from {wanted} in it; there are {', '.join(there)}")
    source = sources[there[0] if wanted == "auto" else wanted][0]
    base = contents.children.get(source, BASE)
    mount = _along(edges, frame, base if base in frames else frame, times)
    if source not in tracks:
        return f"/tf, {frame} in {source}", _along(edges, frame, source, times), mount
    laser = tracks[source].at(times) @ mount
    if base not in frames:
        source += f", with the laser in the middle of {base} for want of a transform"
    return source, laser, mount


def _log(path: Path, contents: _Contents, wanted: str) -> LaserLog:
    """The scans with the poses of the wanted source."""
    source, laser, mounted = _placed(path, contents, wanted)
    # The cosine of the tilt is 1 for an upright laser and −1 for one upside down.
    poses, upright, known = _in_the_plane(laser), laser[:, 2, 2], np.isfinite(laser[:, 0, 0])
    askew = np.abs(upright[known & ~(np.abs(upright) >= LEAST_UPRIGHT)])
    if len(askew):
        tilt = np.degrees(np.arccos(min(askew[0], 1.0)))
        raise InputError(
            f"{path}: the laser {contents.frame} is tilted by {tilt:.0f}°, expected one that scans"
            " in the plane"
        )
    scans = []
    for number, scan in enumerate(contents.scans):
        if not known[number]:
            why = f"scan {number + 1} lies outside the time that poses are known for"
            contents.refuse(number + 1, why, "scan")
            continue
        angles = scan.angles if upright[number] > 0.0 else -scan.angles
        scans.append(replace(scan, pose=Pose(*poses[number].tolist()), angles=angles))
    if not scans:
        raise InputError(f"{path}: no scan within the time of the poses from {source}")
    mount = Pose(*_in_the_plane(mounted[known][:1])[0].tolist())
    bad = tuple(contents.bad)
    return LaserLog(log_name(path), scans, contents.bad_count, bad, source, mount=mount)
