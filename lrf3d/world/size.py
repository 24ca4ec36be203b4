"""Implausible sizes of worlds: a drawing in millimetres, or one as small as its sheet of paper."""

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import lengths
from lrf3d.world.model import World


def size_warning(world: World) -> str | None:
    """A warning, with the remedy, if the size of a world is implausible; otherwise None."""
    # The largest sheets of paper are 1.2 m long.
    if small := _small(world, 2.0):
        return small
    try:
        check_size(world)
    except WorldError as error:
        return str(error)
    return None


def _small(world: World, least: float) -> str | None:
    """What is said of a world that is smaller than the least size [m]; otherwise None."""
    width, height = np.ptp(world.bounds, axis=0).tolist()
    if not len(world.segments) or max(width, height) >= least:
        return None
    return (
        f"the world is {width:.3g} m by {height:.3g} m, a drawing on paper? --scale 100 makes"
        " one of 1:100 as large as the house"
    )


def check_size(world: World) -> None:
    """Check that a world is not so large or small that it must be in other units than metres.

    The message gives the scale that would fit.
    """
    if not len(world.segments):
        return
    # There is no room for a robot.
    if small := _small(world, 0.5):
        raise WorldError(f"{world.name or 'world'}: {small}, or give a route")
    # Half of all wall length is of walls of this length or more.
    long = np.sort(lengths(world.segments))
    usual = float(long[np.searchsorted(np.cumsum(long), 0.5 * long.sum())])
    # A single wall that reaches far away does not make a large plan.
    most = np.ptp(np.quantile(world.segments.reshape(-1, 2), [0.1, 0.9], axis=0), axis=0)
    # A town may be as large, but its walls are shorter.
    if most.max() <= 1000.0 or usual <= 100.0:
        return
    width, height = np.ptp(world.bounds, axis=0).tolist()
    scales = {0.01: "centimetres", 0.001: "millimetres"}
    # Usual walls of plans are 4 m long.
    scale = min(scales, key=lambda each: abs(np.log(each * usual / 4.0)))
    raise WorldError(
        f"{world.name or 'world'}: {width:,.0f} m by {height:,.0f} m, with walls of {usual:,.0f} m,"
        f" is too large to plan a route in; --scale {scale:g}, if the drawing is in"
        f" {scales[scale]}, or give a route"
    )
