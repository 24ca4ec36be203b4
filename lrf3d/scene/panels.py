"""Panels: faces of walls and roofs before they are lit, made, joined, and cut small.

All are quads; a triangle is one that has its last corner twice.
"""

from typing import Any

import numpy as np
import shapely

from lrf3d.geometry import Float, Int
from lrf3d.scene.shapes import Painted, single

_LEAST = 1e-7
"""Triangles below this area [m²] are left out: of outlines that touch themselves there are some."""


def panels(places: Float, normals: Float, colours: Float, objects: Int) -> Painted:
    """Quads or triangles (n, c, 3) that have nothing painted on them; the rest is spread to fit."""
    quad = [0, 1, 2, places.shape[1] - 1]
    return Painted(
        single(places[:, quad]),
        single(np.broadcast_to(normals, places.shape)[:, quad]),
        np.zeros((len(places), 4, 3), np.float32),
        single(np.broadcast_to(colours, places.shape)[:, quad]),
        objects,
    )


def level_panels(corners: Float, heights: Float, colours: Float, objects: Int) -> Painted:
    """Faces with corners (n, c, 2) that lie at heights (n,) [m] and look up."""
    high = np.broadcast_to(heights[:, None, None], (*corners.shape[:2], 1))
    places = np.concatenate([corners, high], axis=2)
    up = np.array([0.0, 0.0, 1.0])
    return panels(places, up, colours[:, None], objects)


def joined(*each: Painted) -> Painted:
    """Faces one after the other."""
    return Painted(*(np.concatenate(column) for column in zip(*each, strict=True)))


def cut_small(quads: Painted, step: float, most: int) -> Painted:
    """Cut quads into pieces no wider and higher than a step [m], for light that changes on them.

    The step is longer where there would be more pieces than the most.
    """
    sides = np.linalg.norm(quads.places[:, [1, 3]] - quads.places[:, :1], axis=2)
    while True:
        counts = np.maximum(1, np.ceil(sides / step - 1e-3)).astype(int)
        if counts.prod(axis=1).sum() <= max(most, len(sides)):
            break
        step *= 1.4
    found = []
    for columns, rows in np.unique(counts, axis=0).tolist():
        chosen = np.flatnonzero((counts == (columns, rows)).all(axis=1))
        places, normals, texture, colours = (
            _cut(values[chosen], columns, rows) for values in quads[:4]
        )
        objects = np.repeat(quads.objects[chosen], columns * rows)
        found.append(Painted(places, normals, texture, colours, objects))
    return joined(*found) if found else quads


def _cut(values: Any, columns: int, rows: int) -> Any:
    """Values (n, 4, …) at the corners of the pieces (n · columns · rows, 4, …) of quads."""
    quad = values.reshape(len(values), 4, -1)
    s, t = np.linspace(0.0, 1.0, columns + 1)[:, None], np.linspace(0.0, 1.0, rows + 1)[:, None]
    bottom = quad[:, None, 0] + s * (quad[:, None, 1] - quad[:, None, 0])
    top = quad[:, None, 3] + s * (quad[:, None, 2] - quad[:, None, 3])
    grid = bottom[:, :, None] + t * (top - bottom)[:, :, None]
    corners = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
    return single(np.stack(corners, axis=3).reshape(-1, *values.shape[1:]))


def triangles(polygons: Any) -> tuple[Float, Int]:
    """Cut polygons (p,) into counter-clockwise triangles (t, 3, 2), and which each (t,) is of."""
    if not len(polygons):
        return np.zeros((0, 3, 2)), np.zeros(0, np.int64)
    found, piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    there = shapely.area(found) > _LEAST
    turned = shapely.orient_polygons(found[there])
    return shapely.get_coordinates(turned).reshape(-1, 4, 2)[:, :3], piece[there]
