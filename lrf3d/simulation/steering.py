"""Steering: a controller decides after each scan how the robot drives on."""

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

import numpy as np

from lrf3d.base.errors import CollisionError, InputError, shown
from lrf3d.casting.collision import Body, Collision, CollisionChecker
from lrf3d.geometry.lines import Float, is_finite, number, numbers
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser import LaserScan
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.kinematics import Twist, hold


class Controller(Protocol):
    """Anything that decides after each scan how the robot drives."""

    def command(self, time: float, pose: Pose, scan: Any) -> Sequence[float] | None:
        """Speed [m/s] and turn rate [rad/s] up to the next scan, or None to end the drive.

        The scan is a LaserScan, or a tuple of those of several lasers. Another robot than a
        unicycle has other commands, such as the speeds of its wheels.
        """
        ...


class Robot(Protocol):
    """How a robot moves by its commands: a Unicycle, or one of `lrf3d.robot.kinematics`."""

    commands: ClassVar[str]
    """What a command consists of, in words."""

    def twist(self, *command: float) -> Twist:
        """Speeds ahead and to the left [m/s], and about itself [rad/s]."""
        ...

    def move(self, pose: Sequence[float], *command_and_duration: float) -> Pose:
        """Where the robot is after it held a command for a time [s]."""
        ...


class ControlledDrive:
    """The drive of a controller; each command is held until the next scan, as an exact arc.

    The interval is the time between two scans [s], of which each takes the time of a sweep [s]; the
    command comes at its end, and is held to the end of the next. A robot without a body drives
    through all. Where it touches something, the drive is an error, or with ``stops`` the robot
    rests there up to the next scan; ``collision`` is that of the last command, or None.
    """

    def __init__(
        self,
        controller: Controller,
        start: Sequence[float] | Float,
        interval: float,
        checker: CollisionChecker | None,
        body: Body | None,
        *,
        stops: bool = False,
        sweep: float = 0.0,
        robot: Robot | None = None,
    ) -> None:
        self._sweep = sweep
        self.robot: Any = Unicycle() if robot is None else robot
        self.controller = controller
        self.body = body
        self._checker = checker
        self._stops = stops
        self.interval = number(interval, "scan_interval", "seconds", positive=True)
        self.start = self.pose = as_pose(start)
        self.time = 0.0
        self.goes_on = True
        self.collision: Collision | None = None
        self.twist: Twist = (0.0, 0.0, 0.0)
        self.since = 0.0, self.pose
        """When the twist began [s], and where."""
        self._commands = 0

    def after(self, scan: LaserScan | Sequence[LaserScan]) -> None:
        """Get the next command of the controller, and drive."""
        time = self.time
        start = self.pose
        if self._sweep:
            time += self._sweep
            start = Pose(*self.at(np.array([time]))[0].tolist())
        self.since = time, start
        self.collision = None
        command = self.controller.command(time, start, scan)
        if command is None:
            self.goes_on = False
            self.twist = (0.0, 0.0, 0.0)
            return
        try:
            values = [float(value) for value in command]
            if not is_finite(*values):
                raise ValueError
            self.twist = self.robot.twist(*values)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"controller: the command {shown(command)} at t = {time:g} s is invalid; expected"
                f" {self.robot.commands} as finite numbers, or None to end"
            ) from None
        self._commands += 1
        self.time = self._commands * self.interval
        seconds = self.time - time if self._sweep else self.interval
        self.pose = self.robot.move(start, *values, seconds)
        if self.body is None or self._checker is None:
            return
        held = start, self.twist, time, self.interval
        self.collision = self._checker.held(self.body, *held)
        if self.collision is not None and not self._stops:
            raise CollisionError(f"{self.collision}; the controller drove it there")
        if self.collision is not None and self.collision.time < self.time:
            self.pose = hold(start, self.twist, self.collision.time - time)

    def at(self, times: Float) -> Float:
        """Poses (n, 3) at times (n,) [s] of a scan that begins now: on along the arc of before."""
        end = np.inf if self.collision is None else self.collision.time
        held = np.maximum(np.minimum(times, end) - self.time, 0.0)
        return np.array([hold(self.pose, self.twist, seconds) for seconds in held.tolist()])


def trajectory_of(drive: Any) -> Trajectory:
    """A Trajectory, or that through poses (k, 3) a second apart."""
    if isinstance(drive, Trajectory):
        return drive
    poses = numbers(drive, "poses")
    return Trajectory(np.arange(len(np.atleast_1d(poses))), poses)
