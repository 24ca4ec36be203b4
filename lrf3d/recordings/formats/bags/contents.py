"""The contents of a bag: scans, the poses of each topic and their frames, and transforms.

Messages of the types in `MESSAGES` enter; of point clouds scans are made.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from os.path import basename
from types import SimpleNamespace
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import LARGEST_COORDINATE
from lrf3d.laser import LaserScan, Stamp
from lrf3d.messages.clouds import CLOUD
from lrf3d.messages.ros import ODOMETRY, SCAN, STATIC_FRAMES, TRANSFORMS, place, turn
from lrf3d.recordings.formats.bags.clouds import CloudScans, level_axes
from lrf3d.recordings.formats.bags.frames import BagPart, Frames, FrameTrack, in_the_plane
from lrf3d.recordings.formats.text.fans import WHOLE_TURN, WIDEST_FAN
from lrf3d.recordings.log import Intake

# Types of messages of scans; where a beam has several echoes, the first one counts.
ECHOES = "sensor_msgs/msg/MultiEchoLaserScan"
SCANS = (SCAN, ECHOES)

# Other types of messages that are read.
POSE = "geometry_msgs/msg/PoseStamped"
UNSURE_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
OLD_TRANSFORMS = "tf/msg/tfMessage"

# How far bearings may differ from what a message says, because it rounds them [rad].
ROUNDED = 0.01

# Largest number of different readings in a scan that stand for no return.
MOST_CODES = 4

# The frame of odometry, as REP 105 calls it.
DRIFTING = "odom"

# Frames that do not move with a robot: clouds in them are maps.
FIXED = ("map", DRIFTING, "world", "earth")


@dataclass(slots=True)
class ScanStream:
    """The scans of a topic that have the same frame, in the order of their receipt."""

    topic: str
    frame: str
    scans: list[LaserScan] = field(default_factory=list)
    track: FrameTrack = field(default_factory=FrameTrack)
    fans: tuple[tuple[float, float], ...] = ()
    note: str = ""
    clouds: CloudScans | None = None
    # Readings that are lost beyond the limits of their message.
    outside: int = 0

    @property
    def words(self) -> str:
        """The number of scans, their topic and their frame."""
        return f"{counted(len(self.scans), 'scan')} of {self.topic} ({self.frame})"

    def add_cloud(self, message: Any, sent: int, *stamp: int) -> None:
        """Add the scan of a point cloud; an error says why it cannot be used."""
        assert self.clouds is not None
        scan, begins = self.clouds.scan(message, sent)
        self.note = self.clouds.words
        self.scans.append(scan)
        self.track.add(begins, *stamp)

    def add(self, message: Any, *stamp: int) -> None:
        """Add a message; an error says why it cannot be used."""
        scan = LaserScan.from_ros(message)
        first, last = scan.angles[[0, -1]].tolist()
        low = message.angle_min
        high = message.angle_max
        step = message.angle_increment
        # Drivers may send two beams more or fewer than the message says.
        apart = abs(high - last) > max(ROUNDED, 2.0 * abs(step))
        if not abs(step * (len(scan.angles) - 1) - (last - first)) < ROUNDED:
            self.note = (
                f"the angle_increment of {self.topic} contradicts its angle_min and angle_max:"
                " beams lie evenly between these"
            )
        elif apart and high and abs(high - low) <= WIDEST_FAN:
            self.note = (
                f"the beams of {self.topic} end at {last:.3g} rad, its angle_max is {high:.3g}"
            )
            self.fans = ((low, high),)
        elif abs(high - last) > 0.5 * abs(step) and high - low < WHOLE_TURN:
            self.note = (
                f"the angle_max of {self.topic} is {(high - last) / step:.2g} angle_increment past"
                " its last beam: beams lie an increment apart"
            )
        sent = np.asarray(message.ranges, dtype=np.float64)
        outside = sent[np.isfinite(sent) & (sent > 0.0) & ~np.isfinite(scan.ranges)]
        # A few numbers beyond the limits stand for no return.
        if len(np.unique(outside)) > MOST_CODES:
            self.outside += len(outside)
        # A range finder whose range_max is infinite does not measure such ranges either.
        scan = replace(scan, ranges=np.where(scan.ranges > LARGEST_COORDINATE, np.inf, scan.ranges))
        if self.scans and np.array_equal(self.scans[-1].angles, scan.angles):
            # Scans with the same angles share one array.
            scan = replace(scan, angles=self.scans[-1].angles)
        self.scans.append(scan)
        self.track.add(*stamp)


@dataclass(slots=True)
class Contents:
    """The contents of a bag: scans, the poses of each topic and their frames, and transforms.

    Scans are kept by topic and frame; transforms by namespace, since several robots may use the
    usual names of frames. ``children`` holds the frame whose poses a topic of poses reports.
    """

    intake: Intake
    band: Sequence[float] | None = None
    by_frame: dict[tuple[str, str], ScanStream] = field(default_factory=dict)
    scan_topics: list[str] = field(default_factory=list)
    tracks: dict[str, FrameTrack] = field(default_factory=lambda: defaultdict(FrameTrack))
    children: dict[str, str] = field(default_factory=dict)
    edges: dict[str, dict[str, tuple[str, FrameTrack]]] = field(
        default_factory=lambda: defaultdict(dict)
    )

    @property
    def streams(self) -> list[ScanStream]:
        """The scans in the order of their topics, the preferred one first."""
        found = self.by_frame.values()
        return sorted(found, key=lambda each: self.scan_topics.index(each.topic))

    def take_scan(self, topic: str, message: Any, received: int, number: int) -> None:
        """Read a scan."""
        frame = _frame(message.header.frame_id)
        stream = self.by_frame.get((topic, frame)) or ScanStream(topic, frame)
        stream.add(message, _stamp(message), received, number)
        self.by_frame[topic, frame] = stream

    def take_echoes(self, topic: str, message: Any, received: int, number: int) -> None:
        """Read a scan of several echoes, of which the first counts."""
        message.ranges = [[*each.echoes, np.inf][0] for each in message.ranges]
        message.intensities = []
        self.take_scan(topic, message, received, number)

    def take_cloud(self, topic: str, message: Any, received: int, number: int) -> None:
        """Read a point cloud as a scan; all transforms have been read before."""
        frame = _frame(message.header.frame_id)
        stream = self.by_frame.get((topic, frame))
        if stream is None:
            stream = self._levelled(topic, frame)
        stream.add_cloud(message, _stamp(message), received, number)
        self.by_frame[topic, frame] = stream

    def _levelled(self, topic: str, frame: str) -> ScanStream:
        """An empty stream of clouds, in a frame of the lidar that is made level."""
        if basename(frame) in FIXED:
            raise InputError(f"points in the frame {frame}, which is not that of a lidar")
        always = BagPart(np.empty(0, dtype=np.int64), 0)
        frames = Frames(edges_of(self, topic), always)
        base = frames.base(frame)
        if base == frame:
            axes, _ = level_axes(frame, None)
            return ScanStream(topic, frame, clouds=CloudScans(topic, axes, 0.0, "", self.band))
        mount = frames.poses(frame, base, np.zeros(1, dtype=np.int64))[0]
        axes, is_level = level_axes(frame, mount)
        clouds = CloudScans(topic, axes, float(mount[2, 3]), base, self.band)
        if is_level:
            return ScanStream(topic, frame, clouds=clouds)
        level = f"{frame} made level"
        where = SimpleNamespace(**place(*mount[:3, 3].tolist()))
        heading = SimpleNamespace(**turn(float(in_the_plane(mount[None])[0, 2])))
        track = FrameTrack(is_static=True)
        track.add_pose(where, heading, 0, 0, 0)
        space = next(space for space, own in self.edges.items() if frame in own)
        self.edges[space][level] = base, track
        return ScanStream(topic, level, clouds=clouds)

    def take_pose(self, topic: str, message: Any, received: int, number: int) -> None:
        """Read a pose, with a covariance or without, or odometry, which names its frame."""
        stamp = _stamp(message), received, number
        pose = getattr(message.pose, "pose", message.pose)
        child = _frame(getattr(message, "child_frame_id", ""))
        # Of several robots on one topic, each has a track.
        name = topic if self.children.get(topic, child) == child else f"{topic} of {child}"
        self.tracks[name].add_pose(pose.position, pose.orientation, *stamp)
        self.children[name] = child

    def take_transforms(self, topic: str, message: Any, received: int, number: int) -> None:
        """Read transforms."""
        edges = self.edges[topic.rpartition("/")[0]]
        for each in message.transforms:
            above = _frame(each.header.frame_id)
            new = above, FrameTrack(is_static=topic.endswith(STATIC_FRAMES))
            parent, track = edges.setdefault(_frame(each.child_frame_id), new)
            # A frame has one parent; if programs publish different ones, the first counts.
            if parent == above:
                moved = each.transform
                stamp = _stamp(each), received, number
                track.add_pose(moved.translation, moved.rotation, *stamp)


# What reads a message of a type: into the contents, from a topic, received at a time [ns], with its
# number in the bag.
MESSAGES: dict[str, Callable[[Contents, str, Any, int, int], None]] = {
    SCAN: Contents.take_scan,
    ECHOES: Contents.take_echoes,
    CLOUD: Contents.take_cloud,
    ODOMETRY: Contents.take_pose,
    POSE: Contents.take_pose,
    UNSURE_POSE: Contents.take_pose,
    TRANSFORMS: Contents.take_transforms,
    OLD_TRANSFORMS: Contents.take_transforms,
}


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return Stamp(int(stamp.sec), int(stamp.nanosec)).nanoseconds


def _frame(name: str) -> str:
    """The name of a frame in ROS 2; ROS 1 put a slash before it."""
    return name.removeprefix("/")


def edges_of(contents: Contents, topic: str) -> dict[str, tuple[str, FrameTrack]]:
    """The transforms of the namespaces that contain a topic; if they have none, all transforms."""
    spaces = sorted(contents.edges, key=len)
    own = [space for space in spaces if topic.startswith(f"{space}/")]
    return {k: edge for space in own or spaces for k, edge in contents.edges[space].items()}
