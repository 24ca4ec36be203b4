"""Tree: walls in a tree of boxes, so that a scan visits only what its beams can meet.

Boxes are split where the surface-area heuristic finds it cheapest (in the plane: half the
perimeter of a box is in proportion to the beams that meet it). Unlike the cells of a grid, boxes
take worlds of any density and scale, and a wall lies in one leaf however long it is.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int

SPLIT_BINS = 16
"""Places tried for a cut; more make a tree that is hardly better."""

LEAF = 8
"""Walls that a leaf may always hold: visiting them costs no more than another two boxes."""

CHILDREN = 4
"""Boxes below a node, looked at together: as many as a vector register holds numbers."""

SMALL = 24
"""Walls up to which a world gets one leaf and no tree."""

FREE_LEVELS = 40
"""Levels from the root on that are cut where it is cheapest. Below, walls are halved by number:
walls whose scales span many powers of ten could else make a tree as deep as they are many."""

STACK = 256
"""Boxes that may wait on the path through a tree: three for each of at most 40 + 31 levels."""


class Tree(NamedTuple):
    """Boxes (m, 4) over walls (n, 4), in the order of the leaves, and their rows (n,) in a world.

    A box is the smallest x, y and the largest x, y [m] of a node; node 0 is the root. Links (m, 2)
    are for a leaf the row of its first wall and how many it holds; for a node above others the
    first of its children, which lie side by side, and minus how many.
    """

    boxes: Float
    links: NDArray[np.int32]
    walls: Float
    rows: NDArray[np.int32]


Plain = Any
"""A named tuple as Python passes it, as a tuple: Numba takes ten times as long to find its type."""


def build_tree(segments: Float, index: NDArray[np.int32] | None = None) -> Tree:
    """Build the tree over segments (n, 4); index names them where they are a part of a world."""
    segments = np.ascontiguousarray(segments, dtype=np.float64)
    count = len(segments)
    order = np.arange(count, dtype=np.int32)
    capacity = 1 if count <= SMALL else 2 * count
    boxes = np.empty((capacity, 4))
    links = np.zeros((capacity, 2), dtype=np.int32)
    used = _build(segments, order, boxes, links)
    names = order if index is None else index[order]
    return Tree(boxes[:used].copy(), links[:used].copy(), segments[order], names)


@compiled
def _build(
    segments: Float, order: NDArray[np.int32], boxes: Float, links: NDArray[np.int32]
) -> int:
    """Sort `order` into leaves and fill boxes and links; the number of nodes."""
    stack = np.empty((STACK, 4), dtype=np.int64)
    _bound(segments, order, 0, len(order), boxes[0])
    used = 1
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, 0, len(order), 0
    top = 1
    weight = np.empty(SPLIT_BINS, dtype=np.int64)
    bin_box = np.empty((SPLIT_BINS, 4))
    cost = np.empty(SPLIT_BINS)
    cuts = np.empty(CHILDREN + 1, dtype=np.int64)
    while top > 0:
        top -= 1
        node, start, stop, level = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        leaf = SMALL if len(links) == 1 else LEAF
        cuts[0], cuts[1] = start, stop
        parts = 1
        while parts < CHILDREN:
            # The part with most walls is cut next.
            widest = 0
            for k in range(1, parts):
                if cuts[k + 1] - cuts[k] > cuts[widest + 1] - cuts[widest]:
                    widest = k
            if cuts[widest + 1] - cuts[widest] <= leaf:
                break
            middle = (cuts[widest] + cuts[widest + 1]) // 2
            if level < FREE_LEVELS:
                middle = _cut(
                    segments, order, cuts[widest], cuts[widest + 1], weight, bin_box, cost
                )
            for k in range(parts, widest, -1):
                cuts[k + 1] = cuts[k]
            cuts[widest + 1] = middle
            parts += 1
        if parts == 1:
            links[node, 0] = start
            links[node, 1] = stop - start
            continue
        links[node, 0] = used
        links[node, 1] = -parts
        for k in range(parts):
            _bound(segments, order, cuts[k], cuts[k + 1], boxes[used + k])
            stack[top, 0], stack[top, 1], stack[top, 2] = used + k, cuts[k], cuts[k + 1]
            stack[top, 3] = level + 1
            top += 1
        used += parts
    return used


@inner
def _cut(
    segments: Float, order: NDArray[np.int32], start: int, stop: int, weight: Int, bin_box: Float,
    cost: Float,
) -> int:  # fmt: skip
    """Order the walls by the cheapest cut of their middles; the first row behind the cut."""
    low, high, box = np.empty(2), np.empty(2), np.empty(4)
    for axis in range(2):
        low[axis], high[axis] = np.inf, -np.inf
    for row in range(start, stop):
        for axis in range(2):
            middle = segments[order[row], axis] + segments[order[row], axis + 2]
            low[axis] = min(low[axis], middle)
            high[axis] = max(high[axis], middle)
    best = np.inf
    best_axis, best_bin = 0, -1
    for axis in range(2):
        if not high[axis] > low[axis]:
            continue
        scale = SPLIT_BINS / (high[axis] - low[axis])
        for b in range(SPLIT_BINS):
            weight[b] = 0
            _empty(bin_box[b])
        for row in range(start, stop):
            wall = segments[order[row]]
            b = min(SPLIT_BINS - 1, int((wall[axis] + wall[axis + 2] - low[axis]) * scale))
            weight[b] += 1
            _widen(bin_box[b], wall)
        _empty(box)
        below = 0
        for b in range(SPLIT_BINS - 1):
            below += weight[b]
            _join(box, bin_box[b])
            cost[b] = below * _half_perimeter(box) if below > 0 else np.inf
        _empty(box)
        above = 0
        for b in range(SPLIT_BINS - 1, 0, -1):
            above += weight[b]
            _join(box, bin_box[b])
            total = cost[b - 1] + above * _half_perimeter(box) if above > 0 else np.inf
            if total < best:
                best, best_axis, best_bin = total, axis, b
    if best_bin < 0:
        # All middles are one point: cut by number, so that no leaf grows without bound.
        return (start + stop) // 2
    scale = SPLIT_BINS / (high[best_axis] - low[best_axis])
    left, right = start, stop - 1
    while left <= right:
        wall = segments[order[left]]
        place = (wall[best_axis] + wall[best_axis + 2] - low[best_axis]) * scale
        if min(SPLIT_BINS - 1, int(place)) < best_bin:
            left += 1
        else:
            order[left], order[right] = order[right], order[left]
            right -= 1
    return left


@inner
def _half_perimeter(box: Float) -> float:
    return float((box[2] - box[0]) + (box[3] - box[1]))


@inner
def _empty(box: Float) -> None:
    box[0], box[1], box[2], box[3] = np.inf, np.inf, -np.inf, -np.inf


@inner
def _widen(box: Float, wall: Float) -> None:
    box[0] = min(box[0], wall[0], wall[2])
    box[1] = min(box[1], wall[1], wall[3])
    box[2] = max(box[2], wall[0], wall[2])
    box[3] = max(box[3], wall[1], wall[3])


@inner
def _join(box: Float, other: Float) -> None:
    box[0] = min(box[0], other[0])
    box[1] = min(box[1], other[1])
    box[2] = max(box[2], other[2])
    box[3] = max(box[3], other[3])


@inner
def _bound(segments: Float, order: NDArray[np.int32], start: int, stop: int, box: Float) -> None:
    _empty(box)
    for row in range(start, stop):
        _widen(box, segments[order[row]])
