"""Live robots for any middleware: what they publish, the commands that they obey, and time.

Commands enter; messages leave as CDR. Time advances in ticks; stamps are exact multiples of the
interval between two scans, and never run back.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, cos, inf, sin
from pathlib import Path
from time import monotonic
from typing import Any, Literal, NamedTuple

import numpy as np

from lrf3d.base.errors import InputError, check_names, expect, missing_extra
from lrf3d.base.interrupts import asked
from lrf3d.geometry.lines import ROUNDING, Float, is_finite, number, whole_number
from lrf3d.geometry.pose import Pose, as_pose, between
from lrf3d.laser import Stamp
from lrf3d.laser.cloud_sensors import CloudSensors
from lrf3d.mapping.tracking import ObjectTracker
from lrf3d.messages import ros
from lrf3d.messages.clouds import cloud_messages, cloud_topics, mount_transforms
from lrf3d.messages.robot_model import urdf, wheels_of
from lrf3d.messages.ros import ODOMETRY, SCAN, TRANSFORMS, made
from lrf3d.robot import OmniDrive
from lrf3d.robot.odometry import WheelOdometry, twist_of
from lrf3d.simulation.live import LiveRobot, live_fleet
from lrf3d.simulation.loop import line_mapper
from lrf3d.simulation.scenario import Scenario

# Simulated time from one line map to the next [s].
LINES_EVERY = 1.0

# Commands beyond are clipped [m/s], [rad/s]: no robot with a laser is faster.
FASTEST = 20.0

# Longest tick [s]: clock, transforms and odometry come at 50 Hz of simulated time or more.
LONGEST_TICK = 0.02

# Least side of a cell of the published grid [m]: a whole city is then some megabytes.
FINEST_CELL = 0.1

# How far a tick may be behind [s] before the time that is lost counts as a standstill.
LATE = 0.25

# Wall time from one check of the pace to the next [s].
PACE_CHECKED_EVERY = 2.0

# Share of the asked speed below which a warning says that the robot is behind.
FULL_SPEED = 0.97

# The command of a robot at rest.
REST = (0.0, 0.0, 0.0)

# Scans mapped before the clock starts: all kernels of the mapper are compiled by the third.
REHEARSED_SCANS = 3

# Reports a message at a level: ``info``, ``warning`` or ``error``.
Say = Callable[[str, str], None]


class Topic(NamedTuple):
    """A topic with its type, the depth of its queue, and whether late subscribers get the last."""

    name: str
    type: str
    depth: int = 5
    latched: bool = False


Messages = Iterator[tuple[Topic, ros.Fields]]
Encoded = Iterator[tuple[Topic, bytes]]

MARKERS = "visualization_msgs/msg/MarkerArray"
START = "geometry_msgs/msg/PoseWithCovarianceStamped"
MOVING = Topic("tf", TRANSFORMS, depth=100)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", depth=1)
FIXED = Topic("tf_static", TRANSFORMS, depth=1, latched=True)
GRID = Topic("map", "nav_msgs/msg/OccupancyGrid", depth=1, latched=True)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a robot that is served.

    Args:
        rate: Scans per second; that of the scenario if not given.
        speed_up: Simulated seconds per second; 0 means as fast as possible.
        give: What is published of the truth: ``pose`` (the map and the robot in it), ``map`` or
            ``none``.
        wheels: Odometry with the errors of wheels, by default ones if the world file gives none.
        cmd_timeout: Simulated time after the last command at which the robot stops [s]; 0 means
            never.
        namespace: Namespace of the topics.
        robots: Number of robots; the topics and frames of several begin with robot1, robot2, ….
        clock: Publish the simulated time.
        lines: Map while driving, and publish the line map.
        odom_tf: Publish the transforms of the odometry; without them another program estimates it.
        commands: The type of cmd_vel: ``Twist``, ``TwistStamped`` or ``both``.
        rng: Seed of the noise.
    """

    rate: float | None = None
    speed_up: float = 1.0
    give: Literal["pose", "map", "none"] = "pose"
    wheels: bool = False
    cmd_timeout: float = 0.5
    namespace: str = ""
    robots: int = 1
    clock: bool = True
    lines: bool = False
    odom_tf: bool = True
    commands: Literal["both", "Twist", "TwistStamped"] = "both"
    rng: int = 0

    def __post_init__(self) -> None:
        number(self.speed_up, "speed_up")
        number(self.cmd_timeout, "cmd_timeout", "seconds")
        whole_number(self.robots, "robots")
        if self.rate is not None:
            number(self.rate, "rate", "scans per second", positive=True)
        check_names("give", [self.give], ("pose", "map", "none"))
        check_names("commands", [self.commands], ("both", "Twist", "TwistStamped"))
        expect(self.namespace, str, "namespace")


class DrivenRobot:
    """A robot that is driven by commands, and publishes its measurements.

    The prefix, such as ``robot1/``, precedes its topics and frames; a tick takes a time [s].
    """

    def __init__(
        self,
        robot: LiveRobot,
        scenario: Scenario,
        settings: Settings,
        *,
        say: Say,
        prefix: str,
        tick: float,
    ) -> None:
        self.robot = robot
        self.prefix = prefix
        self.tick = tick
        self._say = say
        self._settings = settings
        lasers = scenario.lasers
        self._mapper = line_mapper(scenario.noise, **scenario.mapper) if settings.lines else None
        self._tracker = ObjectTracker()
        self._lines_due = LINES_EVERY
        # The command that the robot holds [m/s], [rad/s], and until when [s].
        self.held = REST
        self._until = inf
        self._scans = [
            Topic(prefix + ("scan" if len(lasers) == 1 else f"scan_{lrf.name}"), SCAN)
            for lrf in lasers
        ]
        self._odom = Topic(f"{prefix}odom", ODOMETRY)
        self._truth = Topic(f"{prefix}ground_truth", ODOMETRY)
        self._imu = Topic(f"{prefix}imu", "sensor_msgs/msg/Imu", depth=50)
        self._lines = Topic(f"{prefix}map_objects", MARKERS, depth=1, latched=True)
        self._model = Topic(f"{prefix}robot_description", "std_msgs/msg/String", 1, latched=True)
        self._begins = Topic(f"{prefix}start_pose", START, depth=1, latched=True)
        self._joints = Topic(f"{prefix}joint_states", "sensor_msgs/msg/JointState")
        self.topics = [
            *self._scans, self._odom, self._truth, MOVING, self._model, self._begins, self._joints,
        ]  # fmt: skip
        self.topics += [self._imu] * (scenario.imu is not None) + [self._lines] * settings.lines
        self.sensors = CloudSensors.of(scenario.lidars, scenario.depth_cameras, scenario.noise)
        self._clouds = {
            name: Topic(prefix + name, kind) for name, kind in cloud_topics(self.sensors).items()
        }
        self.topics += self._clouds.values()
        # Variances of the gyro and of the accelerometers.
        self._variances = (0.0, 0.0) if scenario.imu is None else scenario.imu.variances
        # The wheels, and how far they have turned [rad].
        self._wheels = wheels_of(scenario.radius)
        self._turned = [0.0 for _ in self._wheels]
        self._urdf = urdf(scenario.radius, lasers, prefix=prefix)
        # Frames, poses and heights [m] of links that are fixed to the robot.
        base = prefix + ros.BASE
        self.mounts = [(base, prefix + lrf.name, lrf.mount, lrf.height) for lrf in lasers]
        self.mounts.append((base, prefix + ros.FOOTPRINT, Pose(0.0, 0.0, 0.0), 0.0))

    def first(self, stamp: Stamp) -> Messages:
        """Messages that are published once: the robot's model and its start."""
        yield self._model, {"data": self._urdf}
        header = ros.header_fields(stamp, ros.MAP)
        yield self._begins, {"header": header, "pose": ros.pose_fields(self.robot.start)}

    def show(self) -> None:
        """Show the other robots how this one drives from now on."""
        if self.robot.time >= self._until:
            self._stop("no command for a while: the robot stops")
        self.robot.show(*self.held)

    def messages(self, stamp: Stamp, *, scan_time: float | None) -> Messages:
        """Where the robot is, and, if the time from scan to scan [s] is given, its scans."""
        robot = self.robot
        prefix = self.prefix
        odometry = robot.odometry
        world = prefix + ros.WORLD
        moved = [ros.transform(stamp, world, prefix + ros.BASE, odometry)] * self._settings.odom_tf
        if self._settings.give == "pose" and moved:
            drift = robot.pose @ odometry.inverse()
            moved.append(ros.transform(stamp, ros.MAP, world, drift))
        moved += self._wheel_frames(stamp)
        yield MOVING, {"transforms": moved}
        for at, *measured in robot.imu().tolist():
            yield self._imu, ros.imu_fields(Stamp.of(at), measured, self._variances, prefix=prefix)
        speed = [robot.speed, robot.turning]
        belief = robot.belief
        sure: tuple[Float | None, Float | None] = (None, None)
        if belief is not None:
            twist = np.array([robot.speed, 0.0, robot.turning])
            sure = belief.covariance, belief.twist_covariance(twist, self.tick)
        yield (
            self._odom,
            ros.odometry(stamp, odometry, speed, frame=world, prefix=prefix, covariances=sure),
        )
        yield self._truth, ros.odometry(stamp, robot.pose, speed, frame=ros.MAP, prefix=prefix)
        yield (
            self._joints,
            {
                "header": ros.header_fields(stamp, ""),
                "name": [prefix + each.joint for each in self._wheels],
                "position": self._turned,
            },
        )
        if scan_time is None:
            return
        scans = robot.scans()
        for topic, scan in zip(self._scans, scans, strict=True):
            yield topic, scan.as_ros(prefix + scan.laser, scan_time=scan_time)
        for name, fields in cloud_messages(*robot.clouds(), stamp, prefix):
            yield self._clouds[name], fields
        if self._mapper is None:
            return
        self._mapper.update(scans)
        if robot.time >= self._lines_due:
            lines = self._mapper.map
            self._lines_due = robot.time + LINES_EVERY
            marker = ros.line_marker(lines.segments, self._tracker.follow(lines), stamp)
            yield self._lines, {"markers": [marker]}

    def drive(self) -> None:
        """Drive by one tick with the last command."""
        before = self.robot.pose
        self.robot.drive(self.tick, *self.held)
        ahead, _, turn = twist_of(between(np.array(before), np.array(self.robot.pose))).tolist()
        pairs = zip(self._turned, self._wheels, strict=True)
        self._turned = [angle + wheel.angle(ahead, turn) for angle, wheel in pairs]

    def _wheel_frames(self, stamp: Stamp) -> list[ros.Fields]:
        frames = []
        for wheel, angle in zip(self._wheels, self._turned, strict=True):
            name = self.prefix + wheel.name
            where = ros.place(0.0, wheel.left, wheel.radius)
            # Wheels turn about their axis, which points to the left.
            rotation = {"x": 0.0, "y": sin(0.5 * angle), "z": 0.0, "w": cos(0.5 * angle)}
            frames.append(ros.turned(stamp, self.prefix + ros.BASE, name, where, rotation))
        return frames

    def obey(self, message: Any) -> None:
        """Obey a Twist or a TwistStamped."""
        twist = getattr(message, "twist", message)
        self.command(twist.linear.x, twist.angular.z, twist.linear.y)

    def command(self, speed: float, turning: float, sideways: float = 0.0) -> None:
        """Obey a command [m/s], [rad/s] until the next one, or until the time-out."""
        if not is_finite(speed, turning, sideways):
            self._stop(f"command ({speed:g}, {turning:g}): not finite; the robot stops")
            return
        if sideways and not isinstance(self.robot.moves, OmniDrive):
            self._say("warning", "linear.y is ignored: this robot cannot drive sideways")
        asked = (speed, turning, sideways)
        speed, turning, sideways = (max(-FASTEST, min(FASTEST, float(each))) for each in asked)
        self.held = speed, turning, sideways
        self._until = self.robot.time + (self._settings.cmd_timeout or inf)

    def _stop(self, why: str) -> None:
        if any(self.held):
            self._say("warning", self.prefix + why)
        self.held = REST
        self._until = inf

    def set_pose(self, frame: str, pose: tuple[float, float, float]) -> None:
        """Put the robot at a pose in ``map`` or ``odom``; report an invalid one."""
        own = self.prefix + ros.WORLD
        try:
            if frame not in ("", ros.MAP, own):
                raise InputError(f"frame {frame!r}: expected {ros.MAP} or {own}")
            asked = as_pose(pose)
            if frame == own:
                # The odometry's frame has drifted.
                asked = self.robot.pose @ self.robot.odometry.inverse() @ asked
            self.robot.carry(asked)
        except InputError as error:
            self._say("error", f"set_pose: {error}; ignored")
        else:
            self._say("info", f"set_pose: the robot is at {asked}")

    def reset(self) -> None:
        """Put the robot back to its start."""
        self.held = REST
        self.robot.restart()


class Stream:
    """Live robots in a world, and the messages that they publish.

    Calls are made from one thread; ``say`` reports what users should know.
    """

    def __init__(self, scenario: Scenario, settings: Settings, say: Say) -> None:
        try:
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise missing_extra("live topics need rosbags", "ros") from None
        # The messages that are used have not changed since.
        self.types = get_typestore(Stores.ROS2_HUMBLE)
        self.scenario = scenario
        self.settings = settings
        self.say = say
        self.paused = False
        self._count = 0
        self.interval = scenario.scan_interval if settings.rate is None else 1.0 / settings.rate
        # Number of ticks from scan to scan; rounding must not add one.
        self.ticks = ceil(self.interval / LONGEST_TICK - ROUNDING)
        wheels = scenario.odometry or (WheelOdometry() if settings.wheels else None)
        robots = live_fleet(scenario, settings.robots, rng=settings.rng, wheels=wheels)
        self.robots = [
            DrivenRobot(
                robot,
                scenario,
                settings,
                say=say,
                prefix=f"robot{k}/" if len(robots) > 1 else "",
                tick=self.interval / self.ticks,
            )
            for k, robot in enumerate(robots, 1)
        ]
        self._rehearse()
        given = {CLOCK: settings.clock, GRID: settings.give != "none", FIXED: True}
        own = [topic for robot in self.robots for topic in robot.topics]
        # All topics that are published.
        self.topics = [topic for topic, wanted in given.items() if wanted] + [*dict.fromkeys(own)]

    def _rehearse(self) -> None:
        """Compile kernels and build search trees before the clock starts."""
        robot = self.robots[0].robot
        scans = robot.scans()
        robot.touched(robot.pose, REST, 0.0)
        mapper = line_mapper(self.scenario.noise, **self.scenario.mapper)
        tracker = ObjectTracker()
        for _ in range(REHEARSED_SCANS * self.settings.lines):
            mapper.update(scans)
            tracker.follow(mapper.map)

    @property
    def stamp(self) -> Stamp:
        """The time of the last tick."""
        return Stamp.of(self.robots[0].robot.time)

    def encoded(self, messages: Messages) -> Encoded:
        """Messages as CDR."""
        for topic, fields in messages:
            message = made(self.types, topic.type, fields)
            yield topic, bytes(self.types.serialize_cdr(message, topic.type))

    def run(self, publish: Callable[[Encoded], None], serve: Callable[[float], None]) -> None:
        """Drive and publish until the program is interrupted; serve clients between two ticks.

        After a standstill of the program, such as a suspended machine, time does not hurry.
        """
        publish(self.encoded(self.first()))
        speed_up = self.settings.speed_up
        lost = 0.0
        tick = self.interval / self.ticks / speed_up if speed_up else 0.0
        due = checked = monotonic()
        while not asked():
            if not self.paused:
                publish(self.encoded(self.tick()))
            due = due + (LONGEST_TICK if self.paused else tick)
            now = monotonic()
            if now > due + LATE:
                lost = lost + now - due
                due = now
            serve(due - now)
            if (passed := now - checked) > PACE_CHECKED_EVERY:
                if speed_up and (share := 1.0 - lost / passed) < FULL_SPEED:
                    self.say("warning", f"behind: only {share:.2f} of the speed; scan less often")
                checked = now
                lost = 0.0

    def first(self) -> Messages:
        """Messages that are published once: robots, mounts of lasers, and the map if given."""
        mounts = [mount for robot in self.robots for mount in robot.mounts]
        fixed = [ros.transform(self.stamp, *mount) for mount in mounts]
        for robot in self.robots:
            fixed += mount_transforms(robot.sensors, self.stamp, robot.prefix)
        yield FIXED, {"transforms": fixed}
        for robot in self.robots:
            yield from robot.first(self.stamp)
        if GRID in self.topics:
            world = self.scenario.world
            yield GRID, ros.occupancy_grid(world, FINEST_CELL, self.stamp, Path(world.name))

    def tick(self) -> Messages:
        """Drive on by a tick, and publish where the robots are; scan where an interval ends."""
        if self._count:
            for robot in self.robots:
                robot.show()
            for robot in self.robots:
                robot.drive()
        scans = self._count % self.ticks == 0
        # Time is counted, not summed.
        now = self._count * self.interval / self.ticks
        self._count += 1
        for robot in self.robots:
            robot.robot.time = now
            robot.robot.show(0.0, 0.0)
        if self.settings.clock:
            yield CLOCK, {"clock": ros.time_fields(self.stamp)}
        for robot in self.robots:
            yield from robot.messages(self.stamp, scan_time=self.interval if scans else None)

    def step(self) -> Messages:
        """One interval between two scans, also while time is paused."""
        for _ in range(self.ticks):
            yield from self.tick()

    def reset(self) -> None:
        """Put the robots back to their starts; time goes on."""
        for robot in self.robots:
            robot.reset()
