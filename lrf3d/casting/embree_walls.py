"""Walls as triangles that Embree cannot miss, and the part of each wall where its hit is final.

Embree works in float32: each position may be off by an error ε. The triangles for a wall therefore
extend beyond it (everything upright, the beams at z = 0 horizontal):

- the wall's own plane, longer by 3δ at both ends, where δ = 2ε;
- across each end, δ before it, a cap that reaches 2δ to both sides, but for square corners.

Let `strip` be all that lies within δ of the wall, squared off. A beam that truly meets the wall
and starts outside the strip either crosses it from long side to long side, and then float32 has it
cross the plane; or it passes a short side, and then it has it cross a cap. So Embree finds the
wall, at some place of the beam's way through the strip, give or take 5δ.

Where another wall begins at the very end, at an angle φ of 45° to 135°, that one is the cap. Its
line parts the wall from the short side, so a beam that passes both crosses it between them, no
more than δ / sin φ from the end. If the beam meets the wall under so small an angle that float32
may have it pass by (by sin 1/6 or less, its plane being 3δ longer), it crosses the other one's
line under 35° or more, and float32 has it do so no more than ε / sin 35° < δ away: in all less
than 2.5δ from the end, where the other wall's plane still is.

Say Embree's first hit is on wall w, and the beam does meet w, at a point h and under an angle
whose sine is at least s. Embree's place is within 5δ / s of h. Any wall that the beam meets before
h then has its strip end no more than (5 + 5 / s) δ before h, so it comes within (7 + 5 / s) δ of h.
Where no other wall is that near, w is the one: this part of w is `clear`, for beams of that sine.

Embree's tree of boxes may be off by ε as well, so each triangle's box needs that much room around
the part at z = 0. Where it is thin, the base is moved a little to one side and the top to the
other, which leaves the part at z = 0 where it is.

A beam's way through a strip may be as long as the wall, so Embree looks that much beyond the
range, and 8δ more. No hit at all then means that there is none.

All this holds for walls of any length above 0: of one much shorter than δ the plane is 6δ long and
stands between its caps, and no part is clear, so every beam that Embree has hit it is cast again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.embree_proof import LEAST_SINE, STEEP_SINE
from lrf3d.casting.kernels.neighbours import clear_parts, cluster_of, least_width
from lrf3d.casting.kernels.tree import Tree
from lrf3d.geometry import Float, Int

LONGER, CAP = 3.0, 2.0
"""How many δ a plane reaches beyond each end of its wall, and a cap to each side."""

APEX = 9.0
"""A wall is one triangle, with its base below the beams; this many times as much is above them."""

THIN = APEX
"""A triangle not wider than this many δ has a base with less than δ of room at either end."""

LEAN = 2.0
"""How many δ the base of such a triangle is moved, and its top APEX times as much."""

SQUARE = 0.71
"""Sine of the angle from which on a corner is square enough: a little more than of 45°."""


class Ends(NamedTuple):
    """The ends of walls.

    Attributes:
        point: (2 n,) which point each end is, those of a wall side by side.
        points: (m, 2) the points [m], each once, in ascending order of x and y.
    """

    point: Int
    points: Float


def ends_of(segments: Float) -> Ends:
    """The ends of segments (n, 4)."""
    ends = segments.reshape(-1, 2)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ordered = ends[order]
    first = np.ones(len(ends), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    point = np.empty(len(ends), dtype=np.int64)
    point[order] = np.cumsum(first) - 1
    return Ends(point, ordered[first])


def narrowest_cluster(ends: Ends) -> float:
    """The width [m] of the narrowest cluster of walls with these ends, or a little less.

    A cluster is what hangs together by shared ends. Its width is 0 where all lies in one line;
    without walls it is infinite.
    """
    point, points = ends
    cluster = cluster_of(point.reshape(-1, 2), len(points))
    together = np.argsort(cluster, kind="stable")
    starts = np.flatnonzero(np.diff(cluster[together], prepend=-1))
    return float(least_width(points[together], starts))


def square_corners(segments: Float, ends: Ends) -> NDArray[np.bool_]:
    """Which ends (n, 2) of segments (n, 4) are those of just one other too, about square to it."""
    point = ends.point
    order = np.argsort(point, kind="stable")
    count = np.bincount(point)
    first = order[(np.cumsum(count) - count)[count == 2]]
    second = order[(np.cumsum(count) - 1)[count == 2]]
    along = segments[:, 2:] - segments[:, :2]
    one, other = along[first // 2], along[second // 2]
    cross = abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    lengths = np.hypot(one[:, 0], one[:, 1]) * np.hypot(other[:, 0], other[:, 1])
    square = cross > SQUARE * lengths
    found = np.zeros(2 * len(segments), dtype=bool)
    found[first], found[second] = square, square
    return found.reshape(-1, 2)


def float32_error(radius: float, distance: float) -> float:
    """Bound on Embree's error ε [m], at coordinates up to a radius from the middle.

    The ends and the laser are rounded, and, in proportion to the distance, the direction and each
    of the seven steps of the intersection.
    """
    return 2.0**-24 * (2.0 * radius + 16.0 * distance)


def all_clear_parts(tree: Tree, delta: float) -> Float:
    """The clear parts (n, 4) of walls: from where to where, of 0 to 1, for flat and steep beams.

    Between two places of which each lies in one of a wall's parts, there is no other wall.
    """
    part = np.tile([1.0, 0.0], (len(tree.walls), 1))
    both = []
    for sine in (LEAST_SINE, STEEP_SINE):
        reach = (7.0 + 5.0 / sine) * delta
        part = clear_parts(tree, reach, part)
        both.append(part)
    return np.hstack(both)


def triangles(
    walls: Float, ends: Ends, centre: tuple[float, float], delta: float, unit: float
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices (3 m, 3) float32 of m triangles, and which wall (n, 4) each of these is for.

    The vertices are relative to the centre, in metres times the unit.
    """
    start, end = walls[:, :2] - centre, walls[:, 2:] - centre
    # Seen from the centre both ends of a short wall may round to one point, or to a wall of another
    # direction. Between the ends as they are the difference is right to its last bit.
    along = walls[:, 2:] - walls[:, :2]
    length = np.hypot(along[:, 0], along[:, 1])[:, None]
    along = along / length
    across = np.column_stack([-along[:, 1], along[:, 0]])
    capped = ~square_corners(walls, ends)
    near, far = capped.T
    rows = np.arange(len(walls), dtype=np.int32)
    owners = np.concatenate([rows, rows[near], rows[far]])
    middles = np.concatenate(
        [0.5 * (start + end), (start - delta * along)[near], (end + delta * along)[far]]
    )
    sides = np.concatenate([along, across[near], across[far]])
    caps = np.full((int(capped.sum()), 1), CAP * delta)
    halves = np.concatenate([0.5 * length + LONGER * delta, caps])
    # At z = 0 a triangle is APEX / (APEX + 1) as wide as its base.
    wide = sides * halves * (1.0 + 1.0 / APEX)
    lean = LEAN * delta * (abs(sides * halves) < THIN * delta)
    vertices = np.zeros((len(owners), 3, 3))
    vertices[:, 0, :2] = middles - wide + lean
    vertices[:, 1, :2] = middles + wide + lean
    vertices[:, 2, :2] = middles - APEX * lean
    vertices[:, :2, 2] = -2.0 * halves / APEX
    vertices[:, 2, 2:] = 2.0 * halves
    return (unit * vertices.reshape(-1, 3)).astype(np.float32), owners
