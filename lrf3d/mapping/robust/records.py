"""Records: rows of named columns, for tables that kernels share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Records = NDArray[Any]
"""Rows of a record."""


def record(**columns: type) -> np.dtype[Any]:
    """The type of rows with these columns, in the order given; kernels read ``row.column``."""
    return np.dtype((np.record, np.dtype(list(columns.items()), align=True)))


MOMENTS = record(
    weight=float,  # [1/m²] sum of the inverse variances of the points
    x=float, y=float,  # [m] their mean
    xx=float, xy=float, yy=float,  # their weighted scatter about it
)  # fmt: skip
"""The moments of the points of a segment."""

PIECE_COUNTS = record(
    hits=float, violations=float,  # [beams] that hit it, and that went through it
    nearer=float,  # [beams] that would be hits had they not hit another wall more nearly
    scans=float,  # scans that hit it
    passes_between=float,  # [beams] that went through between these
    passes_before=float,  # [beams] that went through before the first, a sum over the hits
    spell=float,  # [scans] from the first to the last
)  # fmt: skip
"""What the beams did at a piece of a wall."""

PIECE_SUMS = record(
    weight=float,  # [1/m²]
    along=float, aside=float,  # their place along the wall and beside it
    along_along=float, along_aside=float, aside_aside=float,
)  # fmt: skip
"""Weighted sums over the hits of a piece of a wall."""
