"""Unicycle: the kinematic model of the robot (Eq. 2 of Teslić et al.), its exact arcs, and drives.

The inputs v and ω over time enter; a trajectory leaves.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, is_finite, number, numbers
from lrf3d.pose import Pose, as_pose
from lrf3d.robot.trajectory import Trajectory

RADIUS = 0.35
"""Radius of the robot's round body [m] if none is given."""

MOST_POSES = 10_000_000
"""Largest number of poses of a drive."""

Twist = tuple[float, float, float]
"""Speeds ahead and to the left [m/s], and about itself [rad/s]."""

Input = float | ArrayLike | Callable[[float], float]
"""A speed over time: a number, one number for each time interval, or a function of time [s]."""


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
        if not is_finite(v, omega, duration):
            raise InputError(f"move {shown((v, omega, duration))}: expected finite numbers")
        x, y, theta = as_pose(pose)
        half_turn = 0.5 * omega * duration
        chord = v * duration * sinc(half_turn / np.pi)
        middle = theta + half_turn
        return Pose(
            x + chord * float(np.cos(middle)),
            y + chord * float(np.sin(middle)),
            theta + 2.0 * half_turn,
        )


def sinc(x: float) -> float:
    """The same number as `np.sinc`, which takes ten times as long for one."""
    angle = np.pi * (x or 1e-20)
    return float(np.sin(angle)) / angle


def hold(pose: Sequence[float], twist: Twist, seconds: float) -> Pose:
    """The pose after a twist was held for some seconds: an exact arc."""
    (x, y, theta), (ahead, left, turn) = pose, twist
    half = 0.5 * turn * seconds
    chord = seconds * sinc(half / np.pi)
    cos, sin = chord * math.cos(theta + half), chord * math.sin(theta + half)
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
    tolerance: float = 1e-9,
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
    robot, speed, rate = Unicycle(), _function(v), _function(omega)
    # Steps no longer than dt keep RK45 from skipping short pulses of the input.
    solution = solve_ivp(
        lambda t, state: robot.derivative(state, speed(t), rate(t)),
        (0.0, seconds),
        pose,
        method="RK45",
        t_eval=_sample_times(seconds, dt),
        rtol=max(tolerance, 1e-13),  # SciPy warns about less, as float64 cannot reach it.
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
        steps = f"duration {duration:g} s in steps of {dt:g} s"
        raise InputError(f"{steps}: more than {MOST_POSES:,} poses; give a larger dt")
    # Rounding must neither lose the last sample nor add one just before the end.
    times = np.arange(int(np.floor(duration / dt * (1.0 + 1e-12))) + 1) * dt
    return np.append(times if duration - times[-1] > 1e-9 * dt else times[:-1], duration)


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
