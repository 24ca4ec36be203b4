"""Marks of an estimate in figures: the estimated path, its ellipses, and the loop closures."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from lrf3d.geometry import Float, Int
from lrf3d.render.page import Frame
from lrf3d.robot import EstimatedTrajectory
from lrf3d.scene.estimate import BELIEVED, kept_ellipses, outlines
from lrf3d.scene.look import ESTIMATE_COLOUR, ESTIMATE_FADED

CLOSED, DROPPED = "#0b8a5f", "#d6361f"
"""Colours of loops that were closed, and of those that only seemed to close."""


def draw_estimate(axes: Axes, frame: Frame, estimate: EstimatedTrajectory) -> list[Line2D]:
    """Draw the estimated path, and each loop closure as a line between its two poses."""
    x, y = frame.local(estimate.poses[:, :2]).T
    axes.plot(x, y, color=ESTIMATE_COLOUR, linewidth=0.8, zorder=3.2)
    kept = kept_ellipses(estimate)
    middles = frame.local(estimate.poses[estimate.known_scans[kept], :2])
    rings = outlines(middles, estimate.ellipses[kept])
    rings = np.concatenate([rings, rings[:, :1]], axis=1)
    alpha = 0.5 * (1.0 + ESTIMATE_FADED)
    ellipses = LineCollection(list(rings), colors=[ESTIMATE_COLOUR], linewidths=0.8, alpha=alpha)
    ellipses.set_zorder(3.3)
    axes.add_collection(ellipses)
    return [
        Line2D([], [], color=ESTIMATE_COLOUR, linewidth=1.1, label=BELIEVED),
        *_draw_loops(axes, frame, estimate, estimate.dropped_closures, DROPPED, "dropped closures"),
        *_draw_loops(axes, frame, estimate, estimate.closures, CLOSED, "loop closures"),
    ]


def _draw_loops(
    axes: Axes,
    frame: Frame,
    estimate: EstimatedTrajectory,
    pairs: Int,
    colour: str,
    name: str,
) -> list[Line2D]:
    if not len(pairs):
        return []
    ends: Float = frame.local(estimate.lines(pairs)).reshape(-1, 2, 2)
    axes.add_collection(LineCollection(list(ends), colors=colour, linewidths=0.7, zorder=3.5))
    return [Line2D([], [], color=colour, linewidth=0.8, label=name)]
