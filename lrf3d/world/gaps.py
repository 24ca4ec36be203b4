"""Gaps: closes the gaps that a scanner leaves where the walls of a map should meet.

The input is the segments and the free cells of a map; the output is walls that meet at their
corners, or a world of them. A mapped wall ends at its outermost hit, short of the corner, so that
beams and robots would slip through. Doors stay open: they are wider, and beams went through them.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, cross, lengths
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.model import World
from lrf3d.world.touching import connected

WIDEST = 0.4
"""Widest gap [m] that is closed: half of a door."""

OVERSHOOT = 0.3
"""Largest length [m] of a wall beyond its corner, which is cut off."""

LEAST_ANGLE = np.deg2rad(15.0)
"""Angle [rad] between walls below which they are one wall with a gap instead of a corner."""

ASIDE = 0.1
"""Largest distance [m] of the two ends of a straight gap, across the wall."""

STEP = 0.05
"""Distance [m] between the points of a closing piece that are compared with the free cells."""

MOST_FREE = 0.25
"""Largest share of the closing piece in free cells: the borders of free space are ragged."""


def world_of_map(mapped: World, free: FreeCells | None = None) -> World:
    """A map as a world: its walls meet at corners, and walls that touch are one object."""
    segments, walls = close_gaps(mapped.segments, free)
    return World(
        segments,
        connected(segments),
        mapped.heights[walls],
        mapped.name,
        place=mapped.place,
        free=free,
    )


class _Closing(NamedTuple):
    """A possible closing of a gap; the least ones are taken first.

    An end of a segment has twice the number of its row, and one more if it is the second. It meets
    another end at a corner (2,) or straight on (no corner), or a wall within (no other end).
    """

    within: bool
    cost: float
    ends: tuple[int, ...]
    corner: Float | None


def close_gaps(segments: Float, free: FreeCells | None = None) -> tuple[Float, Int]:
    """Make the walls (n, 4) [m] of a map meet at their corners; no wall grows into free cells.

    Returns:
        The n walls with new ends, and after them those that close straight gaps; and the rows (m,)
        of the walls that they continue.
    """
    origin = np.round(segments.reshape(-1, 2).mean(axis=0)) if len(segments) else np.zeros(2)
    ends = (segments.reshape(-1, 2, 2) - origin).reshape(-1, 2)
    outward = _outward(ends)
    moved, bridges, rows = ends.copy(), [], []
    taken = np.zeros(len(ends), dtype=np.bool_)
    # Corners of two ends come first: if one end met the side of the other wall, that wall's own end
    # would stay behind as a stub.
    for closing in sorted([*_corners(ends, outward), *_joints(ends, outward)], key=lambda c: c[:3]):
        both, corner = list(closing.ends), closing.corner
        target = ends[both[-1]] if corner is None else corner
        if taken[both].any() or (free is not None and _is_free(free, ends[both], target, origin)):
            continue
        taken[both] = True
        if corner is None:
            bridges.append(np.concatenate([ends[both[0]], target]))
            rows.append(both[0] // 2)
        else:
            moved[both] = corner
    grown = moved.reshape(-1, 4)
    grown = np.where((lengths(grown) > STEP)[:, None], grown, ends.reshape(-1, 4))
    walls = np.vstack([grown, *bridges]) + np.tile(origin, 2)
    return walls, np.concatenate([np.arange(len(segments)), np.array(rows, np.int64)])


def _outward(ends: Float) -> Float:
    """Unit vectors (2n, 2) along the segments, each out of its end."""
    pairs = ends.reshape(-1, 2, 2)
    along = pairs[:, 1] - pairs[:, 0]
    unit = along / np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([-unit, unit], axis=1).reshape(-1, 2)


def _corners(ends: Float, outward: Float) -> list[_Closing]:
    """Ends that meet other ends: at the corner of their lines, or straight on."""
    from scipy.spatial import cKDTree

    if not len(ends):
        return []
    pairs = cKDTree(ends).query_pairs(WIDEST + OVERSHOOT, output_type="ndarray")
    pairs = pairs[pairs[:, 0] // 2 != pairs[:, 1] // 2]
    one, other = pairs.T
    between = ends[other] - ends[one]
    sine = cross(outward[one], outward[other])
    distance = np.linalg.norm(between, axis=1)
    aside = np.abs(cross(outward[one], between))
    ahead = np.einsum("ij,ij->i", outward[one], between)
    facing = np.einsum("ij,ij->i", outward[one], outward[other]) < 0.0
    bends = np.abs(sine) > np.sin(LEAST_ANGLE)
    with np.errstate(divide="ignore", invalid="ignore"):
        first = cross(between, outward[other]) / sine
        second = cross(between, outward[one]) / sine
        corners = ends[one] + first[:, None] * outward[one]
    meets = bends & _may_grow(first) & _may_grow(second)
    straight = ~bends & facing & (ahead > 0.0) & (distance <= WIDEST) & (aside <= ASIDE)
    both = list(zip(one.tolist(), other.tolist(), strict=True))
    cost = np.maximum(np.abs(first), np.abs(second))
    return [
        *(_Closing(False, float(cost[k]), both[k], corners[k]) for k in np.flatnonzero(meets)),
        *(_Closing(False, float(distance[k]), both[k], None) for k in np.flatnonzero(straight)),
    ]


def _joints(ends: Float, outward: Float) -> list[_Closing]:
    """Ends that meet another wall between its ends."""
    import shapely

    if not len(ends):
        return []
    tree = shapely.STRtree(shapely.linestrings(ends.reshape(-1, 2, 2)))
    end, wall = tree.query(shapely.points(ends), predicate="dwithin", distance=WIDEST)
    apart = end // 2 != wall
    end, wall = end[apart], wall[apart]
    along = outward[2 * wall + 1]
    from_start = ends[2 * wall] - ends[end]
    sine = cross(outward[end], along)
    with np.errstate(divide="ignore", invalid="ignore"):
        growth = cross(from_start, along) / sine
        station = cross(from_start, outward[end]) / sine
        corners = ends[end] + growth[:, None] * outward[end]
    length = np.linalg.norm(ends[2 * wall + 1] - ends[2 * wall], axis=1)
    fits = (np.abs(sine) > np.sin(LEAST_ANGLE)) & _may_grow(growth)
    fits &= (station > 0.0) & (station < length)
    return [
        _Closing(True, abs(float(growth[k])), (int(end[k]),), corners[k])
        for k in np.flatnonzero(fits)
    ]


def _may_grow(growth: Float) -> Bool:
    """Whether walls may grow by these lengths [m], or, where negative, be cut back."""
    return (growth >= -OVERSHOOT) & (growth <= WIDEST)


def _is_free(free: FreeCells, begins: Float, corner: Float, origin: Float) -> bool:
    """Whether beams went through any closing piece, each from an end to a corner."""
    for begin in begins:
        count = int(np.hypot(*(corner - begin)) / STEP) + 1
        shares = (np.arange(count) + 0.5) / count
        if free.contain(begin + shares[:, None] * (corner - begin) + origin).mean() > MOST_FREE:
            return True
    return False
