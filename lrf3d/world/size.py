"""Implausible sizes of worlds: a drawing in millimetres, or one as small as its sheet of paper."""

import numpy as np

from lrf3d.geometry import lengths
from lrf3d.world.model import World

SMALLEST_SIDE = 2.0
"""Side [m] below which no robot drives in a world: the largest sheets are 1.2 m long."""

LARGEST_SIDE, LONGEST_WALLS = 1000.0, 100.0
"""Side of a world and median of its walls [m] above which the file is probably in
centimetres or millimetres: a town may be as large as this, but its walls are shorter."""


def size_warning(world: World) -> str | None:
    """A warning, with the remedy, if the size of a world is implausible; otherwise None."""
    if not len(world.segments):
        return None
    width, height = (float(side) for side in np.ptp(world.bounds, axis=0))
    size = f"the world is {_metres(width)} by {_metres(height)}"
    if max(width, height) < SMALLEST_SIDE:
        return f"{size}, a drawing on paper? --scale 100 makes one of 1:100 as large as the house"
    median = float(np.median(lengths(world.segments)))
    if max(width, height) > LARGEST_SIDE and median > LONGEST_WALLS:
        return (
            f"{size}, with walls of {_metres(median)}, a drawing in other units? --scale 0.001"
            " takes them for millimetres"
        )
    return None


def _metres(size: float) -> str:
    return f"{size:,.0f} m" if size >= 100.0 else f"{size:.3g} m"
