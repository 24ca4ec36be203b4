"""Where panel and inset of a film go: in pictures of any size they never lie over each other."""

from dataclasses import dataclass

import numpy as np

from lrf3d.render.hud import Line, panel_size

SMALLEST_SCALE = 0.62
"""Where there is room, text is not smaller than this times its size at 720 lines."""

GAP = 16
"""Free border round panels [pixels]."""

REFERENCE = 720
"""Shorter side of a picture [pixels] at which sizes of text are as given."""

LEAST_SCALE = 0.47
"""Letters smaller than this times their size in a picture of that side are not drawn: nobody
reads them."""

SIDE = 0.36
"""Side of the inset, as a share of the shorter side of the picture."""

MOST_COVERED = 0.6
"""Panel and inset, one under the other, take at most this share of the picture's height."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where panel and inset go.

    Args:
        scale: Size of the panel's letters against that at 720 lines; None for no panel.
        inset: Left, top and side of the inset [pixels]; None for no inset.
        gap: Free border round both [pixels].
        covered: Width and height of the corner that the panel takes, in heights of the picture.
    """

    scale: float | None
    inset: tuple[int, int, int] | None
    gap: int
    covered: tuple[float, float]


def scale_of(size: tuple[int, int]) -> float:
    """How many times their size at 720 lines lines and letters are in a picture [pixels]."""
    return max(SMALLEST_SCALE, min(size) / REFERENCE)


def lay_out(size: tuple[int, int], lines: tuple[Line, ...], small: float = 1.0) -> Layout:
    """Find room for a panel of the widest lines that it will have, and for the inset.

    Args:
        size: Width and height of the picture [pixels].
        lines: The lines.
        small: Size of the letters against their usual one.

    The inset stands beside the panel or, where the picture is too narrow, under it; where there
    is no room for both the panel goes first, and then the letters are made smaller.
    """
    width, height = size
    usual, side = max(LEAST_SCALE, small * scale_of(size)), round(SIDE * min(size))
    gap = round(GAP * scale_of(size))
    scales = [float(scale) for scale in np.linspace(usual, LEAST_SCALE, 12)]

    def beside(scale: float) -> Layout | None:
        wide, high = panel_size(lines, scale)
        if 3 * gap + wide + side > width or 2 * gap + max(high, side) > height:
            return None
        return Layout(scale, (width - gap - side, gap, side), gap, _covered(size, gap, wide, high))

    def under(scale: float) -> Layout | None:
        wide, high = panel_size(lines, scale)
        if 2 * gap + wide > width or 3 * gap + high + side > MOST_COVERED * height:
            return None
        place = width - gap - side, high + 2 * gap, side
        return Layout(scale, place, gap, _covered(size, gap, wide, high))

    def alone(scale: float) -> Layout | None:
        wide, high = panel_size(lines, scale)
        if 2 * gap + wide > width or 2 * gap + high > MOST_COVERED * height:
            return None
        return Layout(scale, None, gap, _covered(size, gap, wide, high))

    # Tall pictures have more room under the panel than beside it.
    first, second = (under, beside) if height > width else (beside, under)
    for tried, some in ((beside, scales[:1]), (first, scales), (second, scales), (alone, scales)):
        for scale in some:
            found = tried(scale)
            if found is not None:
                return found
    return Layout(None, (width - gap - side, gap, side), gap, (0.0, 0.0))


def _covered(size: tuple[int, int], gap: int, wide: int, high: int) -> tuple[float, float]:
    return (wide + 2 * gap) / size[1], (high + 2 * gap) / size[1]
