"""Textures for rays, compiled: colours of the copies of a picture, between the nearest texels.

What enters is the texture of walls or a picture of the ground, as all of its copies one after the
other, and a place on it; a colour leaves, from the copy whose texels are as large as pixels.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import inner
from lrf3d.geometry import Float, Int
from lrf3d.scene.facades import SLANTS, WINDOWED


@inner
def clamp(value: float, low: float, high: float) -> float:
    """A value, kept between two others."""
    return min(max(value, low), high)


@inner
def mix(first: float, second: float, share: float) -> float:
    """What lies between two values, at a share of the way."""
    return first + (second - first) * share


@inner
def sharp(place: float, coarse: float) -> float:
    """A place on a texture [texels] that makes edges one pixel wide where they are magnified."""
    edge = math.floor(place + 0.5)
    return edge + clamp((place - edge) / min(coarse, 1.0), -0.5, 0.5)


@inner
def painted_at(
    along: float,
    up: float,
    along_step: float,
    up_step: float,
    layer: int,
    painted: NDArray[np.uint8],
    levels: Int,
) -> tuple[float, float, float, float]:
    """What is painted on a wall at a place [texels], and how much of the wall shows.

    Steps are texels to a pixel, as in the shader ``walls.frag``.
    """
    along_step, up_step = max(along_step, 1e-4), max(up_step, 1e-4)
    fit = clamp(along_step, 0.5 * up_step, up_step)
    finest = max(math.floor(math.log2(max(fit, along_step / (1 << (SLANTS - 1)))) + 0.5), 0.0)
    if layer >= WINDOWED:
        slant = math.floor(math.log2(along_step) + 0.5) - finest
        layer += int(clamp(slant, 0.0, SLANTS - 1.0))
    number = min(int(finest), len(levels) - 1)
    start, width, height = levels[number, 0], levels[number, 1], levels[number, 2]
    start += layer * width * height * 4
    scale = 1.0 / (1 << number)
    x = sharp(along, along_step) * scale - 0.5
    y = sharp(up, up_step) * scale - 0.5
    left, low = math.floor(x), math.floor(y)
    x, y = x - left, y - low
    # The texture repeats.
    first, second = int(left) % width, int(left + 1) % width
    below, above = int(low) % height * width, int(low + 1) % height * width
    a, b = start + 4 * (below + first), start + 4 * (below + second)
    c, d = start + 4 * (above + first), start + 4 * (above + second)
    a_share, b_share = (1.0 - x) * (1.0 - y) / 255.0, x * (1.0 - y) / 255.0
    c_share, d_share = (1.0 - x) * y / 255.0, x * y / 255.0
    r = a_share * painted[a] + b_share * painted[b] + c_share * painted[c] + d_share * painted[d]
    g = a_share * painted[a + 1] + b_share * painted[b + 1]
    g += c_share * painted[c + 1] + d_share * painted[d + 1]
    bl = a_share * painted[a + 2] + b_share * painted[b + 2]
    bl += c_share * painted[c + 2] + d_share * painted[d + 2]
    wall = a_share * painted[a + 3] + b_share * painted[b + 3]
    wall += c_share * painted[c + 3] + d_share * painted[d + 3]
    return r, g, bl, wall


@inner
def between(
    texels: NDArray[np.uint8],
    here: int,
    right: int,
    below: int,
    channel: int,
    a: float,
    b: float,
    c: float,
    d: float,
) -> float:
    """One channel between four texels, by their shares."""
    value: float = a * texels[here + channel] + b * texels[here + right + channel]
    value += c * texels[below + channel] + d * texels[below + right + channel]
    return value


@inner
def picture_colour(
    x: float,
    y: float,
    step: float,
    sharper: float,
    texels: NDArray[np.uint8],
    levels: Int,
    ground: Float,
) -> tuple[float, float, float, float]:
    """A picture of the ground at a place, from the copy whose texels are as large as pixels."""
    u, v = (x - ground[4]) * ground[6], (y - ground[5]) * ground[7]
    first, count = int(ground[8]), int(ground[9])
    level = first
    texel_size = 1.0 / (ground[6] * levels[first, 1])
    if step > texel_size * texel_size or (sharper > 0.0 and step > 0.0):
        finer = 0.5 * math.log2(step / (texel_size * texel_size)) + sharper
        level += min(max(int(finer + 0.5), 0), count - 1)
    start, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    # Between the four nearest texels.
    x = clamp(u * width - 0.5, 0.0, width - 1.0)
    y = clamp(v * height - 0.5, 0.0, height - 1.0)
    left, top = int(x), int(y)
    x, y = x - left, y - top
    here = start + 4 * (top * width + left)
    right = 4 if left < width - 1 else 0
    below = here + (4 * width if top < height - 1 else 0)
    a, b = (1.0 - x) * (1.0 - y) / 255.0, x * (1.0 - y) / 255.0
    c, d = (1.0 - x) * y / 255.0, x * y / 255.0
    return (
        between(texels, here, right, below, 0, a, b, c, d),
        between(texels, here, right, below, 1, a, b, c, d),
        between(texels, here, right, below, 2, a, b, c, d),
        between(texels, here, right, below, 3, a, b, c, d),
    )
