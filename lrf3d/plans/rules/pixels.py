"""Pixels of pictures: their colours, and how far each is from the paper's.

The files of pictures enter; colours and opacity leave, for maps, and contrasts and a threshold, for
plans. The light on a photograph of paper is evened.
"""

from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, grey_closing

from lrf3d.geometry.lines import Bool, Int, Single
from lrf3d.plans.canvas import WHITE

# Share of the pixels of walls that are dark below which walls are drawn as outlines.
HOLLOW = 0.7


def on_paper(pixels: Any, paper: float = WHITE) -> Any:
    """The colours of pixels (rows, columns, 2 or 4), composited on paper of a grey."""
    alpha = pixels[..., -1:] / np.float32(WHITE)
    return np.round(paper - alpha * (paper - pixels[..., :-1])).astype(np.uint8)


def evened(colours: Any, wide: float) -> Any:
    """The colours (rows, columns, 3) as under even light, or None where the light is even.

    Nothing dark is this wide [pixels], so the lightest colours around a pixel are the paper's.
    """
    # Under even light, the paper and the ink of a plan have few greys.
    counts = np.bincount((colours.mean(axis=2, dtype=np.float32) // 4.0).astype(np.uint8).ravel())
    if np.sort(counts)[-6:].sum() > 0.65 * counts.sum():
        return None
    side = max(1, int(wide / 8.0))
    rows, columns = colours.shape[:2]
    high = -(-rows // side)
    long = -(-columns // side)
    even = np.empty((rows, columns, 3), dtype=np.uint8)
    for channel in range(3):
        padding = ((0, high * side - rows), (0, long * side - columns))
        whole = np.pad(colours[..., channel], padding, mode="edge")
        blocks = whole.reshape(high, side, long, side).swapaxes(1, 2).reshape(high, long, -1)
        size = (int(wide / side) + 1,) * 2
        closed = grey_closing(np.median(blocks, axis=2), size)
        paper = Image.fromarray(gaussian_filter(closed, 1.0).astype(np.float32))
        light = np.asarray(paper.resize((long * side, high * side), Image.Resampling.BILINEAR))
        share = colours[..., channel] / np.maximum(light[:rows, :columns], 16.0)
        even[..., channel] = np.minimum(WHITE * share, WHITE)
    return even


def contrast_of(colours: Any) -> tuple[Single, Single, Int]:
    """Differences (rows, columns) from the paper in colour and in lightness; numbers of colours.

    Differences are from 0 to 1; that in colour is the difference of the channel that differs most.
    """
    # Sixteen steps of each channel: the noise of a scan is one colour.
    red, green, blue = (colours[..., channel].astype(np.uint16) >> 4 for channel in range(3))
    key = red << 8 | green << 4 | blue
    light = np.minimum(np.minimum(red, green), blue) >= 11
    # The paper of a blueprint is dark.
    usual = int(np.argmax(np.bincount(key[light] if light.mean() > 0.2 else key.ravel())))
    paper = np.median(colours[key == usual], axis=0).astype(np.float32)
    most: Any = np.zeros(key.shape, dtype=np.float32)
    scale = np.float32(WHITE)
    for channel in range(3):
        np.maximum(most, np.abs(colours[..., channel] - paper[channel]), out=most)
    lightness = np.abs(colours.mean(axis=2, dtype=np.float32) - paper.mean())
    return most / scale, lightness / scale, key


def threshold_of(contrast: Single) -> float:
    """The contrast that separates walls best from paper and floors.

    If much of the picture is above it, and in two colours, the lighter one is that of floors: the
    threshold is raised between them, and so on.
    """
    counts = np.bincount(np.round(contrast * WHITE).astype(np.int64).ravel(), minlength=256)
    first, _ = _separated(counts)
    while counts[first:].sum() > 0.2 * counts.sum():
        more, apart = _separated(counts[first:])
        if apart < 40.0:
            break
        first += more
    return (first - 0.5) / WHITE


def _separated(counts: Int) -> tuple[int, float]:
    """The first of the upper of two groups of levels, and the difference of their means.

    The variance between the groups is the largest. Between two colours all levels are as good, and
    the middle one is taken.
    """
    levels = np.arange(len(counts))
    below = np.cumsum(counts)[:-1]
    sums = np.cumsum(counts * levels)[:-1]
    with np.errstate(all="ignore"):
        apart = (counts @ levels - sums) / (counts.sum() - below) - sums / below
    variance = np.nan_to_num((counts.sum() - below) * below.astype(np.float64) * apart**2)
    best = round(float(np.flatnonzero(variance == variance.max()).mean()))
    return best + 1, float(np.nan_to_num(apart)[best])


def pen_of(walls: Bool, dark: Bool) -> float:
    """The thickness [pixels] of the lines that outline walls; 0 where most of a wall is dark."""
    ink = walls & dark
    if not 0 < ink.sum() < HOLLOW * walls.sum():
        return 0.0
    edges = sum(int(np.diff(ink.astype(np.int8), axis=axis).astype(bool).sum()) for axis in (0, 1))
    return 2.0 * float(ink.sum()) / edges
