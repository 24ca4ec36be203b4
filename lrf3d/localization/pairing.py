"""Pairing lines of a scan with lines of a known map (end of section 3.1).

The input is local lines, known lines and a predicted pose; the output is pairs, with the number of
comparisons. A strategy selects the lines to compare. A criterion decides which of them may be a
pair by their innovation, the difference of both lines in the robot's frame: the known line is
expected at the angle alpha − theta and at the distance p = n·(middle − position). Both are linear
in the pose and independent of the world's origin.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, Value, lengths, wrap_angle
from lrf3d.localization.lines import KnownLines, LocalLines
from lrf3d.pose import Pose

STRATEGIES = ("seen-objects-first", "all")

GATE = 13.8
"""Largest squared Mahalanobis distance of a pair, with two degrees of freedom: it rejects one true
pair in a thousand."""

LEAST_ALONGSIDE = 0.5
"""Share of the shorter segment of a pair that must overlap the longer one, with an allowance for
the uncertainty of the pose: half, so that no wall is paired with its neighbour."""

END_DEVIATION = 0.1
"""Standard deviation of the end of a segment along its wall [m], in addition to the uncertainty of
the pose: about the distance between neighbouring returns."""


class Criterion(Protocol):
    """Anything that scores how well local lines fit known ones."""

    def scores(
        self, local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
    ) -> Float:
        """Compare all local lines (m) with some known rows (n,).

        Returns:
            (m, n) scores, of which the lowest is best; +inf for lines that are not a pair.
        """
        ...


@dataclass(frozen=True, slots=True)
class SquaredDifferences:
    """The paper's criterion: a small sum of the squared differences of alpha and p in the world.

    It adds radians to metres, and p is relative to the world's origin: an error of 0.01 rad moves
    the p of a line 100 m away by 1 m. It cannot distinguish collinear walls.

    Args:
        threshold: Largest sum of the squares.
    """

    threshold: float = 0.25

    def scores(
        self, local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
    ) -> Float:
        """Sums of squared differences (m, n)."""
        alpha = wrap_angle(local.lines[:, 0] + pose.theta)
        p = local.lines[:, 1] + pose.x * np.cos(alpha) + pose.y * np.sin(alpha)
        alpha, p = np.where(p < 0.0, wrap_angle(alpha + np.pi), alpha), np.abs(p)
        lines = known.lines[rows]
        squares = wrap_angle(alpha[:, None] - lines[:, 0]) ** 2 + (p[:, None] - lines[:, 1]) ** 2
        return np.where(squares < self.threshold, squares, np.inf)


@dataclass(frozen=True, slots=True)
class MahalanobisGate:
    """A gate on the Mahalanobis distance of both lines in the robot's frame.

    The segments must overlap as well, and the robot must be on the visible side of the known
    line. Of collinear walls the best is the one that the local line extends beyond least.

    Args:
        gate: Largest squared distance, with two degrees of freedom.
    """

    gate: float = GATE

    def scores(
        self, local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
    ) -> Float:
        """Squared Mahalanobis distances (m, n), and the squared excess of the local line."""
        every = np.arange(len(local))[:, None]
        difference = innovation(local, known, pose, rows=every, known_rows=rows[None, :])
        squares = difference.squared_distance(covariance)
        beside, excess = _alongside(local, known, rows, pose, covariance)
        fits = difference.faces & (squares <= self.gate) & beside
        return np.where(fits, squares + excess, np.inf)


def _alongside(
    local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
) -> tuple[Bool, Float]:
    """Whether local and known lines overlap, and the squared normalised excess (m, n)."""
    cos, sin = np.cos(pose.theta), np.sin(pose.theta)
    turned = local.segments.reshape(-1, 2, 2) @ np.array([[cos, sin], [-sin, cos]])
    middle = turned.mean(axis=1)
    unit = (turned[:, 1] - turned[:, 0]) / lengths(local.segments)[:, None]
    half = 0.5 * lengths(local.segments)[:, None]
    # How the middle moves along the wall with the position and the heading of the pose.
    gradient = np.column_stack([unit, unit[:, 1] * middle[:, 0] - unit[:, 0] * middle[:, 1]])
    variance = np.einsum("ij,jk,ik->i", gradient, covariance, gradient)[:, None]
    # Three standard deviations of the pose, so that hardly any true pair is lost.
    slack = 3.0 * np.sqrt(variance) + END_DEVIATION
    known_middle = known.middles[rows] - [pose.x, pose.y]
    apart = np.abs(unit @ known_middle.T - np.einsum("ij,ij->i", unit, middle)[:, None])
    other = known.halves[rows]
    overlap = np.minimum(half + other - apart, 2.0 * np.minimum(half, other))
    beside = overlap + slack >= LEAST_ALONGSIDE * 2.0 * np.minimum(half, other)
    excess = np.maximum(half + apart - other, 0.0)
    return beside, np.asarray(excess**2 / (variance + END_DEVIATION**2))


@dataclass(frozen=True, eq=False)
class Pairs(Value):
    """Pairs of a line of a scan and a known line.

    Args:
        local: (k,) rows of the local lines, in ascending order.
        known: (k,) rows of their known lines.
        comparisons: Number of comparisons of a local line with a known one.
        objects: The objects that were seen, in ascending order.
    """

    local: Int
    known: Int
    comparisons: int
    objects: Int

    def __post_init__(self) -> None:
        self._hold("local", "known", "objects", dtype=np.int64)

    def __len__(self) -> int:
        return len(self.local)


def pair_lines(
    local: LocalLines,
    known: KnownLines,
    pose: Pose,
    covariance: Float,
    *,
    criterion: Criterion | None = None,
    strategy: str = "seen-objects-first",
    seen: Int | None = None,
) -> Pairs:
    """Find the known line of each line of a scan.

    Args:
        local: The lines of the scan, in the robot's frame.
        known: The known map.
        pose: The predicted pose.
        covariance: (3, 3) covariance of the pose, x, y [m], theta [rad].
        criterion: Decides which lines are a pair; a MahalanobisGate if not given.
        strategy: ``all`` compares all lines with all; ``seen-objects-first`` compares first with
            the lines of the objects in ``seen``, and with the others only where that finds no pair.
        seen: Objects that were seen in the previous scan; none if not given.

    Raises:
        InputError: There is no such strategy.
    """
    if strategy not in STRATEGIES:
        raise InputError(f"strategy {strategy!r}: expected one of {', '.join(STRATEGIES)}")
    criterion = MahalanobisGate() if criterion is None else criterion
    nothing = np.empty(0, np.int64)
    rest = np.arange(len(known))
    partner = np.full(len(local), -1)
    comparisons = 0
    if strategy == "seen-objects-first":
        first = known.of_objects(nothing if seen is None else seen)
        partner = _best(criterion.scores(local, known, first, pose, covariance), first)
        comparisons += len(local) * len(first)
        rest = np.delete(rest, first)
    unpaired = np.flatnonzero(partner < 0)
    if len(unpaired):
        scores = criterion.scores(local.take(unpaired), known, rest, pose, covariance)
        partner[unpaired] = _best(scores, rest)
        comparisons += len(unpaired) * len(rest)
    paired = np.flatnonzero(partner >= 0)
    return Pairs(paired, partner[paired], comparisons, np.unique(known.objects[partner[paired]]))


def _best(scores: Float, rows: Int) -> Int:
    """The row with the lowest score for each local line (m,), or −1 if none is a pair."""
    if not scores.size:
        return np.full(len(scores), -1)
    best = scores.argmin(axis=1)
    found = np.isfinite(scores[np.arange(len(scores)), best])
    return np.where(found, rows[best], -1)


class Innovation(NamedTuple):
    """Differences of pairs of lines, in the robot's frame; all arrays have the pairs' shape.

    Attributes:
        angle: Measured less expected alpha [rad].
        offset: Measured less expected p [m].
        normal_x: x and y of the known line's normal in the world, pointing away from the robot.
        normal_y: See above.
        variance_angle: Variances [rad², rad·m, m²] of the difference, without the pose's share.
        covariance: See above.
        variance_offset: See above.
        faces: Whether the robot is on the visible side of the known line.
    """

    angle: Float
    offset: Float
    normal_x: Float
    normal_y: Float
    variance_angle: Float
    covariance: Float
    variance_offset: Float
    faces: Bool

    def with_pose(self, pose_covariance: Float) -> tuple[Float, Float, Float]:
        """Variances of the difference, with the share of a pose's covariance (3, 3)."""
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = pose_covariance.tolist()
        x, y = self.normal_x, self.normal_y
        return (
            self.variance_angle + tt,
            self.covariance + x * xt + y * yt,
            self.variance_offset + x * x * xx + 2.0 * x * y * xy + y * y * yy,
        )

    def squared_distance(self, pose_covariance: Float) -> Float:
        """Mahalanobis distance squared, of two degrees of freedom."""
        aa, ap, pp = self.with_pose(pose_covariance)
        angle, offset = self.angle, self.offset
        return np.asarray(
            (pp * angle**2 - 2.0 * ap * angle * offset + aa * offset**2) / (aa * pp - ap**2)
        )


def innovation(
    local: LocalLines, known: KnownLines, pose: Pose, *, rows: Int, known_rows: Int
) -> Innovation:
    """Compare lines of a scan with known lines, for a robot at a predicted pose.

    Args:
        local: The lines of the scan.
        known: The known map.
        pose: The estimated pose.
        rows: Rows of the scan's lines, of any shape that broadcasts with known_rows.
        known_rows: Rows of the known lines.
    """
    x, y = known.units[known_rows, 1], -known.units[known_rows, 0]
    dx = known.middles[known_rows, 0] - pose.x
    dy = known.middles[known_rows, 1] - pose.y
    turn = wrap_angle(local.lines[rows, 0] - np.arctan2(y, x) + pose.theta)
    faces = np.abs(turn) <= 0.5 * np.pi
    side = np.where(faces, 1.0, -1.0)
    angle = turn - np.where(faces, 0.0, np.copysign(np.pi, turn))
    # The expected p changes with the direction of the known line by the lever from foot to middle.
    expected, lever = side * (x * dx + y * dy), side * (x * dy - y * dx)
    turn_variance = known.deviations[known_rows, 0] ** 2
    covariances = local.covariances[rows]
    return Innovation(
        angle,
        local.lines[rows, 1] - expected,
        side * x,
        side * y,
        covariances[..., 0, 0] + turn_variance,
        covariances[..., 0, 1] + lever * turn_variance,
        covariances[..., 1, 1] + lever**2 * turn_variance + known.deviations[known_rows, 1] ** 2,
        faces | (not known.one_sided),
    )
