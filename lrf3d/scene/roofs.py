"""Flat roofs of solids."""

import numpy as np

from lrf3d.scene.panels import level_panels, triangles
from lrf3d.scene.shapes import Painted
from lrf3d.scene.structures import Structures

_GREY, _SHARE_OF_GREY = np.array([0.52, 0.52, 0.53]), 0.75
"""Colour of roofs, and its share in a roof: the rest is the wall's."""


def build_roofs(structures: Structures) -> Painted:
    """Triangles (t,) of the roofs of all solids."""
    corners, owner = triangles(structures.solids)
    walls = structures.solid_colours[owner]
    grey = walls + _SHARE_OF_GREY * (_GREY - walls)
    colours = walls if structures.indoor else grey
    return level_panels(
        corners, structures.solid_heights[owner], colours, structures.solid_objects[owner]
    )
