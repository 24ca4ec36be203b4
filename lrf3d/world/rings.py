"""Rings: ways that share their ends become closed outlines, and holes find what they are in."""

from collections.abc import Hashable, Sequence
from typing import TypeVar

import numpy as np

from lrf3d.geometry import Float

Node = TypeVar("Node", bound=Hashable)


def close_rings(ways: Sequence[Sequence[Node]]) -> list[list[Node]]:
    """Closed rings, their first node repeated at the end, of ways that share their end nodes.

    Ways that do not close, as at the edge of an extract, are left out.
    """
    ends: dict[Node, list[int]] = {}
    for index, way in enumerate(ways):
        for node in way[:1], way[-1:]:
            if len(way) > 1:
                ends.setdefault(node[0], []).append(index)
    left = {index for index, way in enumerate(ways) if len(way) > 1}
    rings = []
    for index in range(len(ways)):
        if index not in left:
            continue
        left.discard(index)
        ring = list(ways[index])
        while ring[0] != ring[-1]:
            # What is used is dropped for good, so that a node of many ways is no trap.
            others = ends[ring[-1]]
            while others and others[-1] not in left:
                others.pop()
            if not others:
                break
            following = others.pop()
            left.discard(following)
            way = list(ways[following])
            ring += way[1:] if way[0] == ring[-1] else way[-2::-1]
        if ring[0] == ring[-1]:
            rings.append(ring)
    return rings


def nest_rings(outer: Sequence[Float], inner: Sequence[Float]) -> tuple[tuple[Float, ...], ...]:
    """Polygons of outer rings (k, 2), each with those of the inner rings that lie in it."""
    import shapely

    areas = [shapely.make_valid(shapely.Polygon(ring)) for ring in outer]
    tree = shapely.STRtree(areas)
    polygons: list[list[Float]] = [[ring] for ring in outer]
    for ring in inner:
        within = tree.query(shapely.Point(*ring[0]), predicate="intersects")
        if len(within):
            polygons[int(within.min())].append(ring)
    return tuple(tuple(rings) for rings in polygons)


def valid_ring(points: Float) -> Float | None:
    """The ring (k, 2) without points that repeat, or None where it encloses nothing."""
    ring = points[(points != np.roll(points, 1, axis=0)).any(axis=1)]
    if len(ring) < 3:
        return None
    arms = ring[1:] - ring[0]
    return ring if (arms[:, 0] * arms[-1, 1] != arms[:, 1] * arms[-1, 0]).any() else None
