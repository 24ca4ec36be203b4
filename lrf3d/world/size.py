"""Implausible sizes of worlds: a drawing in millimetres, or one as small as its sheet of paper."""

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import lengths
from lrf3d.world.model import World

LEAST, SHEET = 0.5, 2.0
"""Sides [m] below which there is no room for a robot, and below which a plan may be on paper."""


def size_problem(world: World, least: float = SHEET) -> str | None:
    """What is implausible about the size of a world, and the scale that would fit, or None."""
    if not len(world.segments):
        return None
    width, height = np.ptp(world.bounds, axis=0).tolist()
    if max(width, height) < least:
        return (
            f"the world is {width:.3g} m by {height:.3g} m, a drawing on paper? --scale 100 makes"
            " one of 1:100 as large as the house"
        )
    # Half of all wall length is of walls of this length or more.
    long = np.sort(lengths(world.segments))
    usual = float(long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())])
    # A single wall that reaches far away does not make a large plan.
    most = np.ptp(np.quantile(world.segments.reshape(-1, 2), [0.1, 0.9], axis=0), axis=0)
    # A town may be as large, but its walls are shorter.
    if most.max() <= 1000.0 or usual <= 100.0:
        return None
    scales = {0.01: "centimetres", 0.001: "millimetres"}
    # Usual walls of plans are 4 m long.
    scale = min(scales, key=lambda each: abs(np.log(each * usual / 4.0)))
    return (
        f"{width:,.0f} m by {height:,.0f} m, with walls of {usual:,.0f} m, is too large to plan a"
        f" route in; --scale {scale:g}, if the drawing is in {scales[scale]}"
    )


def check_size(world: World) -> None:
    """Check that a world is not so large or small that it must be in other units than metres."""
    if problem := size_problem(world, LEAST):
        raise WorldError(f"{world.name or 'world'}: {problem}, or give a route")
