"""Colours of the objects of maps: in figures and messages an object has the same one."""

import numpy as np

from lrf3d.geometry.lines import Float, Int

# [turns] Hue of the laser and of the trail, which no object has, and the least distance from it.
_TAKEN_HUE = 0.708
_FREE_HUE = 0.056

# Lightnesses that objects take in turn, and their chroma, in Oklch: legible on white.
_TONES = np.array([0.44, 0.628, 0.503, 0.69, 0.565])
_CHROMA = 0.17

# [turns] Hue of the first object, and the step from one object to the next, of Roberts' sequence:
# they leave the nearest two of sixty objects furthest apart. With the golden step every 21st looks
# the same.
_FIRST_HUE = 0.85
_HUE_STEP = 0.5698402910

# From Oklab to the responses of cones, and from these to linear sRGB (Ottosson, 2020).
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


# The transfer curve of sRGB (IEC 61966-2-1): the slope of colours up to a limit on the screen, and
# the offset and the power of brighter ones.
_SLOPE = 12.92
_LIMIT = 0.04045
_OFFSET = 0.055
_POWER = 2.4


def linear_light(screen: Float) -> Float:
    """Colours in linear light of those of a screen."""
    bright = ((screen + _OFFSET) / (1.0 + _OFFSET)) ** _POWER
    return np.where(screen <= _LIMIT, screen / _SLOPE, bright)


def object_tints(objects: Int) -> Float:
    """Colours (n, 3) of the objects of a map on white, the same for the same number."""
    number = np.asarray(objects, dtype=np.float64)
    # Hues such a step apart never come round; five tones part those that come near.
    turn = np.mod(_FIRST_HUE - number * _HUE_STEP, 1.0)
    hue = 2.0 * np.pi * (_TAKEN_HUE + _FREE_HUE + turn * (1.0 - 2.0 * _FREE_HUE))
    lightness = _TONES[number.astype(np.int64) % len(_TONES)]
    # In Oklch (Ottosson, 2020) all hues look equally bright.
    lab = np.column_stack([lightness, _CHROMA * np.cos(hue), _CHROMA * np.sin(hue)])
    linear: Float = np.clip((lab @ _LMS_FROM_LAB.T) ** 3 @ _RGB_FROM_LMS.T, 0.0, 1.0)
    bright = (1.0 + _OFFSET) * linear ** (1.0 / _POWER) - _OFFSET
    return np.where(linear <= _LIMIT / _SLOPE, _SLOPE * linear, bright)
