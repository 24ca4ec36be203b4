"""The plan of a town: the blocks that its houses make up, the streets between them, and lawns.

Houses and where a robot drives enter; polygons leave. No file says where streets are: this is what
a street map round such houses would look like.
"""

from typing import Any, NamedTuple

import shapely

from lrf3d.scene.structures import Structures

PAVEMENT, KERB = 1.7, 0.16
"""Width of pavements round blocks and along streets, and of the kerbs between both [m]."""

STREET = 8.0
"""How far a street reaches from the kerb [m] where nothing stands on its other side."""

SQUARE = 6.0
"""Open ground of up to twice this width [m] between streets is paved like them."""

_BLOCK = 7.0
"""Houses less than this apart [m] are of one block: they have one kerb."""

_STRAIGHT = 0.6
"""How far kerbs may be off the outline of their block [m] to run straight."""

_TURN, _INNER_TURN = 2.0, 0.8
"""Radius of the corners of blocks [m], and of those that look into a block."""

_WAY, _WAY_STEP = 2.6, 0.3
"""Half the width of the street that a robot always has, and how far its path may be simplified [m].
"""

_FOOT = 0.8
"""Width of the pavement along the walls of a house [m]: the least that it always has."""


class TownPlan(NamedTuple):
    """What covers the ground of a town. What is not paved is a lawn."""

    streets: Any
    """The asphalt between the blocks, as a shapely geometry."""
    paved: Any
    """Streets, their pavements, and what lies along the walls of houses."""


def plan_town(structures: Structures) -> TownPlan:
    """Plan the streets round the houses of a town."""
    solids, path = structures.houses, structures.path
    drive = shapely.linestrings(path) if len(path) > 1 else shapely.multipoints(path)
    way = shapely.simplify(drive, _WAY_STEP)
    blocks = shapely.union_all(
        shapely.buffer(solids, 0.5 * _BLOCK, join_style="mitre", mitre_limit=1.5)
    )
    blocks = shapely.buffer(blocks, PAVEMENT - 0.5 * _BLOCK, join_style="mitre", mitre_limit=1.5)
    blocks = _rounded(shapely.simplify(blocks, _STRAIGHT), _TURN, _INNER_TURN)
    feet = shapely.union_all(shapely.buffer(solids, _FOOT, join_style="mitre"))
    far = shapely.buffer(blocks, STREET + SQUARE, quad_segs=4)
    open_ground = shapely.difference(shapely.buffer(far, -SQUARE, quad_segs=4), blocks)
    parts = shapely.get_parts(open_ground)
    # What blocks close round, and no robot enters, is a yard.
    outer = shapely.get_exterior_ring(shapely.get_parts(blocks))
    filled = shapely.union_all(shapely.polygons(outer[~shapely.is_empty(outer)]))
    shapely.prepare(filled)
    parts = parts[shapely.intersects(parts, way) | ~shapely.contains(filled, parts)]
    driven = shapely.difference(shapely.buffer(way, _WAY, quad_segs=4), feet)
    streets = _rounded(shapely.union_all([*parts, driven]), _INNER_TURN, _TURN)
    paved = shapely.union(shapely.buffer(streets, KERB + PAVEMENT, quad_segs=4), feet)
    return TownPlan(streets, paved)


def _rounded(shape: Any, outer: float, inner: float) -> Any:
    """A shape whose corners are round, of one radius [m] where it ends and one where it bends."""
    for reach in (inner, -inner - outer, outer):
        shape = shapely.buffer(shape, reach, quad_segs=4)
    return shape
