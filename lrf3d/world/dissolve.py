"""Dissolving: footprints of buildings that touch become blocks, with only their outer walls.

The input is footprints with heights, the output blocks. No beam can reach a wall that two buildings
share, and a straight façade of several buildings is one segment to a laser.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import Float, Int

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

MOST_CROSSINGS, CROSSINGS_A_WALL = 10_000, 10
"""Largest number of intersections of the walls of one outline, in all and for each wall: neighbours
always meet, and drawing errors are few."""

MOST_AT_ONCE = 100
"""Walls that are intersected with all others before the intersections are counted."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """The outline of a building: rings (k, 2) [m], the outer one first, and its height [m]."""

    rings: tuple[Float, ...]
    height: float


@dataclass(frozen=True, slots=True)
class Block:
    """A group of footprints that touch.

    Args:
        rings: Rings (k, 2) [m]: outer ones counter-clockwise, courtyards clockwise.
        heights: For each ring the heights (k,) [m] of the walls from point i to point i + 1.
        footprints: Indices of its footprints, in ascending order.
    """

    rings: tuple[Float, ...]
    heights: tuple[Float, ...]
    footprints: Int


def dissolve(
    footprints: Sequence[Footprint], *, closing: float = CLOSING, simplify: float = STRAIGHT
) -> list[Block]:
    """Join footprints that touch, overlap or nearly touch into blocks.

    Args:
        footprints: The buildings.
        closing: Widest gap between two footprints of a block [m].
        simplify: Largest distance from a straight wall of a corner that is left out [m].

    Returns:
        The blocks, in the order of the first footprint of each.
    """
    import shapely
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if not footprints:
        return []
    corners = np.concatenate([ring for footprint in footprints for ring in footprint.rings])
    origin = np.round(0.5 * (corners.min(axis=0) + corners.max(axis=0)))
    polygons = np.array([_polygon(footprint, origin) for footprint in footprints], dtype=object)
    first, second = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=closing)
    count = len(polygons)
    links = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    _, label = connected_components(links, directed=False)
    # Labels are numbered by their first members, so blocks keep the order of the source.
    members = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
    outlines = _Corners(corners, origin)
    blocks = []
    for group in members:
        heights = np.array([footprints[index].height for index in group])
        joined = _close(polygons[group], closing)
        rings = [ring for part in joined for ring in _rings(part, simplify, outlines)]
        if rings:
            walls = tuple(_heights(ring - origin, polygons[group], heights) for ring in rings)
            blocks.append(Block(tuple(rings), walls, np.asarray(group, dtype=np.int64)))
    return blocks


def _polygon(footprint: Footprint, origin: Float) -> Any:
    """The polygon of a footprint in the local frame; one that crosses itself is made valid."""
    import shapely

    outer, *holes = (ring - origin for ring in footprint.rings)
    polygon = shapely.Polygon(outer, holes)
    if polygon.is_valid:
        return polygon
    _check_crossings(footprint.rings)
    # This may leave lines where an outline ran there and back; they enclose nothing.
    return shapely.union_all(_polygons_in(shapely.make_valid(polygon)))


def _check_crossings(rings: tuple[Float, ...]) -> None:
    """Check that rings do not cross themselves so often that making them valid takes hours."""
    import shapely

    ends = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
    walls = shapely.linestrings(np.concatenate(ends) - rings[0][0])
    tree, most = shapely.STRtree(walls), MOST_CROSSINGS + CROSSINGS_A_WALL * len(walls)
    met = 0
    for part in np.array_split(walls, len(walls) // MOST_AT_ONCE + 1):
        met += tree.query(part, predicate="intersects").shape[1]
        if met > most:
            raise WorldError(
                f"a Polygon of {len(walls):,} walls that cross each other thousands of times;"
                " mend its outline"
            )


def _polygons_in(geometry: Any) -> list[Any]:
    import shapely

    return [part for part in shapely.get_parts([geometry]) if part.geom_type == "Polygon"]


def _close(polygons: Any, closing: float) -> list[Any]:
    """The union of polygons as a list, with gaps up to the given width closed."""
    import shapely

    union = shapely.union_all(polygons)
    if len(polygons) > 1:
        # Slightly more than half on each side, so that a gap of exactly this width is closed.
        reach = 0.5001 * closing
        for distance in (reach, -reach):
            union = shapely.buffer(
                union, distance, join_style="mitre", mitre_limit=MITRE_LIMIT, quad_segs=1
            )
    return _polygons_in(union)


def _rings(polygon: Any, simplify: float, outlines: "_Corners") -> list[Float]:
    """The rings of a polygon with straightened walls, in the coordinates of the source."""
    rings = []
    for index, ring in enumerate((polygon.exterior, *polygon.interiors)):
        points = outlines.restore(_straighten(np.array(ring.coords)[:-1], simplify))
        area = _area(points - outlines.origin)
        if abs(area) <= (SMALLEST_COURTYARD if index else 0.0):
            continue
        rings.append(points if (area > 0.0) == (index == 0) else points[::-1])
    return rings


def _straighten(ring: Float, tolerance: float) -> Float:
    """The corners of a ring (k, 2) that lie farther than the tolerance from straight walls."""
    import shapely

    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    base, arm = after - before, ring - before
    width = np.hypot(base[:, 0], base[:, 1])
    cross = np.abs(base[:, 0] * arm[:, 1] - base[:, 1] * arm[:, 0])
    # Simplifying keeps the ends of a line, so the ring is opened at its sharpest corner.
    sharpest = int(np.argmax(cross / np.maximum(width, 1e-12)))
    opened = np.roll(ring, -sharpest, axis=0)
    line = shapely.linestrings(np.vstack([opened, opened[:1]]))
    kept = {tuple(point) for point in shapely.simplify(line, tolerance).coords}
    return ring[[tuple(point) in kept for point in ring]]


def _area(ring: Float) -> float:
    """Signed area [m²] of a ring (k, 2), positive when counter-clockwise."""
    following = np.roll(ring, -1, axis=0)
    return 0.5 * float((ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]).sum())


def _heights(ring: Float, polygons: Any, heights: Float) -> Float:
    """Height (k,) of each wall of a ring: that of the tallest footprint at the wall's middle."""
    import shapely

    middles = shapely.points(0.5 * (ring + np.roll(ring, -1, axis=0)))
    tree = shapely.STRtree(polygons)
    tallest = np.asarray(heights[tree.nearest(middles)], dtype=np.float64)
    wall, neighbour = tree.query(middles, predicate="dwithin", distance=STRAIGHT)
    np.maximum.at(tallest, wall, heights[neighbour])
    return tallest


class _Corners:
    """The corners of the source, whose exact coordinates the corners of blocks take over.

    Args:
        corners: (k, 2) all corners in the coordinates of the source [m].
        origin: (2,) origin of the local frame.
    """

    def __init__(self, corners: Float, origin: Float) -> None:
        from scipy.spatial import cKDTree

        self.corners, self.origin = corners, origin
        self.tree = cKDTree(corners - origin)

    def restore(self, points: Float) -> Float:
        """Points (k, 2) of the local frame in the source's coordinates, without repeated ones."""
        gaps, nearest = self.tree.query(points)
        exact = (np.asarray(gaps) <= SNAP)[:, None]
        restored = np.where(exact, self.corners[nearest], points + self.origin)
        twice = (restored == np.roll(restored, 1, axis=0)).all(axis=1)
        return np.asarray(restored[~twice], dtype=np.float64)
