"""KnownLines: a map that is known already, made ready to find the lines of a scan in it."""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, Int, Value, directions, lengths, normal_lines
from lrf3d.mapping.line_map import LineMap
from lrf3d.world import World


@dataclass(frozen=True, eq=False)
class KnownLines(Value):
    """Line segments of a known map.

    Args:
        segments: (n, 4) x1 y1 x2 y2 [m] in the world.
        objects: (n,) the object, or union, that each belongs to, from 0.
        middles: (n, 2) the middle of each [m].
        units: (n, 2) direction of each, from its first end to its second.
        halves: (n,) half the length of each [m].
        lines: (n, 2) alpha [rad], p [m] in the world (Eq. 3).
        deviations: (n, 2) standard deviation of the direction [rad], and of the offset in the
            middle [m].
        one_sided: Whether each is seen only from its left.
    """

    segments: Float
    objects: Int
    middles: Float
    units: Float
    halves: Float
    lines: Float
    deviations: Float
    one_sided: bool

    def __post_init__(self) -> None:
        self._hold("segments", "middles", "units", "halves", "lines", "deviations")
        self._hold("objects", dtype=np.int64)

    @classmethod
    def from_world(cls, world: World) -> "KnownLines":
        """The true walls of a world, seen from both sides."""
        return cls._of(world.segments, world.objects, np.zeros((len(world.segments), 2)), False)

    @classmethod
    def from_map(cls, line_map: LineMap, *, deviation: float = 0.0) -> "KnownLines":
        """A map that a LineMapper built; its segments have the laser on their left.

        Args:
            line_map: The map.
            deviation: Standard deviation [m] of the points that the map was fitted to; with 0
                the map is taken for the truth.
        """
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
            # Halves are added to the first end, which keeps the digits of places far away.
            middles=segments[:, :2] + 0.5 * (segments[:, 2:] - segments[:, :2]),
            units=directions(segments),
            halves=0.5 * lengths(segments),
            lines=normal_lines(segments),
            deviations=deviations,
            one_sided=one_sided,
        )

    def __len__(self) -> int:
        return len(self.segments)

    def of_objects(self, objects: Int) -> Int:
        """Rows of the segments that belong to any of some objects."""
        return np.flatnonzero(np.isin(self.objects, objects))
