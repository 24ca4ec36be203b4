"""Colours of the objects of maps: in figures and messages an object has the same one."""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int


class _Palette(NamedTuple):
    """Colours of the objects of maps in Oklch."""

    taken: float  # [turns] The hue of the laser or of the trail, which no object has,
    free: float  # [turns] and the least distance of an object's hue from it.
    tones: Float  # The lightnesses that objects take in turn.
    chroma: float


# [turns] Hue of the first object, and the step from one object to the next, of Roberts' sequence:
# they leave the nearest two of sixty objects furthest apart. With the golden step every 21st looks
# the same.
_FIRST_HUE = 0.85
_HUE_STEP = 0.5698402910

# Legible on white.
_ON_PAPER = _Palette(0.708, 0.056, np.array([0.44, 0.628, 0.503, 0.69, 0.565]), 0.17)

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


def object_tints(objects: Int) -> Float:
    """Colours (n, 3) of the objects of a map on white, the same for the same number."""
    number = np.asarray(objects, dtype=np.float64)
    # Hues such a step apart never come round; five tones part those that come near.
    turn = np.mod(_FIRST_HUE - number * _HUE_STEP, 1.0)
    hue = 2.0 * np.pi * (_ON_PAPER.taken + _ON_PAPER.free + turn * (1.0 - 2.0 * _ON_PAPER.free))
    lightness = _ON_PAPER.tones[number.astype(np.int64) % len(_ON_PAPER.tones)]
    # In Oklch (Ottosson, 2020) all hues look equally bright.
    lab = np.column_stack(
        [lightness, _ON_PAPER.chroma * np.cos(hue), _ON_PAPER.chroma * np.sin(hue)]
    )
    linear = np.clip((lab @ _LMS_FROM_LAB.T) ** 3 @ _RGB_FROM_LMS.T, 0.0, 1.0)
    # The transfer curve of sRGB (IEC 61966-2-1).
    offset = 0.055
    curved = (1.0 + offset) * linear ** (1.0 / 2.4) - offset
    colours: Float = np.where(linear <= 0.0031308, 12.92 * linear, curved)
    return colours
