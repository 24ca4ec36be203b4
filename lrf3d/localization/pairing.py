"""Pairing lines of a scan with lines of a known map (end of section 3.1).

Local lines, known lines and a predicted pose enter; pairs leave, with the number of comparisons.
Two lines may be a pair by their innovation, the difference of both in the robot's frame: the known
line is expected at the angle alpha − theta and at the distance p = n·(middle − position). Both are
linear in the pose and independent of the world's origin.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, lengths, wrap_angle
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


class Innovation(NamedTuple):
    """Differences of pairs of lines, in the robot's frame; all arrays have the pairs' shape."""

    angle: Float  # Measured less expected alpha [rad],
    offset: Float  # and p [m].
    normal_x: Float  # The known line's normal in the world, pointing away from the robot.
    normal_y: Float
    variance_angle: Float  # Variances of the difference, without the pose's share [rad²],
    covariance: Float  # [rad·m],
    variance_offset: Float  # and [m²].
    faces: Bool  # Whether the robot is on the visible side of the known line.

    def squared_distance(self, pose_covariance: Float) -> Float:
        """Mahalanobis distance squared, of two degrees of freedom, for a pose's (3, 3)."""
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = pose_covariance.tolist()
        x, y, angle, offset = self.normal_x, self.normal_y, self.angle, self.offset
        aa, ap = self.variance_angle + tt, self.covariance + x * xt + y * yt
        pp = self.variance_offset + x * x * xx + 2.0 * x * y * xy + y * y * yy
        return np.asarray(
            (pp * angle**2 - 2.0 * ap * angle * offset + aa * offset**2) / (aa * pp - ap**2)
        )


def innovation(
    local: LocalLines, known: KnownLines, pose: Pose, rows: Int, known_rows: Int
) -> Innovation:
    """Compare lines of a scan with known lines, in rows that broadcast, at a predicted pose."""
    x, y = known.units[known_rows, 1], -known.units[known_rows, 0]
    dx = known.middles[known_rows, 0] - pose.x
    dy = known.middles[known_rows, 1] - pose.y
    turn = wrap_angle(local.lines[rows, 0] - np.arctan2(y, x) + pose.theta)
    faces = np.abs(turn) <= 0.5 * np.pi
    side = np.where(faces, 1.0, -1.0)
    # The expected p changes with the direction of the known line by the lever from foot to middle.
    expected, lever = side * (x * dx + y * dy), side * (x * dy - y * dx)
    turn_variance = known.deviations[known_rows, 0] ** 2
    covariances = local.covariances[rows]
    return Innovation(
        turn - np.where(faces, 0.0, np.copysign(np.pi, turn)),
        local.lines[rows, 1] - expected,
        side * x,
        side * y,
        covariances[..., 0, 0] + turn_variance,
        covariances[..., 0, 1] + lever * turn_variance,
        covariances[..., 1, 1] + lever**2 * turn_variance + known.deviations[known_rows, 1] ** 2,
        faces | (not known.one_sided),
    )


class Pairs(NamedTuple):
    """Pairs (k,) of a line of a scan and a known line."""

    local: Int  # Rows of the local lines, in ascending order,
    known: Int  # and of their known lines.
    comparisons: int  # Number of comparisons of a local line with a known one.
    objects: Int  # The objects that were seen, in ascending order.


def pair_lines(
    local: LocalLines,
    known: KnownLines,
    pose: Pose,
    covariance: Float,
    *,
    strategy: str = STRATEGIES[0],
    seen: Int | None = None,
) -> Pairs:
    """Find the known line of each line of a scan, from a predicted pose with a covariance (3, 3).

    The strategy ``all`` compares all lines with all; ``seen-objects-first`` compares first with the
    lines of the objects that were seen in the previous scan, and with the others only where that
    finds no pair.
    """
    partner = np.full(len(local), -1)
    every = np.arange(len(known))
    first = np.zeros(len(known), np.bool_)
    if strategy == STRATEGIES[0] and seen is not None:
        first = np.isin(known.objects, seen)
    comparisons = 0
    for rows in (every[first], every[~first]):
        unpaired = np.flatnonzero(partner < 0)
        found = scores(local.take(unpaired), known, rows, pose, covariance)
        comparisons += found.size
        if found.size:
            best = found.argmin(axis=1)
            fits = np.isfinite(found[np.arange(len(found)), best])
            partner[unpaired[fits]] = rows[best[fits]]
    paired = np.flatnonzero(partner >= 0)
    return Pairs(paired, partner[paired], comparisons, np.unique(known.objects[partner[paired]]))


def scores(local: LocalLines, known: KnownLines, rows: Int, pose: Pose, covariance: Float) -> Float:
    """How badly local lines (m) fit some rows (n,) of known ones (m, n); +inf where not at all.

    It is the squared Mahalanobis distance, and the squared excess of the local line: of collinear
    walls the best is the one that the local line extends beyond least. The segments must overlap,
    and the robot must be on the visible side of the known line.
    """
    difference = innovation(local, known, pose, np.arange(len(local))[:, None], rows[None, :])
    squares = difference.squared_distance(covariance)
    beside, excess = _alongside(local, known, rows, pose, covariance)
    return np.where(difference.faces & (squares <= GATE) & beside, squares + excess, np.inf)


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
