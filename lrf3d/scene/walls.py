"""Walls as panels: cut where storeys end, and laid on the texture of façades."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, directions, lengths
from lrf3d.scene.facades import (
    BAY,
    BAYS,
    BLANK,
    GROUND,
    ROWS,
    SLANTS,
    STOREY,
    STYLES,
    UPPER,
    WINDOWED,
)
from lrf3d.scene.look import spread
from lrf3d.scene.panels import joined, level_panels, triangles
from lrf3d.scene.shapes import Painted, single
from lrf3d.scene.structures import Structures

CORNICE, NARROW = 0.45, 1.7
"""Height of the band under the roof, and the shortest face that has windows [m]."""

PLINTH, SKIRTING = 0.45, 0.09
"""Heights of the darker foot of a house, and of that of a wall in rooms [m]."""

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_NARROWEST = 0.4
"""What walls of rooms close round and is narrower [m] is the inside of a wall, or a shaft."""

_TOGETHER = 0.05
"""Length [m] over which two walls at one place are one."""

_LOWEST_FACADE = 3.0
"""Walls below this height [m] are fences and garden walls: no windows."""

_APART = 0.004
"""Half the gap between both faces of a free wall [m]: a ray meets the one that looks at it."""


def wall_sides(structures: Structures) -> tuple[Int, Float]:
    """The walls (n,) whose sides can be seen: those of solids once, free ones from both sides.

    Returns also the sides (n, 4) [m], which look to the right of their directions.
    """
    solid, (free, parts) = np.flatnonzero(structures.closed), _free_walls(structures)
    sides = structures.segments[solid], parts, parts[:, [2, 3, 0, 1]]
    return np.concatenate([solid, free, free]), np.concatenate(sides)


def _free_walls(structures: Structures) -> tuple[Int, Float]:
    """The free walls (n,), and the parts (n, 4) of them that lie on no higher or earlier wall.

    Plans have a line twice where rooms meet: of two faces at one place now this, now that is seen.
    """
    free, lines = np.flatnonzero(~structures.closed), structures.tree.geometries
    later, other = structures.tree.query(lines[free], predicate="dwithin", distance=_APART)
    ranks = np.argsort(np.lexsort([np.arange(len(lines)), -structures.heights]))
    hides = ranks[other] < ranks[free[later]]
    later, other = later[hides], other[hides]
    strips = shapely.buffer(lines[other], _APART, cap_style="flat")
    along = shapely.length(shapely.intersection(lines[free[later]], strips)) > _TOGETHER
    hidden = np.full(len(free), shapely.Polygon(), dtype=object)
    shapely.geometrycollections(strips[along], indices=later[along], out=hidden)
    left = shapely.difference(lines[free], shapely.union_all(hidden[:, None], axis=1))
    parts, owner = shapely.get_parts(left, return_index=True)
    there = shapely.length(parts) > _APART
    return free[owner[there]], shapely.get_coordinates(parts[there]).reshape(-1, 4)


def lay_walls(structures: Structures) -> Painted:
    """All walls and the tops of free ones: ground floors, upper floors and cornices of houses."""
    number, segments = wall_sides(structures)
    length, along = lengths(segments), directions(segments)
    bays = np.maximum(1.0, np.floor(length / BAY))
    normals = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(along))])
    starts = (
        segments[:, :2] + np.where(structures.closed[number], 0.0, _APART)[:, None] * normals[:, :2]
    )
    way = segments[:, 2:] - segments[:, :2]
    found = []
    for chosen, *columns in _rows(structures, number, length, bays):
        side = np.flatnonzero(chosen)
        below, above, layer, first, storey, unit, bright = (
            np.broadcast_to(column, number.shape)[side, None] for column in columns
        )
        share = np.tile([0.0, 1.0, 1.0, 0.0], (len(side), 1))
        up = np.hstack([below, below, above, above])
        level = starts[side, None] + share[..., None] * way[side, None]
        # Along the wall, only windows differ from place to place.
        bay = np.where(layer >= WINDOWED, first + share * bays[side, None], 0.0)
        texture = np.stack([bay, storey + (up - below) / unit, layer + 0.0 * up], axis=2)
        wall, shape = number[side], texture.shape
        found.append(
            Painted(
                single(np.concatenate([level, up[..., None]], axis=2)),
                single(np.broadcast_to(normals[side, None], shape)),
                single(texture),
                single(np.broadcast_to((bright * structures.colours[wall])[:, None], shape)),
                structures.objects[wall],
            )
        )
    corners, wall = _caps(structures)
    if structures.indoor:
        lids, nearest = _lids(structures)
        corners, wall = np.concatenate([corners, lids]), np.append(wall, nearest)
    colours = (0.55 if structures.indoor else 0.85) * structures.colours[wall]
    heights, objects = structures.heights[wall], structures.objects[wall]
    return joined(*found, level_panels(corners, heights, colours, objects))


def _rows(
    structures: Structures, walls: Int, length: Float, bays: Float
) -> Iterator[tuple[Any, ...]]:
    """What stands one above the other in the sides of walls (n,), and in which of them (n,).

    From and up to which height [m]; layer of the texture, the bay and the storey where it begins,
    and how high a storey of it is [m]; how much brighter than its wall it is.
    """
    heights, seeds = structures.heights[walls], spread(structures.objects[walls], 0.11)
    facade = structures.closed[walls] & (heights >= _LOWEST_FACADE) & ~structures.smooth[walls]
    facade &= not structures.indoor
    top = heights - CORNICE
    storey = top / np.maximum(1.0, np.floor(top / STOREY))
    wide, style = length > NARROW, SLANTS * np.floor(len(STYLES) * np.modf(seeds * 7.31)[0])
    # The door, in the first bay of the texture, goes to one bay of the face, if it has several.
    door = np.where(bays > 1.5, -np.floor(seeds * 0.999 * bays), 1.0)
    pattern = np.floor(seeds * 997.0) + 3.0 * np.arange(len(walls))
    ground, upper = np.where(wide, GROUND + style, BLANK), np.where(wide, UPPER + style, BLANK)
    yield facade, 0.0, PLINTH, ground, door, 0.0, storey, 0.82
    yield facade, PLINTH, storey, ground, door, PLINTH / storey, storey, 1.0
    tall = facade & (top > 1.5 * storey)
    yield tall, storey, top, upper, pattern % BAYS, pattern % ROWS, storey, 1.0
    yield facade, top, heights, BLANK, 0.0, 0.0, 1.0, 1.10
    foot = SKIRTING if structures.indoor else 0.0
    skirted = ~facade & (heights > 2.0 * foot) & structures.indoor
    yield skirted, 0.0, foot, BLANK, 0.0, 0.0, 1.0, 0.62
    yield ~facade, np.where(skirted, foot, 0.0), heights, BLANK, 0.0, 0.0, 1.0, 1.0


def _caps(structures: Structures) -> tuple[Float, Int]:
    """Corners (n, 4, 2) of the strips on top of free walls, and the walls (n,)."""
    free, segments = _free_walls(structures)
    along = directions(segments)
    # The strip goes half its width past the ends, so that corners are filled.
    reach = 0.5 * CAP_WIDTH * along
    side = 0.5 * CAP_WIDTH * np.column_stack([-along[:, 1], along[:, 0]])
    start, end = segments[:, :2] - reach, segments[:, 2:] + reach
    return np.stack([start - side, end - side, end + side, start + side], axis=1), free


def _lids(structures: Structures) -> tuple[Float, Int]:
    """Triangles (n, 4, 2) over what free walls close round and is too narrow to be a room.

    Returns also the wall (n,) next to each.
    """
    lines = shapely.union_all(structures.tree.geometries[~structures.closed])
    strips = shapely.buffer(lines, 0.5 * CAP_WIDTH, cap_style="square", join_style="mitre")
    filled = shapely.polygons(shapely.get_exterior_ring(shapely.get_parts(strips)))
    holes = shapely.get_parts(shapely.difference(filled, strips))
    corners, _ = triangles(holes[shapely.is_empty(shapely.buffer(holes, -0.5 * _NARROWEST))])
    middles = shapely.points(corners.mean(axis=1))
    wall = structures.tree.query_nearest(middles, all_matches=False)[1]
    return corners[:, [0, 1, 2, 2]], wall
