"""Panels: faces of walls and roofs before they are lit, in columns, and what cuts them small.

All are quads; a triangle is one that has its last corner twice.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int

LIT = -1e3
"""How far under the shadow's edge a corner lies that is in the sun [m]: not at all."""

_LEAST = 1e-7
"""Triangles below this area [m²] are left out: of outlines that touch themselves there are some."""


class Panels(NamedTuple):
    """Quads (n); the columns are those of :class:`~lrf3d.scene.shapes.Painted`."""

    places: Float
    """(n, 4, 3) corners, counter-clockwise from outside."""
    normals: Float
    """(n, 4, 3) unit normals."""
    texture: Float
    """(n, 4, 3) bays along and storeys up the texture; its layer."""
    colours: Float
    """(n, 4, 3) colour of the wall itself."""
    under: Float
    """(n, 4) how far under the edge of its shadow a corner lies [m]."""
    objects: Int
    """(n,) the object of each."""


def panels(places: Float, normals: Float, colours: Float, under: Float, objects: Int) -> Panels:
    """Quads or triangles (n, c, 3) that have nothing painted on them; the rest is spread to fit."""
    quad = [0, 1, 2, places.shape[1] - 1]
    return Panels(
        places[:, quad],
        np.broadcast_to(normals, places.shape)[:, quad],
        np.zeros((len(places), 4, 3)),
        np.broadcast_to(colours, places.shape)[:, quad],
        np.broadcast_to(under, places.shape[:2])[:, quad],
        objects,
    )


def level_panels(
    corners: Float, heights: Float, colours: Float, under: Float, objects: Int
) -> Panels:
    """Faces with corners (n, c, 2) that lie at heights (n,) [m] and look up."""
    high = np.broadcast_to(heights[:, None, None], (*corners.shape[:2], 1))
    places = np.concatenate([corners, high], axis=2)
    up = np.array([0.0, 0.0, 1.0])
    return panels(places, up, colours[:, None], under[:, None], objects)


def joined(*each: Panels) -> Panels:
    """Panels one after the other."""
    return Panels(*(np.concatenate(column) for column in zip(*each, strict=True)))


def cut_small(quads: Panels, step: float, most: int) -> Panels:
    """Cut quads into pieces no wider and higher than a step [m], for light that changes on them.

    The step is longer where there would be more pieces than the most.
    """
    wide, high = (
        np.linalg.norm(quads.places[:, corner] - quads.places[:, 0], axis=1) for corner in (1, 3)
    )
    while True:
        counts = (np.ceil(side / step - 1e-3) for side in (wide, high))
        across, up = (np.maximum(1, count).astype(int) for count in counts)
        if int((across * up).sum()) <= max(most, len(wide)):
            break
        step *= 1.4
    found = []
    corners = quads.places, quads.normals, quads.texture, quads.colours, quads.under
    for columns, rows in np.unique(np.column_stack([across, up]), axis=0).tolist():
        chosen = np.flatnonzero((across == columns) & (up == rows))
        places, normals, texture, colours, under = (
            _cut(values[chosen], columns, rows) for values in corners
        )
        objects = np.repeat(quads.objects[chosen], columns * rows)
        found.append(Panels(places, normals, texture, colours, under, objects))
    return joined(*found) if found else quads


def _cut(values: Float, columns: int, rows: int) -> Float:
    """Values (n, 4, …) at the corners of the pieces (n · columns · rows, 4, …) of quads."""
    quad = values.reshape(len(values), 4, -1)
    s = (np.arange(columns + 1) / columns)[:, None]
    bottom = quad[:, None, 0] + s * (quad[:, None, 1] - quad[:, None, 0])
    top = quad[:, None, 3] + s * (quad[:, None, 2] - quad[:, None, 3])
    t = (np.arange(rows + 1) / rows).reshape(1, 1, -1, 1)
    grid = bottom[:, :, None] + t * (top - bottom)[:, :, None]
    corners = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
    return np.stack(corners, axis=3).reshape(-1, *values.shape[1:])


def triangles(polygons: Any) -> tuple[Float, Int]:
    """Cut polygons (p,) into counter-clockwise triangles (t, 3, 2), and which each (t,) is of."""
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
