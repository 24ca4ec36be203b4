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
"""

import math
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import LARGEST_COORDINATE, Int
from lrf3d.io.bag_frames import FrameTrack, FrameTree, Placed, Rows
from lrf3d.io.bag_messages import (
    ODOMETRY,
    SCAN,
    STATIC_FRAMES,
    TRANSFORMS,
    Bag,
    Message,
    open_bag,
)
from lrf3d.io.laser_log import MOST_READINGS, NAMED, BadLine, LaserLog, log_name
from lrf3d.laser import LaserScan, Stamp
from lrf3d.pose import Pose

LEAST_UPRIGHT = np.cos(np.radians(15.0))
"""Least cosine of the tilt of a laser; one that is tilted more does not scan in the plane."""

BASE, DRIFTING = "base_link", "odom"
"""Frames of the robot, for poses that name none, and of its odometry, as REP 105 calls them."""


def load_bag(path: str | Path, *, poses: str = "auto", scan_topic: str | None = None) -> LaserLog:
    """Read the scans of a ROS 2 bag; see `load_log`."""
    path = Path(path)
    with open_bag(path) as bag:
        topic = _scan_topic(bag, scan_topic)
        contents = _read(bag, topic)
    if not contents.scans:
        why = f"; first {contents.bad[0]}" if contents.bad else ""
        raise InputError(f"{path}: no scan on {topic} that can be used{why}")
    found = _placed(path, contents, np.array(contents.stamps, dtype=np.int64), poses)
    return _log(path, contents, found)


@dataclass(frozen=True, eq=False)
class PlacedLaser:
    """Where the laser was at the scans, and on the robot's base; the source in words."""

    source: str
    laser: Placed
    mount: Placed


@dataclass(slots=True)
class _Contents:
    """What a bag holds."""

    scans: list[LaserScan] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    frame: str = ""
    rows: dict[str, Rows] = field(default_factory=lambda: defaultdict(Rows))
    children: dict[str, str] = field(default_factory=dict)
    edges: dict[str, tuple[str, Rows, bool]] = field(default_factory=dict)
    bad: list[BadLine] = field(default_factory=list)
    bad_count: int = 0

    def refuse(self, bad: BadLine) -> None:
        """Count a message that cannot be used; the first few are kept."""
        self.bad_count += 1
        if len(self.bad) < NAMED:
            self.bad.append(bad)


def _scan_topic(bag: Bag, wanted: str | None) -> str:
    topics = sorted(topic for topic, kind in bag.topics.items() if kind == SCAN)
    if not topics:
        raise InputError(f"{bag.path}: no topic of {SCAN} in it")
    if wanted is None:
        return "/scan" if "/scan" in topics else topics[0]
    if wanted not in topics:
        raise InputError(f"{bag.path}: no scans on {wanted}; there are {', '.join(topics)}")
    return wanted


def _read(bag: Bag, scan_topic: str) -> _Contents:
    contents, readings = _Contents(), 0
    topics = {topic for topic, kind in bag.topics.items() if kind != SCAN} | {scan_topic}
    for message in bag.messages(topics):
        if isinstance(message, BadLine):
            contents.refuse(message)
            continue
        try:
            if message.kind == SCAN:
                _take_scan(contents, message.content)
                readings += len(contents.scans[-1].ranges)
            elif message.kind == TRANSFORMS:
                _take_transforms(contents, message)
            else:
                _take_pose(contents, message)
        except (InputError, OverflowError) as error:
            contents.refuse(BadLine(message.number, str(error), "message"))
        if readings > MOST_READINGS:
            raise InputError(f"{bag.path}: more than {MOST_READINGS:,} readings; cut it into parts")
    return contents


def _take_scan(contents: _Contents, said: Any) -> None:
    scan = LaserScan.from_ros(said)
    # A range finder whose range_max is infinite does not measure such ranges either.
    scan = replace(scan, ranges=np.where(scan.ranges > LARGEST_COORDINATE, np.inf, scan.ranges))
    if contents.scans and np.array_equal(contents.scans[-1].angles, scan.angles):
        # Scans with the same angles share one array.
        scan = replace(scan, angles=contents.scans[-1].angles)
    contents.frame = contents.frame or _frame(said.header.frame_id)
    contents.scans.append(scan)
    contents.stamps.append(_stamp(said.header))


def _take_transforms(contents: _Contents, message: Message) -> None:
    is_static = message.topic == STATIC_FRAMES
    for said in message.content.transforms:
        child, parent = _frame(said.child_frame_id), _frame(said.header.frame_id)
        known_parent, rows, _ = contents.edges.setdefault(child, (parent, Rows(), is_static))
        row = _row(said.transform.translation, said.transform.rotation)
        # A frame has one parent; if two programs publish different ones, the first counts.
        if known_parent == parent:
            rows.add(_stamp(said.header), row)


def _take_pose(contents: _Contents, message: Message) -> None:
    said = message.content
    child = _frame(said.child_frame_id) if message.kind == ODOMETRY else ""
    pose = said.pose.pose if hasattr(said.pose, "pose") else said.pose
    row = _row(pose.position, pose.orientation)
    contents.rows[message.topic].add(_stamp(said.header), row)
    contents.children[message.topic] = child or BASE


def _row(place: Any, turn: Any) -> tuple[float, ...]:
    """Position x, y, z and quaternion x, y, z, w of a pose or a transform."""
    row = place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w
    # In this order the comparisons refuse NaN as well.
    if not (
        all(abs(value) <= LARGEST_COORDINATE for value in row) and 0.5 < math.hypot(*row[3:]) < 2.0
    ):
        raise InputError(f"pose {row}: expected numbers and a unit quaternion")
    return row


def _stamp(header: Any) -> int:
    return Stamp(int(header.stamp.sec), int(header.stamp.nanosec)).nanoseconds


def _frame(name: str) -> str:
    """The name of a frame in ROS 2; ROS 1 put a slash before it."""
    return name.removeprefix("/")


def _placed(path: Path, contents: _Contents, times: Int, wanted: str) -> PlacedLaser:
    """The poses of the laser at the times, and the source that they come from."""
    tree = FrameTree(
        {
            child: (parent, FrameTrack.of(rows, is_static=is_static))
            for child, (parent, rows, is_static) in contents.edges.items()
            if len(rows)
        }
    )
    truths = [topic for topic in sorted(contents.rows) if "ground_truth" in topic]
    drives = sorted(set(contents.rows) - set(truths), key=lambda topic: (topic != "/odom", topic))
    chain = tree.chain(contents.frame)
    root, moves = chain[-1], tree.moves(contents.frame)
    sources = {"truth": truths[:1], "tf": [root] if moves else [], "odom": drives[:1]}
    if not drives and moves and DRIFTING in chain:
        sources["odom"] = [DRIFTING]
    there = [name for name, topics in sources.items() if topics]
    if not there:
        raise InputError(f"{path}: no poses in it: no ground truth, no transforms, no odometry")
    if wanted != "auto" and wanted not in there:
        raise InputError(f"{path}: no poses from {wanted} in it; there are {', '.join(there)}")
    chosen = there[0] if wanted == "auto" else wanted
    name = sources[chosen][0]
    none = Placed.identity(len(times))
    if name in (root, DRIFTING) and name not in contents.rows:
        mount = tree.placed(contents.frame, BASE, times) if BASE in chain else none
        laser = tree.placed(contents.frame, name, times)
        return PlacedLaser(f"/tf, {contents.frame} in {name}", laser, mount)
    base = contents.children[name]
    robot = FrameTrack.of(contents.rows[name]).at(times)
    if base in chain:
        mount = tree.placed(contents.frame, base, times)
        return PlacedLaser(name, robot @ mount, mount)
    guessed = f"{name}, with the laser in the middle of {base} for want of a transform"
    return PlacedLaser(guessed, robot, none)


def _log(path: Path, contents: _Contents, found: PlacedLaser) -> LaserLog:
    placed, source = found.laser, found.source
    poses, upright = placed.in_the_plane()
    askew = np.flatnonzero(placed.known & ~(np.abs(upright) >= LEAST_UPRIGHT))
    if len(askew):
        tilt = np.degrees(np.arccos(np.clip(np.abs(upright[askew[0]]), 0.0, 1.0)))
        raise InputError(
            f"{path}: the laser {contents.frame} is tilted by {tilt:.0f}°, expected one that scans"
            " in the plane"
        )
    scans = []
    for number, scan in enumerate(contents.scans):
        if not placed.known[number]:
            why = f"scan {number + 1} lies outside the time that poses are known for"
            contents.refuse(BadLine(number + 1, why, "scan"))
            continue
        angles = scan.angles if upright[number] > 0.0 else -scan.angles
        scans.append(replace(scan, pose=Pose(*poses[number].tolist()), angles=angles))
    if not scans:
        raise InputError(f"{path}: no scan within the time of the poses from {source}")
    first = int(np.flatnonzero(placed.known)[0])
    mount = Pose(*found.mount.in_the_plane()[0][first].tolist())
    bad = tuple(contents.bad)
    return LaserLog(log_name(path), scans, contents.bad_count, bad, source, mount=mount)
