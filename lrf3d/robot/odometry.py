"""What a robot measures of its own motion: odometry by its wheels, and an inertial unit (IMU).

True poses enter one after the other; what the wheels and the IMU make of the motion between them
leaves. Between two poses a robot drives an arc.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.geometry.lines import NORMAL_MEDIAN, ROUNDING, Float, Value, as_rows, is_finite, number
from lrf3d.geometry.pose import between, compose


@dataclass(frozen=True, slots=True)
class WheelOdometry:
    """The errors of wheel odometry; the usual ones put a robot 1 to 3 % of its path off.

    Args:
        scale: Share of the distance that is measured too much: a wrong circumference.
        track: Share of each turn that is measured too much: a wrong distance between the wheels.
        turn_per_metre: Turn that is measured but not made, for each metre [rad/m]: unequal wheels.
        slip: Standard deviation of the distance after 1 m [m]; after 4 m it is twice as much.
        swerve: Standard deviation of the heading after 1 m [rad], which grows likewise.
        skid: Standard deviation of the heading after a turn of 1 rad [rad], which grows likewise.

    Raises:
        InputError: A number is not finite, a share is −1 or less, or a deviation negative.

    Examples:
        >>> import lrf3d
        >>> wheels = lrf3d.WheelOdometry(scale=0.1, slip=0, swerve=0, track=0, turn_per_metre=0)
        >>> room = lrf3d.load_world("paper_room")
        >>> drive = [(1, 1, 0), (2, 1, 0)]
        >>> run = lrf3d.simulate(room, drive, odometry=wheels, rng=0)
        >>> run.odometry[-1].round(6).tolist()
        [2.1, 1.0, 0.0]
    """

    scale: float = 0.005
    track: float = 0.005
    turn_per_metre: float = 0.0005
    slip: float = 0.01
    swerve: float = 0.002
    skid: float = 0.005

    def __post_init__(self) -> None:
        values = [getattr(self, each.name) for each in fields(self)]
        if is_finite(*values[:2]) and max(map(abs, values[:2])) >= 1.0:
            raise InputError(
                f"scale {values[0]:g}, track {values[1]:g}: expected shares between"
                " −1 and 1, such as 0.02 for 2 %"
            )
        if not is_finite(*values) or min(values[3:]) < 0.0:
            raise InputError(
                f"errors {shown(values)}: expected finite numbers, deviations of at least 0"
            )

    def __call__(self, increment: Float, rng: np.random.Generator) -> Float:
        """What the wheels measure of an increment (3,): ahead, to the left [m], turn [rad]."""
        expect(rng, np.random.Generator, "wheel odometry: rng")
        ahead, left, turn = twist_of(as_rows([increment], "increments", 3)[0]).tolist()
        distance = float(np.hypot(ahead, left))
        stretched, turned = rng.normal(size=2).tolist()
        longer = 1.0 + self.scale
        if distance > 0.0:
            longer += self.slip * stretched / np.sqrt(distance)
        spread = np.sqrt(self.swerve**2 * distance + self.skid**2 * abs(turn))
        measured = turn * (1.0 + self.track) + self.turn_per_metre * ahead + spread * turned
        return increment_of(np.array([ahead * longer, left * longer, measured]))

    def noise(self, ahead: float, left: float, turn: float) -> Float:
        """Covariance (3, 3) of the random errors of an arc: ahead, to the left [m], turn [rad]."""
        distance = float(np.hypot(ahead, left))
        noise = np.zeros((3, 3))
        if distance > 0.0:
            # Slip makes errors along the path.
            path = np.array([ahead, left]) / distance
            noise[:2, :2] = self.slip**2 * distance * np.outer(path, path)
        noise[2, 2] = self.swerve**2 * distance + self.skid**2 * abs(turn)
        return noise


class OdometryBelief:
    """The uncertainty of a pose by odometry, whose covariance grows along the drive.

    The variances of random errors add up. Systematic errors are the same along the whole drive, so
    they themselves add up. Both are propagated to first order.
    """

    def __init__(self, wheels: WheelOdometry) -> None:
        self._wheels = wheels
        # Standard deviation of each systematic error.
        self._shares = np.array([wheels.scale, wheels.track, wheels.turn_per_metre])
        self._random = np.zeros((3, 3))
        # Derivative of the pose by each systematic error.
        self._drift = np.zeros((3, 3))

    @property
    def covariance(self) -> Float:
        """Covariance (3, 3) of the pose: x, y [m], theta [rad], along the axes of its frame."""
        drift = self._drift * self._shares
        return np.asarray(self._random + drift @ drift.T)

    def drive(self, pose: Float, increment: Float) -> None:
        """Add a measured increment (3,) at a pose (3,)."""
        cos = np.cos(pose[2])
        sin = np.sin(pose[2])
        turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        x, y, _ = turned @ increment
        by_pose = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        ahead, left, turn = twist_of(increment).tolist()
        by_shares = np.array([[ahead, 0.0, 0.0], [left, 0.0, 0.0], [0.0, turn, ahead]])
        noise = turned @ self._wheels.noise(ahead, left, turn) @ turned.T
        self._random = by_pose @ self._random @ by_pose.T + noise
        self._drift = by_pose @ self._drift + turned @ by_shares

    def twist_covariance(self, twist: Float, seconds: float) -> Float:
        """Covariance (3, 3) of a twist [m/s], [rad/s] that was measured during a time [s]."""
        ahead, left, turn = (twist * seconds).tolist()
        shares = np.array([[ahead, 0.0, 0.0], [left, 0.0, 0.0], [0.0, turn, ahead]]) * self._shares
        noise = self._wheels.noise(ahead, left, turn) + shares @ shares.T
        return np.asarray(noise / seconds**2)


@dataclass(frozen=True, slots=True)
class Imu:
    """The errors of an IMU: a gyro about the vertical, and accelerometers ahead and to the left.

    Args:
        rate: Measurements a second [Hz].
        gyro_noise: Noise density of the gyro [rad/s/√Hz].
        gyro_walk: Random walk of its bias [rad/s²/√Hz].
        accelerometer_noise: Noise density of the accelerometers [m/s²/√Hz].
        accelerometer_walk: Random walk of their biases [m/s³/√Hz].

    Raises:
        InputError: A number is negative or not finite, or the rate not positive.

    Examples:
        >>> import lrf3d
        >>> room, drive = lrf3d.load_world("paper_room"), [(1, 1, 0), (2, 1, 0)]
        >>> *_, last = lrf3d.Simulation(room, drive, imu=lrf3d.Imu(rate=50.0), rng=0)
        >>> last.imu.shape
        (50, 4)
    """

    rate: float = 100.0
    gyro_noise: float = 0.0005
    gyro_walk: float = 0.00002
    accelerometer_noise: float = 0.005
    accelerometer_walk: float = 0.0002

    def __post_init__(self) -> None:
        most_rate = 10_000.0  # Highest rate of an IMU [Hz].
        number(self.rate, "rate", "measurements a second", positive=True, most=most_rate)
        for each in fields(self)[1:]:
            number(getattr(self, each.name), each.name)

    @property
    def variances(self) -> tuple[float, float]:
        """Variances of a measurement: turn rate [rad²/s²], accelerations [m²/s⁴]."""
        return self.rate * self.gyro_noise**2, self.rate * self.accelerometer_noise**2


class Odometer:
    """Wheels that count on: the pose by odometry, current after every `drive`."""

    def __init__(self, wheels: WheelOdometry, rng: np.random.Generator) -> None:
        self._wheels = wheels
        self._rng = rng
        self._true: Float | None = None
        self.pose = np.zeros(3)
        self.increment = np.zeros(3)

    def drive(self, pose: Float) -> Float:
        """The pose (3,) by odometry where the robot is now at a pose (3,); the first is known."""
        if self._true is None:
            self.pose = np.array(pose)
        else:
            self.increment = self._wheels(between(self._true, np.asarray(pose)), self._rng)
            self.pose = compose(self.pose, self.increment)
        self._true = np.array(pose)
        return self.pose


class Motion(NamedTuple):
    """A robot at a time [s] and a pose (3,), and how it got there from the last one."""

    time: float
    pose: Float
    distance: float = 0.0  # [m] driven so far.
    turn: float = 0.0  # [rad/s]
    speed: Float = np.zeros(2)  # Ahead and to the left [m/s].
    pull: Float = np.zeros(2)  # Accelerations ahead and to the left [m/s²].

    def on_to(self, time: float, pose: Float) -> "Motion":
        """The motion to a pose (3,) at a later time [s]; at the same time it stays as it is."""
        gap = time - self.time
        if gap <= 0.0:
            return self
        ahead, left, turn = (twist_of(between(self.pose, pose)) / gap).tolist()
        speed = np.array([ahead, left])
        # The speed of this stretch is reached evenly; a turn adds the centripetal part.
        pull = (speed - self.speed) / gap + turn * np.array([-left, ahead])
        distance = self.distance + gap * float(np.hypot(ahead, left))
        return Motion(time, pose, distance, turn, speed, pull)


class InertialUnit:
    """An IMU that is carried along: measurements up to now, at its own rate."""

    def __init__(self, imu: Imu, rng: np.random.Generator) -> None:
        self._imu = imu
        self._rng = rng
        self._count = 0
        self._motion: Motion | None = None
        self._bias = np.zeros(3)

    def drive(self, time: float, pose: Float) -> Float:
        """Rows (m, 4) since the last call, now that the robot is at a pose (3,) at a time [s].

        Each has a time [s], a turn rate [rad/s], and accelerations ahead and to the left [m/s²].
        """
        imu = self._imu
        if self._motion is None:
            self._begin = time
            self._motion = Motion(time, np.array(pose))
            return np.empty((0, 4))
        self._motion = self._motion.on_to(time, np.array(pose))
        count = int(np.floor((time - self._begin) * imu.rate + ROUNDING)) - self._count
        times = self._begin + (self._count + 1.0 + np.arange(count)) / imu.rate
        self._count += count
        densities = np.array([imu.gyro_noise, *2 * [imu.accelerometer_noise]])
        walks = np.array([imu.gyro_walk, *2 * [imu.accelerometer_walk]])
        noise, steps = self._rng.normal(size=(2, count, 3))
        biases = self._bias + np.cumsum(steps * walks / np.sqrt(imu.rate), axis=0)
        self._bias = biases[-1] if count else self._bias
        true = np.array([self._motion.turn, *self._motion.pull])
        return np.column_stack([times, true + biases + noise * densities * np.sqrt(imu.rate)])


@dataclass(frozen=True, eq=False, repr=False)
class ImuRecord(Value):
    """The measurements of an IMU in a run.

    Times (m,) [s], turn rates (m,) [rad/s], and accelerations (m, 2) ahead and to the left [m/s²].
    """

    times: Float
    turn_rates: Float
    accelerations: Float

    def __post_init__(self) -> None:
        self._hold("times", "turn_rates", "accelerations")
        shapes = self.times.shape, self.turn_rates.shape, self.accelerations.shape
        if shapes != ((len(self.times),), (len(self.times),), (len(self.times), 2)):
            raise InputError(f"imu: arrays of {shapes}; expected (m,), (m,) and (m, 2)")

    @property
    def variances(self) -> tuple[float, float]:
        """Variances of the turn rate [rad²/s²] and of the acceleration [m²/s⁴], from their noise.

        Second differences remove most of the motion, and their median ignores its steps.
        """
        if len(self.times) < 3:
            return 0.0, 0.0
        columns = self.turn_rates[:, None], self.accelerations
        spreads = [float(np.median(np.abs(np.diff(each, n=2, axis=0)))) for each in columns]
        # A second difference has six times the variance.
        of_gyro, of_accelerometers = ((spread / NORMAL_MEDIAN) ** 2 / 6 for spread in spreads)
        return of_gyro, of_accelerometers

    @classmethod
    def of(cls, rows: list[Float]) -> "ImuRecord":
        """The record of the rows that an `InertialUnit` returned."""
        table = np.concatenate([np.empty((0, 4)), *rows])
        return cls(table[:, 0], table[:, 1], table[:, 2:])


def twist_of(increments: Float) -> Float:
    """Distances ahead and to the left [m] and turns [rad] (…, 3) along the arcs of increments."""
    x, y, turn = np.moveaxis(increments, -1, 0)
    half = 0.5 * turn
    cos = np.cos(half)
    sin = np.sin(half)
    share = np.sinc(half / np.pi)
    return np.stack([(x * cos + y * sin) / share, (y * cos - x * sin) / share, turn], axis=-1)


def increment_of(twist: Float) -> Float:
    """The increment (3,) of an arc: `twist_of` the other way round."""
    ahead, left, turn = twist.tolist()
    half = 0.5 * turn
    cos = np.cos(half)
    sin = np.sin(half)
    chord = np.sinc(half / np.pi)
    return np.array([chord * (ahead * cos - left * sin), chord * (ahead * sin + left * cos), turn])
