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
    starts = poses[result.scan, :2]
    beams = [
        lrf.directions(poses[scan])[beam]
        for scan, beam in zip(result.scan, result.beam, strict=True)
    ]
    # Many beams are drawn finer, or they would hide the world and each other.
    fine = float(np.interp(len(starts), [20, 100], [1.0, 0.4]))
    for answers, colour, label, width in (
        (result.ranges[:, 1], WRONG, "Embree's answer", 1.2),
        (result.ranges[:, 0], plot.BEAM, "exact answer", 2.0),
    ):
        if not len(answers):
            continue
        reach = np.clip(answers, 0.0, lrf.range_max)
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
    found = "all agree on wall and range"
    if result.causes:
        causes = ", ".join(f"{count} {cause}" for cause, count in result.counts.items())
        found = f"{len(result.causes)} seen differently: {causes}"
    title = f"{world.name or 'world'}: the plane against bare Embree"
    return title, f"{result.beams:,} beams  ·  {found}"
