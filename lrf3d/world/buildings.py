"""Worlds from features of maps in metres: footprints of buildings become blocks, lines walls.

No beam can reach a wall that two buildings share, and a straight façade of several buildings is one
segment to a laser: footprints that touch are dissolved into blocks, with only their outer walls.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import Float, Int
from lrf3d.world.features import Feature
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import Part, from_corner, groups, walls, world_of_parts

DEFAULT_BUILDING_HEIGHT = 8.0
"""Default height of a building [m]: two storeys and a roof."""

CLOSING = 0.05
"""Widest gap [m] between footprints that touch: surveys leave hairline gaps."""

STRAIGHT = 0.01
"""Largest distance [m] from a straight façade of a corner that is left out."""

SNAP = 0.002
"""Distance [m] within which a corner of a block takes the coordinates of a corner of the source."""

SMALLEST_COURTYARD = 1.0
"""Area [m²] below which a hole in a block is a gap between footprints and not a courtyard."""

MITRE_LIMIT = 20.0
"""Corners sharper than 6° are cut when gaps are closed; all others come back as they were."""


def world_of_features(
    features: Sequence[Feature], name: str, *, place: tuple[float, float] | None = None
) -> World:
    """The world of features: polygons are dissolved into blocks, lines follow after them.

    The place is the longitude and latitude [°] of the point (0, 0), if they are known.

    Raises:
        WorldError: No wall remains.
    """
    owners = [feature for feature in features for _ in feature.polygons]
    polygons = [polygon for feature in features for polygon in feature.polygons]
    tall = np.array([owner.height_or(DEFAULT_BUILDING_HEIGHT) for owner in owners])
    parts = list[Part]()
    for number, (members, rings) in enumerate(_blocks(polygons, tall)):
        parts += [Part(number, walls(points, closed=True), tops) for points, tops in rings]
        looks = [owners[index].looks for index in members.tolist()]
        parts += [Part(number, np.empty((0, 4)), np.empty(0), *each) for each in looks]
    loose = [feature for feature in features if not feature.polygons]
    numbered = not owners and all(feature.number is not None for feature in loose)
    for feature in features:
        lines = [walls(line, closed=False) for line in feature.lines]
        if lines or numbered:
            number = parts[-1].number + 1 if parts else 0
            if numbered and feature.number is not None:
                number = feature.number
            segments = np.concatenate([np.empty((0, 4)), *lines])
            each = isinstance(feature.height, tuple) and len(feature.height) == len(segments)
            heights = feature.height if each else feature.height_or(DEFAULT_HEIGHT)
            parts.append(Part(number, segments, np.array(heights), *feature.looks))
    if not any(len(part.segments) for part in parts):
        raise WorldError("the footprints are too small to leave a wall")
    return world_of_parts(parts, name, place=place)


def _blocks(polygons: list[Any], heights: Float) -> list[tuple[Int, list[tuple[Float, Float]]]]:
    """Groups of footprints of some heights (n,) that touch, in the order of the first of each.

    Returns:
        For each block its footprints, and its rings (k, 2), outer ones counter-clockwise and
        courtyards clockwise, with the heights (k,) of the walls from point i to point i + 1.
    """
    import shapely
    from scipy.spatial import cKDTree

    if not polygons:
        return []
    corners = shapely.get_coordinates(polygons)
    origin = np.round(0.5 * (corners.min(axis=0) + corners.max(axis=0)))
    source = cKDTree(corners - origin)
    local = np.array([_valid(shapely.transform(p, lambda xy: xy - origin)) for p in polygons])
    first, second = shapely.STRtree(local).query(local, predicate="dwithin", distance=CLOSING)
    label = groups(first, second, len(local))
    # Labels are numbered by their first members, so blocks keep the order of the source.
    blocks_of = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
    blocks = []
    for members in blocks_of:
        rings = []
        for part in _joined(local[members]):
            for index, outline in enumerate((part.exterior, *part.interiors)):
                points = _straightened(np.array(outline.coords)[:-1])
                gaps, nearest = source.query(points)
                exact = np.where(
                    (np.asarray(gaps) <= SNAP)[:, None], corners[nearest], points + origin
                )
                twice = (exact == np.roll(exact, 1, axis=0)).all(axis=1)
                exact, points = exact[~twice], points[~twice]
                if len(points) < 3:
                    continue
                ring = shapely.linearrings(points)
                if shapely.area(shapely.polygons(ring)) > (SMALLEST_COURTYARD if index else 0.0):
                    turn = 1 if shapely.is_ccw(ring) == (index == 0) else -1
                    tops = _heights(points[::turn], local[members], heights[members])
                    rings.append((exact[::turn], tops))
        if rings:
            blocks.append((np.asarray(members, dtype=np.int64), rings))
    return blocks


def _valid(polygon: Any) -> Any:
    """A polygon, made valid if it crosses itself; lines there and back enclose nothing."""
    import shapely

    return polygon if polygon.is_valid else shapely.union_all(_areas(shapely.make_valid(polygon)))


def _areas(geometry: Any) -> list[Any]:
    import shapely

    return [part for part in shapely.get_parts([geometry]) if part.geom_type == "Polygon"]


def _joined(polygons: Any) -> list[Any]:
    """The union of polygons, with the gaps between them closed."""
    import shapely

    union = shapely.union_all(polygons)
    if len(polygons) > 1:
        # Slightly more than half on each side, so that a gap of exactly this width is closed.
        for distance in (0.5001 * CLOSING, -0.5001 * CLOSING):
            union = shapely.buffer(
                union, distance, join_style="mitre", mitre_limit=MITRE_LIMIT, quad_segs=1
            )
    return _areas(union)


def _straightened(ring: Float) -> Float:
    """The corners of a ring (k, 2) that do not lie on straight walls."""
    import shapely

    line = shapely.linestrings(from_corner(np.vstack([ring, ring[:1]])))
    kept = shapely.get_coordinates(shapely.simplify(line, STRAIGHT))
    return ring[np.isin(ring @ [1.0, 1.0j], kept @ [1.0, 1.0j])]


def _heights(ring: Float, polygons: Any, heights: Float) -> Float:
    """Height (k,) of each wall of a ring: that of the tallest footprint at the wall's middle."""
    import shapely

    middles = shapely.points(0.5 * (ring + np.roll(ring, -1, axis=0)))
    tree = shapely.STRtree(polygons)
    tallest = np.asarray(heights[tree.nearest(middles)], dtype=np.float64)
    wall, neighbour = tree.query(middles, predicate="dwithin", distance=STRAIGHT)
    np.maximum.at(tallest, wall, heights[neighbour])
    return tallest
