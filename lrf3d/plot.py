"""Plots on matplotlib axes, in world coordinates [m]; see :mod:`lrf3d.studio.figures.plot`."""

from lrf3d.studio.figures.plot import estimate, map, png, points, run, scan, trajectory, world

__all__ = ["estimate", "map", "png", "points", "run", "scan", "trajectory", "world"]
