"""What the messages of a bag hold: scans, poses of frames, and what could not be read."""

from collections import defaultdict
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lrf3d.geometry import LARGEST_COORDINATE
from lrf3d.io.bag_frames import Stamps, Track
from lrf3d.io.intake import A_MESSAGE, A_POSE, Intake
from lrf3d.laser import LaserScan, Stamp
from lrf3d.text import counted

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
UNSURE_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
OLD_TRANSFORMS = "tf/msg/tfMessage"
TYPES = (SCAN, ODOMETRY, POSE, UNSURE_POSE, TRANSFORMS, OLD_TRANSFORMS)
"""The types of messages that are read."""

STATIC_FRAMES = "/tf_static"
"""The topic of constant transforms; a robot's namespace may come before it."""


@dataclass(slots=True)
class Stream:
    """The scans of a topic that have the same frame, in the order of their receipt."""

    topic: str
    frame: str
    scans: list[LaserScan] = field(default_factory=list)
    stamps: Stamps = field(default_factory=Stamps)

    @property
    def words(self) -> str:
        """How many scans of what."""
        return f"{counted(len(self.scans), 'scan')} of {self.topic} ({self.frame})"

    def add(self, message: Any, *stamp: int) -> None:
        """Add a message; an error says why it cannot be used."""
        scan = LaserScan.from_ros(message)
        # A range finder whose range_max is infinite does not measure such ranges either.
        scan = replace(scan, ranges=np.where(scan.ranges > LARGEST_COORDINATE, np.inf, scan.ranges))
        if self.scans and np.array_equal(self.scans[-1].angles, scan.angles):
            # Scans with the same angles share one array.
            scan = replace(scan, angles=self.scans[-1].angles)
        self.scans.append(scan)
        self.stamps.add(*stamp)


@dataclass(slots=True)
class Contents:
    """What a bag holds: scans, the poses of each topic and their frames, and transforms.

    Scans are kept by topic and frame; transforms by namespace: in its own, a robot may have frames
    of the usual names.
    """

    intake: Intake
    by_frame: dict[tuple[str, str], Stream] = field(default_factory=dict)
    scan_topics: list[str] = field(default_factory=list)
    tracks: dict[str, Track] = field(default_factory=lambda: defaultdict(Track))
    children: dict[str, str] = field(default_factory=dict)
    edges: dict[str, dict[str, tuple[str, Track]]] = field(
        default_factory=lambda: defaultdict(dict)
    )

    @property
    def streams(self) -> list[Stream]:
        """The scans in the order of their topics, the preferred one first."""
        found = self.by_frame.values()
        return sorted(found, key=lambda each: self.scan_topics.index(each.topic))

    def take(self, topic: str, kind: str, message: Any, received: int, number: int) -> int:
        """Take a message, and return its size in readings; an error says why it is of no use."""
        if kind in (TRANSFORMS, OLD_TRANSFORMS):
            edges = self.edges[topic.rpartition("/")[0]]
            for each in message.transforms:
                child, above = _frame(each.child_frame_id), _frame(each.header.frame_id)
                track = Track(is_static=topic.endswith(STATIC_FRAMES))
                parent, track = edges.setdefault(child, (above, track))
                # A frame has one parent; if programs publish different ones, the first counts.
                if parent == above:
                    moved = each.transform
                    track.add(moved.translation, moved.rotation, _stamp(each), received, number)
            return A_POSE * len(message.transforms)
        stamp = _stamp(message), received, number
        if kind == SCAN:
            frame = _frame(message.header.frame_id)
            stream = self.by_frame.get((topic, frame)) or Stream(topic, frame)
            stream.add(message, *stamp)
            self.by_frame[topic, frame] = stream
            return len(message.ranges) + A_MESSAGE
        pose = message.pose if kind == POSE else message.pose.pose
        child = _frame(message.child_frame_id) if kind == ODOMETRY else ""
        # Of several robots on one topic, each has a track.
        name = topic if self.children.get(topic, child) == child else f"{topic} of {child}"
        self.tracks[name].add(pose.position, pose.orientation, *stamp)
        self.children[name] = child
        return A_POSE


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return Stamp(int(stamp.sec), int(stamp.nanosec)).nanoseconds


def _frame(name: str) -> str:
    """The name of a frame in ROS 2; ROS 1 put a slash before it."""
    return name.removeprefix("/")
