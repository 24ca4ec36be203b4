"""Pairing: which line of a known map each line of a scan shows (end of section 3.1).

Local lines, known lines and a predicted pose enter; pairs leave, with the number of comparisons
that it took. A strategy says which are compared, a criterion which of those may be a pair.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, Value, lengths, wrap_angle
from lrf3d.mapping.innovation import innovation
from lrf3d.mapping.known_lines import KnownLines
from lrf3d.mapping.local_lines import LocalLines
from lrf3d.pose import Pose

STRATEGIES = ("unions-first", "all")

GATE = 13.8
"""Largest squared Mahalanobis distance of a pair: one true pair in a thousand lies beyond it, of
two degrees of freedom."""

LEAST_OVERLAP = 0.5
"""Share of the shorter segment of a pair that must lie alongside the longer one, after what the
pose's uncertainty may shift it: the half, so that a wall is never taken for its neighbour."""

END_DEVIATION = 0.1
"""How far the end of a segment may be off along its wall [m], beside what the pose's uncertainty
shifts it: about the distance of two neighbouring returns."""


class Criterion(Protocol):
    """Anything that says how well local lines fit known ones."""

    def scores(
        self, local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
    ) -> Float:
        """Compare all local lines (m) with some known rows (n,).

        Returns:
            (m, n) scores, the least the best; +inf for what is no pair.
        """
        ...


@dataclass(frozen=True, slots=True)
class SquaredDifferences:
    """The paper's: the squared differences of (alpha, p) in the world sum up to little.

    It adds radians to metres, and p is counted from the world's origin: a direction off by
    0.01 rad moves the p of a line 100 m away by 1 m. Nothing tells collinear walls apart.

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
    """A pair differs by no more than its lines and the pose are uncertain, in the robot's frame.

    It also lies side by side, and the known line shows its seen side. Among walls on one line,
    that one fits best beyond which the local line reaches least.

    Args:
        gate: Largest squared distance, of two degrees of freedom.
    """

    gate: float = GATE

    def scores(
        self, local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
    ) -> Float:
        """Squared Mahalanobis distances (m, n), and the squared excess of the local line."""
        every, some = np.arange(len(local))[:, None], rows[None, :]
        difference = innovation(local, known, pose, rows=every, known_rows=some)
        squares = difference.squared_distance(covariance)
        beside, excess = _alongside(local, known, rows, pose, covariance)
        fits = difference.faces & (squares <= self.gate) & beside
        return np.where(fits, squares + excess, np.inf)


def _alongside(
    local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float
) -> tuple[Bool, Float]:
    """Whether local and known lines overlap, and the squared excess in deviations (m, n)."""
    cos, sin = np.cos(pose.theta), np.sin(pose.theta)
    turned = local.segments.reshape(-1, 2, 2) @ np.array([[cos, sin], [-sin, cos]])
    middle = turned.mean(axis=1)
    unit = (turned[:, 1] - turned[:, 0]) / lengths(local.segments)[:, None]
    half = 0.5 * lengths(local.segments)[:, None]
    # Where the middle goes along the wall as the pose moves: with the place, and with the turn.
    gradient = np.column_stack([unit, unit[:, 1] * middle[:, 0] - unit[:, 0] * middle[:, 1]])
    variance = np.einsum("ij,jk,ik->i", gradient, covariance, gradient)[:, None]
    slack = 3.0 * np.sqrt(variance) + END_DEVIATION
    place = known.middles[rows] - [pose.x, pose.y]
    apart = np.abs(unit @ place.T - np.einsum("ij,ij->i", unit, middle)[:, None])
    other = known.halves[rows]
    overlap = np.minimum(half + other - apart, 2.0 * np.minimum(half, other))
    beside = overlap + slack >= LEAST_OVERLAP * 2.0 * np.minimum(half, other)
    excess = np.maximum(half + apart - other, 0.0)
    return beside, np.asarray(excess**2 / (variance + END_DEVIATION**2))


@dataclass(frozen=True, eq=False)
class Pairs(Value):
    """Lines of a scan with the known lines that they show.

    Args:
        local: (k,) rows of the local lines, rising.
        known: (k,) the row of the known line of each.
        comparisons: How often a local line was compared with a known one.
        objects: The objects that were seen, rising.
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
    strategy: str = "unions-first",
    seen: Int | None = None,
) -> Pairs:
    """Find for each line of a scan the known line that it shows.

    Args:
        local: The lines of the scan, in the robot's frame.
        known: The known map.
        pose: The predicted pose.
        covariance: (3, 3) covariance of the pose, x, y [m], theta [rad].
        criterion: What makes a pair; a MahalanobisGate where not given.
        strategy: ``all`` compares all with all; ``unions-first`` looks among the lines of the
            objects seen before, and among the rest only for what is not found there.
        seen: Objects that the previous scan showed; none where not given.

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
    if strategy == "unions-first":
        first = known.of_objects(nothing if seen is None else seen)
        partner = _best(criterion.scores(local, known, first, pose, covariance), first)
        comparisons += len(local) * len(first)
        rest = np.delete(rest, first)
    lonely = np.flatnonzero(partner < 0)
    if len(lonely):
        scores = criterion.scores(local.take(lonely), known, rest, pose, covariance)
        partner[lonely] = _best(scores, rest)
        comparisons += len(lonely) * len(rest)
    paired = np.flatnonzero(partner >= 0)
    return Pairs(paired, partner[paired], comparisons, np.unique(known.objects[partner[paired]]))


def _best(scores: Float, rows: Int) -> Int:
    """The row with the least score for each local line (m,), −1 where none is a pair."""
    if not scores.size:
        return np.full(len(scores), -1)
    best = scores.argmin(axis=1)
    found = np.isfinite(scores[np.arange(len(scores)), best])
    return np.where(found, rows[best], -1)
