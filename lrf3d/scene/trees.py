"""Trees: solids of bark, with crowns over them.

The trunk, which is as high as its tree, is a wall like others, that beams meet; its crown is drawn
round its upper part, above a laser that looks ahead, and hides the sun from the ground and from
what stands near.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely
import trimesh

from lrf3d.geometry import Float
from lrf3d.scene.look import LEAF_COLOURS, SUN, spread
from lrf3d.scene.panels import LIT, Panels, panels
from lrf3d.scene.structures import Structures

_LOWEST = 3.0
"""Trunks below this height [m] are posts: they have no crown."""

_FOOT, _CLEAR = 0.30, 2.2
"""Where a crown begins, in heights of its tree, and at the least [m]: above robots and lasers."""

_TOP, _WIDTH = 1.03, 0.30
"""Where it ends, and its radius, in heights of its tree."""

_BESIDE, _NARROWEST = 0.15, 0.4
"""How far a crown stays off walls [m], where that leaves it so much of its radius."""

_TALLEST = 1.5
"""Half the height of a crown, in its radius, at the most."""

_LUMPS, _SKYWARD = 0.16, 0.35
"""How far its corners lie off an ellipsoid, in its radius, and how far leaves are turned up."""

_FINE, _PATCHES = 400, 0.10
"""Up to so many trees have crowns of 80 triangles, where there are more, of 20; by how much
triangles of a crown differ in brightness."""


class Crowns(NamedTuple):
    """The crowns of some trees."""

    middles: Float
    """(c, 3) their middles [m]."""
    sizes: Float
    """(c, 2) their level and upright radii [m]."""
    faces: Panels
    """(c · f triangles) of leaves."""


def crowns_of(structures: Structures) -> Crowns:
    """The crowns of all trees that are high enough; they stay off houses where they can."""
    trees = structures.trees[structures.solid_heights[structures.trees] >= _LOWEST]
    stems = shapely.centroid(structures.solids[trees])
    places = shapely.get_coordinates(stems).reshape(-1, 2)
    heights, seeds = structures.solid_heights[trees], spread(np.arange(len(trees)), 0.31)
    half = 0.5 * (_TOP * heights - np.maximum(_CLEAR, _FOOT * heights))
    radius = _WIDTH * (0.82 + 0.36 * seeds) * heights
    index, room = shapely.STRtree(structures.houses), np.full(len(trees), np.inf)
    near, house = index.query(stems, predicate="dwithin", distance=radius.max(initial=0.1))
    np.minimum.at(room, near, shapely.distance(stems[near], index.geometries[house]))
    free = (room - _BESIDE) / (1.0 + _LUMPS)
    radius = np.maximum(np.minimum(radius, free), _NARROWEST * radius)
    half = np.minimum(half, _TALLEST * radius)
    middles = np.column_stack([places, _TOP * heights - half])
    ball = trimesh.creation.icosphere(subdivisions=1 if len(trees) <= _FINE else 0)
    body = np.asarray(ball.vertices)
    rng = np.random.default_rng(11)
    body = body * (1.0 + _LUMPS * rng.uniform(-1.0, 1.0, (len(trees), len(body), 1)))
    scale = np.column_stack([radius, radius, half])[:, None]
    normals = _unit(_unit(body / scale) + np.array([0.0, 0.0, _SKYWARD]))
    count, corners = len(trees) * len(ball.faces), (middles[:, None] + body * scale)[:, ball.faces]
    leaf = LEAF_COLOURS[(spread(np.arange(len(trees)), 0.05) * len(LEAF_COLOURS)).astype(int)]
    patch = 1.0 + _PATCHES * (2.0 * spread(np.arange(count), 0.5) - 1.0)
    colours = np.repeat(leaf, len(ball.faces), axis=0) * patch[:, None]
    objects = np.repeat(structures.solid_objects[trees], len(ball.faces))
    shape = (count, 3, 3)
    faces = panels(
        corners.reshape(shape),
        normals[:, ball.faces].reshape(shape),
        colours[:, None],
        np.array(LIT),
        objects,
    )
    return Crowns(middles, np.column_stack([radius, half]), faces)


def screens(crowns: Crowns) -> tuple[Float, Float]:
    """Walls (4 · c, 4), and heights (4 · c, 2) of both ends, that hide as much of the sun.

    They stand across its way under the middle of the crown. As the sun stands high, what it sees
    between the crown and the ground lies too near to the trunk for a house.
    """
    level = SUN[:2] / np.hypot(*SUN[:2])
    side = np.array([-level[1], level[0]])
    share = np.array([-1.0, -0.7, 0.0, 0.7, 1.0])
    radius, half = crowns.sizes.T
    # The outline of an ellipsoid along a slanting way, where it meets the upright plane.
    high = np.hypot(half, radius * SUN[2] / np.hypot(*SUN[:2]))
    tops = crowns.middles[:, 2:] + high[:, None] * np.sqrt(1.0 - share**2)
    ends = crowns.middles[:, None, :2] + radius[:, None, None] * share[:, None] * side
    walls = np.concatenate([ends[:, :-1], ends[:, 1:]], axis=2)
    return walls.reshape(-1, 4), np.stack([tops[:, :-1], tops[:, 1:]], axis=2).reshape(-1, 2)


def shadows(crowns: Crowns) -> Any:
    """What crowns hide from the sun on the ground: polygons (c,)."""
    count = len(crowns.middles)
    corners = crowns.faces.places.reshape(count, -1 if count else 0, 3)
    slide = corners[..., 2:] * (SUN[:2] / SUN[2])
    return shapely.convex_hull(shapely.multipoints(corners[..., :2] - slide))


def _unit(ways: Float) -> Float:
    return np.asarray(ways / np.linalg.norm(ways, axis=-1, keepdims=True))
