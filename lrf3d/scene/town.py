"""The plan of a town: the blocks that its houses make up, the streets between them, and lawns.

Houses and where a robot drives enter; polygons leave. No file says where streets are: this is what
a street map round such houses would look like.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lrf3d.geometry import Float
from lrf3d.scene.structures import Structures

PAVEMENT, KERB = 1.7, 0.16
"""Width of pavements round blocks and along streets, and of the kerbs between both [m]."""

STREET = 8.0
"""How far a street reaches from the kerb [m] where nothing stands on its other side."""

SQUARE = 6.0
"""Open ground of up to twice this width [m] between streets is paved like them."""

_BLOCK = 7.0
"""Houses less than this apart [m], with no way between them, are of one block."""

_BAY = 12.0
"""Kerbs run straight past bays of up to twice this width [m] between the houses of a block."""

_PASSAGE = 5.0
"""What stays free between a house and the block on the other side of the street [m]."""

_STRAIGHT = 0.6
"""How far kerbs may be off the outline of their block [m] to run straight."""

_TURN, _INNER_TURN = 2.0, 0.8
"""Radius of the corners of blocks [m], and of those that look into a block."""

_WAY = 2.6
"""Half the width of the street that a robot always has [m]."""

_FOOT = 0.8
"""Width of the pavement along the walls of a house [m]: the least that it always has."""

_WAY_STEP = 0.3
"""How far the robot's way may be simplified [m]."""


class TownPlan(NamedTuple):
    """What covers the ground of a town. What is not paved is a lawn.

    Args:
        blocks: Pavements with the houses on them, as a shapely geometry.
        streets: The asphalt between them.
        paved: Streets, their pavements, and what lies along the walls of houses.
    """

    blocks: Any
    streets: Any
    paved: Any


def plan_town(structures: Structures) -> TownPlan:
    """Plan the streets round the houses of a town."""
    solids, way = structures.houses, _way(structures.path)
    around = blocks(solids, way)
    feet = shapely.union_all(shapely.buffer(solids, _FOOT, join_style="mitre"))
    far = shapely.buffer(around, STREET + SQUARE, quad_segs=4)
    open_ground = shapely.difference(shapely.buffer(far, -SQUARE, quad_segs=4), around)
    parts = shapely.get_parts(open_ground)
    # What blocks close round, and no robot enters, is a yard.
    filled = shapely.union_all(shapely.polygons(shapely.get_exterior_ring(_polygons(around))))
    shapely.prepare(filled)
    parts = parts[shapely.intersects(parts, way) | ~shapely.contains(filled, parts)]
    driven = shapely.difference(shapely.buffer(way, _WAY, quad_segs=4), feet)
    streets = _rounded(shapely.union_all([*parts, driven]), _INNER_TURN, _TURN)
    paved = shapely.union(shapely.buffer(streets, KERB + PAVEMENT, quad_segs=4), feet)
    return TownPlan(around, streets, paved)


def blocks(solids: Any, way: Any) -> Any:
    """Pavements of the blocks that houses make up, as a shapely geometry.

    Houses that stand side by side have one kerb, which runs straight before them; the corners of
    blocks are round.

    Args:
        solids: (k,) polygons of the houses.
        way: Where a robot drives: houses to both sides of it are not of one block.
    """
    tree = shapely.STRtree(solids)
    first, second = tree.query(solids, predicate="dwithin", distance=_BLOCK)
    first, second = (side[first < second] for side in (first, second))
    apart = shapely.intersects(shapely.shortest_line(solids[first], solids[second]), way)
    first, second = first[~apart], second[~apart]
    joined = coo_array((np.ones(len(first)), (first, second)), shape=(len(solids), len(solids)))
    _, block = connected_components(joined, directed=False)
    order = np.argsort(block, kind="stable")
    starts = np.flatnonzero(np.diff(block[order])) + 1
    own = shapely.buffer(solids, PAVEMENT, join_style="mitre", mitre_limit=1.5)
    whole = [shapely.union_all(part) for part in np.split(own[order], starts)]
    straight = shapely.buffer(whole, _BAY, join_style="mitre", mitre_limit=1.5)
    straight = shapely.buffer(straight, -_BAY, join_style="mitre", mitre_limit=1.5)
    # It stays away from houses of other blocks.
    number, solid = tree.query(straight, predicate="dwithin", distance=_PASSAGE)
    other = block[solid] != number
    for near in np.unique(number[other]):
        houses = solids[solid[other & (number == near)]]
        free = shapely.union_all(shapely.buffer(houses, _PASSAGE, join_style="mitre"))
        straight[near] = shapely.union(whole[near], shapely.difference(straight[near], free))
    return _rounded(shapely.simplify(shapely.union_all(straight), _STRAIGHT), _TURN, _INNER_TURN)


def _rounded(shape: Any, outer: float, inner: float) -> Any:
    """A shape whose corners are round, of one radius [m] where it ends and one where it bends."""
    for reach in (inner, -inner - outer, outer):
        shape = shapely.buffer(shape, reach, quad_segs=8)
    return shape


def _polygons(shape: Any) -> Any:
    """The polygons that a shape is made of."""
    parts = shapely.get_parts(shape)
    return parts[(shapely.get_type_id(parts) == 3) & ~shapely.is_empty(parts)]


def _way(path: Float) -> Any:
    """Where a robot drives (k, 2), as a shapely geometry."""
    if len(path) < 2:
        return shapely.multipoints(path)
    return shapely.simplify(shapely.linestrings(path), _WAY_STEP)
