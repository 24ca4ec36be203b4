"""The ground of a film: one picture of a small world; of a large one a fine piece round the eye.

The fine piece moves in steps with the eye, so that what is drawn depends on the eye alone and not
on the frames before. Round it lies the coarse picture of the whole, and round that plain land.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.render.ground import Ground, paint_ground, paint_window
from lrf3d.render.primitives import Primitive, Single
from lrf3d.render.structures import Structures
from lrf3d.render.textures import Texture

_FARTHEST = 3000.0
"""How far the ground goes [m]: to the horizon."""

_LARGE, _LARGE_INDOOR = 220.0, 60.0
"""Worlds longer than this [m] get a fine piece: one picture of the whole would be blurred."""

_WINDOW, _WINDOW_INDOOR = 180.0, 50.0
"""Side of the fine piece [m]."""

_STEP = 0.25
"""By how much of its side the fine piece moves."""


class GroundLayer:
    """Draws the ground.

    Args:
        structures: What stands on it.
    """

    def __init__(self, structures: Structures) -> None:
        self._structures = structures
        whole = paint_ground(structures)
        self._whole = whole
        self._low, self._high = whole.corner, whole.corner + whole.size
        indoor = structures.indoor
        self._side = _WINDOW_INDOOR if indoor else _WINDOW
        self._large = float(whole.size.max()) > (_LARGE_INDOOR if indoor else _LARGE)
        self._middle: Float | None = None
        self._near = Primitive("ground", (2,), np.zeros((0, 2), np.float32), capacity=6)
        self._far = Primitive("ground", (2,), _square(self._low, self._high), capacity=24)
        middle = 0.5 * (self._low + self._high)
        size = max(_FARTHEST, float(whole.size.max()))
        land = _ring(middle - size, middle + size, self._low, self._high)
        self._land = Primitive("beyond", (2,), land)
        self._far.texture = self._land.texture = Texture(whole.picture, far=True)
        self._area = _area(whole)
        self._near_area = self._area
        self._beyond = (*whole.beyond, 12.0 if indoor else 60.0)

    @property
    def primitives(self) -> tuple[Primitive, ...]:
        """All that it may draw."""
        return (self._near, self._far, self._land)

    def look_from(self, eye: Float) -> None:
        """Put the fine piece under an eye (3,)."""
        if not self._large:
            return
        step = _STEP * self._side
        middle = np.round(eye[:2] / step) * step
        if self._middle is not None and np.array_equal(middle, self._middle):
            return
        self._middle = middle
        low = np.clip(middle - 0.5 * self._side, self._low, self._high)
        high = np.clip(middle + 0.5 * self._side, self._low, self._high)
        if (low >= high).any():
            # Far outside there is nothing but plain land.
            self._near.update(np.zeros(0, np.float32))
            self._far.update(_square(self._low, self._high))
            return
        piece = paint_window(self._structures, middle, self._side)
        self._near_area = _area(piece)
        if self._near.texture is None:
            self._near.texture = Texture(piece.picture, far=True)
        else:
            self._near.texture.update(piece.picture)
        self._near.update(_square(low, high))
        self._far.update(_ring(self._low, self._high, low, high))

    def draws(self) -> Iterator[tuple[Primitive, dict[str, Any]]]:
        """What is drawn, each with its own uniforms."""
        yield self._near, {"area": self._near_area}
        yield self._far, {"area": self._area}
        yield self._land, {"area": self._area, "beyond": self._beyond}


def _area(ground: Ground) -> tuple[float, ...]:
    """Corner of a picture [m] and one over its size [1/m]."""
    return (*ground.corner.tolist(), *(1.0 / ground.size).tolist())


def _square(low: Float, high: Float) -> Single:
    """Corners (6, 2) of two triangles."""
    (x, y), (u, v) = low, high
    return np.array([[x, y], [u, y], [u, v], [x, y], [u, v], [x, v]], np.float32)


def _ring(low: Float, high: Float, inner_low: Float, inner_high: Float) -> Single:
    """Corners (24, 2) of the triangles between two boxes, which share corners and leave no seam."""
    outer = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    inner = np.array(
        [inner_low, [inner_high[0], inner_low[1]], inner_high, [inner_low[0], inner_high[1]]]
    )
    rows = []
    for side in range(4):
        following = (side + 1) % 4
        a, b, c, d = outer[side], outer[following], inner[following], inner[side]
        rows += [a, b, c, a, c, d]
    return np.array(rows, np.float32)
