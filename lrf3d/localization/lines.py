"""Lines for localisation: those of one scan, and those of a known map.

A scan, a world or a built map enters; lines (alpha, p) with their accuracy leave. Those of a scan
are computed in the robot's frame, independently of the world's origin.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lrf3d.errors import expect
from lrf3d.geometry import Float, Int, Value, directions, lengths, normal_lines
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.world import World

GAP = 2.5
"""Gap between two points [m] that always parts two walls of a scan."""

LEAST_FLOOR = 2.5e-4
"""Least deviation of a range [m]: drawn walls are not straight to less, and covariances are to be
inverted without noise, too."""


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
    def from_scan(cls, scan: LaserScan, noise: RangeNoise) -> "LocalLines":
        """The lines of a scan whose ranges have a noise.

        A change of a line moves it sideways by t·δα − δp at the distance t along it from the foot
        of the robot's perpendicular, so the moments of its points are its information.
        """
        floor = max(noise.floor, LEAST_FLOOR)
        extract = LikelihoodExtractor(GAP, 0.0, floor)
        segments, moments, _ = extract.walls(scan, 0.0, RangeNoise(floor, noise.growth))
        lines = normal_lines(segments)
        weight, x, y, xx, xy, yy = moments.T
        along_x, along_y = -np.sin(lines[:, 0]), np.cos(lines[:, 0])
        mean = along_x * x + along_y * y
        turn = 1.0 / (along_x**2 * xx + 2.0 * along_x * along_y * xy + along_y**2 * yy)
        covariances = np.array([[turn, mean * turn], [mean * turn, 1.0 / weight + mean**2 * turn]])
        return cls(segments, lines, covariances.transpose(2, 0, 1))

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, rows: Int) -> "LocalLines":
        """Some of the lines."""
        return LocalLines(self.segments[rows], self.lines[rows], self.covariances[rows])


@dataclass(frozen=True, eq=False, repr=False)
class KnownLines(Value):
    """Line segments (n, 4) of a known map [m], each of an object (n,) from 0.

    Standard deviations (n, 2) are those of the direction [rad] and of the offset in the middle [m];
    all lines are visible from both sides, or only from their left. They come of a world or of a
    built map.

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
    def from_world(cls, world: World) -> "KnownLines":
        """The true walls of a world, visible from both sides."""
        expect(world, World, "world")
        return cls(world.segments, world.objects, np.zeros((len(world.segments), 2)), False)

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
        return cls(segments, line_map.objects[solid], np.column_stack([turn, offset]), True)

    def __len__(self) -> int:
        return len(self.segments)

    @cached_property
    def middles(self) -> Float:
        """The middle (n, 2) of each line [m]."""
        # Adding half of the difference to the first end keeps digits far from the origin.
        return self.segments[:, :2] + 0.5 * (self.segments[:, 2:] - self.segments[:, :2])

    @cached_property
    def units(self) -> Float:
        """The direction (n, 2) of each line."""
        return directions(self.segments)

    @cached_property
    def halves(self) -> Float:
        """Half of the length (n,) of each line [m]."""
        return 0.5 * lengths(self.segments)
