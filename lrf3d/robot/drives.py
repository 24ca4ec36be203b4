"""Drives beside the unicycle: what a robot's wheels are commanded, as the speeds of its body.

A command enters; a twist leaves, speeds ahead and to the left [m/s] and the turn rate [rad/s]. All
of these drives hold a twist as long as their command stays, so that their paths are exact arcs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from lrf3d.errors import InputError, shown
from lrf3d.geometry import is_finite, number
from lrf3d.pose import Pose, as_pose
from lrf3d.robot.unicycle import Twist, hold

STEEPEST = math.radians(85.0)
"""Largest steering angle [rad]: at 90° a car would turn about its own rear axle."""


def checked(name: str, *command: float) -> None:
    """Check that a command that comes from outside is finite numbers."""
    if not is_finite(*command):
        raise InputError(f"{name} {shown(command)}: expected finite numbers")


def moved(twist: Twist, pose: Sequence[float], seconds: float) -> Pose:
    """Where a robot is after it held a twist for some seconds."""
    checked("move", *twist, seconds)
    return hold(as_pose(pose), twist, seconds)


@dataclass(frozen=True, slots=True)
class DifferentialDrive:
    """Two wheels on one axle, each with its own motor; commands are their speeds.

    Args:
        track: Distance between the wheels [m].
        radius: Radius of the wheels [m], for speeds in rad/s; 1 for speeds in m/s.

    Examples:
        >>> import lrf3d
        >>> robot = lrf3d.DifferentialDrive(track=0.5)
        >>> robot.twist(1.0, 1.5)
        (1.25, 0.0, 1.0)
    """

    track: float
    radius: float = 1.0
    commands: ClassVar[str] = "speeds of the left and the right wheel"

    def __post_init__(self) -> None:
        for name in ("track", "radius"):
            number(getattr(self, name), f"differential drive: {name}", "metres", positive=True)

    def twist(self, left: float, right: float) -> Twist:
        """The twist at speeds of the left wheel and of the right one."""
        checked("differential drive:", left, right)
        return (
            0.5 * self.radius * (left + right), 0.0, self.radius * (right - left) / self.track
        )  # fmt: skip

    def move(self, pose: Sequence[float], left: float, right: float, duration: float) -> Pose:
        """Where the robot is after it held the wheels' speeds for a time [s]."""
        return moved(self.twist(left, right), pose, duration)


@dataclass(frozen=True, slots=True)
class AckermannDrive:
    """A car: commands are the speed of the rear axle [m/s] and the steering angle [rad].

    The pose is that of the middle of the rear axle.

    Args:
        wheelbase: Distance between the axles [m].
        most: Largest steering angle [rad]; larger ones are limited to it.

    Examples:
        >>> import lrf3d
        >>> import math
        >>> car = lrf3d.AckermannDrive(wheelbase=2.0)
        >>> ahead, left, turn = car.twist(3.0, math.atan(0.5))
        >>> round(turn, 6)
        0.75
    """

    wheelbase: float
    most: float = math.radians(45.0)
    commands: ClassVar[str] = "speed [m/s] and steering angle [rad]"

    def __post_init__(self) -> None:
        number(self.wheelbase, "ackermann drive: wheelbase", "metres", positive=True)
        number(self.most, "ackermann drive: most", "radians", positive=True, most=STEEPEST)

    def twist(self, speed: float, steering: float) -> Twist:
        """The twist at a speed and a steering angle, positive to the left."""
        checked("ackermann drive:", speed, steering)
        angle = min(max(steering, -self.most), self.most)
        return speed, 0.0, speed * math.tan(angle) / self.wheelbase

    def move(self, pose: Sequence[float], speed: float, steering: float, duration: float) -> Pose:
        """Where the car is after it held speed and steering for a time [s]."""
        return moved(self.twist(speed, steering), pose, duration)


@dataclass(frozen=True, slots=True)
class OmniDrive:
    """A robot on wheels that roll to all sides; commands are its twist.

    Examples:
        >>> import lrf3d
        >>> lrf3d.OmniDrive().move((0, 0, 0), 0.0, 1.0, 0.0, 2.0).y
        2.0
    """

    commands: ClassVar[str] = "speeds ahead and to the left [m/s] and turn rate [rad/s]"

    def twist(self, ahead: float, left: float, turn: float) -> Twist:
        """The twist itself."""
        checked("omni drive:", ahead, left, turn)
        return ahead, left, turn

    def move(
        self, pose: Sequence[float], ahead: float, left: float, turn: float, duration: float
    ) -> Pose:
        """Where the robot is after it held a twist for a time [s]."""
        return moved((ahead, left, turn), pose, duration)
