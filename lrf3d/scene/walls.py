"""Walls as panels: cut where shadows and storeys end, and laid on the texture of façades."""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions, lengths
from lrf3d.scene.facades import (
    BAY,
    BAYS,
    BLANK,
    FOOT,
    GROUND,
    PLINTH,
    PLINTH_HEIGHT,
    ROWS,
    SKIRTING_HEIGHT,
    SLANTS,
    STOREY,
    STYLES,
    UPPER,
    WINDOWED,
)
from lrf3d.scene.panels import LIT, Panels, joined, level_panels
from lrf3d.scene.shadows import shade_walls
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import Crowns

CORNICE, NARROW = 0.45, 1.7
"""Height of the band under the roof, and the shortest face that has windows [m]."""

CAP_WIDTH = 0.12
"""Width [m] of the strip on top of a free wall, which shows where it runs from above."""

_LOWEST_FACADE = 3.0
"""Walls below this height [m] are fences and garden walls: no windows."""

_APART = 0.004
"""Half the gap between both faces of a free wall [m]: a ray meets the one that looks at it."""


class Sides(NamedTuple):
    """Sides of walls that can be seen: one of those of solids, both of free ones."""

    walls: Int
    """(n,) the wall of each."""
    segments: Float
    """(n, 4) x1 y1 x2 y2 [m]; it looks to the right of its way."""
    free: Bool
    """(n,) whether it is of a free wall."""


class _Row(NamedTuple):
    """Pieces of walls between two heights, with values for all sides (n,)."""

    chosen: Bool
    """Which sides have one."""
    low: Float
    high: Float
    """From and up to which height [m]."""
    layer: Float
    """Layer of the texture."""
    bay: Float
    storey: Float
    """Where on the layer it begins."""
    unit: Float
    """How high a storey of the layer is [m]."""
    bright: float = 1.0
    """How much brighter than its wall it is."""


def wall_sides(structures: Structures) -> Sides:
    """The sides of all walls."""
    solid, free = np.flatnonzero(structures.closed), np.flatnonzero(~structures.closed)
    walls = np.concatenate([solid, free, free])
    segments = structures.segments[walls]
    turned = slice(len(solid) + len(free), None)
    segments[turned] = segments[turned][:, [2, 3, 0, 1]]
    return Sides(walls, segments, np.arange(len(walls)) >= len(solid))


def lay_walls(structures: Structures, crowns: Crowns) -> Panels:
    """All walls and the tops of free ones: ground floors, upper floors and cornices of houses."""
    sides, indoor = wall_sides(structures), structures.indoor
    number, segments = sides.walls, sides.segments
    strips = shade_walls(structures, crowns, segments)
    length, along = lengths(segments), directions(segments)
    bays = np.maximum(1.0, np.floor(length / BAY))
    normals = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(along))])
    starts = segments[:, :2] + np.where(sides.free, _APART, 0.0)[:, None] * normals[:, :2]
    way = segments[:, 2:] - segments[:, :2]
    found = []
    for row in _rows(structures, number, length, bays):
        strip = np.flatnonzero(row.chosen[strips.face])
        side = strips.face[strip]
        begin, end = strips.start[strip], strips.end[strip]
        place = np.column_stack([begin, end, end, begin])
        share = place / np.maximum(length[side], 1e-9)[:, None]
        up = np.column_stack([row.low[side], row.low[side], row.high[side], row.high[side]])
        low, high = strips.low[strip], strips.high[strip]
        level = starts[side, None] + share[..., None] * way[side, None]
        texture = np.zeros((len(side), 4, 3))
        # Along the wall, only windows differ from place to place.
        windowed = (row.layer[side] >= WINDOWED)[:, None]
        bay = row.bay[side, None] + share * bays[side, None]
        texture[..., 0] = np.where(windowed, bay, 0.0)
        texture[..., 1] = row.storey[side, None] + (up - row.low[side, None]) / row.unit[side, None]
        texture[..., 2] = row.layer[side, None]
        wall, shape = number[side], (len(side), 4, 3)
        found.append(
            Panels(
                np.concatenate([level, up[..., None]], axis=2),
                np.broadcast_to(normals[side, None], shape),
                texture,
                np.broadcast_to(row.bright * structures.colours[wall, None], shape),
                np.column_stack([low, high, high, low]) - up,
                structures.objects[wall],
            )
        )
    return joined(*found, _caps(structures, 0.55 if indoor else 0.85))


def _rows(structures: Structures, walls: Int, length: Float, bays: Float) -> tuple[_Row, ...]:
    """What stands one above the other in the sides of walls (n,)."""
    heights, seeds = structures.heights[walls], structures.seeds[walls]
    facade = structures.closed[walls] & (heights >= _LOWEST_FACADE) & ~structures.smooth[walls]
    facade &= not structures.indoor
    top = heights - CORNICE
    storey = top / np.maximum(1.0, np.floor(top / STOREY))
    none, one = np.zeros(len(walls)), np.ones(len(walls))
    wide, style = length > NARROW, SLANTS * np.floor(len(STYLES) * np.modf(seeds * 7.31)[0])
    # The door, in the first bay of the texture, goes to one bay of the face, if it has several.
    door = np.where(bays > 1.5, -np.floor(seeds * 0.999 * bays), 1.0)
    pattern = np.floor(seeds * 997.0) + 3.0 * np.arange(len(walls))
    ground, upper = np.where(wide, GROUND + style, PLINTH), np.where(wide, UPPER + style, BLANK)
    tall, foot = facade & (top > 1.5 * storey), np.minimum(heights, STOREY)
    return (
        _Row(facade, none, storey, ground, door, none, storey),
        _Row(tall, storey, top, upper, pattern % BAYS, pattern % ROWS, storey),
        _Row(facade, top, heights, none, none, none, one, 1.10),
        _Row(~facade, none, foot, FOOT * one, none, none, STOREY / ROWS * one),
        _Row(~facade & (heights > STOREY), foot, heights, none, none, none, one),
    )


def bare_above_foot(pieces: Panels, *, indoor: bool) -> Panels:
    """Pieces of walls, with nothing painted on those above the foot of their wall.

    Half of a picture may be such walls, and without a texture they are drawn in half the time.
    """
    low, layer = pieces.texture[..., 1].min(axis=1), pieces.texture[:, 0, 2]
    # The foot of a plain wall is painted in rooms only.
    foot = (SKIRTING_HEIGHT / STOREY * ROWS) if indoor else -1.0
    above = (layer == FOOT) & (low > foot)
    above |= (layer == PLINTH) & (low > PLINTH_HEIGHT / STOREY)
    texture = pieces.texture.copy()
    texture[above, :, 2] = BLANK
    return pieces._replace(texture=texture)


def _caps(structures: Structures, bright: float) -> Panels:
    """Strips on top of free walls, so much brighter than these."""
    free = ~structures.closed
    segments = structures.segments[free]
    along = directions(segments)
    # The strip goes half its width past the ends, so that corners are filled.
    reach = 0.5 * CAP_WIDTH * along
    side = 0.5 * CAP_WIDTH * np.column_stack([-along[:, 1], along[:, 0]])
    start, end = segments[:, :2] - reach, segments[:, 2:] + reach
    corners = np.stack([start - side, end - side, end + side, start + side], axis=1)
    colours, lit = bright * structures.colours[free], np.full(len(segments), LIT)
    return level_panels(corners, structures.heights[free], colours, lit, structures.objects[free])
