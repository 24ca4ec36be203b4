"""SegmentTable: line segments with the moments of the points they were fitted to.

Moments are the total weight, the mean and the scatter about the mean. They add up: the moments
of two segments together are those of all their points, so a merged line is the exact fit to
all of them, in whatever order they were merged.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from lrf3d.geometry import Float, Int, principal_direction
from lrf3d.mapping.line_map import LineMap, solid_map


@dataclass(frozen=True, slots=True, eq=False)
class SegmentTable:
    """Line segments, a row each.

    Args:
        ends: (m, 4) x1 y1 x2 y2 [m]; the laser saw the segment from its left.
        moments: (m, 6) weight, mean x, mean y [m] and scatter xx, xy, yy about the mean; with
            weights 1/variance [1/m²] the scatter has no unit.
        points: (m,) number of points.
        unions: (m,) the union, or object, that each belongs to.
    """

    ends: Float
    moments: Float
    points: Int
    unions: Int

    @classmethod
    def empty(cls, rows: int = 0) -> "SegmentTable":
        """A table of rows that have no points."""
        points, unions = np.zeros((2, rows), np.int64)
        return cls(np.zeros((rows, 4)), np.zeros((rows, 6)), points, unions)

    def __len__(self) -> int:
        return len(self.ends)

    def take(self, rows: Int) -> "SegmentTable":
        """The table of some rows."""
        return SegmentTable(*(getattr(self, column.name)[rows] for column in fields(self)))

    def join(self, other: "SegmentTable") -> "SegmentTable":
        """The rows of this table and then those of another."""
        return SegmentTable(
            *(
                np.concatenate([getattr(self, column.name), getattr(other, column.name)])
                for column in fields(self)
            )
        )

    def as_map(self, place: Float) -> LineMap:
        """The map of the segments around a place (2,) [m] in the world."""
        return solid_map(self.ends + np.tile(place, 2), self.unions, self.points)

    def shifted(self, offset: Float) -> "SegmentTable":
        """The table with all places moved by an offset (2,) [m]."""
        moments = self.moments.copy()
        moments[:, 1:3] += offset
        return replace(self, ends=self.ends + np.tile(offset, 2), moments=moments)


def measure_moments(points: Float, weights: Float) -> Float:
    """Moments (6,) of points (n, 2) with weights (n,)."""
    total = weights.sum()
    mean = weights @ points / total
    centred = points - mean
    xx, xy, yy = (weights @ (centred[:, i] * centred[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    return np.array([total, mean[0], mean[1], xx, xy, yy])


def add_moments(one: Float, other: Float) -> Float:
    """Moments (6,) of the points of two moments (6,) together."""
    total = one[0] + other[0]
    share = other[0] / total
    dx, dy = other[1] - one[1], other[2] - one[2]
    spread = one[0] * share
    return np.array(
        [
            total,
            one[1] + share * dx,
            one[2] + share * dy,
            one[3] + other[3] + spread * dx * dx,
            one[4] + other[4] + spread * dx * dy,
            one[5] + other[5] + spread * dy * dy,
        ]
    )


def fit_ends(moments: Float, ends: Float) -> Float:
    """The segment (4,) on the best line of moments (6,) that spans all of ends (k, 4).

    It runs the way that the first of the ends do.
    """
    mean = moments[1:3]
    unit = principal_direction(moments[3], moments[4], moments[5])
    if unit @ (ends[0, 2:] - ends[0, :2]) < 0.0:
        unit = -unit
    along = (ends.reshape(-1, 2) - mean) @ unit
    return np.concatenate([mean + along.min() * unit, mean + along.max() * unit])
