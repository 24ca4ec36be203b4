"""Trees of OpenStreetMap extracts: nodes ``natural=tree`` become trunks, slender blocks of bark.

Tags of a node enter; a feature leaves whose walls are the sides of the trunk, as high as the tree.
OpenStreetMap's wiki defines them on the pages Tag:natural=tree, Key:circumference and
Key:diameter_crown. Rows of trees, which do not say where their trees stand, are left out.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.world.features import Feature, metres_of
from lrf3d.world.materials import BUILT_IN

DEFAULT_TREE = 8.0
"""Height [m] of a tree of which nothing is given: one along a street, some decades old."""

_TALLEST, _LOWEST = 100.0, 1.0
"""Heights [m] outside of which a tag counts as an error."""

_CROWN = 0.6
"""Width of a crown, in heights of its tree."""

_SLENDER = 1.0 / 45.0
"""Radius of a trunk at the height of a laser, in heights of its tree."""

_RADII, _SIDES = (0.05, 1.2), 6
"""Least and largest radius of a trunk [m], and number of its sides."""

_CLEAR = 0.1
"""Trees whose trunks are nearer than this to a building [m] are left out: maps are not as exact,
and what touches a wall would be a part of it."""


def is_tree(tags: dict[str, str]) -> bool:
    """Whether the tags of a node describe a tree."""
    return tags.get("natural") == "tree" and tags.get("location") != "underground"


def tree_height(tags: dict[str, str]) -> float:
    """Height [m] of a tree: given, or as its crown is wide, or that of most."""
    height = metres_of(tags.get("height", ""))
    if height is None:
        height = (metres_of(tags.get("diameter_crown", "")) or 0.0) / _CROWN
    return height if _LOWEST <= height <= _TALLEST else DEFAULT_TREE


def trunk_radius(tags: dict[str, str]) -> float:
    """Radius [m] of the trunk of a tree: by its circumference, or as such trees have it."""
    around = metres_of(tags.get("circumference", "")) or 0.0
    radius = around / (2.0 * np.pi) or _SLENDER * tree_height(tags)
    return float(np.clip(radius, *_RADII))


def trunks(
    places: Float, tags: Sequence[dict[str, str]], buildings: Sequence[Any]
) -> list[Feature]:
    """The trunks of trees at places (k, 2) [m] that stand free of buildings and of each other."""
    import shapely

    radii, points = np.array([trunk_radius(each) for each in tags]), shapely.points(places)
    houses = shapely.STRtree(shapely.make_valid(np.array(buildings)))
    tree, _ = houses.query(points, predicate="dwithin", distance=radii + _CLEAR)
    near = np.zeros(len(points), dtype=bool)
    near[tree] = True
    # Of a tree that is mapped twice, the first one counts.
    first, second = shapely.STRtree(points).query(
        points, predicate="dwithin", distance=radii + radii.max()
    )
    gap = np.hypot(*(places[first] - places[second]).T)
    near[second[(first < second) & (gap <= radii[first] + radii[second])]] = True
    turn = np.arange(_SIDES + 1) % _SIDES * (2.0 * np.pi / _SIDES)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    found = []
    for number in np.flatnonzero(~near).tolist():
        own = tags[number]
        outline = shapely.LineString(places[number] + radii[number] * circle)
        name = own.get("name") or own.get("species") or own.get("genus") or ""
        found.append(Feature((outline,), tree_height(own), name, material=BUILT_IN["bark"]))
    return found
