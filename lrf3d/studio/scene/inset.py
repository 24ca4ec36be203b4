"""The inset: which part of a world a small map in the corner of a picture shows."""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.studio.scene import look
from lrf3d.studio.scene.shapes import ON_TOP, Lens

# Least width [m]: there may be no wall.
_LEAST_WIDTH = 4.0

# Least height, and usually the largest, in the width.
_ASPECTS = (0.22, 1.6)

# Factor of the extent of the world that leaves a rim.
_RIM = 1.04

# How much larger all is at least in a view that is turned.
_TURNS = 1.1

# Width in lengths of the longest scale bar.
_BARS = 3.0


class InsetView(NamedTuple):
    """What the inset shows."""

    # Its middle (2,) [m]; None where that is the robot.
    middle: Float | None
    # Its width [m].
    width: float
    # Its height, in its width.
    aspect: float
    # Whether the y axis points to the right, so that the world fills its room.
    turned: bool = False
    # Whether it is a part of what it usually shows.
    close: bool = False

    @classmethod
    def of(cls, places: Float, tallest: float = _ASPECTS[1], *, turns: bool = False) -> "InsetView":
        """A view of all places (n, 2) or, where that would be too large, around the robot.

        It is at most so many times as high as wide. It may be turned, where all is larger then.
        """
        low = places.min(axis=0)
        high = places.max(axis=0)
        wide, tall = _RIM * (high - low)
        larger = max(wide, tall / tallest) / max(tall, wide / tallest, look.TINY)
        turned = bool(turns and larger > _TURNS)
        if turned:
            wide, tall = tall, wide
        aspect = min(max(float(tall / max(wide, look.TINY)), _ASPECTS[0]), tallest)
        width = max(float(wide), float(tall) / aspect, _LEAST_WIDTH)
        if width > look.INSET_WHOLE:
            return cls(None, look.INSET_FOLLOWED, min(1.0, tallest))
        return cls(0.5 * (low + high), width, aspect, turned)

    @property
    def bar(self) -> float:
        """The longest of 1, 2, 5, 10 … that takes up to a third of it, to show its scale by [m]."""
        most = self.width / _BARS
        power = float(10.0 ** np.floor(np.log10(most)))
        return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= most)

    def lens(self, robot: Float) -> Lens:
        """The lens that shows it where the robot is at a place (2,)."""
        middle = robot if self.middle is None else self.middle
        # With a negative height the first row of the picture has the largest y.
        size = self.width * np.array([1.0, -self.aspect])
        return lens_from_above(middle, size, turned=self.turned)


def lens_from_above(middle: Float, size: Float, *, turned: bool = False) -> Lens:
    """A lens straight above a middle (2,), which shows a width and height (2,) [m].

    Where it is turned, the picture's right is the y axis.
    """
    matrix = np.diag([*2.0 / size, 0.0, 1.0])
    if turned:
        matrix[:2, :2] = matrix[:2, :2] @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    matrix[:2, 3] = -matrix[:2, :2] @ middle
    return Lens(matrix, np.array([*middle, ON_TOP]), 1.0, 0.0, 0.0, ON_TOP)
