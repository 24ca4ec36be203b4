"""Cast beams in 3D at triangles, compiled, in float64 throughout.

The tree is that of walls, over the triangles as seen from above. Which side of a triangle's edge a
beam passes is the sign of d · (a × b), with the edge's ends a and b seen from the laser. Seen from
the other triangle at the edge it is the same number negated, to the last bit, so no beam passes
between the two. The number is off by some 1e-16 of its terms: decisions are right for all beams
that pass edges by more than about 1e-15 rad.
"""

import numpy as np

from lrf3d.casting.kernels.tree import (
    ROOM,
    Plain,
    Stack,
    Tree,
    enter,
    new_stack,
    next_leaf,
    way_of,
)
from lrf3d.compiling import borrower, compiled
from lrf3d.geometry.lines import Float, Int

Vector = tuple[float, float, float]


@compiled
def cast_solid(
    plain_tree: Plain, corners: Float, origins: Float, beams: Float, reach: float,
    distances: Float, hits: Int,
) -> None:  # fmt: skip
    """Fill in distances (n,) and triangles (n,) that beams (n, 3) meet first.

    Origins (n, 3) are those of the beams; of (1, 3) the one is that of all. Corners (m, 3, 3) are
    in the order of the tree. Of triangles at the same distance the first is met.
    """
    tree = Tree(*plain_tree)
    stack = new_stack()
    for i in range(len(beams)):
        origin = origins[min(i, len(origins) - 1)]
        turn = beams[i, 0], beams[i, 1], beams[i, 2]
        distances[i], hits[i] = _first_met(tree, corners, origin, turn, reach, stack)


@borrower
def _first_met(
    tree: Tree, corners: Float, origin: Float, turn: Vector, reach: float, stack: Stack
) -> tuple[float, int]:
    """The distance and the triangle that a ray meets first; infinity and −1 for none.

    Nothing needs to be found beyond reach [m].
    """
    dx, dy, dz = turn
    way = way_of(origin[0], origin[1], 0.0, 0.0, dx, dy)
    best = np.inf
    hit = -1
    limit = reach * ROOM
    top = enter(tree, stack)
    while top > 0:
        first, stop, top = next_leaf(tree, way, limit, stack, top)
        for k in range(first, stop):
            t = _meet(corners[k], origin, dx, dy, dz)
            if t < best or (t == best and tree.rows[k] < hit):
                best = t
                hit = tree.rows[k]
                limit = min(limit, best * ROOM)
    return best, hit


@borrower
def _meet(corners: Float, origin: Float, dx: float, dy: float, dz: float) -> float:
    """The distance at which a beam meets a triangle, infinite where it does not."""
    ax, ay, az = a = _seen(corners[0], origin)
    bx, by, bz = b = _seen(corners[1], origin)
    cx, cy, cz = c = _seen(corners[2], origin)
    d = dx, dy, dz
    ab = _side(a, b, d)
    bc = _side(b, c, d)
    ca = _side(c, a, d)
    if not ((ab >= 0.0 and bc >= 0.0 and ca >= 0.0) or (ab <= 0.0 and bc <= 0.0 and ca <= 0.0)):
        return np.inf
    ex = bx - ax
    ey = by - ay
    ez = bz - az
    fx = cx - ax
    fy = cy - ay
    fz = cz - az
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    slope = nx * dx + ny * dy + nz * dz
    # A beam along a triangle meets the neighbours at its edge, and this one has no distance.
    if slope == 0.0:
        return np.inf
    t = (nx * ax + ny * ay + nz * az) / slope
    # What is met lies between the nearest and the farthest corner, however flat the triangle.
    at_a = ax * dx + ay * dy + az * dz
    at_b = bx * dx + by * dy + bz * dz
    at_c = cx * dx + cy * dy + cz * dz
    t = min(max(t, min(at_a, at_b, at_c)), max(at_a, at_b, at_c))
    return t if t >= 0.0 else np.inf


@borrower
def _seen(corner: Float, origin: Float) -> Vector:
    """A corner as seen from the origin."""
    return corner[0] - origin[0], corner[1] - origin[1], corner[2] - origin[2]


@borrower
def _side(a: Vector, b: Vector, d: Vector) -> float:
    """On which side of the edge from a to b the beam passes: the sign of d · (a × b)."""
    ax, ay, az = a
    bx, by, bz = b
    dx, dy, dz = d
    return dx * (ay * bz - az * by) + dy * (az * bx - ax * bz) + dz * (ax * by - ay * bx)
