"""Rows of vertices, as the shaders take them, of what a scene is made of."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Single
from lrf3d.scene.shapes import Faces, GroundPicture, Lines, Mark, Points, Soft

WALL_SIZES, FACE_SIZES = (3, 3, 3, 3, 3, 1), (3, 3, 3)
"""Floats of a vertex of walls and of faces, attribute by attribute."""

_LAND_REACH = 3000.0
"""How far the ground goes [m]: to the horizon."""


class Packed(NamedTuple):
    """What draws a mark: the sizes of its attributes, and its vertices."""

    sizes: tuple[int, ...]
    rows: Single


def faces_of(faces: Faces) -> Single:
    """Vertices (3 t, 9) of faces."""
    return np.concatenate(faces, axis=2).reshape(-1, 9)


def mark_of(mark: Mark) -> Packed:
    """The vertices of a mark."""
    if isinstance(mark, Soft):
        return Packed((3, 4), np.concatenate(mark, axis=2).reshape(-1, 7))
    if isinstance(mark, Points):
        rows = np.concatenate([mark.places, mark.colours, mark.sides], axis=1)
        return Packed((3, 4, 2), rows.astype(np.float32))
    return Packed((3, 3, 1, 4, 2), _lines(mark))


def _lines(lines: Lines) -> Single:
    """Each line as two triangles: here, there, turn, colour and opacity, side of the wall."""
    rows = np.empty((len(lines.starts), 6, 13), np.float32)
    # Corner, whether at the end, and the side seen on the way from there to the other end.
    for corner, (at_end, turn) in enumerate([(0, 1), (0, -1), (1, 1), (0, 1), (1, 1), (1, -1)]):
        ends = (lines.ends, lines.starts) if at_end else (lines.starts, lines.ends)
        rows[:, corner, 0:3], rows[:, corner, 3:6] = ends
        rows[:, corner, 6] = turn * (1 + at_end)
        rows[:, corner, 10] = lines.opacities[:, at_end]
    rows[:, :, 7:10] = lines.colours[:, None]
    rows[:, :, 11:13] = lines.sides[:, None]
    return rows.reshape(-1, 13)


def land_of(ground: GroundPicture) -> Single:
    """The land around the ground's picture: four sides, whose corners leave no seam."""
    low, high = ground.corner, ground.corner + ground.size
    middle = 0.5 * (low + high)
    reach = max(_LAND_REACH, float(ground.size.max()))
    outer, inner = (
        np.array([a, [b[0], a[1]], b, [a[0], b[1]]])
        for a, b in ((middle - reach, middle + reach), (low, high))
    )
    rows = np.zeros((4, 6, 9), np.float32)
    for side in range(4):
        following = (side + 1) % 4
        a, b, c, d = outer[side], outer[following], inner[following], inner[side]
        rows[side, :, :2] = [a, b, c, a, c, d]
    rows[..., 6:] = ground.land
    return rows.reshape(-1, 9)


def rectangle(low: NDArray[np.float64], high: NDArray[np.float64]) -> Single:
    """Corners (6, 2) of two triangles."""
    (x, y), (u, v) = low, high
    return np.array([[x, y], [u, y], [u, v], [x, y], [u, v], [x, v]], np.float32)


def mesh(columns: int, rows: int) -> Single:
    """Corners (6 · columns · rows, 2) of the triangles of a mesh over −1…1."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    first = np.column_stack([x.ravel(), y.ravel()])
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]])
    places = (first[:, None] + corners) / [columns, rows]
    return np.asarray((2.0 * places - 1.0).reshape(-1, 2), np.float32)
