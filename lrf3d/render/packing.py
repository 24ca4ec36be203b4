"""The vertices, as the shaders take them, of what a scene is made of, and its light.

The arrays of a mark are its vertex attributes, in the order of the shader's locations.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Single
from lrf3d.scene.look import (
    COOL,
    COOL_INDOOR,
    FALL,
    LEAST_FALL,
    NIGHT_HIGH,
    NIGHT_HIGH_INDOOR,
    NIGHT_LOW,
)
from lrf3d.scene.shapes import Faces, GroundPicture, Mark, Painted

LAND_REACH = 3000.0
"""How far the ground goes past its picture [m]: to the horizon, in the colour of its edge."""

GREY = np.array([0.3, 0.55, 0.15])
"""Shares of the colours in how bright something is."""


def columns_of(mark: Mark | Faces) -> dict[str, NDArray[Any]]:
    """The arrays of a mark by their names."""
    return {name: each for name, each in mark._asdict().items() if isinstance(each, np.ndarray)}


def walls_of(faces: Painted) -> tuple[Single, ...]:
    """The arrays of walls and roofs."""
    return faces.places, faces.colours, faces.before


def ground_of(ground: GroundPicture, reach: float = LAND_REACH) -> Single:
    """Corners (6, 2) of the ground, so far past its picture [m]."""
    return rectangle(ground.corner - reach, ground.corner + ground.size + reach)


def exposed(day: Any, on: Any, height: Any, *, indoor: bool) -> Float:
    """Colours (…, 3) in the laser's light, long after it came, as ``common.glsl`` has them.

    How lit they are (…), and how high they lie [m].
    """
    high, cool = (NIGHT_HIGH_INDOOR, COOL_INDOOR) if indoor else (NIGHT_HIGH, COOL)
    dark = NIGHT_LOW + (day @ GREY)[..., None] * (np.array(high) - NIGHT_LOW)
    share = on * np.maximum(1.0 - FALL * height, LEAST_FALL)
    return np.asarray(dark + share[..., None] * (day * cool - dark))


def rectangle(low: Any, high: Any) -> Single:
    """Corners (6, 2) of two triangles."""
    (x, y), (u, v) = low, high
    return np.array([[x, y], [u, y], [u, v], [x, y], [u, v], [x, v]], np.float32)


def mesh(columns: int, rows: int) -> Single:
    """Corners (6 · columns · rows, 2) of the triangles of a mesh over −1…1."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    first = np.column_stack([x.ravel(), y.ravel()])
    places = (first[:, None] + rectangle([0.0, 0.0], [1.0, 1.0])) / [columns, rows]
    return np.asarray((2.0 * places - 1.0).reshape(-1, 2), np.float32)
