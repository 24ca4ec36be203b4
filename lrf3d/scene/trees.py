"""Trees: trunks of bark that a world has, with crowns over them.

A world and the areas of its objects enter; leave which of them are trees, and the faces of trunks
and crowns in the rows of :mod:`lrf3d.scene.walls`. A beam meets the trunk, which is as high as its
tree; the crown is drawn round its upper part, above a laser that looks ahead. Its leaves hide the
sun from the ground, and from what stands near.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Int, Single
from lrf3d.scene.facades import CAP, TILED
from lrf3d.scene.look import BARK_COLOUR, LEAF_COLOURS, SUN, spread
from lrf3d.world import World

BARK = "bark"
"""The material of trunks."""

_THICKEST = 1.5
"""Largest radius of a trunk [m]: what is thicker is something else of bark."""

_LOWEST = 3.0
"""Trunks below this height [m] are posts: they have no crown."""

_FOOT, _CLEAR = 0.30, 2.2
"""Where a crown begins, in heights of its tree, and at the least [m]: above robots and lasers."""

_TOP, _WIDTH = 1.03, 0.30
"""Where it ends, and its radius, in heights of its tree."""

_BESIDE = 0.15
"""How far a crown stays off walls [m], where that leaves it more than the next."""

_NARROWEST = 0.4
"""What is left of its radius at the least."""

_TALLEST = 1.5
"""Half the height of a crown, in its radius, at the most."""

_LUMPS = 0.16
"""How far corners of a crown lie off its ellipsoid, in its radius."""

_SKYWARD = 0.35
"""How far leaves are turned up: they look at the light, and let some of it through."""

_SHAPES = 7
"""Different crowns; each tree turns and stretches one of them."""

_FINE = 400
"""Up to so many trees have crowns of 80 triangles; where there are more, of 20."""

_PATCHES = 0.10
"""By how much triangles of a crown differ in brightness."""


def find_trees(world: World, areas: Any) -> Bool:
    """Which objects of a world are trees, by the area (k,) that the walls of each close round."""
    bark = [material is not None and material.name == BARK for material in world.materials]
    found = np.zeros(world.object_count, dtype=bool)
    found[: len(bark)] = bark
    slender = np.sqrt(np.nan_to_num(shapely.area(areas)) / np.pi) < _THICKEST
    return np.asarray(found & ~shapely.is_missing(areas) & slender)


def tree_rows(areas: Any, heights: Float) -> Float:
    """Trees (t, 4), x and y, radius of the trunk, height [m], by areas and heights of trunks."""
    middles = shapely.get_coordinates(shapely.centroid(areas)).reshape(-1, 2)
    return np.column_stack([middles, np.sqrt(shapely.area(areas) / np.pi), heights])


class Crowns(NamedTuple):
    """Crowns, each the body of a shape turned and stretched.

    Args:
        trees: (c,) the tree that each is of.
        middles: (c, 3) their middles [m].
        sizes: (c, 2) their level and upright radii [m].
        corners: (c, v, 3) corners of their triangles [m].
        normals: (c, v, 3) which way leaves look at them.
        triangles: (f, 3) which corners make the triangles of each.
    """

    trees: Int
    middles: Float
    sizes: Float
    corners: Float
    normals: Float
    triangles: Int

    @classmethod
    def of(cls, trees: Float, houses: Any) -> "Crowns":
        """The crowns of trees (t, 4); they stay off the polygons of houses where they can."""
        high = np.flatnonzero(trees[:, 3] >= _LOWEST)
        rows, seeds = trees[high], spread(high, 0.31)
        low = np.maximum(_CLEAR, _FOOT * rows[:, 3])
        half = 0.5 * (_TOP * rows[:, 3] - low)
        radius = _WIDTH * (0.82 + 0.36 * seeds) * rows[:, 3]
        points, index = shapely.points(rows[:, :2]), shapely.STRtree(houses)
        near, house = index.query(points, predicate="dwithin", distance=radius.max(initial=0.1))
        room = np.full(len(rows), np.inf)
        np.minimum.at(room, near, shapely.distance(points[near], index.geometries[house]))
        room = (room - _BESIDE) / (1.0 + _LUMPS)
        radius = np.maximum(np.minimum(radius, room), _NARROWEST * radius)
        half = np.minimum(half, _TALLEST * radius)
        middles = np.column_stack([rows[:, :2], _TOP * rows[:, 3] - half])
        shapes, triangles = _shapes(1 if len(high) <= _FINE else 0)
        turn = 2.0 * np.pi * spread(high, 0.77)
        body = shapes[(seeds * 997.0).astype(int) % _SHAPES]
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        body = np.stack(
            [cos * body[..., 0] - sin * body[..., 1], sin * body[..., 0] + cos * body[..., 1],
             body[..., 2]], axis=-1
        )  # fmt: skip
        scale = np.column_stack([radius, radius, half])[:, None]
        normals = body / scale
        normals /= np.linalg.norm(normals, axis=2)[..., None]
        normals[..., 2] += _SKYWARD
        normals /= np.linalg.norm(normals, axis=2)[..., None]
        sizes = np.column_stack([radius, half])
        return cls(high, middles, sizes, middles[:, None] + body * scale, normals, triangles)

    def faces(self) -> Single:
        """Their triangles (c · f, 3, 14)."""
        count, each = len(self.trees), len(self.triangles)
        rows = np.zeros((count, each, 3, 14), np.float32)
        rows[..., :3] = self.corners[:, self.triangles]
        rows[..., 3:6] = self.normals[:, self.triangles]
        rows[..., 8:10] = 1.0
        leaf = LEAF_COLOURS[(spread(self.trees, 0.05) * len(LEAF_COLOURS)).astype(int)]
        patch = 1.0 + _PATCHES * (2.0 * spread(np.arange(count * each), 0.5) - 1.0)
        rows[..., 10:13] = (leaf[:, None] * patch.reshape(count, each, 1))[:, :, None]
        rows[..., 13] = TILED + 0.5
        return rows.reshape(-1, 3, 14)

    def screens(self) -> tuple[Float, Float]:
        """Walls (4 · c, 4), and heights (4 · c, 2) of both ends, that hide as much of the sun.

        They stand across its way under the middle of the crown. As the sun stands high, what it
        sees between the crown and the ground lies too near to the trunk for a house.
        """
        level = SUN[:2] / np.hypot(*SUN[:2])
        side = np.array([-level[1], level[0]])
        share = np.array([-1.0, -0.7, 0.0, 0.7, 1.0])
        radius, half = self.sizes.T
        # The outline of an ellipsoid along a slanting way, where it meets the upright plane.
        high = np.hypot(half, radius * SUN[2] / np.hypot(*SUN[:2]))
        tops = self.middles[:, 2:] + high[:, None] * np.sqrt(1.0 - share**2)
        ends = self.middles[:, None, :2] + radius[:, None, None] * share[:, None] * side
        walls = np.concatenate([ends[:, :-1], ends[:, 1:]], axis=2)
        return walls.reshape(-1, 4), np.stack([tops[:, :-1], tops[:, 1:]], axis=2).reshape(-1, 2)

    def shadows(self) -> Any:
        """What they hide from the sun on the ground: polygons (c,)."""
        slide = self.corners[..., 2:] * (SUN[:2] / SUN[2])
        return shapely.convex_hull(shapely.multipoints(self.corners[..., :2] - slide))


def trunk_faces(trees: Float, crowns: Crowns) -> Single:
    """The sides (6 · t, 4, 14) of the trunks of trees (t, 4), up to within their crowns."""
    heights = trees[:, 3].copy()
    heights[crowns.trees] = crowns.middles[:, 2]
    turn = np.arange(7) * (np.pi / 3.0)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    places = trees[:, None, :2] + trees[:, 2, None, None] * ring
    faces = np.zeros((len(trees), 6, 4, 14), np.float32)
    for corner, (end, up) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        faces[:, :, corner, :2] = places[:, end : end + 6]
        faces[:, :, corner, 2] = up * heights[:, None]
    middle = 0.5 * (ring[1:] + ring[:-1])
    faces[..., 3:5] = (middle / np.linalg.norm(middle, axis=1)[:, None])[:, None]
    faces[..., 8:10] = 1.0
    faces[..., 10:13] = BARK_COLOUR
    faces[..., 13] = CAP + 0.5
    return faces.reshape(-1, 4, 14)


def _shapes(level: int) -> tuple[Float, Int]:
    """Lumpy balls: corners (:data:`_SHAPES`, v, 3) about the origin, and triangles (f, 3).

    They are icosahedra whose triangles are cut in four as often as the level says.
    """
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=level)
    corners = np.asarray(ball.vertices)
    rng = np.random.default_rng(11)
    lumps = 1.0 + _LUMPS * rng.uniform(-1.0, 1.0, (_SHAPES, len(corners), 1))
    return corners * lumps, np.asarray(ball.faces)
