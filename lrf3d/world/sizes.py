"""Sizes: worlds as small as a sheet of paper, or drawn in millimetres that were read as metres."""

import numpy as np

from lrf3d.geometry import lengths
from lrf3d.world.model import World

SMALLEST = 2.0
"""Side [m] below which no robot drives in a world: the largest sheets are 1.2 m long."""

LARGEST, LONGEST = 1000.0, 100.0
"""Side of a world and median of its walls [m] above which both are too long for those of houses:
flats are as wide as this in centimetres, and towns are, but not their walls."""


def size_warning(world: World) -> str | None:
    """What to say of a world whose size is that of no world, with the mend; None where it is."""
    if not len(world.segments):
        return None
    width, height = (float(side) for side in np.ptp(world.bounds, axis=0))
    size = f"the world is {_shown(width)} by {_shown(height)}"
    if max(width, height) < SMALLEST:
        return f"{size}, a drawing on paper? --scale 100 makes one of 1:100 as large as the house"
    median = float(np.median(lengths(world.segments)))
    if max(width, height) > LARGEST and median > LONGEST:
        return (
            f"{size}, with walls of {_shown(median)}, a drawing in other units? --scale 0.001 takes"
            " them for millimetres"
        )
    return None


def _shown(size: float) -> str:
    return f"{size:,.0f} m" if size >= 100.0 else f"{size:.3g} m"
