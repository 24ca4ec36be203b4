"""Steering: a controller decides after each scan how the robot drives on."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from lrf3d.collision import Body, Collision, CollisionChecker
from lrf3d.errors import CollisionError, InputError, shown
from lrf3d.geometry import Float, is_finite, number, numbers
from lrf3d.laser import LaserScan
from lrf3d.pose import Pose, as_pose
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.unicycle import Twist, hold


class Controller(Protocol):
    """Anything that decides after each scan how the robot drives."""

    def command(self, time: float, pose: Pose, scan: Any) -> tuple[float, float] | None:
        """Speed [m/s] and turn rate [rad/s] up to the next scan, or None to end the drive.

        The scan is a LaserScan, or a tuple of those of several lasers.
        """
        ...


class ControlledDrive:
    """The drive of a controller; each command is held until the next scan, as an exact arc.

    The interval is the time between two scans [s]; a robot without a body drives through all. Where
    the body touches something, the drive is an error, or with ``stops`` the robot rests there up
    to the next scan; ``collision`` is that of the last command, or None.
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
    ) -> None:
        self.controller, self.body, self._checker, self._stops = controller, body, checker, stops
        self.interval = number(interval, "scan_interval", "seconds", positive=True)
        self.start = self.pose = as_pose(start)
        self.time, self.goes_on = 0.0, True
        self.collision: Collision | None = None
        self.twist: Twist = (0.0, 0.0, 0.0)
        self.since = 0.0, self.pose
        """When the twist began [s], and where."""
        self._commands = 0

    def after(self, scan: LaserScan | Sequence[LaserScan]) -> None:
        """Get the next command of the controller, and drive."""
        self.since = time, start = self.time, self.pose
        self.collision = None
        command = self.controller.command(time, start, scan)
        if command is None:
            self.goes_on, self.twist = False, (0.0, 0.0, 0.0)
            return
        try:
            v, omega = (float(value) for value in command)
        except (TypeError, ValueError, OverflowError):
            v = omega = np.nan
        if not is_finite(v, omega):
            raise InputError(
                f"controller: the command {shown(command)} at t = {time:g} s is invalid; expected"
                " speed [m/s] and turn rate [rad/s] as two finite numbers, or None to end"
            )
        self._commands += 1
        self.time = self._commands * self.interval
        self.pose = Unicycle().move(start, v, omega, self.interval)
        self.twist = v, 0.0, omega
        if self.body is None or self._checker is None:
            return
        held = start, self.twist, time, self.interval
        self.collision = self._checker.held(self.body, *held)
        if self.collision is not None and not self._stops:
            raise CollisionError(f"{self.collision}; the controller drove it there")
        if self.collision is not None:
            self.pose = hold(start, self.twist, self.collision.time - time)


def trajectory_of(drive: Any) -> Trajectory:
    """A Trajectory, or that through poses (k, 3) a second apart."""
    if isinstance(drive, Trajectory):
        return drive
    poses = numbers(drive, "poses")
    return Trajectory(np.arange(len(np.atleast_1d(poses))), poses)
