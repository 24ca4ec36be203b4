"""Cross-check figure: the world with the beams that two casters see differently."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lrf3d import plot
from lrf3d.casting.comparison import CrossCheck
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from lrf3d.render.figures import finished, metre_sheet
from lrf3d.world import World

WRONG = "#7a3fb0"
"""Colour of Embree's answer."""


def draw_crosscheck(
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    result: CrossCheck,
    path: str | Path | None = None,
) -> Figure:
    """Draw a world, the poses (k, 3), and the beams that the casters see differently.

    Raises:
        OutputError: The picture cannot be written.
    """
    places = [world.segments.reshape(-1, 2), poses[:, :2]]
    figure, (ax,) = metre_sheet(places, 1, *_titles(world, result))
    plot.world(world, ax, poses=poses)
    plot.trajectory(poses, ax)
    starts = poses[[one.scan for one in result.differences], :2]
    beams = [lrf.directions(poses[one.scan])[one.beam] for one in result.differences]
    # Many beams are drawn finer, or they would hide the world and each other.
    fine = float(np.interp(len(starts), [20, 100], [1.0, 0.4]))
    for answers, colour, label, width in (
        ([one.embree[0] for one in result.differences], WRONG, "Embree's answer", 1.2),
        ([one.planar[0] for one in result.differences], plot.BEAM, "exact answer", 2.0),
    ):
        if not answers:
            continue
        reach = np.clip(np.array(answers), 0.0, lrf.range_max)
        ends = starts + reach[:, None] * np.array(beams)
        style: dict[str, Any] = {
            "colors": colour,
            "linewidths": fine * width,
            "label": label,
            "zorder": 4,
        }
        ax.add_collection(LineCollection(list(np.stack([starts, ends], axis=1)), **style))
        ax.plot(*ends.T, "o", markersize=4.0 * fine, color=colour, mew=0, zorder=5)
    return finished(figure, [ax], path)


def _titles(world: World, result: CrossCheck) -> tuple[str, str]:
    other = "bare Embree" if result.raw else "Embree"
    differ = len(result.differences)
    if differ == 0:
        exactly = "" if result.largest_difference else ", to the last bit"
        found = f"all agree on wall and range{exactly}"
    else:
        causes = ", ".join(f"{count} {cause}" for cause, count in result.causes.items())
        found = f"{differ} seen differently: {causes}"
    title = f"{world.name or 'world'}: the plane against {other}"
    return title, f"{result.beams:,} beams  ·  {found}"
