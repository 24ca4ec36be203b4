"""Gaps: closes the gaps that a scanner leaves where the walls of a map should meet.

The input is the segments and the free cells of a map; the output is walls that meet at their
corners, or a world of them. A mapped wall ends at its outermost hit, short of the corner, so that
beams and robots would slip through. Doors stay open: they are wider, and beams went through them.
"""

from collections.abc import Iterator

import numpy as np
import shapely

from lrf3d.geometry.lines import Bool, Float, Int, cross, directions, lengths
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.model import World
from lrf3d.world.pieces import connected

# Widest gap [m] that is closed: half of a door.
WIDEST = 0.4

# Largest length [m] by which a wall is cut back to its corner.
OVERSHOOT = 0.3

# Distance [m] between the points of a closing piece that are compared with the free cells.
STEP = 0.05


def world_of_map(mapped: World, free: FreeCells | None = None) -> World:
    """A map as a world: its walls meet at corners, and walls that touch are one object."""
    segments, walls = close_gaps(mapped.segments, free)
    heights = mapped.heights[walls]
    return World(segments, connected(segments), heights, mapped.name, place=mapped.place, free=free)


def close_gaps(segments: Float, free: FreeCells | None = None) -> tuple[Float, Int]:
    """Make the walls (n, 4) [m] of a map meet at their corners; no wall grows into free cells.

    After the n walls with new ends come those that close straight gaps; the rows (m,) are those of
    the walls that they continue.
    """
    origin = np.round(segments.reshape(-1, 2).mean(axis=0)) if len(segments) else np.zeros(2)
    ends = (segments - np.tile(origin, 2)).reshape(-1, 2)
    moved = ends.copy()
    bridges = []
    rows = []
    taken = np.zeros(len(ends), dtype=np.bool_)
    for closing, corner in _closings(ends):
        is_straight = np.isnan(corner).any()
        target = ends[closing[1]] if is_straight else corner
        open_way = free is not None and _is_free(free, ends[closing] + origin, target + origin)
        if taken[closing].any() or open_way:
            continue
        taken[closing] = True
        if is_straight:
            bridges.append(ends[closing].reshape(-1))
            rows.append(closing[0] // 2)
        else:
            moved[closing] = corner
    grown = moved.reshape(-1, 4)
    grown = np.where((lengths(grown) > STEP)[:, None], grown, ends.reshape(-1, 4))
    walls = np.vstack([grown, *bridges]) + np.tile(origin, 2)
    return walls, np.concatenate([np.arange(len(segments)), np.array(rows, np.int64)])


def _closings(ends: Float) -> Iterator[tuple[Int, Float]]:
    """Two ends that may meet, and their corner (2,), NaN if they meet straight on; best first.

    An end has twice the number of its wall, and one more if it is the second. A wall that meets
    another one between its ends has one end, which is given twice.
    """
    if not len(ends):
        return
    along = np.repeat(directions(ends.reshape(-1, 4)), 2, axis=0)
    outward = along * np.tile([[-1.0], [1.0]], (len(ends) // 2, 1))
    from scipy.spatial import cKDTree

    one, other = cKDTree(ends).query_pairs(WIDEST + OVERSHOOT, output_type="ndarray").T
    apart = one // 2 != other // 2
    one = one[apart]
    other = other[apart]
    first, second, corner = _crossing(ends[one], outward[one], ends[other], outward[other])
    meets = _may_grow(first) & _may_grow(second)
    between = ends[other] - ends[one]
    distance = np.hypot(*between.T)
    straight = np.isnan(first) & (np.einsum("ij,ij->i", outward[one], outward[other]) < 0.0)
    straight &= (np.einsum("ij,ij->i", outward[one], between) > 0.0) & (distance <= WIDEST)
    straight &= np.abs(cross(outward[one], between)) <= 0.1
    tree = shapely.STRtree(shapely.linestrings(ends.reshape(-1, 2, 2)))
    end, wall = tree.query(shapely.points(ends), predicate="dwithin", distance=WIDEST)
    begin = ends[2 * wall]
    length = np.hypot(*(ends[2 * wall + 1] - ends[2 * wall]).T)
    growth, station, joint = _crossing(ends[end], outward[end], begin, along[2 * wall])
    within = (end // 2 != wall) & _may_grow(growth) & (station > 0.0) & (station < length)
    closes = np.column_stack([one, other])
    pairs = np.vstack([closes[meets | straight], np.column_stack([end, end])[within]])
    corners = np.vstack([corner[meets | straight], joint[within]])
    cost = np.where(straight, distance, np.maximum(np.abs(first), np.abs(second)))
    cost = np.append(cost[meets | straight], np.abs(growth[within]))
    # Corners of two ends come first: if one end met the side of the other wall, that wall's own end
    # would stay behind as a stub.
    for best in np.lexsort([pairs[:, 1], pairs[:, 0], cost, pairs[:, 0] == pairs[:, 1]]):
        yield pairs[best], corners[best]


def _crossing(begins: Float, along: Float, others: Float, beside: Float) -> tuple[Float, ...]:
    """Distances (k,) from begins and others to where their lines cross, and the crossings (k, 2).

    They are NaN for lines less than 15° apart, which are one wall with a gap and no corner.
    """
    sine = cross(along, beside)
    sine[np.abs(sine) <= np.sin(np.radians(15))] = np.nan
    first = cross(others - begins, beside) / sine
    second = cross(others - begins, along) / sine
    return first, second, begins + first[:, None] * along


def _may_grow(growth: Float) -> Bool:
    """Whether walls may grow by these lengths [m], or, where negative, be cut back."""
    return (growth >= -OVERSHOOT) & (growth <= WIDEST)


def _is_free(free: FreeCells, begins: Float, corner: Float) -> bool:
    """Whether beams went through any closing piece, each from an end to a corner."""
    for begin in begins:
        count = int(np.hypot(*(corner - begin)) / STEP) + 1
        shares = (np.arange(count) + 0.5) / count
        # The borders of free space are ragged.
        if free.contain(begin + shares[:, None] * (corner - begin)).mean() > 0.25:
            return True
    return False
