"""Pairing: which lines of a scan and of a known map are the same (end of section 3.1).

Lines of a scan, known lines and a predicted pose enter; pairs leave. The innovation of a pair is
its difference in the robot's frame: the known line is expected at the angle alpha − theta and at
the distance p = n·(middle − position). Both are linear in the pose and independent of the world's
origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import expect
from lrf3d.geometry.lines import (
    Bool,
    Float,
    Int,
    Value,
    directions,
    lengths,
    normal_lines,
    wrap_angle,
)
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.laser.range_finder import CENTRE
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.matching.surface import DEVIATIONS
from lrf3d.world import World

STRATEGIES = ("seen-objects-first", "all")

# Largest squared Mahalanobis distance of a pair (χ² with two degrees of freedom): it rejects one
# true pair in a thousand.
GATE = 13.8


class LocalLines(NamedTuple):
    """Lines of one scan in the frame of the robot, which is on the left of their segments."""

    segments: Float  # (m, 4) [m].
    lines: Float  # (m, 2) alpha [rad], p [m]: their normals point away from the robot.
    covariances: Float  # (m, 2, 2) of alpha and p.

    @classmethod
    def from_scan(cls, scan: LaserScan, noise: RangeNoise) -> LocalLines:
        """The lines of a scan whose ranges have a noise, seen from the robot's centre.

        If alpha and p change by δα and δp, the line moves sideways by t·δα − δp at a point that is
        t along it from the foot of the robot's perpendicular. So the moments of t over its points
        are the information on alpha and p.
        """
        # Least standard deviation of a range [m]: drawn walls are no straighter, and covariances
        # must be invertible without noise as well.
        least_floor = 2.5e-4
        floor = max(noise.floor, least_floor)
        gap = 2.5  # Gap between two points [m] that always separates two walls of a scan.
        extract = LikelihoodExtractor(gap, 0.0, floor)
        found = extract.walls(scan, 0.0, RangeNoise(floor, noise.growth))
        segments = found.ends
        fits = found.fits
        lines = normal_lines(segments)
        weight, x, y, xx, xy, yy = (fits[name] for name in ("weight", "x", "y", "xx", "xy", "yy"))
        along_x = -np.sin(lines[:, 0])
        along_y = np.cos(lines[:, 0])
        mean = along_x * x + along_y * y
        turn = 1.0 / (along_x**2 * xx + 2.0 * along_x * along_y * xy + along_y**2 * yy)
        if scan.mount != CENTRE:
            # The line turns about the foot of the laser's perpendicular, not of the robot's.
            segments = scan.mount.apply(segments.reshape(-1, 2)).reshape(-1, 4)
            lines = normal_lines(segments)
            aside = np.array([-np.sin(lines[:, 0]), np.cos(lines[:, 0])])
            mean = mean + scan.mount[:2] @ aside
        covariances = np.array([[turn, mean * turn], [mean * turn, 1.0 / weight + mean**2 * turn]])
        return cls(segments, lines, covariances.transpose(2, 0, 1))


@dataclass(frozen=True, eq=False, repr=False)
class KnownLines(Value):
    """Line segments (n, 4) of a known map [m], each of an object (n,) from 0.

    The ``deviations`` (n, 2) are standard deviations of the direction [rad] and of the offset in
    the middle [m]. If ``one_sided``, as in a built map, all lines are visible only from their left;
    else, as in a world, from both sides.

    Examples:
        >>> import lrf3d
        >>> known = lrf3d.KnownLines.from_world(lrf3d.load_world("paper_room"))
        >>> bool(len(known) > 0)
        True
    """

    segments: Float
    objects: Int
    deviations: Float
    one_sided: bool

    def __post_init__(self) -> None:
        self._hold("segments", "deviations")
        self._hold("objects", dtype=np.int64)

    @classmethod
    def from_world(cls, world: World) -> KnownLines:
        """The true walls of a world, visible from both sides."""
        expect(world, World, "world")
        return cls(world.segments, world.objects, np.zeros((len(world.segments), 2)), False)

    @classmethod
    def from_map(cls, line_map: LineMap, *, deviation: float = 0.0) -> KnownLines:
        """A map that a LineMapper built; its segments have the laser on their left.

        The deviation [m] is that of the points that it was fitted to; 0 treats it as the truth.
        """
        expect(line_map, LineMap, "map")
        solid = np.flatnonzero(lengths(line_map.segments) > 0.0)
        segments = line_map.segments[solid]
        offset = deviation / np.sqrt(np.maximum(line_map.points[solid], 1))
        # Points spread evenly over the length L scatter by L/√12 about the middle.
        turn = offset * np.sqrt(12) / lengths(segments)
        return cls(segments, line_map.objects[solid], np.column_stack([turn, offset]), True)

    def __len__(self) -> int:
        return len(self.segments)

    @cached_property
    def frames(self) -> tuple[Float, Float, Float]:
        """The middles (n, 2) and half the lengths (n,) of the lines [m], and directions (n, 2)."""
        # Adding half of the difference to the first end keeps digits far from the origin.
        middles = self.segments[:, :2] + 0.5 * (self.segments[:, 2:] - self.segments[:, :2])
        return middles, 0.5 * lengths(self.segments), directions(self.segments)


class Innovation(NamedTuple):
    """Differences of pairs of lines (…), in the robot's frame."""

    difference: Float  # Measured less expected alpha [rad] and p [m], (…, 2),
    noise: Float  # with its covariance (…, 2, 2), without the share of the pose.
    normal: Float  # The known line's normal (…, 2) in the world, pointing away from the robot.
    faces: Bool  # Whether the robot is on the visible side of the known line.

    def squared_distance(self, covariance: Float) -> Float:
        """Mahalanobis distance squared, for a pose's covariance (…, 3, 3)."""
        normal = self.normal
        angle, offset = np.moveaxis(self.difference, -1, 0)
        turn = self.noise[..., 0, 0] + covariance[..., 2, 2]
        both = self.noise[..., 0, 1] + (normal * covariance[..., :2, 2]).sum(axis=-1)
        along = np.einsum("...i,...ij,...j", normal, covariance[..., :2, :2], normal)
        shift = self.noise[..., 1, 1] + along
        squares = shift * angle**2 - 2.0 * both * angle * offset + turn * offset**2
        return np.asarray(squares / (turn * shift - both**2))


def innovation(
    local: LocalLines, known: KnownLines, pose: Pose, rows: Int, known_rows: Int
) -> Innovation:
    """Compare lines of a scan with known lines, in rows that broadcast, at a predicted pose."""
    middles, _, units = known.frames
    unit = units[known_rows]
    off = middles[known_rows] - [pose.x, pose.y]
    normal = np.stack([unit[..., 1], -unit[..., 0]], axis=-1)
    direction = np.arctan2(normal[..., 1], normal[..., 0])
    turn = wrap_angle(local.lines[rows, 0] - direction + pose.theta)
    faces = np.abs(turn) <= 0.5 * np.pi
    side = np.where(faces, 1.0, -1.0)
    turn = turn - np.where(faces, 0.0, np.copysign(np.pi, turn))
    offset = local.lines[rows, 1] - side * (normal * off).sum(axis=-1)
    # The expected p changes with the direction of the known line by the lever from foot to middle.
    lever = side * (unit * off).sum(axis=-1)
    turn_variance, offset_variance = np.moveaxis(known.deviations[known_rows] ** 2, -1, 0)
    noise = local.covariances[rows] + np.zeros((*lever.shape, 2, 2))
    noise[..., 0, 0] += turn_variance
    noise[..., 0, 1] += lever * turn_variance
    noise[..., 1, 0] = noise[..., 0, 1]
    noise[..., 1, 1] += lever**2 * turn_variance + offset_variance
    seen = faces | (not known.one_sided)
    return Innovation(np.stack([turn, offset], axis=-1), noise, side[..., None] * normal, seen)


class Pairs(NamedTuple):
    """Pairs (k,) of a line of a scan and a known line."""

    local: Int  # Rows of the local lines, in ascending order,
    known: Int  # and of their known lines.
    comparisons: int  # Number of comparisons of a local line with a known one.
    objects: Int  # The objects that were seen, in ascending order.


def pair_lines(
    local: LocalLines, known: KnownLines, pose: Pose, covariance: Float, objects: Int
) -> Pairs:
    """Find the known line of each line of a scan, from a predicted pose with a covariance (3, 3).

    The lines of some objects are compared first, such as those that were seen in the previous scan,
    and the others only where that finds no pair.
    """
    partner = np.full(len(local.lines), -1)
    comparisons = 0
    first = np.isin(known.objects, objects)
    for rows in (np.flatnonzero(first), np.flatnonzero(~first)):
        unpaired = np.flatnonzero(partner < 0)
        found = _misfits(local, known, pose, covariance, unpaired, rows)
        comparisons += found.size
        if found.size:
            fits = np.isfinite(found.min(axis=1))
            partner[unpaired[fits]] = rows[found.argmin(axis=1)[fits]]
    paired = np.flatnonzero(partner >= 0)
    return Pairs(paired, partner[paired], comparisons, np.unique(known.objects[partner[paired]]))


def _misfits(
    local: LocalLines, known: KnownLines, pose: Pose, covariance: Float, rows: Int, known_rows: Int
) -> Float:
    """Misfits (m, n) of local lines (m,) and known ones (n,); +inf where they cannot be a pair.

    A misfit is the squared Mahalanobis distance plus the squared excess: how far the local line
    reaches beyond the known one, which decides between collinear walls. The segments must overlap,
    and the robot must be on the visible side of the known line.
    """
    pairs = innovation(local, known, pose, rows[:, None], known_rows)
    squares = pairs.squared_distance(covariance)
    cos = np.cos(pose.theta)
    sin = np.sin(pose.theta)
    ends = local.segments[rows].reshape(-1, 2, 2) @ np.array([[cos, sin], [-sin, cos]])
    middle = ends.mean(axis=1)
    half = 0.5 * lengths(local.segments[rows])[:, None]
    unit = (ends[:, 1] - ends[:, 0]) / (2.0 * half)
    # How the middle moves along the wall with the position and the heading of the pose.
    gradient = np.column_stack([unit, unit[:, 1] * middle[:, 0] - unit[:, 0] * middle[:, 1]])
    variance = np.einsum("ij,jk,ik->i", gradient, covariance, gradient)[:, None]
    # Standard deviation of the end of a segment along its wall [m], in addition to the uncertainty
    # of the pose: about the distance between neighbouring returns.
    end_deviation = 0.1
    slack = DEVIATIONS * np.sqrt(variance) + end_deviation
    off = known.frames[0][known_rows] - [pose.x, pose.y]
    other = known.frames[1][known_rows]
    apart = np.abs(unit @ off.T - (unit * middle).sum(axis=1)[:, None])
    shorter = 2.0 * np.minimum(half, other)
    # Share of the shorter segment of a pair that must overlap the longer one, with an allowance for
    # the uncertainty of the pose: half, so that no wall is paired with its neighbour.
    least_alongside = 0.5
    beside = np.minimum(half + other - apart, shorter) + slack >= least_alongside * shorter
    excess = np.maximum(half + apart - other, 0.0) ** 2 / (variance + end_deviation**2)
    return np.where(pairs.faces & (squares <= GATE) & beside, squares + excess, np.inf)
