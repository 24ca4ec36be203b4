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
