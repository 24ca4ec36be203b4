"""Façades, painted once: the texture that all pictures of walls take, and where faces lie on it.

A layer of the texture is some bays wide and storeys high and repeats. Its texels hold what is
painted over the wall and, as opacity, how much of the wall's own colour still shows: a wall is
seen as ``colour * texel[3] + texel[:3]``, so that every house has its own plaster. The edges of
windows and doors lie between texels, which renderers may therefore magnify with sharp edges.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float

Texels = NDArray[np.uint8]

BAY, STOREY = 2.7, 3.1
"""About the distance between windows and the height of a storey [m]."""

TILE, BAYS, ROWS = 64, 8, 4
"""Texels along both sides of a bay's storey; bays and storeys of a layer."""

SLANTS = 4
"""Copies of a layer with windows, each twice as blurred along the wall as the one before: a wall
seen at a slant is narrow and yet high, which smaller copies of a picture are not made for."""

BLANK, WINDOWED = 0, 1
"""Layers: nothing painted, and the first of those with windows."""

STYLES = ((12, 16), (14, 15), (11, 18))
"""Half the width and height of a window [texels], for each style of houses."""

GROUND, UPPER = WINDOWED, WINDOWED + SLANTS * len(STYLES)
"""The first layers of ground floors and of those above."""

_WOOD = np.array([[0.30, 0.20, 0.15], [0.16, 0.24, 0.22], [0.30, 0.20, 0.15]])
_DARK_PANE, _LIGHT_PANE = np.array([0.20, 0.27, 0.38]), np.array([0.42, 0.53, 0.68])
"""Colours of doors by style, and of panes."""

_MIDDLE, _DOOR = 35, (13, 45)
"""Height of a window's middle, and half the width and height of doors [texels]."""


@cache
def layers(indoor: bool) -> tuple[Texels, ...]:
    """The texture: (layers, h, w, 4) red, green, blue and what is left of the wall's colour.

    Row 0 lies at the foot of the wall. Each further level is half as wide and high.
    """
    painted = [_blank()]
    if not indoor:
        rng = np.random.default_rng(4)
        for ground in (True, False):
            for style in range(len(STYLES)):
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


def _windows(style: int, rng: np.random.Generator, *, ground: bool) -> Float:
    """Windows in all bays of all storeys, or of the ground floor, with a door in its first bay."""
    layer = _blank()
    wide, tall = STYLES[style]
    height = ((np.arange(TILE) + 0.5) / TILE)[:, None, None]
    for row in range(1 if ground else ROWS):
        for bay in range(BAYS):
            tile = layer[row * TILE : (row + 1) * TILE, bay * TILE : (bay + 1) * TILE]
            if ground and bay == 0:
                half, top = _DOOR
                _box(tile, half, 0, top)[:] = [*_WOOD[style], 0.0]
                continue
            pane = np.zeros((TILE, 1, 4))
            share = 0.65 * rng.random() + 0.35 * height
            pane[..., :3] = _DARK_PANE + share * (_LIGHT_PANE - _DARK_PANE)
            low, high = _MIDDLE - tall, _MIDDLE + tall
            _box(tile, wide, low, high)[:] = pane[low:high]
    return layer


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
