"""Localiser: an extended Kalman filter that tracks the robot on a known map.

Odometry increments and scans enter; poses with covariances leave. The prediction moves the pose by
an increment; the correction uses pairs of lines, as in the localisation for which Teslić et al.
build their map. The pose that is stored in a scan is never used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, each_of, expect, shown
from lrf3d.geometry.lines import (
    Bool,
    Float,
    Int,
    Value,
    generator,
    is_finite,
    numbers,
    read_only,
    wrap_angle,
)
from lrf3d.geometry.pose import Pose, as_pose, as_poses, between, compose, turned
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.laser.unrolling import unrolled
from lrf3d.slam.places.pairing import (
    GATE,
    STRATEGIES,
    Innovation,
    KnownLines,
    LocalLines,
    innovation,
    pair_lines,
)


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Gaussian noise of each odometry increment, independent of its length.

    The position has this standard deviation [m] ahead, and the same to the side; the heading has
    that of the turn [rad].

    Raises:
        InputError: A number is negative or not finite.

    Examples:
        >>> import lrf3d
        >>> wheels = lrf3d.OdometryNoise(position=0.02, heading=0.01)
        >>> wheels.covariance.diagonal().round(6).tolist()
        [0.0004, 0.0004, 0.0001]
    """

    position: float = 0.1
    heading: float = float(np.radians(2.0))

    def __post_init__(self) -> None:
        values = (self.position, self.heading)
        if not (is_finite(*values) and min(values) >= 0.0):
            raise InputError(f"odometry noise {shown(values)}: expected finite numbers, at least 0")

    @property
    def covariance(self) -> Float:
        """Covariance (3, 3) of a step: ahead, to the left [m], turn [rad]."""
        return np.diag([self.position**2, self.position**2, self.heading**2])

    def __call__(self, steps: Float, rng: np.random.Generator | int) -> Float:
        """Return increments (k, 3) as the wheels would measure them."""
        deviations = [self.position, self.position, self.heading]
        return steps + generator(rng).normal(size=steps.shape) * deviations


def odometry_increments(poses: ArrayLike) -> Float:
    """The increments (k − 1, 3) from pose to pose (k, 3): ahead, to the left [m], turn [rad].

    Raises:
        InputError: The poses are not rows of three finite numbers.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> poses = np.array([(0, 0, 0), (1, 0, 1.5), (1, 2, 1.5)])
        >>> lrf3d.odometry_increments(poses).round(2).tolist()
        [[1.0, 0.0, 1.5], [1.99, 0.14, 0.0]]
    """
    poses = as_poses(poses)
    return between(poses[:-1], poses[1:])


@dataclass(frozen=True, eq=False, repr=False)
class PoseEstimate(Value):
    """An estimated pose, with the covariance (3, 3) of x, y [m] and theta [rad] in the world.

    Raises:
        InputError: The pose is invalid, or the covariance is not symmetric or has a negative
            variance.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> start = lrf3d.PoseEstimate(lrf3d.Pose(0, 0, 0), np.diag([0.01, 0.01, 0.001]))
        >>> start.pose.x
        0.0
    """

    pose: Pose
    covariance: Float

    def __post_init__(self) -> None:
        covariance = read_only(self.covariance, "covariance")
        if covariance.shape != (3, 3) or not np.isfinite(covariance).all():
            raise InputError(f"covariance of shape {covariance.shape}: expected finite (3, 3)")
        if not np.array_equal(covariance, covariance.T) or (np.diag(covariance) < 0.0).any():
            raise InputError("covariance: expected a symmetric matrix with variances of at least 0")
        object.__setattr__(self, "pose", as_pose(self.pose))
        object.__setattr__(self, "covariance", covariance)

    def moved(self, step: Float, noise: Float) -> PoseEstimate:
        """The estimate after an odometry increment (3,) whose noise has a covariance (3, 3)."""
        pose = np.array(self.pose)
        after = compose(pose, np.asarray(step))
        dx, dy, _ = after - pose
        by_pose = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        covariance = by_pose @ self.covariance @ by_pose.T + turned(noise, pose[2])
        # Rounding may leave an asymmetry or negative variances.
        covariance = 0.5 * (covariance + covariance.T)
        np.fill_diagonal(covariance, covariance.diagonal().clip(0.0))
        return PoseEstimate(Pose(*after.tolist()), covariance)

    def corrected(self, pairs: Innovation) -> tuple[PoseEstimate, Bool]:
        """The estimate after pairs of lines (k,), and which of them (k,) it uses.

        Each pair is compared with the estimate that the prediction and all other pairs give. While
        the worst pair lies beyond the gate of pairing, it is left out. So a wrong pair within the
        wide gate of the prediction does not make right ones look wrong, and many consistent lines
        outweigh a poor prediction. The innovations are those at this estimate's pose, in which they
        are linear.
        """
        count = len(pairs.faces)
        gradient = np.zeros((count, 2, 3))
        gradient[:, 0, 2] = -1.0
        gradient[:, 1, :2] = -pairs.normal
        weighted = gradient.transpose(0, 2, 1) @ np.linalg.inv(pairs.noise)
        information = weighted @ gradient
        vector = weighted @ pairs.difference[:, :, None]
        spread, axes = np.linalg.eigh(self.covariance)
        root = axes * np.sqrt(spread.clip(0.0))
        used = np.ones(count, np.bool_)
        while True:
            others = used & ~np.eye(count, dtype=np.bool_)
            change, covariance = _fused(
                root, np.tensordot(others, information, 1), np.tensordot(others, vector, 1)
            )
            residual = pairs.difference - (gradient @ change)[:, :, 0]
            squares = pairs._replace(difference=residual).squared_distance(covariance)
            squares[~used] = 0.0
            if squares.max(initial=0.0) <= GATE:
                break
            used[squares.argmax()] = False
        change, covariance = _fused(root, information[used].sum(axis=0), vector[used].sum(axis=0))
        x, y, theta = (np.array(self.pose) + change[:, 0]).tolist()
        return PoseEstimate(Pose(x, y, float(wrap_angle(theta))), covariance), used


def _fused(root: Float, information: Float, vector: Float) -> tuple[Float, Float]:
    """The change (…, 3, 1) of a pose by measurements, and its covariance (…, 3, 3) afterwards.

    The measurements enter as their information matrix (…, 3, 3) and vector (…, 3, 1). With a root
    of the prior covariance no matrix that may be singular is inverted, and the result stays
    positive under rounding.
    """
    weights, axes = np.linalg.eigh(root.T @ information @ root)
    half = root @ (axes / np.sqrt(1.0 + weights.clip(0.0))[..., None, :])
    covariance = half @ np.swapaxes(half, -1, -2)
    return covariance @ vector, 0.5 * (covariance + np.swapaxes(covariance, -1, -2))


@dataclass(frozen=True, eq=False, repr=False)
class Track(Value):
    """The estimated poses of the robot at each scan.

    Poses (k, 3) are x, y [m] and theta [rad], with covariances (k, 3, 3); each correction used a
    number of pairs of lines (k,), found by a number of comparisons (k,).
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

    It starts at the first scan. The strategy ``seen-objects-first`` compares the lines of a scan
    with those of the objects in the previous scan before all others; ``all`` has no such order.

    Raises:
        InputError: An argument is of another kind, or there is no such strategy.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> known = lrf3d.KnownLines.from_world(lrf3d.load_world("paper_room"))
        >>> start = lrf3d.PoseEstimate(lrf3d.Pose(1, 1, 0), 0.01 * np.eye(3))
        >>> lrf3d.Localiser(known, start).move((0.5, 0, 0)).pose
        Pose(x=1.5, y=1.0, theta=0.0)
    """

    def __init__(
        self,
        known: KnownLines,
        start: PoseEstimate,
        *,
        range_noise: RangeNoise | None = None,
        odometry_noise: OdometryNoise | None = None,
        strategy: str = STRATEGIES[0],
    ) -> None:
        self._range_noise = RangeNoise.from_sigma() if range_noise is None else range_noise
        noise = OdometryNoise() if odometry_noise is None else odometry_noise
        expect(known, KnownLines, "localiser: known")
        expect(start, PoseEstimate, "localiser: start")
        expect(self._range_noise, RangeNoise, "localiser: range_noise")
        expect(noise, OdometryNoise, "localiser: odometry_noise")
        if strategy not in STRATEGIES:
            raise InputError(f"strategy {shown(strategy)}: expected one of {', '.join(STRATEGIES)}")
        self.known = known
        self.estimate = start
        self._strategy = strategy
        self.used = self.comparisons = 0
        self._seen: Int = np.empty(0, np.int64)
        self._step_covariance = noise.covariance

    def __repr__(self) -> str:
        return f"Localiser({len(self.known)} known lines, at {self.estimate.pose})"

    def move(self, step: ArrayLike) -> PoseEstimate:
        """Predict the pose after an odometry increment (3,): ahead, to the left [m], turn [rad].

        Raises:
            InputError: It is not three finite numbers.
        """
        (increment,) = as_poses([step])
        self.estimate = self.estimate.moved(increment, self._step_covariance)
        return self.estimate

    def see(self, scan: LaserScan) -> PoseEstimate:
        """Correct the pose by a scan, unrolled if its motion is known.

        Raises:
            InputError: It is not a scan.
        """
        expect(scan, LaserScan, "scan")
        local = LocalLines.from_scan(unrolled(scan), self._range_noise)
        pose = self.estimate.pose
        pairs = pair_lines(local, self.known, pose, self.estimate.covariance, self._seen)
        self.comparisons = pairs.comparisons
        if self._strategy == "seen-objects-first":
            self._seen = pairs.objects
        off = innovation(local, self.known, pose, pairs.local, pairs.known)
        self.estimate, used = self.estimate.corrected(off)
        self.used = int(used.sum())
        return self.estimate


def localise(
    localiser: Localiser, scans: Iterable[LaserScan | Sequence[LaserScan]], steps: ArrayLike
) -> Track:
    """Localise the robot at every scan of a drive, from the one that the localiser starts at.

    A run has its scans (k) as ``run.scans``, those of several lasers as ``run.scans_at(index)``;
    the steps (k − 1, 3) are the odometry increments from each scan to the next.

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
    given = numbers(steps, "steps")
    steps = as_poses(given if given.size else given.reshape(-1, 3))
    expect(localiser, Localiser, "localiser")
    rows = []
    for count, scan in enumerate(each_of(scans, object, "scans")):
        # The robot moves between scans, so the first one has no increment before it.
        if 0 < count <= len(steps):
            localiser.move(steps[count - 1])
        for each in (scan,) if isinstance(scan, LaserScan) else each_of(scan, LaserScan, "scan"):
            now = localiser.see(each)
        rows.append((now.pose, now.covariance, localiser.used, localiser.comparisons))
    if len(rows) != len(steps) + 1:
        raise InputError(f"{len(steps)} steps of odometry for {len(rows)} scans")
    return Track(*map(np.array, zip(*rows, strict=True)))
