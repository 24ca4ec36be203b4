"""A live robot as other programs see it: its topics, the commands that it obeys, its messages."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import is_finite
from lrf3d.io import ros_messages as ros
from lrf3d.io.bag_contents import ODOMETRY, SCAN, TRANSFORMS
from lrf3d.laser import Stamp
from lrf3d.live import LiveRobot
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.pose import Pose, as_pose
from lrf3d.ros.settings import Settings
from lrf3d.scenario import Scenario
from lrf3d.simulation import line_mapper, update_mapper

FASTEST, FASTEST_TURN = 20.0, 20.0
"""Commands beyond are clipped [m/s], [rad/s]."""

LINES_EVERY = 1.0
"""Simulated time from one line map to the next [s]."""

REST = (0.0, 0.0)
"""The command of a robot at rest."""

Say = Callable[[str, str], None]
"""Reports a message at a level: ``info``, ``warning`` or ``error``."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic with its type, the depth of its queue, and whether late subscribers get the last."""

    name: str
    type: str
    depth: int = 5
    latched: bool = False


Message = tuple[Topic, ros.Fields]
Messages = Iterator[Message]

MOVING = Topic("tf", TRANSFORMS, depth=100)


class DrivenRobot:
    """A robot that is driven by commands, and publishes what it measures.

    The prefix stands before its topics and frames, such as ``robot1/``.
    """

    def __init__(
        self, robot: LiveRobot, scenario: Scenario, settings: Settings, prefix: str, say: Say
    ) -> None:
        self.robot, self.prefix, self._say = robot, prefix, say
        self._settings, lasers = settings, scenario.lasers
        self._mapper = line_mapper(scenario.noise, **scenario.mapper) if settings.lines else None
        self._tracker, self._lines_due = ObjectTracker(), LINES_EVERY
        self._command, self._until = REST, inf
        self._scans = [
            Topic(prefix + ("scan" if len(lasers) == 1 else f"scan_{lrf.name}"), SCAN)
            for lrf in lasers
        ]
        self._odom, self._truth = (
            Topic(prefix + name, ODOMETRY) for name in ("odom", "ground_truth")
        )
        self._imu = Topic(f"{prefix}imu", "sensor_msgs/msg/Imu", depth=50)
        marker = "visualization_msgs/msg/MarkerArray"
        self._lines = Topic(f"{prefix}map_objects", marker, depth=1, latched=True)
        self.topics = [*self._scans, self._odom, self._truth, MOVING]
        self.topics += [self._imu] if scenario.imu else []
        self.topics += [self._lines] if settings.lines else []
        self.mounts = [
            (prefix + ros.BASE, prefix + lrf.name, lrf.mount, lrf.height) for lrf in lasers
        ]
        """Frames, pose and height [m] of the lasers."""

    def show(self) -> None:
        """Show the other robots how this one drives from now on."""
        if self.robot.time >= self._until:
            self._stop("no command for a while: the robot stops")
        self.robot.show(*self._command)

    def drive(self, seconds: float) -> None:
        """Drive on for a time [s], as the last command says."""
        self.robot.drive(seconds, *self._command)

    def messages(self, stamp: Stamp, *, scan_time: float | None) -> Messages:
        """Where the robot is, and, if the time from scan to scan [s] is given, its scans."""
        robot, prefix = self.robot, self.prefix
        odometry, speeds = Pose(*robot.odometry.tolist()), [robot.speed, robot.turning]
        moved = [ros.transform(stamp, prefix + ros.WORLD, prefix + ros.BASE, odometry)]
        if self._settings.give == "pose":
            drift = robot.pose @ odometry.inverse()
            moved.append(ros.transform(stamp, ros.MAP, prefix + ros.WORLD, drift))
        yield MOVING, {"transforms": moved}
        for at, *measured in robot.imu().tolist():
            fields = ros.imu_fields(Stamp.of(at), *measured)
            fields["header"]["frame_id"] = prefix + ros.BASE
            yield self._imu, fields
        for topic, pose in ((self._odom, odometry), (self._truth, robot.pose)):
            fields = ros.odometry(stamp, pose, speeds)
            fields["header"]["frame_id"] = prefix + ros.WORLD
            fields["child_frame_id"] = prefix + ros.BASE
            yield topic, fields
        if scan_time is not None:
            yield from self._scanned(stamp, scan_time)

    def _scanned(self, stamp: Stamp, scan_time: float) -> Messages:
        scans = self.robot.scans()
        for topic, scan in zip(self._scans, scans, strict=True):
            yield topic, scan.as_ros(self.prefix + scan.laser, scan_time=scan_time)
        if self._mapper is None:
            return
        update_mapper(self._mapper, scans)
        if self.robot.time >= self._lines_due:
            lines = self._mapper.map
            marker = ros.line_marker(lines.segments, self._tracker.follow(lines), stamp)
            self._lines_due = self.robot.time + LINES_EVERY
            yield self._lines, {"markers": [marker]}

    def command(self, speed: float, turning: float, sideways: float = 0.0) -> None:
        """Obey a command [m/s], [rad/s] until the next one, or until the time-out."""
        if not is_finite(speed, turning, sideways):
            self._stop(f"command ({speed:g}, {turning:g}): not finite; the robot stops")
            return
        if sideways:
            self._say("warning", "linear.y is ignored: this robot cannot drive sideways")
        self._command = (
            float(np.clip(speed, -FASTEST, FASTEST)),
            float(np.clip(turning, -FASTEST_TURN, FASTEST_TURN)),
        )
        self._until = self.robot.time + (self._settings.cmd_timeout or inf)

    def _stop(self, why: str) -> None:
        if any(self._command):
            self._say("warning", self.prefix + why)
        self._command, self._until = REST, inf

    def set_pose(self, frame: str, pose: tuple[float, float, float]) -> None:
        """Put the robot at a pose in ``map`` or ``odom``; report an invalid one."""
        try:
            if frame not in ("", ros.MAP, self.prefix + ros.WORLD):
                raise InputError(f"frame {frame!r}: expected {ros.MAP} or {self.prefix}{ros.WORLD}")
            asked = as_pose(pose)
            if frame == self.prefix + ros.WORLD:
                # The odometry's frame has drifted.
                odometry = Pose(*self.robot.odometry.tolist())
                asked = self.robot.pose @ odometry.inverse() @ asked
            self.robot.place(asked)
        except InputError as error:
            self._say("error", f"set_pose: {error}; ignored")
            return
        self._say("info", f"set_pose: the robot is at {asked}")

    def reset(self) -> None:
        """Put the robot back to its start."""
        self._command = REST
        self.robot.restart()
