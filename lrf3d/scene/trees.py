"""Trees: solids of bark, with crowns over them.

The trunk, which is as high as its tree, is a wall like others, that beams meet; its crown is drawn
round its upper part, above a laser that looks ahead.
"""

import numpy as np
import shapely
import trimesh

from lrf3d.scene.look import LEAF_COLOURS, spread
from lrf3d.scene.panels import panels
from lrf3d.scene.shapes import Painted
from lrf3d.scene.structures import Structures

_LOWEST = 3.0
"""Trunks below this height [m] are posts: they have no crown."""

_FOOT, _CLEAR, _WIDTH = 0.30, 2.2, 0.27
"""Where a crown begins, in heights of its tree, and at the least [m]: above robots and lasers; and
its radius, in these heights."""

_FINE = 400
"""Crowns of this number of trees have 80 triangles, of more 20: nobody sees them all from near
by."""

_LUMPS, _PATCHES = 0.16, 0.10
"""How far its corners lie off an ellipsoid, in its radius, and by how much its triangles differ in
brightness."""


def crowns_of(structures: Structures) -> Painted:
    """The leaves of all trees that are high enough: as many triangles for each."""
    trees = structures.trees[structures.solid_heights[structures.trees] >= _LOWEST]
    places = shapely.get_coordinates(shapely.centroid(structures.solids[trees]))
    tops, number = structures.solid_heights[trees], np.arange(len(trees))
    half = 0.5 * (tops - np.maximum(_CLEAR, _FOOT * tops))
    radius = _WIDTH * tops
    middles = np.column_stack([places, tops - half]).reshape(-1, 1, 3)
    scale = np.column_stack([radius, radius, half])[:, None]
    ball = trimesh.creation.icosphere(subdivisions=1 if len(trees) <= _FINE else 0)
    rng = np.random.default_rng(11)
    lumps = 1.0 + _LUMPS * rng.uniform(-1.0, 1.0, (len(trees), len(ball.vertices), 1))
    corners = (middles + scale * lumps * ball.vertices)[:, ball.faces].reshape(-1, 3, 3)
    normals = np.tile(ball.vertices[ball.faces], (len(trees), 1, 1))
    leaf = LEAF_COLOURS[(spread(number, 0.05) * len(LEAF_COLOURS)).astype(int)]
    patch = 1.0 + _PATCHES * rng.uniform(-1.0, 1.0, (len(corners), 1))
    colours = np.repeat(leaf, len(ball.faces), axis=0) * patch
    objects = np.repeat(structures.solid_objects[trees], len(ball.faces))
    return panels(corners, normals, colours[:, None], objects)
