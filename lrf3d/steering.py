"""Steering: a controller decides after each scan how the robot drives on."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from lrf3d.errors import CollisionError, InputError, shown
from lrf3d.geometry import Float, is_finite, number
from lrf3d.laser import LaserScan
from lrf3d.pose import Pose, as_pose
from lrf3d.robot import Trajectory, Unicycle
from lrf3d.robot.collision import CollisionChecker
from lrf3d.robot.unicycle import arcs
from lrf3d.world import World

CHORD_ERROR = 0.001
"""Largest distance [m] between an arc and the chords that are checked for collisions."""

MOST_CHORDS = 10_000
"""Largest number of chords of one arc: only a faulty controller spins faster."""


class Controller(Protocol):
    """Anything that decides after each scan how the robot drives."""

    def command(self, time: float, pose: Pose, scan: LaserScan) -> tuple[float, float] | None:
        """Speed [m/s] and turn rate [rad/s] up to the next scan, or None to end the drive."""
        ...


class ControlledDrive:
    """The drive of a controller; each command is held until the next scan, as an exact arc.

    The interval is the time between two scans [s]; a robot without a radius [m] drives through
    walls.
    """

    def __init__(
        self,
        controller: Controller,
        start: Sequence[float] | Float,
        interval: float,
        world: World,
        radius: float | None,
    ) -> None:
        self.controller = controller
        self.interval = number(interval, "scan_interval", "seconds", positive=True)
        self.start = self.pose = as_pose(start)
        self.goes_on = True
        self.radius = radius
        self._robot = Unicycle()
        self._checker = None if radius is None else CollisionChecker(world)
        self._index = 0

    def after(self, scan: LaserScan) -> None:
        """Get the next command of the controller, and drive."""
        time = self._index * self.interval
        self._index += 1
        command = self.controller.command(time, self.pose, scan)
        if command is None:
            self.goes_on = False
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
        before, self.pose = self.pose, self._robot.move(self.pose, v, omega, self.interval)
        if self._checker is not None and self.radius is not None:
            path = self._chords(time, before, v, omega)
            collision = self._checker.first(path, self.radius)
            if collision is not None:
                raise CollisionError(f"{collision}; the controller drove it there")

    def _chords(self, time: float, start: Pose, v: float, omega: float) -> Trajectory:
        """The arc up to the next scan as chords within `CHORD_ERROR` of it."""
        # The sagitta of a chord over a time t is |v·ω|·t²/8.
        chords = self.interval * np.sqrt(abs(v) * abs(omega) / (8.0 * CHORD_ERROR))
        count = int(np.clip(np.ceil(chords), 1, MOST_CHORDS))
        shares = np.linspace(0.0, 1.0, count + 1)
        begin, ones = np.tile(start, (count + 1, 1)), np.ones(count + 1)
        poses = arcs(begin, v * ones, omega * ones, shares * self.interval)
        return Trajectory(time + shares * self.interval, poses)
