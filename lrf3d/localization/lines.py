"""Lines for localisation: those of one scan, and those of a known map.

The input is the local map of a scan, a world or a built map; the output is lines (alpha, p) with
their accuracy. Local lines are computed in the robot's frame, independently of the world's origin.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.errors import expect
from lrf3d.geometry import Float, Int, Value, directions, lengths, normal_lines
from lrf3d.laser import RangeNoise
from lrf3d.mapping.line_map import LineMap
from lrf3d.world import World

COVARIANCE_BEAMS = 16
"""Number of beams that represent all returns of a segment when its covariance is computed: with
more, the covariance changes by less than a percent."""

LEAST_INCIDENCE = 0.05
"""Smallest cosine of incidence in a variance: for grazing beams other errors dominate."""

LEAST_DEVIATION = 1e-5
"""Least standard deviation of a range [m], so that covariances can be inverted without noise: no
wall is flat to a hundredth of a millimetre."""


@dataclass(frozen=True, eq=False, repr=False)
class LocalLines(Value):
    """Lines (m, 2) alpha [rad], p [m] of one scan, in the frame of the robot.

    Their normals point away from the robot, which is on the left of their segments (m, 4) [m];
    covariances (m, 2, 2) are those of alpha and p.
    """

    segments: Float
    lines: Float
    covariances: Float

    def __post_init__(self) -> None:
        self._hold("segments", "lines", "covariances")

    @classmethod
    def from_map(
        cls, local_map: LineMap, noise: RangeNoise, *, spacing: float | None = None
    ) -> "LocalLines":
        """The lines of a local map that was made in the robot's frame, by ranges with a noise.

        The spacing is the angle [rad] between two beams of the scan, if it is known.
        """
        segments = local_map.segments.copy()
        right = segments[:, 0] * segments[:, 3] - segments[:, 1] * segments[:, 2] < 0.0
        segments[right] = segments[right][:, [2, 3, 0, 1]]
        usable = (lengths(segments) > 0.0) & (local_map.points >= 2)
        segments, points = segments[usable], local_map.points[usable]
        lines = normal_lines(segments)
        covariances = line_covariances(segments, lines, points, noise, spacing=spacing)
        return cls(segments, lines, covariances)

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, rows: Int) -> "LocalLines":
        """Some of the lines."""
        return LocalLines(self.segments[rows], self.lines[rows], self.covariances[rows])


def line_covariances(
    segments: Float, lines: Float, points: Int, noise: RangeNoise, *, spacing: float | None = None
) -> Float:
    """Covariances (m, 2, 2) of alpha [rad] and p [m] of lines fitted to the points of a scan.

    The points (m,) of a segment were measured by beams a constant angle apart. At the distance t
    along the line from the foot of the robot's perpendicular, a change of the line moves it
    sideways by t·δα − δp; there a point has the variance of its range times the square of the
    cosine of incidence. The sum over all points is the information matrix.

    With the spacing [rad] between two beams, a segment that was extended to a corner counts only as
    far as its points reach; without it, its ends count as points.
    """
    alpha, p = lines[:, :1], lines[:, 1:]
    along = np.stack([-np.sin(alpha[:, 0]), np.cos(alpha[:, 0])], axis=-1)
    first = np.einsum("ij,ij->i", segments[:, :2], along)[:, None]
    last = np.einsum("ij,ij->i", segments[:, 2:], along)[:, None]
    low, high = np.minimum(first, last), np.maximum(first, last)
    start, turn = np.arctan2(low, p), np.arctan2(high, p) - np.arctan2(low, p)
    # Each beam covers the angle halfway to its neighbours; so do the outermost ones.
    step = turn / (points[:, None] - 1.0)
    if spacing is not None:
        step = np.minimum(step, spacing)
    width = points[:, None] * step
    share = (np.arange(COVARIANCE_BEAMS) + 0.5) / COVARIANCE_BEAMS
    angles = start + 0.5 * (turn - width) + width * share
    # For a wall that points at the robot the tangent is unbounded.
    margin = (high - low) / (points[:, None] - 1.0)
    t = np.clip(p * np.tan(angles), low - margin, high + margin)
    ranges = np.maximum(np.hypot(p, t), np.finfo(np.float64).tiny)
    incidence = np.maximum(p / ranges, LEAST_INCIDENCE)
    variance = np.maximum(noise.variance(ranges), LEAST_DEVIATION**2)
    weights = points[:, None] / COVARIANCE_BEAMS / (variance * incidence**2)
    total, first_moment = weights.sum(axis=1), (weights * t).sum(axis=1)
    mean = first_moment / total
    # About the mean, so that a short segment far along its line loses no digits. Points that lie
    # evenly scatter by (1 − 1/n²)·length²/12; the samples do so with their own number.
    spread = (weights * (t - mean[:, None]) ** 2).sum(axis=1)
    seen = np.divide(width, turn, out=np.ones_like(turn), where=turn > 0.0)
    evenly = total * ((high - low) * seen)[:, 0] ** 2 / 12.0
    spread += evenly * (1.0 / COVARIANCE_BEAMS**2 - 1.0 / points**2)
    # On a wall that points straight at the robot all samples are at one place.
    spread = np.maximum(spread, evenly / points**2)
    angle_variance = 1.0 / spread
    covariances = np.empty((len(lines), 2, 2))
    covariances[:, 0, 0] = angle_variance
    covariances[:, 0, 1] = covariances[:, 1, 0] = mean * angle_variance
    covariances[:, 1, 1] = 1.0 / total + mean**2 * angle_variance
    return covariances


@dataclass(frozen=True, eq=False, repr=False)
class KnownLines(Value):
    """Line segments (n, 4) of a known map [m], each of an object (n,) from 0.

    Each has its middle (n, 2) [m], its direction (n, 2), half of its length (n,) [m], and standard
    deviations (n, 2) of the direction [rad] and of the offset in the middle [m]; all are visible
    from both sides, or only from their left. They come of a world or of a built map.

    Examples:
        >>> import lrf3d
        >>> known = lrf3d.KnownLines.from_world(lrf3d.load_world("paper_room"))
        >>> bool(len(known) > 0)
        True
    """

    segments: Float
    objects: Int
    middles: Float
    units: Float
    halves: Float
    deviations: Float
    one_sided: bool

    def __post_init__(self) -> None:
        self._hold("segments", "middles", "units", "halves", "deviations")
        self._hold("objects", dtype=np.int64)

    @classmethod
    def from_world(cls, world: World) -> "KnownLines":
        """The true walls of a world, visible from both sides."""
        expect(world, World, "world")
        return cls._of(world.segments, world.objects, np.zeros((len(world.segments), 2)), False)

    @classmethod
    def from_map(cls, line_map: LineMap, *, deviation: float = 0.0) -> "KnownLines":
        """A map that a LineMapper built; its segments have the laser on their left.

        The deviation [m] is that of the points that it was fitted to; 0 treats it as the truth.
        """
        expect(line_map, LineMap, "map")
        solid = np.flatnonzero(lengths(line_map.segments) > 0.0)
        segments = line_map.segments[solid]
        offset = deviation / np.sqrt(np.maximum(line_map.points[solid], 1))
        # Points spread evenly over the length L scatter by L/√12 about the middle.
        turn = offset * np.sqrt(12.0) / lengths(segments)
        return cls._of(segments, line_map.objects[solid], np.column_stack([turn, offset]), True)

    @classmethod
    def _of(cls, segments: Float, objects: Int, deviations: Float, one_sided: bool) -> "KnownLines":
        return cls(
            segments=segments,
            objects=objects,
            # Adding half the difference to the first end keeps digits far from the origin.
            middles=segments[:, :2] + 0.5 * (segments[:, 2:] - segments[:, :2]),
            units=directions(segments),
            halves=0.5 * lengths(segments),
            deviations=deviations,
            one_sided=one_sided,
        )

    def __len__(self) -> int:
        return len(self.segments)
