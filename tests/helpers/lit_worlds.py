"""Worlds of walls that each have a material."""

import numpy as np

from lrf3d import World
from lrf3d.world import Material

WHITE = Material("white", diffuse=1.0)
PERFECT = Material("perfect mirror", specular=1.0)


def world_of(*walls, heights=None):
    """A world of walls, each an object of its own: x1, y1, x2, y2 and a material."""
    segments = [wall[:4] for wall in walls]
    return World(segments, np.arange(len(walls)), heights, materials=[wall[4] for wall in walls])
