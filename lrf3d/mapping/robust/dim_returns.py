"""Dim returns: single returns that may be of glass, kept until a line of glass goes through them.

Glass returns few beams between the places where it flashes, often one in a scan, and often before
the flash that shows its line. What enters are the returns of each scan that lie on no known line;
what leaves are those on a line that has become known since, or better known.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.robust.optics_constants import (
    DIM_CELL,
    DIM_SHARE,
    MOST_DIM,
    PANE_DEVIATIONS,
    PANE_DISTANCE,
    PANE_GAP,
)


class Line(NamedTuple):
    """A line of glass, as far as it is known.

    Attributes:
        point: (2,) where stations along it count from [m].
        unit: (2,) its direction.
        mean: (2,) the mean of its returns [m].
        weight: Inverse variance of the mean [1/m²].
        spread: Inverse variance of the direction [1/rad²].
        low: Station of the first return [m].
        high: Station of the last one [m].
    """

    point: Float
    unit: Float
    mean: Float
    weight: float
    spread: float
    low: float
    high: float


class DimReturns:
    """Returns that are dim or flash, and lie on no known line of glass.

    Attributes:
        returns: (n, 6) the place of each [m], the unit vector of its beam, its variance [m²], and
            its brightness as a share of the usual one.
    """

    def __init__(self) -> None:
        self.returns = np.empty((0, 6))

    def add(self, returns: Float) -> None:
        """Add returns (k, 6), one in each cell of the ground, and forget the oldest of too many."""
        together = np.concatenate([self.returns, returns])
        cells = np.floor(together[:, :2] / DIM_CELL).astype(np.int64)
        first = np.sort(np.unique(cells, axis=0, return_index=True)[1])
        self.returns = together[first][-MOST_DIM:]

    def near(self, line: Line) -> tuple[Int, Float]:
        """Which returns are on a line, without a gap that is too long, and their stations [m]."""
        places, units, variance, bright = np.split(self.returns, [2, 4, 5], axis=1)
        offset = places - line.mean
        along = offset @ line.unit
        aside = offset[:, 1] * line.unit[0] - offset[:, 0] * line.unit[1]
        cosine = np.abs(units[:, 1] * line.unit[0] - units[:, 0] * line.unit[1])
        allowed = 1.0 / line.weight + along**2 / line.spread + variance[:, 0] * cosine**2
        on: Bool = np.abs(aside) < np.minimum(PANE_DEVIATIONS * np.sqrt(allowed), 3 * PANE_DISTANCE)
        # At a grazing angle plaster is dim as well.
        on &= (bright[:, 0] > 1.0) | (bright[:, 0] < DIM_SHARE * cosine)
        rows = np.flatnonzero(on)
        stations = (places[rows] - line.point) @ line.unit
        rows, stations = rows[np.argsort(stations)], np.sort(stations)
        return _reached(rows, stations, line.low, line.high)

    def take(self, rows: Int) -> Float:
        """Remove some returns, and return them."""
        taken: Float = self.returns[rows]
        self.returns = np.delete(self.returns, rows, axis=0)
        return taken

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names."""
        return {"dim_returns": self.returns.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.returns = state["dim_returns"].copy()


def _reached(rows: Int, stations: Float, low: float, high: float) -> tuple[Int, Float]:
    """Those of rows at rising stations that hang together with a line from low to high [m]."""
    first = int(np.searchsorted(stations, low))
    last = int(np.searchsorted(stations, high))
    while first > 0 and low - stations[first - 1] < PANE_GAP:
        first -= 1
        low = stations[first]
    while last < len(rows) and stations[last] - high < PANE_GAP:
        high = stations[last]
        last += 1
    return rows[first:last], stations[first:last]
