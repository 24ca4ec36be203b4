"""Slam in the simulator: a mapper that does not know where the robot is.

Scans of a simulation enter; their poses are the true ones, from which wheels with errors make the
odometry. Only that and the ranges go on to `Slam`, and its map leaves.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, generator, is_finite
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.pose import between, compose
from lrf3d.robot import EstimatedTrajectory
from lrf3d.run import Run
from lrf3d.slam.slam import Slam

COVARIANCE_INTERVAL, COVARIANCE_SHARE = 4, 32
"""Scans from one covariance that is kept to the next: the first number, or this part of the drive
so far. Each takes a step over the whole pose graph: on a long drive they come more seldom, so that
a scan does not take longer in the end."""


@dataclass(frozen=True, slots=True)
class WheelErrors:
    """What wheels measure wrong: ``errors(increment, rng)`` is what they say of an increment.

    The usual ones are those of calibrated wheels: after some hundred metres their poses are off by
    1 to 5 % of the distance.

    Args:
        turn_per_metre: Turn that is measured but not made for each metre [rad/m]: wheels of unequal
            size.
        slip: Standard deviation of the distance as a share of it, and of the turn as a share of it.
        position: Standard deviation of each increment [m].
        heading: Standard deviation of its turn [rad].

    Raises:
        InputError: A number is not finite, or a deviation is negative.
    """

    turn_per_metre: float = 0.0007
    slip: float = 0.03
    position: float = 0.005
    heading: float = 0.003

    def __post_init__(self) -> None:
        values = (self.slip, self.position, self.heading)
        if not (is_finite(self.turn_per_metre, *values) and min(values) >= 0.0):
            raise InputError(f"{self}: expected finite numbers, deviations of at least 0")

    def __call__(self, increment: Float, rng: np.random.Generator) -> Float:
        """What the wheels measure of an increment (3,): ahead, to the left [m], turn [rad]."""
        longer, ahead, left, tighter, turn = rng.normal(size=5)
        measured: Float = increment * (1.0 + self.slip * np.array([longer, 0.0, tighter]))
        measured[2] += self.turn_per_metre * increment[0]
        measured += [self.position * ahead, self.position * left, self.heading * turn]
        return measured


class SlamMapper:
    """A mapper for simulations that finds the robot's poses itself; ``lrf3d run --slam`` uses it.

    Args:
        wheels: What makes odometry of true increments, in simulations without odometry.
        rng: The source of the wheels' noise, or a seed of it.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.slam import SlamMapper
        >>> room = lrf3d.load_world("paper_room")
        >>> mapper = SlamMapper(rng=0)
        >>> drive = [(1 + 0.1 * k, 1, 0) for k in range(10)]
        >>> run = lrf3d.simulate(room, drive, mapper=mapper, rng=0)
        >>> bool(mapper.errors().max() < 0.05), len(run.map) > 3
        (True, True)
    """

    def __init__(
        self, wheels: WheelErrors | None = None, *, rng: np.random.Generator | int = 0
    ) -> None:
        self.slam = Slam()
        self._wheels = WheelErrors() if wheels is None else wheels
        self._rng = generator(rng)
        self._measured: Float | None = None
        # Poses at all scans: true ones, by the wheels, and as believed when the scan was in.
        self._true: list[Float] = []
        self._by_wheels: list[Float] = []
        self._believed: list[Float] = []
        self._covariances: dict[int, Float] = {}

    several = True
    """It takes the scans of all lasers of a moment at once."""

    def update(self, scan: LaserScan | tuple[LaserScan, ...]) -> None:
        """Take in a scan; of its pose only the increment that the wheels measure is used."""
        # How the robot moved during a scan is known only by the wheels, too.
        scans = tuple(
            each if each.motion is None else replace(each, motion=None)
            for each in ((scan,) if isinstance(scan, LaserScan) else scan)
        )
        number, true, increment = len(self._true), np.array(scans[0].robot), np.zeros(3)
        if number and self._measured is not None:
            increment = self._measured
        elif number:
            increment = self._wheels(between(self._true[-1], true), self._rng)
        else:
            # Where the world's origin is no scan can tell, so that the first pose is given.
            self.slam = Slam(start=true)
        self.slam.update(scans, increment)
        self._by_wheels.append(compose(self._by_wheels[-1], increment) if number else true)
        self._true.append(true)
        self._believed.append(np.array(self.slam.pose))
        last = max(self._covariances, default=-COVARIANCE_INTERVAL)
        if number >= last + max(COVARIANCE_INTERVAL, last // COVARIANCE_SHARE):
            self._covariances[number] = self.slam.covariance()

    def drive(self, increment: Float) -> None:
        """Take the odometry increment (3,) up to the next scan instead of that of own wheels."""
        self._measured = increment

    @property
    def map(self) -> LineMap:
        """The map as the robot knows it."""
        return self.slam.map

    @property
    def estimate(self) -> EstimatedTrajectory:
        """Where the robot was believed to be when each scan was in, with its covariances."""
        return self.slam.estimate(
            np.array(self._believed).reshape(-1, 3),
            np.array(list(self._covariances), dtype=np.int64),
            np.array(list(self._covariances.values())).reshape(-1, 3, 3),
            np.array(self._by_wheels).reshape(-1, 3),
        )

    def errors(self) -> Float:
        """How far (k,) the robot is believed to be from where it is, at all scans [m]."""
        return self._apart(self.slam.trajectory())

    def report(self, run: Run, folder: Path) -> dict[str, Any]:
        """The figures for the summary of ``lrf3d run``."""
        errors = self.errors()
        return {
            "slam_mean_error_m": float(errors.mean()),
            "slam_largest_error_m": float(errors.max()),
            "odometry_largest_error_m": float(self._apart(np.array(self._by_wheels)).max()),
            "loop_closures": len(self.slam.closures),
        }

    def _apart(self, poses: Float) -> Float:
        apart = poses - np.array(self._true)
        return np.hypot(apart[:, 0], apart[:, 1])
