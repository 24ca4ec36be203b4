"""Smoothing the edges of a picture with one sample a pixel (FXAA; Lottes, 2011).

In software OpenGL, a shader pass over all pixels takes as long as four samples a pixel. Here only
pixels at edges take time, a few per cent of all.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled
from lrf3d.studio.scene.shapes import Pixels

# Largest distance at which the ends of an edge are searched [pixels].
_REACH = 20

# Least difference of brightness at an edge, of 255.
_LEAST = 8

# Least opacity of a pixel that is smoothed, of 255: lines and points already have soft edges.
_WHOLE = 250


@borrower
def far_end(
    bright: NDArray[np.int16], x: int, y: int, way: tuple[int, int], beyond: tuple[int, int]
) -> tuple[int, int]:
    """Distance to the end of an edge in one direction [pixels], and how much brighter it is there.

    The edge lies between the pixel x, y and the one beyond it; twice the brightness is compared.
    """
    height, width = bright.shape
    here = bright[y, x]
    there = bright[y + beyond[1], x + beyond[0]]
    gap = abs(there - here)
    for k in range(1, _REACH + 1):
        px = x + k * way[0]
        py = y + k * way[1]
        if px < 1 or py < 1 or px >= width - 1 or py >= height - 1:
            break
        off = bright[py, px] + bright[py + beyond[1], px + beyond[0]] - here - there
        if 2 * abs(off) >= gap:
            return k, off
    return _REACH, 0


@borrower
def edge_share(bright: NDArray[np.int16], x: int, y: int) -> tuple[float, int, int]:
    """The share of a pixel that the surface beyond an edge covers, and the step to that side."""
    m = bright[y, x]
    n = bright[y - 1, x]
    s = bright[y + 1, x]
    w = bright[y, x - 1]
    e = bright[y, x + 1]
    nw = bright[y - 1, x - 1]
    ne = bright[y - 1, x + 1]
    sw = bright[y + 1, x - 1]
    se = bright[y + 1, x + 1]
    level = 2 * abs(n + s - 2 * m) + abs(ne + se - 2 * e) + abs(nw + sw - 2 * w)
    upright = 2 * abs(w + e - 2 * m) + abs(nw + ne - 2 * n) + abs(sw + se - 2 * s)
    along = level >= upright
    one = n if along else w
    two = s if along else e
    side = -1 if abs(one - m) >= abs(two - m) else 1
    beyond = (0, side) if along else (side, 0)
    way = (1, 0) if along else (0, 1)
    back, off = far_end(bright, x, y, (-way[0], -way[1]), beyond)
    ahead, other = far_end(bright, x, y, way, beyond)
    nearest = back
    if ahead < back:
        nearest = ahead
        off = other
    across = m - bright[y + beyond[1], x + beyond[0]]
    # The pixel on the other side of the edge is covered instead.
    if off == 0 or (off < 0) == (across < 0):
        return 0.0, 0, 0
    return 0.5 - nearest / (back + ahead), beyond[0], beyond[1]


@borrower
def unpack(packed: NDArray[np.uint32], row: Pixels) -> None:
    """Fill in the colours (w, 3) of pixels in numbers (w,)."""
    for x in range(len(packed)):
        pixel = packed[x]
        row[x, 0] = np.uint8(pixel)
        row[x, 1] = np.uint8(pixel >> 8)
        row[x, 2] = np.uint8(pixel >> 16)


@compiled
def smooth_edges(
    packed: NDArray[np.uint32],
    bright: NDArray[np.int16],
    contrast: NDArray[np.int16],
    picture: Pixels,
) -> None:
    """Fill in a picture (h, w, 3) of pixels in numbers (h, w), blended at edges with those beyond.

    Its brightness is filled into bright (h, w), and the contrast over the least at edges into
    contrast (h, w): in these plain loops the processor works on many pixels at a time.
    """
    height, width = bright.shape
    for y in range(height):
        for x in range(width):
            pixel = np.int32(packed[y, x])
            red = pixel & 255
            green = pixel >> 8 & 255
            blue = pixel >> 16 & 255
            bright[y, x] = np.int16((5 * red + 9 * green + 2 * blue) >> 4)
        unpack(packed[y], picture[y])
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            n = bright[y - 1, x]
            s = bright[y + 1, x]
            w = bright[y, x - 1]
            e = bright[y, x + 1]
            least = min(min(n, s), min(w, e), bright[y, x])
            most = max(max(n, s), max(w, e), bright[y, x])
            contrast[y, x] = most - least - max(np.int16(_LEAST), np.int16(most >> 3))
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            if contrast[y, x] < 0 or packed[y, x] >> 24 < _WHOLE:
                continue
            share, dx, dy = edge_share(bright, x, y)
            here = np.int64(packed[y, x])
            there = np.int64(packed[y + dy, x + dx])
            for k in range(3):
                low = here >> 8 * k & 255
                high = there >> 8 * k & 255
                picture[y, x, k] = low + share * (high - low)
