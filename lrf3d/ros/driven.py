"""A live robot as other programs see it: its topics, the commands that it obeys, its messages."""

from collections.abc import Callable, Iterator
from math import inf
from typing import NamedTuple

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

FASTEST = 20.0
"""Commands beyond are clipped [m/s], [rad/s]."""

LINES_EVERY = 1.0
"""Simulated time from one line map to the next [s]."""

REST = (0.0, 0.0)
"""The command of a robot at rest."""

Say = Callable[[str, str], None]
"""Reports a message at a level: ``info``, ``warning`` or ``error``."""


class Topic(NamedTuple):
    """A topic with its type, the depth of its queue, and whether late subscribers get the last."""

    name: str
    type: str
    depth: int = 5
    latched: bool = False


Messages = Iterator[tuple[Topic, ros.Fields]]

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
        self._odom = Topic(f"{prefix}odom", ODOMETRY)
        self._truth = Topic(f"{prefix}ground_truth", ODOMETRY)
        self._imu = Topic(f"{prefix}imu", "sensor_msgs/msg/Imu", depth=50)
        marker = "visualization_msgs/msg/MarkerArray"
        self._lines = Topic(f"{prefix}map_objects", marker, depth=1, latched=True)
        self.topics = [*self._scans, self._odom, self._truth, MOVING]
        self.topics += [self._imu] * (scenario.imu is not None) + [self._lines] * settings.lines
        self.mounts = [
            (prefix + ros.BASE, prefix + lrf.name, lrf.mount, lrf.height) for lrf in lasers
        ]
        """Frames, pose and height [m] of the lasers."""

    @property
    def odometry(self) -> Pose:
        """Where the robot is by its wheels."""
        return Pose(*self.robot.odometry.tolist())

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
        robot, prefix, odometry = self.robot, self.prefix, self.odometry
        moved = [ros.transform(stamp, prefix + ros.WORLD, prefix + ros.BASE, odometry)]
        if self._settings.give == "pose":
            drift = robot.pose @ odometry.inverse()
            moved.append(ros.transform(stamp, ros.MAP, prefix + ros.WORLD, drift))
        yield MOVING, {"transforms": moved}
        for at, *measured in robot.imu().tolist():
            yield self._imu, ros.imu_fields(Stamp.of(at), *measured, prefix=prefix)
        for topic, pose in ((self._odom, odometry), (self._truth, robot.pose)):
            yield topic, ros.odometry(stamp, pose, [robot.speed, robot.turning], prefix=prefix)
        if scan_time is None:
            return
        scans = robot.scans()
        for topic, scan in zip(self._scans, scans, strict=True):
            yield topic, scan.as_ros(prefix + scan.laser, scan_time=scan_time)
        if self._mapper is None:
            return
        update_mapper(self._mapper, scans)
        if robot.time >= self._lines_due:
            lines, self._lines_due = self._mapper.map, robot.time + LINES_EVERY
            marker = ros.line_marker(lines.segments, self._tracker.follow(lines), stamp)
            yield self._lines, {"markers": [marker]}

    def command(self, speed: float, turning: float, sideways: float = 0.0) -> None:
        """Obey a command [m/s], [rad/s] until the next one, or until the time-out."""
        if not is_finite(speed, turning, sideways):
            self._stop(f"command ({speed:g}, {turning:g}): not finite; the robot stops")
            return
        if sideways:
            self._say("warning", "linear.y is ignored: this robot cannot drive sideways")
        speed, turning = (max(-FASTEST, min(FASTEST, float(each))) for each in (speed, turning))
        self._command = speed, turning
        self._until = self.robot.time + (self._settings.cmd_timeout or inf)

    def _stop(self, why: str) -> None:
        if any(self._command):
            self._say("warning", self.prefix + why)
        self._command, self._until = REST, inf

    def set_pose(self, frame: str, pose: tuple[float, float, float]) -> None:
        """Put the robot at a pose in ``map`` or ``odom``; report an invalid one."""
        own = self.prefix + ros.WORLD
        try:
            if frame not in ("", ros.MAP, own):
                raise InputError(f"frame {frame!r}: expected {ros.MAP} or {own}")
            asked = as_pose(pose)
            if frame == own:
                # The odometry's frame has drifted.
                asked = self.robot.pose @ self.odometry.inverse() @ asked
            self.robot.place(asked)
        except InputError as error:
            self._say("error", f"set_pose: {error}; ignored")
        else:
            self._say("info", f"set_pose: the robot is at {asked}")

    def reset(self) -> None:
        """Put the robot back to its start."""
        self._command = REST
        self.robot.restart()
