"""Localiser: tracks the robot on a known map.

The input is odometry increments and scans; the output is poses with covariances. The pose that is
stored in a scan is never used.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from typing import Protocol

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, Value, wrap_angle
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.laser.noise import USUAL_RANGE
from lrf3d.localization.estimate import PoseEstimate
from lrf3d.localization.lines import KnownLines, LocalLines
from lrf3d.localization.odometry import OdometryNoise
from lrf3d.localization.pairing import Criterion, Pairs, innovation, pair_lines
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.pose import Pose, as_poses

ROBOT = Pose(0.0, 0.0, 0.0)
"""The robot's pose in its own frame."""


LEAST_FLOOR = 0.001
"""Least floor of the noise [m] when lines are extracted: walls that are drawn in whole millimetres
are not straighter than that."""


class Extractor(Protocol):
    """Anything that makes a local map of one scan, such as a LineMapper."""

    def local_map(self, scan: LaserScan) -> LineMap:
        """Return the local map, in the frame that the scan's pose is given in."""
        ...


@dataclass(frozen=True, eq=False)
class Track(Value):
    """The estimated poses of the robot at each scan.

    Args:
        poses: (k, 3) x, y [m], theta [rad].
        covariances: (k, 3, 3) their covariances.
        lines: (k,) number of pairs of lines that each correction used.
        comparisons: (k,) number of comparisons that finding them took.
    """

    poses: Float
    covariances: Float
    lines: Int
    comparisons: Int

    def __post_init__(self) -> None:
        self._hold("poses", "covariances")
        self._hold("lines", "comparisons", dtype=np.int64)

    def __len__(self) -> int:
        return len(self.poses)

    def errors(self, truth: Float) -> Float:
        """Differences (k, 3) from the true poses (k, 3): x, y [m], theta [rad]."""
        difference = self.poses - as_poses(truth)
        difference[:, 2] = wrap_angle(difference[:, 2])
        return difference

    def nees(self, truth: Float) -> Float:
        """Normalised estimation error squared (k,), with three degrees of freedom: 3 on average.

        Directions in which the covariance is 0 are left out.
        """
        errors = self.errors(truth)
        information = np.linalg.pinv(self.covariances, hermitian=True)
        return np.asarray(np.einsum("ki,kij,kj->k", errors, information, errors))


class Localiser:
    """Extended Kalman filter over the lines of a known map.

    Args:
        known: The map.
        start: The pose at the first scan, with its covariance.
        range_noise: The noise of the ranges.
        odometry_noise: The noise of the odometry.
        extractor: Finds the lines of a scan; a LineMapper with this noise if not given.
        criterion: Decides which lines are a pair; a MahalanobisGate if not given.
        strategy: Which lines are compared: ``seen-objects-first`` or ``all``.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> known = lrf3d.KnownLines.from_world(room)
        >>> start = lrf3d.PoseEstimate(run.scan(0).pose, np.diag([0.01, 0.01, 0.001]))
        >>> localiser = lrf3d.Localiser(known, start)
        >>> estimate = localiser.see(run.scan(0))
        >>> bool(abs(estimate.pose.x - 1.0) < 0.05)
        True
    """

    def __init__(
        self,
        known: KnownLines,
        start: PoseEstimate,
        *,
        range_noise: RangeNoise | None = None,
        odometry_noise: OdometryNoise | None = None,
        extractor: Extractor | None = None,
        criterion: Criterion | None = None,
        strategy: str = "seen-objects-first",
    ) -> None:
        self.known = known
        self.estimate = start
        self.pairs: Pairs | None = None
        self.used = 0
        self._range_noise = RangeNoise.from_sigma() if range_noise is None else range_noise
        noise = OdometryNoise() if odometry_noise is None else odometry_noise
        self._step_covariance = noise.covariance
        self._extractor = extractor
        self._criterion, self._strategy = criterion, strategy

    def move(self, step: Float) -> PoseEstimate:
        """Predict the pose after an odometry increment (3,): ahead, to the left [m], turn [rad]."""
        self.estimate = self.estimate.moved(step, self._step_covariance)
        return self.estimate

    def see(self, scan: LaserScan) -> PoseEstimate:
        """Correct the pose by a scan."""
        if self._extractor is None:
            # Eq. 7 gives the noise at range_max.
            reach = scan.range_max if scan.range_max < np.inf else USUAL_RANGE
            floor = max(self._range_noise.floor, LEAST_FLOOR)
            self._extractor = LineMapper(sigma=self._range_noise.growth * reach, floor=floor)
        local_map = self._extractor.local_map(replace(scan, pose=ROBOT))
        local = LocalLines.from_map(local_map, self._range_noise, spacing=_spacing(scan))
        self.pairs = pair_lines(
            local,
            self.known,
            self.estimate.pose,
            self.estimate.covariance,
            criterion=self._criterion,
            strategy=self._strategy,
            seen=None if self.pairs is None else self.pairs.objects,
        )
        difference = innovation(
            local,
            self.known,
            self.estimate.pose,
            rows=self.pairs.local,
            known_rows=self.pairs.known,
        )
        self.estimate, used = self.estimate.corrected(difference)
        self.used = int(used.sum())
        return self.estimate


def localise(localiser: Localiser, scans: Iterable[LaserScan], steps: Float) -> Track:
    """Localise the robot at every scan of a drive.

    Args:
        localiser: The filter at the first scan.
        scans: The scans (k); a run has them as ``run.scans``.
        steps: (k − 1, 3) odometry increments from each scan to the next.

    Raises:
        InputError: There is not one increment from each scan to the next.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> known = lrf3d.KnownLines.from_world(room)
        >>> start = lrf3d.PoseEstimate(run.scan(0).pose, np.diag([0.01, 0.01, 0.001]))
        >>> steps = lrf3d.odometry_increments(run.trajectory.poses)
        >>> track = lrf3d.localise(lrf3d.Localiser(known, start), run.scans, steps)
        >>> bool(abs(track.errors(run.trajectory.poses)).max() < 0.05)
        True
    """
    poses, covariances, lines, comparisons = [], [], [], []
    # The robot moves between scans, so the first one has no increment before it.
    increments = chain([None], steps)
    for scan in scans:
        try:
            step = next(increments)
        except StopIteration:
            raise InputError(f"{len(steps)} steps of odometry for more scans than that") from None
        if step is not None:
            localiser.move(step)
        estimate = localiser.see(scan)
        poses.append(estimate.pose)
        covariances.append(estimate.covariance)
        lines.append(localiser.used)
        comparisons.append(0 if localiser.pairs is None else localiser.pairs.comparisons)
    if len(poses) != len(steps) + 1:
        raise InputError(f"{len(steps)} steps of odometry for {len(poses)} scans")
    return Track(
        np.array(poses).reshape(-1, 3),
        np.array(covariances).reshape(-1, 3, 3),
        np.array(lines),
        np.array(comparisons),
    )


def _spacing(scan: LaserScan) -> float | None:
    """The median angle [rad] between two beams of a scan."""
    return float(np.median(np.abs(np.diff(scan.angles)))) if len(scan.angles) > 1 else None
