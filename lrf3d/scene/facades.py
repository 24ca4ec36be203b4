"""Façades, painted once: the texture that all pictures of walls take, and where faces lie on it.

A layer of the texture is some bays wide and storeys high and repeats. Its texels hold what is
painted over the wall and, as opacity, how much of the wall's own colour still shows: a wall is
seen as ``colour * texel[3] + texel[:3]``, so that every house has its own plaster. The edges of
windows and doors lie between texels, which renderers may therefore magnify with sharp edges.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, Single

Texels = NDArray[np.uint8]

FACADE, PLAIN, ROOF, CAP, TILED = 0.0, 1.0, 2.0, 3.0, 4.0
"""What a face is: the whole part of the fourth colour value of :mod:`lrf3d.scene.walls`."""

BAY, STOREY = 2.7, 3.1
"""About the distance between windows and the height of a storey [m]."""

CORNICE, NARROW = 0.45, 1.7
"""Height of the band under the roof, and the shortest face that has windows [m]."""

TILE, BAYS, ROWS = 64, 8, 4
"""Texels along both sides of a bay's storey; bays and storeys of a layer."""

SLANTS = 4
"""Copies of a layer with windows, each twice as blurred along the wall as the one before: a wall
seen at a slant is narrow and yet high, which smaller copies of a picture are not made for."""

BLANK, FOOT, PLINTH, WINDOWED = 0, 1, 2, 3
"""Layers: nothing painted, the foot of a plain wall, that of a house, and the first of those with
windows."""

_STYLES = ((12, 16), (14, 15), (11, 18))
"""Half the width and height of a window [texels], for each style of houses."""

_GROUND, _UPPER = WINDOWED, WINDOWED + SLANTS * len(_STYLES)
"""The first layers of ground floors and of those above."""

_WOOD = np.array([[0.30, 0.20, 0.15], [0.16, 0.24, 0.22], [0.30, 0.20, 0.15]])
_DARK_PANE, _LIGHT_PANE = np.array([0.20, 0.27, 0.38]), np.array([0.42, 0.53, 0.68])
_FRAME = np.array([0.4185, 0.4185, 0.4185, 0.55])
"""Colours of doors by style, of panes, and of frames, which are pale and take on some of the
wall's colour."""

_MIDDLE, _RIM, _DOOR = 35, 2, (13, 45)
"""Height of a window's middle, width of frames, and half the width and height of doors [texels]."""

_SILL, _SILL_PAINT = (5, 5), np.array([0.56, 0.55, 0.53, 0.25])
"""How far a sill reaches to both sides of its window and below it [texels], and its colour."""

_PLINTH_HEIGHT, _SKIRTING_HEIGHT = 0.45, 0.09
"""Heights of the darker foot of a house, and of that of a wall in rooms [m]."""

ROOF_GREY, _ROOF_SHARE = np.array([0.52, 0.52, 0.53]), 0.75
"""Colour of roofs, and its share in a roof: the rest is the wall's."""


@cache
def layers(indoor: bool) -> tuple[Texels, ...]:
    """The texture: (layers, h, w, 4) red, green, blue and what is left of the wall's colour.

    Row 0 lies at the foot of the wall. Each further level is half as wide and high.
    """
    painted = [_blank(), _foot(indoor)]
    if not indoor:
        rng = np.random.default_rng(4)
        painted.append(_darkened(_blank()))
        for ground in (True, False):
            for style in range(len(_STYLES)):
                painted += _slants(_windows(style, rng, ground=ground))
    level = np.round(255.0 * np.array(painted)).astype(np.uint8)
    levels = [level]
    while min(level.shape[1:3]) > 1:
        wide = level.astype(np.uint16)
        total = wide[:, ::2, ::2] + wide[:, 1::2, ::2] + wide[:, ::2, 1::2] + wide[:, 1::2, 1::2]
        level = ((total + 2) // 4).astype(np.uint8)
        levels.append(level)
    return tuple(levels)


def _blank() -> Float:
    layer = np.zeros((ROWS * TILE, BAYS * TILE, 4))
    layer[..., 3] = 1.0
    return layer


def _foot(indoor: bool) -> Float:
    """The lowest storey of a plain wall, with the skirting of one in rooms."""
    layer = _blank()
    if indoor:
        layer[(np.arange(len(layer)) + 0.5) / len(layer) * STOREY <= _SKIRTING_HEIGHT, :, 3] = 0.62
    return layer


def _darkened(layer: Float) -> Float:
    """A layer with the plinth of a house over its lowest storey."""
    layer[:TILE][(np.arange(TILE) + 0.5) / TILE * STOREY <= _PLINTH_HEIGHT] *= 0.82
    # What lies under the foot where the layer repeats is seen with it from far away.
    layer[-TILE // 4 :] = layer[:1]
    return layer


def _windows(style: int, rng: np.random.Generator, *, ground: bool) -> Float:
    """Windows in all bays of all storeys, or of the ground floor, with a door in its first bay."""
    layer = _blank()
    wide, tall = _STYLES[style]
    height = ((np.arange(TILE) + 0.5) / TILE)[:, None, None]
    for row in range(1 if ground else ROWS):
        for bay in range(BAYS):
            tile = layer[row * TILE : (row + 1) * TILE, bay * TILE : (bay + 1) * TILE]
            if ground and bay == 0:
                half, top = _DOOR
                _box(tile, half + _RIM, 0, top + _RIM)[:] = _FRAME
                _box(tile, half, 0, top)[:] = [*_WOOD[style], 0.0]
                continue
            pane = np.zeros((TILE, 1, 4))
            share = 0.65 * rng.random() + 0.35 * height
            pane[..., :3] = _DARK_PANE + share * (_LIGHT_PANE - _DARK_PANE)
            low, high = _MIDDLE - tall, _MIDDLE + tall
            _box(tile, wide + _RIM, low - _RIM, high + _RIM)[:] = _FRAME
            _box(tile, wide + _SILL[0], low - _SILL[1], low - _RIM)[:] = _SILL_PAINT
            _box(tile, wide, low, high)[:] = pane[low:high]
            _box(tile, 1, low, high)[:] = 0.8 * _FRAME + 0.2 * pane[low:high]
            bar = low + 2 * (high - low) // 3
            _box(tile, wide, bar, bar + 1)[:] = 0.8 * _FRAME + 0.2 * pane[bar]
    return _darkened(layer) if ground else layer


def _box(tile: Float, half_width: int, low: int, high: int) -> Float:
    """The part of a tile to both sides of its middle, between two heights [texels]."""
    return tile[low:high, TILE // 2 - half_width : TILE // 2 + half_width]


def _slants(layer: Float) -> list[Float]:
    """A layer, and its means over 2, 4, … texels along the wall."""
    found = [layer]
    for step in range(SLANTS - 1):
        layer = 0.5 * (layer + np.roll(layer, (-1) ** step * 2**step, axis=1))
        found.append(layer)
    return found


def lay_walls(quads: Single, faces: Int, *, indoor: bool) -> tuple[Single, Int]:
    """Cut walls into ground floors, upper floors and cornices, and lay them on the texture.

    Args:
        quads: (n, 4, 15) parts of walls, see :mod:`lrf3d.scene.walls`.
        faces: (n,) number of the wall that each is a part of: all parts of it have one pattern.
        indoor: Whether this is the inside of a house.

    Returns:
        The pieces (m, 4, 16), and which of the quads (m,) each is of. A corner has its position,
        its normal, its place along and up the texture in bays and storeys, its layer, the wall's
        colour, the light on it, and how far under the edge of its shadow it lies [m].
    """
    length, height = (quads[:, 0, k].astype(np.float64) for k in (8, 9))
    kind = np.floor(quads[:, 0, 13])
    seed = (quads[:, 0, 13] - kind) / 0.9
    bays = np.maximum(1.0, np.floor(length / BAY))
    top = height - CORNICE
    storey = top / np.maximum(1.0, np.floor(top / STOREY))
    style = SLANTS * np.floor(len(_STYLES) * np.modf(seed * 7.31)[0])
    wide, facade, plain = length > NARROW, kind == FACADE, kind == PLAIN
    # The door, in the first bay of the texture, goes to one bay of the face, if it has several.
    door = np.where(bays > 1.5, -np.floor(seed * 0.999 * bays), 1.0)
    pattern = np.floor(seed * 997.0) + 3.0 * faces
    none, one = np.zeros(len(quads)), np.ones(len(quads))
    ground, upper = np.where(wide, _GROUND + style, PLINTH), np.where(wide, _UPPER + style, BLANK)
    tall, foot, cap = facade & (top > 1.5 * storey), np.minimum(height, STOREY), kind == CAP
    # Which faces, from and up to which height [m]; the layer, the first bay and storey of it, how
    # high a storey is [m], and how much brighter than the wall the piece is.
    rows = (
        (facade, none, storey, ground, door, none, storey, 1.0),
        (tall, storey, top, upper, pattern % BAYS, pattern % ROWS, storey, 1.0),
        (facade, top, height, none, none, none, one, 1.10),
        (plain, none, foot, FOOT * one, none, none, STOREY / ROWS * one, 1.0),
        (plain & (height > STOREY), foot, height, none, none, none, one, 1.0),
        (cap, none, none, none, none, none, one, 0.55 if indoor else 0.85),
    )
    pieces, owners = [], []
    for chosen, low, high, layer, first, up, unit, bright in rows:
        number = np.flatnonzero(chosen)
        quad = quads[number].astype(np.float64)
        level = quad[:, :, 5] > 0.5
        ends = np.column_stack([low[number], low[number], high[number], high[number]])
        raised = np.where(level, 0.0, ends - quad[:, :, 7])
        piece = np.zeros((len(number), 4, 16))
        piece[..., :6] = quad[..., :6]
        piece[..., 2] += raised
        piece[..., 6] = (
            first[number, None] + quad[..., 6] * (bays / np.maximum(length, 1e-9))[number, None]
        )
        piece[..., 7] = up[number, None] + (ends - low[number, None]) / unit[number, None]
        piece[..., 8] = layer[number, None]
        blank = layer[number] < WINDOWED
        # Along the wall, only windows differ from place to place.
        piece[blank, :, 6] = 0.0
        piece[..., 9:12] = bright * quad[..., 10:13]
        piece[..., 12:15] = 1.0
        piece[..., 15] = quad[..., 14] - raised
        pieces.append(piece)
        owners.append(number)
    return np.concatenate(pieces).astype(np.float32), np.concatenate(owners)


def bare_above_foot(pieces: Single, *, indoor: bool) -> Single:
    """Pieces (n, 4, 16) of walls, with nothing painted on those above the foot of their wall.

    Half of a picture may be such walls, and without a texture they are drawn in half the time.
    """
    low, layer = pieces[:, :, 7].min(axis=1), pieces[:, 0, 8]
    # The foot of a plain wall is painted in rooms only.
    foot = (_SKIRTING_HEIGHT / STOREY * ROWS) if indoor else -1.0
    above = (layer == FOOT) & (low > foot)
    above |= (layer == PLINTH) & (low > _PLINTH_HEIGHT / STOREY)
    bare = pieces.copy()
    bare[above, :, 8] = BLANK
    return bare


def lay_roofs(roofs: Single, *, indoor: bool) -> Single:
    """Roof triangles (t, 3, 15) as corners (t, 3, 16) like those of :func:`lay_walls`."""
    rows = np.zeros((len(roofs), 3, 16), np.float32)
    rows[..., :6] = roofs[..., :6]
    colour = roofs[..., 10:13].astype(np.float64)
    if not indoor:
        grey = 1.08 * (colour + _ROOF_SHARE * (ROOF_GREY - colour))
        rim = 0.5 * (colour + grey)
        kind = np.floor(roofs[..., 13:14])
        colour = np.where(kind == CAP, rim, np.where(kind == TILED, colour, grey))
    rows[..., 9:12] = 1.02 * colour if indoor else colour
    rows[..., 12:15] = 1.0
    rows[..., 15] = roofs[..., 14]
    return rows
