"""Steering: a controller decides after each scan how the robot drives on."""

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol, TypeGuard

import numpy as np

from lrf3d.base.errors import CollisionError, InputError, shown
from lrf3d.casting.collision import Body, CollisionChecker
from lrf3d.geometry.lines import Float, is_finite, number, numbers
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser import LaserScan
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.kinematics import Twist
from lrf3d.simulation.driven import Driven


class Controller(Protocol):
    """Anything that decides after each scan how the robot drives."""

    def command(self, time: float, pose: Pose, scan: Any) -> Sequence[float] | None:
        """Speed [m/s] and turn rate [rad/s] up to the next scan, or None to end the drive.

        The scan is a LaserScan, or a tuple of those of several lasers. Another robot than a
        unicycle has other commands, such as the speeds of its wheels.
        """


class Robot(Protocol):
    """How a robot moves by its commands: a Unicycle, or one of `lrf3d.robot.kinematics`."""

    # What a command consists of, in words.
    commands: ClassVar[str]

    def twist(self, *command: float) -> Twist:
        """Speeds ahead and to the left [m/s], and about itself [rad/s]."""

    def move(self, pose: Sequence[float], *command_and_duration: float) -> Pose:
        """Where the robot is after it held a command for a time [s]."""


class ControlledDrive:
    """The drive of a controller; each command is held until the next scan, as an exact arc.

    The interval is the time between two scans [s], of which each takes the time of a sweep [s]; the
    command comes at its end, and is held to the end of the next. Without a checker the robot drives
    through everything. Where it touches something, the drive is an error, or with ``stops`` it
    rests there up to the next scan.
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
        self.sweep = sweep
        self.robot: Any = Unicycle() if robot is None else robot
        self.controller = controller
        self.body = None if checker is None else body
        self._stops = stops
        self.interval = number(interval, "scan_interval", "seconds", positive=True)
        self.start = as_pose(start)
        self.driven = Driven(self.start, 0.0, body, checker)
        self.at = self.driven.at
        self.goes_on = True
        self._commands = 0

    def after(self, scan: LaserScan | Sequence[LaserScan]) -> None:
        """Get the next command of the controller, and drive."""
        driven = self.driven
        if self.sweep:
            driven.go_on(driven.time + self.sweep)
        try:
            command = self.controller.command(driven.time, driven.pose, scan)
        except (AttributeError, TypeError) as error:
            if isinstance(scan, tuple):
                error.add_note(f"controller: its scan is a tuple of {len(scan)}, one of each laser")
            raise
        if command is None:
            self.goes_on = False
            driven.rest()
            return
        values, twist = self._understood(command)
        self._commands += 1
        time = self._commands * self.interval
        seconds = time - driven.time if self.sweep else self.interval
        end = self.robot.move(driven.pose, *values, seconds)
        collision = driven.hold(twist, seconds, ahead=self.sweep, end=end)
        if collision is not None and not self._stops:
            raise CollisionError(f"{collision}; the controller drove it there")
        # Time is counted, not summed.
        driven.time = time

    def _understood(self, command: Sequence[float]) -> tuple[list[float], Twist]:
        """The numbers of a command, and the twist of the robot."""
        try:
            values = [float(value) for value in command]
            if not is_finite(*values):
                raise ValueError
            return values, self.robot.twist(*values)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"controller: the command {shown(command)} at t = {self.driven.time:g} s is"
                f" invalid; expected {self.robot.commands} as finite numbers, or None to end"
            ) from None


def is_controller(drive: object) -> TypeGuard[Controller]:
    """Whether a drive is a controller rather than a trajectory or its poses."""
    return callable(getattr(drive, "command", None))


def as_drive(drive: Any) -> Trajectory | Controller:
    """A controller or a Trajectory as it is, or the one through poses (k, 3) a second apart."""
    if isinstance(drive, Trajectory) or is_controller(drive):
        return drive
    poses = numbers(drive, "poses")
    return Trajectory(np.arange(len(np.atleast_1d(poses))), poses)
