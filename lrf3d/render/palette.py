"""The colours of films: red, green, blue in 0…1, as a screen shows them."""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.world import World

PLASTER = np.array(
    [
        [0.80, 0.74, 0.62],
        [0.70, 0.50, 0.43],
        [0.74, 0.77, 0.74],
        [0.78, 0.66, 0.50],
        [0.62, 0.68, 0.74],
        [0.84, 0.80, 0.73],
        [0.65, 0.60, 0.53],
        [0.76, 0.58, 0.46],
        [0.68, 0.74, 0.68],
    ]
)
"""Façades of a town: warm plasters, bricks and two cool greys, none next to its like."""

PAINT = np.array(
    [
        [0.87, 0.86, 0.82],
        [0.64, 0.74, 0.80],
        [0.83, 0.72, 0.56],
        [0.70, 0.78, 0.66],
        [0.80, 0.64, 0.60],
        [0.72, 0.70, 0.80],
    ]
)
"""Walls and things in rooms: pale paint."""

MOVERS = np.array([[0.13, 0.48, 0.55], [0.46, 0.36, 0.62], [0.60, 0.58, 0.20], [0.66, 0.28, 0.36]])
"""What moves beside the robot: strong, and none is the robot's orange."""

_HUE_STEP = 0.6180339887
"""The golden ratio's fraction of a turn: neighbours in number lie far apart in hue."""


_TONES, _CHROMA = np.array([0.48, 0.65, 0.56]), 0.17
"""Lightness and colourfulness in Oklch of the objects of maps: legible on white, none shouts."""

_LMS_FROM_LAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_RGB_FROM_LMS = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def object_colours(world: World, *, indoor: bool) -> Float:
    """Colours (objects, 3) of a world's objects: its own, or one from a palette by number."""
    palette = PAINT if indoor else PLASTER
    numbers = np.arange(world.object_count)
    chosen = palette[numbers % len(palette)].copy()
    # A slow drift in brightness keeps two houses of one colour from looking the same.
    chosen *= (0.94 + 0.10 * np.modf(numbers * _HUE_STEP)[0])[:, None]
    given = np.full((world.object_count, 3), np.nan)
    rows = min(len(world.colours), world.object_count)
    given[:rows] = world.colours[:rows]
    return np.clip(np.where(np.isnan(given), chosen, given), 0.0, 1.0)


def object_tints(objects: Int) -> Float:
    """Colours (n, 3) of the objects of a map, strong on white, the same for the same number."""
    number = np.asarray(objects, dtype=np.float64)
    # Hues a golden step apart never come round; three tones part those that come near.
    hue = 2.0 * np.pi * (0.73 - number * _HUE_STEP)
    lightness = _TONES[number.astype(np.int64) % len(_TONES)]
    return _oklch_to_rgb(lightness, np.full(len(number), _CHROMA), hue)


def _oklch_to_rgb(lightness: Float, chroma: Float, hue: Float) -> Float:
    """Screen colours (n, 3) of Oklch (Ottosson, 2020), where all hues look equally bright."""
    lab = np.column_stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)])
    linear = np.clip((lab @ _LMS_FROM_LAB.T) ** 3 @ _RGB_FROM_LMS.T, 0.0, 1.0)
    curved = 1.055 * linear ** (1.0 / 2.4) - 0.055
    colours: Float = np.where(linear <= 0.0031308, 12.92 * linear, curved)
    return colours
