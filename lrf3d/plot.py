"""Plots of worlds, maps, scans, trajectories and runs on matplotlib axes, in world coordinates [m].

Each function draws on the axes that it is given, or on those of a new figure, and returns them.
Several plots on the same axes lie over each other; the view grows to show them all, unless its
limits were set by hand. A metre is as long in x as in y. Further keywords, such as ``color``,
``linewidth`` and ``label``, are those of matplotlib's lines; ``ax.legend()`` names what was drawn.

Examples:
    >>> import lrf3d
    >>> from matplotlib.figure import Figure
    >>> room = lrf3d.load_world("paper_room")
    >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
    >>> figure = Figure()
    >>> axes = figure.add_subplot()
    >>> axes = lrf3d.plot.world(room, axes, color="gray")
    >>> axes = lrf3d.plot.scan(run.scan(1), axes)
    >>> axes = lrf3d.plot.map(run.map, axes)
    >>> figure.savefig("room.png")
"""

from lrf3d.studio.figures.plot import estimate, map, png, points, run, scan, trajectory, world

__all__ = ["estimate", "map", "png", "points", "run", "scan", "trajectory", "world"]
