"""What a live robot publishes and obeys: topics, messages and time, for any middleware.

Commands enter; messages leave as dicts with the fields of ROS. Simulated time advances in ticks;
stamps are exact multiples of the interval between two scans, and never run back.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import ceil, inf
from pathlib import Path
from typing import Literal

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import is_finite, number
from lrf3d.io import ros_messages as ros
from lrf3d.io.bag_contents import ODOMETRY, SCAN, TRANSFORMS
from lrf3d.laser import Stamp
from lrf3d.live import LiveRobot
from lrf3d.mapping import LineMapper
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.pose import Pose, as_pose
from lrf3d.robot.odometry import WheelOdometry
from lrf3d.scenario import Scenario
from lrf3d.simulation import line_mapper, update_mapper

LONGEST_TICK = 0.02
"""Longest tick [s]: the clock, transforms and odometry come at 50 Hz of simulated time or more."""

FASTEST, FASTEST_TURN = 20.0, 20.0
"""Commands beyond are clipped [m/s], [rad/s]."""

FINEST_CELL = 0.1
"""Least side of a cell of the published grid [m]: a whole city is then some megabytes."""

LINES_EVERY = 1.0
"""Simulated time from one line map to the next [s]."""

Say = Callable[[str, str], None]
"""Reports a message at a level: ``info``, ``warning`` or ``error``."""


class SecondClockError(InputError):
    """Another program publishes the simulated time."""


Message = tuple["Topic", ros.Fields]
Messages = Iterator[Message]


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic with its type, the depth of its queue, and whether late subscribers get the last."""

    name: str
    type: str
    depth: int = 5
    latched: bool = False


CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", depth=1)
ODOM, TRUTH = Topic("odom", ODOMETRY), Topic("ground_truth", ODOMETRY)
INERTIA = Topic("imu", "sensor_msgs/msg/Imu")
MOVING = Topic("tf", TRANSFORMS, depth=100)
FIXED = Topic("tf_static", TRANSFORMS, depth=1, latched=True)
GRID = Topic("map", "nav_msgs/msg/OccupancyGrid", depth=1, latched=True)
LINES = Topic("map_objects", "visualization_msgs/msg/MarkerArray", depth=1, latched=True)


@dataclass(frozen=True, slots=True)
class Settings:
    """How a robot is served.

    Args:
        rate: Scans per second; that of the scenario if not given.
        speed_up: Simulated seconds per second; 0 is as fast as it goes.
        give: What is given of the truth: ``pose`` (the map and the robot in it), ``map`` or
            ``none``.
        wheels: Odometry as wheels measure it, also where the world file does not say how.
        cmd_timeout: Simulated time after the last command at which the robot stops [s]; 0 is never.
        namespace: Namespace of the topics.
        clock: Publish the simulated time.
        lines: Map while driving, and publish the line map.
        rng: Seed of the noise.
    """

    rate: float | None = None
    speed_up: float = 1.0
    give: Literal["pose", "map", "none"] = "pose"
    wheels: bool = False
    cmd_timeout: float = 0.5
    namespace: str = ""
    clock: bool = True
    lines: bool = False
    rng: int = 0

    def __post_init__(self) -> None:
        number(self.speed_up, "speed_up")
        number(self.cmd_timeout, "cmd_timeout", "seconds")
        if self.rate is not None:
            number(self.rate, "rate", "scans per second", positive=True)
        if self.give not in ("pose", "map", "none"):
            raise InputError(f"give {self.give!r}: expected pose, map or none")


@dataclass
class Stream:
    """A robot that is driven by commands and publishes what it measures.

    Calls are made from one thread.
    """

    scenario: Scenario
    settings: Settings
    say: Say
    paused: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        rate = self.settings.rate
        self.interval = self.scenario.scan_interval if rate is None else 1.0 / rate
        self.ticks = ceil(self.interval / LONGEST_TICK - 1e-9)
        """Number of ticks from scan to scan."""
        wheels = self.scenario.odometry or (WheelOdometry() if self.settings.wheels else None)
        self.robot = LiveRobot(self.scenario, rng=self.settings.rng, wheels=wheels)
        self._mapper: LineMapper | None = None
        if self.settings.lines:
            self._mapper = line_mapper(self.scenario.noise, **self.scenario.mapper)
        self._tracker, self._lines_due = ObjectTracker(), LINES_EVERY
        self._count, self._command, self._until = 0, (0.0, 0.0), inf
        lasers = self.scenario.lasers
        self._scans = [
            Topic("scan" if len(lasers) == 1 else f"scan_{lrf.name}", SCAN) for lrf in lasers
        ]
        # Compiles kernels and builds search trees before anybody listens.
        self.robot.scans()

    @property
    def stamp(self) -> Stamp:
        """The time of the last tick."""
        return Stamp.of(self.robot.time)

    @property
    def topics(self) -> list[Topic]:
        """All topics that this stream publishes."""
        given = {CLOCK: self.settings.clock, GRID: self._gives_map, LINES: self.settings.lines}
        given[INERTIA] = self.scenario.imu is not None
        always = dict.fromkeys((*self._scans, ODOM, TRUTH, MOVING, FIXED), True)
        return [topic for topic, wanted in (given | always).items() if wanted]

    @property
    def _gives_map(self) -> bool:
        return self.settings.give != "none"

    def first(self) -> Messages:
        """What is published once: where the lasers are mounted, and the map where it is given."""
        stamp, lasers = self.stamp, self.scenario.lasers
        mounted = [
            ros.transform(stamp, ros.BASE, lrf.name, lrf.mount, lrf.height) for lrf in lasers
        ]
        yield FIXED, {"transforms": mounted}
        if self._gives_map:
            world = self.scenario.world
            yield GRID, ros.occupancy_grid(world, FINEST_CELL, stamp, Path(world.name))

    def tick(self) -> Messages:
        """Drive on by a tick, and publish where the robot is; scan where an interval ends."""
        robot, count = self.robot, self._count
        if count:
            if robot.time >= self._until:
                self._stop("no command for a while: the robot stops")
            robot.drive(self.interval / self.ticks, *self._command)
        # Time is counted, not summed.
        robot.time = count * self.interval / self.ticks
        self._count += 1
        stamp, odometry = self.stamp, Pose(*robot.odometry.tolist())
        speeds = [robot.speed, robot.turning]
        if self.settings.clock:
            yield CLOCK, {"clock": ros.time_fields(stamp)}
        moved = [ros.transform(stamp, ros.WORLD, ros.BASE, odometry)]
        if self.settings.give == "pose":
            drift = robot.pose @ odometry.inverse()
            moved.append(ros.transform(stamp, ros.MAP, ros.WORLD, drift))
        yield MOVING, {"transforms": moved}
        for at, *measured in robot.imu().tolist():
            yield INERTIA, ros.imu_fields(Stamp.of(at), *measured)
        yield ODOM, ros.odometry(stamp, odometry, speeds)
        yield TRUTH, ros.odometry(stamp, robot.pose, speeds)
        if count % self.ticks == 0:
            yield from self._scan(stamp)

    def _scan(self, stamp: Stamp) -> Messages:
        scans = self.robot.scans()
        for topic, scan in zip(self._scans, scans, strict=True):
            yield topic, scan.as_ros(scan.laser, scan_time=self.interval)
        if self._mapper is None:
            return
        update_mapper(self._mapper, scans)
        if self.robot.time >= self._lines_due:
            lines = self._mapper.map
            marker = ros.line_marker(lines.segments, self._tracker.follow(lines), stamp)
            self._lines_due = self.robot.time + LINES_EVERY
            yield LINES, {"markers": [marker]}

    def command(self, speed: float, turning: float, sideways: float = 0.0) -> None:
        """Obey a command [m/s], [rad/s] until the next one, or until the time-out."""
        if not is_finite(speed, turning, sideways):
            self._stop(f"command ({speed:g}, {turning:g}): not finite; the robot stops")
            return
        if sideways:
            self.say("warning", "linear.y is ignored: this robot cannot drive sideways")
        self._command = (
            float(np.clip(speed, -FASTEST, FASTEST)),
            float(np.clip(turning, -FASTEST_TURN, FASTEST_TURN)),
        )
        self._until = self.robot.time + (self.settings.cmd_timeout or inf)

    def _stop(self, why: str) -> None:
        if any(self._command):
            self.say("warning", why)
        self._command, self._until = (0.0, 0.0), inf

    def set_pose(self, frame: str, pose: tuple[float, float, float]) -> None:
        """Put the robot at a pose in ``map`` or ``odom``; report an invalid one."""
        try:
            if frame not in ("", ros.MAP, ros.WORLD):
                raise InputError(f"frame {frame!r}: expected {ros.MAP} or {ros.WORLD}")
            asked = as_pose(pose)
            if frame == ros.WORLD:
                # The odometry's frame has drifted.
                odometry = Pose(*self.robot.odometry.tolist())
                asked = self.robot.pose @ odometry.inverse() @ asked
            self.robot.place(asked)
        except InputError as error:
            self.say("error", f"set_pose: {error}; ignored")
            return
        self.say("info", f"set_pose: the robot is at {asked}")

    def reset(self) -> None:
        """Put the robot back to its start; time goes on."""
        self._command = (0.0, 0.0)
        self.robot.restart()

    def step(self) -> Messages:
        """One interval between two scans, also while time is paused."""
        for _ in range(self.ticks):
            yield from self.tick()
