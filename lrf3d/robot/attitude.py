"""Attitude: how a drive tilts its robot, and with it the sensors that it carries.

The motion of a robot enters; pitch and roll leave. Both are right-handed [rad]: a positive pitch
lowers the front, a positive roll raises the left side. The robot's place stays on the floor.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Float, Radians, Value, as_rows, number
from lrf3d.robot.odometry import Motion

# The pitch and the roll of a robot on even ground [rad].
LEVEL = (0.0, 0.0)

# [rad] Largest tilt; degrees that are given as radians are mostly larger.
STEEPEST = 1.2

# [rad] Largest tilt by acceleration, at which springs are compressed.
STOP = 0.15


@dataclass(frozen=True, eq=False)
class Attitude(Value):
    """The pitch and roll of a robot along its drive: the sum of a constant, a profile and a sway.

    Args:
        pitch: Constant pitch [rad]; where it is positive, the robot looks down.
        roll: Constant roll [rad]; where it is positive, its left side is raised.
        sway: Tilt by acceleration [rad per m/s²], up to 0.15 rad: the front rises when it speeds
            up and dips when it brakes, and in curves it leans outwards.
        profile: (k, 3) distances along the drive [m], ascending, with the pitch and the roll there
            [rad]; linear in between, and constant before and after.

    Raises:
        InputError: An angle is over 1.2 rad, or the distances do not ascend.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.World([[3, -9, 3, 9]])
        >>> down = lrf3d.Attitude(pitch=0.5)
        >>> step = next(iter(lrf3d.Simulation(room, [(0, 0, 0)], attitude=down)))
        >>> round(float(step.scan.ranges[90]), 3)  # To the floor, 0.5 m / tan(0.5).
        0.915
    """

    pitch: Radians = 0.0
    roll: Radians = 0.0
    sway: Radians = 0.0
    profile: Float = ((0.0, *LEVEL),)  # type: ignore[assignment]  # It becomes an array.

    def __post_init__(self) -> None:
        self._hold("profile")
        rows = as_rows(self.profile, "attitude: profile", 3)
        if not (np.diff(rows[:, 0]) > 0.0).all():
            raise InputError("attitude: profile: expected ascending distances [m]")
        for angle in (self.pitch, self.roll, self.sway, *rows[:, 1:].ravel().tolist()):
            number(angle, "attitude: angle", "radians", least=-STEEPEST, most=STEEPEST)

    def at(self, motion: Motion) -> tuple[float, float]:
        """Pitch and roll [rad] of a robot in motion."""
        along, *angles = self.profile.T
        pitch, roll = (float(np.interp(motion.distance, along, angle)) for angle in angles)
        ahead, left = np.clip(self.sway * motion.pull, -STOP, STOP).tolist()
        return self.pitch + pitch - ahead, self.roll + roll + left


class Tilting:
    """An attitude along a drive, one moment after the other; without one it stays level."""

    def __init__(self, attitude: Attitude | None) -> None:
        self._attitude = attitude
        self._motion: Motion | None = None

    def drive(self, time: float, pose: Float) -> tuple[float, float]:
        """Pitch and roll [rad] at a time [s], where the robot is at a pose (3,)."""
        if self._attitude is None:
            return LEVEL
        last = self._motion
        pose = np.array(pose)
        self._motion = Motion(time, pose) if last is None else last.on_to(time, pose)
        return self._attitude.at(self._motion)
