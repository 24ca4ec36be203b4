"""Slam in the simulator: a mapper that estimates the poses itself.

Scans of a simulation enter. Their true poses only serve to simulate the odometry of wheels with
errors; that and the ranges go to `Slam`, whose map and poses leave.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.geometry.lines import Float, generator
from lrf3d.geometry.pose import between, compose
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.robot import EstimatedTrajectory
from lrf3d.simulation.run import Run
from lrf3d.slam.slam import Slam

# Number of scans from one stored covariance to the next.
COVARIANCE_INTERVAL = 4

# The same as a part of the drive so far: each covariance takes a step over the whole pose graph, so
# that on a long drive they are stored more seldom.
COVARIANCE_SHARE = 32

# Errors of calibrated wheels: after some hundred metres poses are off by 1 to 5 % of the distance.

# Standard deviation of the slip, as a share of the distance and of the turn.
SLIP = 0.03

# Standard deviation of the position of each increment [m].
POSITION = 0.005

# Standard deviation of the turn of each increment [rad].
HEADING = 0.003

# Turn that is measured but not made [rad/m].
TURN_PER_METRE = 0.0007


def calibrated_wheels(increment: Float, rng: np.random.Generator) -> Float:
    """Odometry of calibrated wheels for a true increment (3,): ahead, left [m], turn [rad]."""
    longer, ahead, left, tighter, turn = rng.normal(size=5)
    measured: Float = increment * (1.0 + SLIP * np.array([longer, 0.0, tighter]))
    distance, *_ = increment
    measured += [0.0, 0.0, TURN_PER_METRE * distance]
    measured += [POSITION * ahead, POSITION * left, HEADING * turn]
    return measured


class SlamMapper:
    """A mapper for simulations that estimates the poses itself; ``lrf3d run --slam`` uses it.

    Args:
        wheels: The model of the odometry in simulations without odometry, such as a
            `WheelOdometry`.
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

    # It takes the scans of all lasers of a moment at once.
    several = True

    def __init__(
        self,
        wheels: Callable[[Float, np.random.Generator], Float] = calibrated_wheels,
        *,
        rng: np.random.Generator | int = 0,
    ) -> None:
        self.slam = Slam()
        self._wheels = wheels
        self._rng = generator(rng)
        self._measured: Float | None = None
        # Poses at all scans: the true ones, those of the wheels, and the online estimates.
        self._true: list[Float] = []
        self._by_wheels: list[Float] = []
        self._estimated: list[Float] = []
        self._covariances: dict[int, Float] = {}

    def update(self, scan: LaserScan | tuple[LaserScan, ...]) -> None:
        """Take in a scan; of its pose only the increment that the wheels measure is used."""
        # The motion during a scan is known only by the wheels, too.
        scans = tuple(
            each if each.motion is None else replace(each, motion=None)
            for each in ((scan,) if isinstance(scan, LaserScan) else scan)
        )
        first, *_ = scans
        number = len(self._true)
        true = np.array(first.robot)
        increment = np.zeros(3)
        if not number:
            # No scan shows where the world's origin is, so the first pose is given.
            self.slam = Slam(start=true)
        elif self._measured is not None:
            increment = self._measured
        else:
            increment = self._wheels(between(self._true[-1], true), self._rng)
        self.slam.update(scans, increment)
        self._by_wheels.append(compose(self._by_wheels[-1], increment) if number else true)
        self._true.append(true)
        self._estimated.append(np.array(self.slam.pose))
        last = max(self._covariances, default=-COVARIANCE_INTERVAL)
        if number >= last + max(COVARIANCE_INTERVAL, last // COVARIANCE_SHARE):
            self._covariances[number] = self.slam.covariance()

    def drive(self, increment: Float) -> None:
        """Use this odometry increment (3,) up to the next scan, instead of simulating one."""
        self._measured = increment

    @property
    def map(self) -> LineMap:
        """The map at the estimated poses."""
        return self.slam.map

    @property
    def estimate(self) -> EstimatedTrajectory:
        """The online pose estimates of all scans, with covariances."""
        return self.slam.estimate(
            np.array(self._estimated).reshape(-1, 3),
            np.array(list(self._covariances), dtype=np.int64),
            np.array(list(self._covariances.values())).reshape(-1, 3, 3),
            np.array(self._by_wheels).reshape(-1, 3),
        )

    def errors(self) -> Float:
        """Distances (k,) of the estimated poses from the true ones at all scans [m]."""
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
        x, y, _ = (poses - np.array(self._true)).T
        return np.asarray(np.hypot(x, y))
