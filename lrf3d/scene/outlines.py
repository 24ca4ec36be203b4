"""Outlines, cut into triangles."""

from typing import Any

import numpy as np
import shapely

from lrf3d.geometry import Float, Int

_LEAST = 1e-7
"""Triangles below this area [m²] are left out: of outlines that touch themselves there are some."""


def triangles(polygons: Any) -> tuple[Float, Int]:
    """Cut polygons into triangles.

    Args:
        polygons: (p,) the polygons.

    Returns:
        Corners (t, 3, 2), counter-clockwise, and which of the polygons (t,) each is of.
    """
    if not len(polygons):
        return np.zeros((0, 3, 2)), np.zeros(0, np.int64)
    found, piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    corners = shapely.get_coordinates(found).reshape(-1, 4, 2)[:, :3]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    corners[area < 0.0] = corners[area < 0.0][:, ::-1]
    there = np.abs(area) > _LEAST
    return corners[there], piece[there]
