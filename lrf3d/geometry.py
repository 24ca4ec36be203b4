"""Points, segments and lines of the plane, on arrays.

A segment is a row x1 y1 x2 y2 [m]; a line is a row alpha [rad] in (−π, π], p [m] of the normal
form x·cos α + y·sin α = p with p ≥ 0 (Eq. 3 of Teslić et al.).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def wrap_angle(angle: ArrayLike) -> Any:
    """Bring angles [rad] into (−π, π]; an angle that lies there already keeps its bits."""
    angle = np.asarray(angle, dtype=np.float64)
    inside = (angle > -np.pi) & (angle <= np.pi)
    wrapped = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    # A float above π has a remainder that may round to a full turn.
    wrapped = np.where(wrapped > -np.pi, wrapped, np.pi)
    return np.where(inside, angle, wrapped)[()]


def lengths(segments: Float) -> Float:
    """Length [m] of each of the segments (n, 4)."""
    return np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])


def directions(segments: Float) -> Float:
    """Unit vectors (n, 2) from the first to the second end of the segments (n, 4)."""
    delta = segments[:, 2:] - segments[:, :2]
    return delta / np.hypot(delta[:, 0], delta[:, 1])[:, None]


def normal_lines(segments: Float) -> Float:
    """Lines (n, 2) that carry the segments (n, 4): alpha [rad] in (−π, π] and p ≥ 0 [m] (Eq. 3).

    For a line through the origin alpha is the direction of the segment's left normal.
    """
    segments = np.asarray(segments, dtype=np.float64).reshape(-1, 4)
    unit = directions(segments)
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    p = np.einsum("ij,ij->i", normal, 0.5 * (segments[:, :2] + segments[:, 2:]))
    normal[p < 0.0] *= -1.0
    alpha = np.arctan2(normal[:, 1], normal[:, 0])
    # A normal along −x, or below it by less than an angle can tell, gives −π.
    alpha[alpha <= -np.pi] = np.pi
    return np.column_stack([alpha, np.abs(p)])


def project_on_segments(points: Float, segments: Float) -> tuple[Float, Float]:
    """Distance [m] and place of points (m, 2) on each of the segments (n, 4).

    Returns:
        The distance (m, n) of each point to each segment, and the place (m, n) of the nearest
        point on it: 0 at the first end, 1 at the second.
    """
    start = segments[:, :2]
    delta = segments[:, 2:] - start
    offset = points[:, None, :] - start[None, :, :]
    square = np.einsum("nk,nk->n", delta, delta)
    place = np.clip(np.einsum("mnk,nk->mn", offset, delta) / square, 0.0, 1.0)
    gap = offset - place[:, :, None] * delta[None, :, :]
    return np.hypot(gap[:, :, 0], gap[:, :, 1]), place


def fit_line(points: Float, weights: Float | None = None) -> tuple[Float, Float]:
    """Total least squares line through points (n, 2), centred so that it is exact far away.

    Returns:
        The (weighted) mean point (2,) and the unit direction (2,) of the line.
    """
    weight = np.ones(len(points)) if weights is None else weights
    mean = weight @ points / weight.sum()
    centred = points - mean
    scatter = (centred * weight[:, None]).T @ centred
    return mean, principal_direction(scatter[0, 0], scatter[0, 1], scatter[1, 1])


def principal_direction(xx: float, xy: float, yy: float) -> Float:
    """Unit vector (2,) of the largest spread of the scatter [[xx, xy], [xy, yy]]."""
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return np.array([np.cos(angle), np.sin(angle)])
