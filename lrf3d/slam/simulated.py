"""Slam in the simulator: a mapper that does not know where the robot is.

Scans of a simulation enter; their poses are the true ones, from which wheels with errors make the
odometry. Only that and the ranges go on to `Slam`, and its map leaves.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, generator, is_finite
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.robot import EstimatedTrajectory
from lrf3d.run import Run
from lrf3d.slam.closures import Closure
from lrf3d.slam.frames import between, compose
from lrf3d.slam.slam import Slam

MOST_COVARIANCES = 128
"""Covariances of poses that are kept of a drive. Each takes a step over the whole pose graph: of
longer drives they are kept more seldom, so that a scan does not take longer in the end."""

COVARIANCE_INTERVAL = 4
"""Scans from one of them to the next at first."""


@dataclass(frozen=True, slots=True)
class WheelErrors:
    """What wheels measure wrong: ``errors(increment, rng)`` is what they say of an increment.

    Args:
        turn_per_metre: Turn that is measured but not made for each metre [rad/m]: wheels of unequal
            size.
        slip: Standard deviation of the distance as a share of it, and of the turn as a share of it.
        position: Standard deviation of each increment [m].
        heading: Standard deviation of its turn [rad].

    Raises:
        InputError: A number is not finite, or a deviation is negative.
    """

    turn_per_metre: float = 0.03
    slip: float = 0.03
    position: float = 0.005
    heading: float = 0.003

    def __post_init__(self) -> None:
        values = (self.slip, self.position, self.heading)
        if not (is_finite(self.turn_per_metre, *values) and min(values) >= 0.0):
            raise InputError(f"{self}: expected finite numbers, deviations of at least 0")

    def __call__(self, increment: Float, rng: np.random.Generator) -> Float:
        """What the wheels measure of an increment (3,): ahead, to the left [m], turn [rad]."""
        ahead, left, turn = increment
        draws = rng.normal(size=5)
        return np.array(
            [
                ahead * (1.0 + self.slip * draws[0]) + self.position * draws[1],
                left + self.position * draws[2],
                turn * (1.0 + self.slip * draws[3])
                + self.turn_per_metre * ahead
                + self.heading * draws[4],
            ]
        )


class SlamMapper:
    """A mapper for simulations that finds the robot's poses itself; ``lrf3d run --slam`` uses it.

    Args:
        wheels: What makes odometry of true increments.
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
        self._true: list[Float] = []
        self._by_wheels: list[Float] = []
        self._believed: list[Float] = []
        self._covariances: dict[int, Float] = {}
        self._interval = COVARIANCE_INTERVAL

    def update(self, scan: LaserScan) -> None:
        """Take in a scan; of its pose only the increment that the wheels measure is used."""
        true = np.array(scan.pose)
        if not self._true:
            # Where the world's origin is no scan can tell, so that the first pose is given.
            self.slam = Slam(start=true)
            self._by_wheels.append(true)
            self.slam.update(scan, np.zeros(3))
        else:
            increment = self._wheels(between(self._true[-1], true), self._rng)
            self._by_wheels.append(compose(self._by_wheels[-1], increment))
            self.slam.update(scan, increment)
        self._true.append(true)
        self._note_estimate()

    @property
    def map(self) -> LineMap:
        """The map as the robot knows it."""
        return self.slam.map

    @property
    def estimate(self) -> EstimatedTrajectory:
        """Where the robot was believed to be when each scan was in, with its covariances."""
        slam = self.slam
        return EstimatedTrajectory(
            np.array(self._believed).reshape(-1, 3),
            np.array(list(self._covariances), dtype=np.int64),
            np.array(list(self._covariances.values())).reshape(-1, 3, 3),
            scans_of(slam.closures, slam.key_scans),
            scans_of(slam.unconfirmed_closures, slam.key_scans),
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

    def _note_estimate(self) -> None:
        """Keep what is believed now, the covariance only at times."""
        scan = len(self._believed)
        self._believed.append(np.array(self.slam.pose))
        if scan % self._interval:
            return
        self._covariances[scan] = self.slam.covariance()
        if len(self._covariances) > MOST_COVARIANCES:
            self._interval *= 2
            self._covariances = {
                kept: covariance
                for kept, covariance in self._covariances.items()
                if kept % self._interval == 0
            }

    def _apart(self, poses: Float) -> Float:
        apart = poses[:, :2] - np.array(self._true)[:, :2]
        return np.hypot(apart[:, 0], apart[:, 1])


def scans_of(closures: list[Closure], key_scans: Int) -> Int:
    """The pairs of scans (c, 2), an older and a newer one, that closures join."""
    pairs = [(closure.old, closure.new) for closure in closures]
    return np.asarray(key_scans[np.array(pairs, dtype=np.int64).reshape(-1, 2)])
