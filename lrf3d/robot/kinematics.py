"""How robots move: the unicycle (Eq. 2 of Teslić et al.) and other drives, on exact arcs.

A command enters; a twist leaves, speeds ahead and to the left [m/s] and the turn rate [rad/s], that
is held as long as the command stays. `drive` takes inputs over time and returns a trajectory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, shown
from lrf3d.geometry.lines import ROUNDING, TINY, Float, is_finite, number, numbers
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.robot.trajectory import Trajectory

# Radius of the robot's round body [m] if none is given.
RADIUS = 0.35

# Largest number of poses of a drive.
MOST_POSES = 10_000_000

# Speeds ahead and to the left [m/s], and about itself [rad/s].
Twist = tuple[float, float, float]

# A speed over time: a number, one number for each time interval, or a function of time [s].
Input = float | ArrayLike | Callable[[float], float]


@dataclass(frozen=True, slots=True)
class Unicycle:
    """A robot that drives in the direction of its heading at v [m/s] and turns at ω [rad/s].

    Args:
        radius: Radius of the robot's round body [m].

    Examples:
        >>> import math
        >>> import lrf3d
        >>> end = lrf3d.Unicycle().move((0, 0, 0), v=math.pi / 2, omega=math.pi / 2, duration=1.0)
        >>> round(end.x, 6), round(end.y, 6), round(end.theta, 6)
        (1.0, 1.0, 1.570796)
    """

    radius: float = RADIUS
    commands: ClassVar[str] = "speed [m/s] and turn rate [rad/s]"

    def __post_init__(self) -> None:
        number(self.radius, "robot of radius", "metres")

    def derivative(self, state: Float, v: float, omega: float) -> Float:
        """Time derivative (3,) of the state x, y, theta (Eq. 2)."""
        return np.array([v * np.cos(state[2]), v * np.sin(state[2]), omega])

    def twist(self, v: float, omega: float) -> Twist:
        """The twist at v and ω."""
        return v, 0.0, omega

    def move(self, pose: Sequence[float], v: float, omega: float, duration: float) -> Pose:
        """Where the robot is after it held v and ω for a time [s]: the exact arc of Eq. 2."""
        finite("move", v, omega, duration)
        x, y, theta = as_pose(pose)
        half_turn = 0.5 * omega * duration
        chord = v * duration * sinc(half_turn / np.pi)
        middle = theta + half_turn
        return Pose(
            x + chord * float(np.cos(middle)),
            y + chord * float(np.sin(middle)),
            theta + 2.0 * half_turn,
        )


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
        finite("differential drive", left, right)
        turn = self.radius * (right - left) / self.track
        return 0.5 * self.radius * (left + right), 0.0, turn

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
    most: float = math.radians(45)
    commands: ClassVar[str] = "speed [m/s] and steering angle [rad]"

    def __post_init__(self) -> None:
        number(self.wheelbase, "ackermann drive: wheelbase", "metres", positive=True)
        # Largest steering angle [rad]: at 90° a car would turn about its own rear axle.
        steepest = math.radians(85)
        number(self.most, "ackermann drive: most", "radians", positive=True, most=steepest)

    def twist(self, speed: float, steering: float) -> Twist:
        """The twist at a speed and a steering angle, positive to the left."""
        finite("ackermann drive", speed, steering)
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
        finite("omni drive", ahead, left, turn)
        return ahead, left, turn

    def move(
        self, pose: Sequence[float], ahead: float, left: float, turn: float, duration: float
    ) -> Pose:
        """Where the robot is after it held a twist for a time [s]."""
        return moved((ahead, left, turn), pose, duration)


def able(robot: object, twist: Twist) -> Twist:
    """The twist that a robot performs when commanded: only an OmniDrive moves sideways.

    Examples:
        >>> from lrf3d.robot.kinematics import AckermannDrive, able
        >>> able(AckermannDrive(wheelbase=1.0), (0.0, 1.0, 2.0))
        (0.0, 0.0, 0.0)
    """
    ahead, _, turn = twist
    if isinstance(robot, OmniDrive):
        return twist
    if isinstance(robot, AckermannDrive):
        most = abs(ahead) * math.tan(robot.most) / robot.wheelbase
        turn = min(max(turn, -most), most)
    return ahead, 0.0, turn


def finite(name: str, *command: float) -> None:
    """Check that a command that comes from outside is finite numbers."""
    if not is_finite(*command):
        raise InputError(f"{name} {shown(command)}: expected finite numbers")


def moved(twist: Twist, pose: Sequence[float], seconds: float) -> Pose:
    """Where a robot is after it held a twist for some seconds."""
    finite("move", *twist, seconds)
    return hold(as_pose(pose), twist, seconds)


def sinc(x: float) -> float:
    """The same number as `np.sinc`, which takes ten times as long for one."""
    angle = np.pi * (x or TINY)
    return float(np.sin(angle)) / angle


def hold(pose: Sequence[float], twist: Twist, seconds: float) -> Pose:
    """The pose after a twist was held for some seconds: an exact arc."""
    x, y, theta = pose
    ahead, left, turn = twist
    half = 0.5 * turn * seconds
    chord = seconds * sinc(half / np.pi)
    cos = chord * math.cos(theta + half)
    sin = chord * math.sin(theta + half)
    return Pose(x + cos * ahead - sin * left, y + cos * left + sin * ahead, theta + 2.0 * half)


def arcs(poses: Float, v: Float, omega: Float, durations: Float) -> Float:
    """Poses (k, 3) after arcs with v (k,), ω (k,) held for durations (k,) [s] from poses (k, 3).

    In this form a straight line is not a special case, and a small ω loses no digits.
    """
    half_turn = 0.5 * omega * durations
    chord = v * durations * np.sinc(half_turn / np.pi)
    middle = poses[:, 2] + half_turn
    step = np.column_stack([chord * np.cos(middle), chord * np.sin(middle), 2.0 * half_turn])
    return poses + step


def drive(
    start: Sequence[float] | Float,
    v: Input,
    omega: Input,
    *,
    duration: float | ArrayLike,
    dt: float = 0.1,
    tolerance: float = ROUNDING,
) -> Trajectory:
    """Drive a unicycle from a start pose with the inputs v and ω.

    Inputs that are functions of time are integrated by SciPy's RK45, the paper's ode45; numbers
    and pieces of constant input give exact arcs.

    Args:
        start: Pose x, y [m], theta [rad] at time 0.
        v: Speed [m/s]: a number, a sequence with one number a piece, or a function of time.
        omega: Turn rate [rad/s], given likewise.
        duration: How long to drive [s]; for pieces, the duration of each, or one for all.
        dt: Time between the poses of the trajectory [s].
        tolerance: Relative and absolute tolerance of RK45.

    Raises:
        InputError: A duration or dt is not positive, or the pieces do not fit together.

    Examples:
        >>> import lrf3d
        >>> path = lrf3d.drive((0, 0, 0), 1.0, 0.0, duration=2.0)
        >>> len(path), path.poses[-1].tolist()
        (21, [2.0, 0.0, 0.0])
    """
    number(dt, "dt", "seconds", positive=True)
    number(tolerance, "tolerance", positive=True)
    pose = np.array(as_pose(start))
    if not (callable(v) or callable(omega)):
        return _chain_arcs(pose, numbers(v, "v"), numbers(omega, "omega"), duration, dt)
    from scipy.integrate import solve_ivp

    seconds = number(duration, "duration", "seconds", positive=True)
    robot = Unicycle()
    speed = _function(v)
    rate = _function(omega)
    # Steps no longer than dt keep RK45 from skipping short pulses of the input.
    solution = solve_ivp(
        lambda t, state: robot.derivative(state, speed(t), rate(t)),
        (0.0, seconds),
        pose,
        method="RK45",
        t_eval=_sample_times(seconds, dt),
        rtol=max(tolerance, 100 * np.finfo(np.float64).eps),  # SciPy warns about less.
        atol=tolerance,
        max_step=dt,
    )
    if not solution.success or not np.isfinite(solution.y).all():
        raise InputError(f"drive: the inputs cannot be integrated ({solution.message})")
    return Trajectory(solution.t, solution.y.T)


def _function(value: Input) -> Callable[[float], float]:
    if callable(value):
        return value
    constant = numbers(value, "v and omega")
    if constant.ndim:
        raise InputError("v and omega: pieces and a function of time do not mix; give two of one")
    return lambda _: float(constant)


def _sample_times(duration: float, dt: float) -> Float:
    """Times 0, dt, 2·dt, … and the duration itself [s]."""
    if duration / dt > MOST_POSES:
        raise InputError(
            f"duration {duration:g} s in steps of {dt:g} s: more than {MOST_POSES:,} poses; give a"
            " larger dt"
        )
    # Rounding must neither lose the last sample nor add one just before the end.
    times = np.arange(int(np.floor(duration / dt * (1.0 + ROUNDING))) + 1) * dt
    return np.append(times if duration - times[-1] > ROUNDING * dt else times[:-1], duration)


def _chain_arcs(
    start: Float, v: Float, omega: Float, duration: float | ArrayLike, dt: float
) -> Trajectory:
    try:
        v, omega, durations = np.broadcast_arrays(
            np.atleast_1d(v), np.atleast_1d(omega), np.atleast_1d(numbers(duration, "duration"))
        )
    except ValueError:
        raise InputError("drive: expected as many pieces of v, omega and duration") from None
    if not (np.isfinite(durations).all() and (durations > 0.0).all() and len(durations)):
        raise InputError(f"duration {shown(duration)}: expected positive numbers of seconds")
    if not (np.isfinite(v).all() and np.isfinite(omega).all()):
        raise InputError("drive: v and omega must be finite numbers")
    starts = np.append(0.0, np.cumsum(durations))
    headings = start[2] + np.append(0.0, np.cumsum(omega * durations))
    turned = np.column_stack([np.zeros((len(v), 2)), headings[:-1]])
    steps = arcs(turned, v, omega, durations)[:, :2]
    positions = start[:2] + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    # The poses between the pieces.
    knots = np.column_stack([positions, headings])
    times = _sample_times(float(starts[-1]), dt)
    piece = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(v) - 1)
    return Trajectory(times, arcs(knots[piece], v[piece], omega[piece], times - starts[piece]))
