"""Façades as textures: windows that repeat over a wall, and a ground floor with doors.

Each tile is a bay wide and a storey high. The wall is left pale, so that a colour laid over the
tiles gives every house its own.
"""

import io

import numpy as np
from PIL import Image, ImageDraw

BAY = 2.7
"""About the distance between windows [m]."""

STOREY = 3.1
"""About the height of a storey [m]."""

CORNICE = 0.45
"""Height of the band under the roof [m], which has no windows."""

NARROWEST = 1.7
"""Walls shorter than this [m] have no windows."""

BAYS, STOREYS = 8, 4
"""Tiles of the texture of upper floors; that of the ground floor has one row of them."""

PALE = 0.86
"""How bright the bare wall is in the texture: what is whiter, such as frames, still stands out."""

_TILE = (128, 128)
_FINER = 4
_FRAME, _BARE = (255, 255, 255), (round(255 * PALE),) * 3
_DARK_GLASS, _LIGHT_GLASS = np.array([70, 92, 126]), np.array([136, 168, 208])
_DOORS = ((96, 66, 50), (56, 80, 74))


def upper_floors() -> bytes:
    """A picture (PNG) of windows, BAYS × STOREYS of them."""
    return _picture(STOREYS, doors=False)


def ground_floor() -> bytes:
    """A picture (PNG) of a row of windows with a door in every fourth bay."""
    return _picture(1, doors=True)


def _picture(storeys: int, *, doors: bool) -> bytes:
    rng = np.random.default_rng(4)
    width, height = _TILE[0] * _FINER, _TILE[1] * _FINER
    picture = Image.new("RGB", (BAYS * width, storeys * height), _BARE)
    draw = ImageDraw.Draw(picture)
    for storey in range(storeys):
        for bay in range(BAYS):
            place = bay * width, storey * height
            if doors and bay % 4 == 1:
                _box(draw, place, (0.24, 0.20, 0.76, 1.0), _FRAME)
                _box(draw, place, (0.28, 0.24, 0.72, 1.0), _DOORS[bay // 4])
                continue
            share = rng.random()
            top = _DARK_GLASS + share * (_LIGHT_GLASS - _DARK_GLASS)
            _box(draw, place, (0.20, 0.17, 0.80, 0.77), _FRAME)
            _box(draw, place, (0.23, 0.20, 0.77, 0.74), _colour(0.86 * top))
            _box(draw, place, (0.23, 0.20, 0.77, 0.42), _colour(top))
            _box(draw, place, (0.49, 0.20, 0.51, 0.74), _FRAME)
            _box(draw, place, (0.17, 0.77, 0.83, 0.80), _FRAME)
    picture = picture.reduce(_FINER)
    file = io.BytesIO()
    picture.save(file, "PNG", optimize=True)
    return file.getvalue()


def _colour(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[int, int, int]:
    red, green, blue = np.clip(values, 0, 255).astype(int).tolist()
    return red, green, blue


def _box(
    draw: ImageDraw.ImageDraw,
    place: tuple[int, int],
    box: tuple[float, float, float, float],
    colour: tuple[int, ...],
) -> None:
    """Fill a box given in parts of a tile, from its upper left corner."""
    x, y = place
    width, height = _TILE[0] * _FINER, _TILE[1] * _FINER
    left, top, right, bottom = box
    corners = [x + left * width, y + top * height, x + right * width - 1, y + bottom * height - 1]
    draw.rectangle(corners, fill=colour)
