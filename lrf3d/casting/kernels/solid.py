"""Cast beams in 3D at triangles, compiled, in float64 throughout.

The tree is that of walls, over the triangles as seen from above. Which side of a triangle's edge a
beam passes is the sign of d · (a × b), with the edge's ends a and b seen from the laser. Seen from
the other triangle at the edge it is the same number negated, to the last bit, so no beam passes
between the two. The number is off by some 1e-16 of its terms: decisions are right for all beams
that pass edges by more than about 1e-15 rad.
"""

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM
from lrf3d.casting.kernels.tree import STACK, Plain, Tree
from lrf3d.compiling import borrower, compiled
from lrf3d.geometry import Float, Int

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
    stack, nears = np.empty(STACK, np.int64), np.empty(STACK)
    for i in range(len(beams)):
        origin = origins[min(i, len(origins) - 1)]
        turn = beams[i, 0], beams[i, 1], beams[i, 2]
        found = _first_met(tree, corners, origin, turn, reach, stack, nears)
        distances[i], hits[i] = found


@borrower
def _first_met(
    tree: Tree, corners: Float, origin: Float, turn: Vector, reach: float, stack: Int, nears: Float
) -> tuple[float, int]:
    """The distance and the triangle that a ray meets first; infinity and −1 for none.

    Nothing needs to be found beyond reach [m]; stack and nears are room for boxes that wait.
    """
    boxes, links, _, rows = tree
    dx, dy, dz = turn
    best, hit = np.inf, -1
    limit = reach * ROOM
    stack[0], nears[0] = 0, 0.0
    top = 1 if len(corners) > 0 else 0
    while top > 0:
        top -= 1
        if nears[top] > limit:
            continue
        node = stack[top]
        first, count = links[node, 0], links[node, 1]
        # Boxes below this one wait with the nearest on top.
        bottom = top
        for k in range(first, first - count):
            near = near_box(boxes[k], origin[0], origin[1], 0.0, 0.0, dx, dy)
            if not near <= limit:
                continue
            place = top
            while place > bottom and nears[place - 1] < near:
                stack[place], nears[place] = stack[place - 1], nears[place - 1]
                place -= 1
            stack[place], nears[place] = k, near
            top += 1
        for k in range(first, first + count):
            t = _meet(corners[k], origin, dx, dy, dz)
            if t < best or (t == best and rows[k] < hit):
                best, hit = t, rows[k]
                limit = min(limit, best * ROOM)
    return best, hit


@borrower
def near_box(box: Float, ox: float, oy: float, x: float, y: float, dx: float, dy: float) -> float:
    """How far away at least a beam from (ox + x, oy + y) meets a box in plan; infinite if not."""
    near, far = 0.0, np.inf
    for axis in range(2):
        o, from_o, d = (ox, x, dx) if axis == 0 else (oy, y, dy)
        low, high = (box[axis] - o) - from_o, (box[axis + 2] - o) - from_o
        if d == 0.0:
            if low > 0.0 or high < 0.0:
                return np.inf
            continue
        one, other = low / d, high / d
        near = max(near, min(one, other) / ROOM)
        far = min(far, max(one, other) * ROOM)
    return near if near <= far else np.inf


@borrower
def _meet(corners: Float, origin: Float, dx: float, dy: float, dz: float) -> float:
    """The distance at which a beam meets a triangle, infinite where it does not."""
    ax, ay, az = a = _seen(corners[0], origin)
    bx, by, bz = b = _seen(corners[1], origin)
    cx, cy, cz = c = _seen(corners[2], origin)
    d = dx, dy, dz
    ab, bc, ca = _side(a, b, d), _side(b, c, d), _side(c, a, d)
    if not ((ab >= 0.0 and bc >= 0.0 and ca >= 0.0) or (ab <= 0.0 and bc <= 0.0 and ca <= 0.0)):
        return np.inf
    ex, ey, ez = bx - ax, by - ay, bz - az
    fx, fy, fz = cx - ax, cy - ay, cz - az
    nx, ny, nz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    slope = nx * dx + ny * dy + nz * dz
    # A beam along a triangle meets the neighbours at its edge, and this one has no distance.
    if slope == 0.0:
        return np.inf
    t = (nx * ax + ny * ay + nz * az) / slope
    # What is met lies between the nearest and the farthest corner, however flat the triangle.
    at_a, at_b = ax * dx + ay * dy + az * dz, bx * dx + by * dy + bz * dz
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
    (ax, ay, az), (bx, by, bz), (dx, dy, dz) = a, b, d
    return dx * (ay * bz - az * by) + dy * (az * bx - ax * bz) + dz * (ax * by - ay * bx)
