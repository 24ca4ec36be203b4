"""Rows of walls: the arrays that a growing map and what changes in it are kept in.

They are named tuples of arrays, which compiled code takes as they are.
"""

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int

Number = TypeVar("Number", np.float64, np.int64)


class Walls(NamedTuple):
    """The walls of a map, a row each; arrays have room for more.

    Args:
        ends: (rows, 4) x1 y1 x2 y2 [m]; the laser saw the wall from its left.
        moments: (rows, 6) weight, mean and scatter of its points.
        points: (rows,) number of its points; 0 where the row is free.
        unions: (rows,) the union each belongs to.
    """

    ends: Float
    moments: Float
    points: Int
    unions: Int

    @classmethod
    def of_size(cls, rows: int) -> "Walls":
        """Free rows."""
        return cls(
            np.zeros((rows, 4)),
            np.zeros((rows, 6)),
            np.zeros(rows, np.int64),
            np.zeros(rows, np.int64),
        )

    def take(self, rows: Int | slice) -> "Walls":
        """Copies of some rows."""
        ends, moments = self.ends[rows].copy(), self.moments[rows].copy()
        return Walls(ends, moments, self.points[rows].copy(), self.unions[rows].copy())

    def put(self, rows: Int, walls: "Walls") -> None:
        """Write walls into rows."""
        self.ends[rows], self.moments[rows] = walls.ends, walls.moments
        self.points[rows], self.unions[rows] = walls.points, walls.unions

    def doubled(self) -> "Walls":
        """The walls with as many free rows behind them."""
        ends, moments = longer(self.ends), longer(self.moments)
        return Walls(ends, moments, longer(self.points), longer(self.unions))


class Changes(NamedTuple):
    """What one update changed: the rows and what stood in them before, to be able to go back.

    Args:
        number: (3,) counts of changed rows, of bonds and of searches.
        rows: (rows,) the rows.
        before: What stood in them.
        stamps: (rows,) the last update that changed each row.
        searched: (rows,) the last search that met each row.
        bonds: (bonds, 2) unions that merging made one.
    """

    number: Int
    rows: Int
    before: Walls
    stamps: Int
    searched: Int
    bonds: Int

    @classmethod
    def of_size(cls, rows: int) -> "Changes":
        """No changes yet."""
        return cls(
            np.zeros(3, np.int64),
            np.empty(rows, np.int64),
            Walls.of_size(rows),
            np.zeros(rows, np.int64),
            np.zeros(rows, np.int64),
            np.empty((rows, 2), np.int64),
        )

    def doubled(self) -> "Changes":
        """The same with room for twice as many rows."""
        return self._replace(
            rows=longer(self.rows),
            before=self.before.doubled(),
            stamps=longer(self.stamps),
            searched=longer(self.searched),
        )


def longer(column: NDArray[Number]) -> NDArray[Number]:
    """An array with as many zeros behind it as it has rows."""
    return np.concatenate([column, np.zeros_like(column)])
