"""Building a tree of boxes over walls, compiled: each node is cut where it is cheapest."""

import numpy as np

from lrf3d.casting.kernels.compiling import compiled, inner

BINS = 16
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
"""Boxes that may wait on the way through a tree: three for each of at most 40 + 31 levels."""


@compiled
def build(segments, order, boxes, links):
    """Sort `order` into leaves and fill boxes and links; the number of nodes."""
    stack = np.empty((STACK, 4), dtype=np.int64)
    _bound(segments, order, 0, len(order), boxes[0])
    used = 1
    stack[0] = 0, 0, len(order), 0
    top = 1
    weight = np.empty(BINS, dtype=np.int64)
    bin_box = np.empty((BINS, 4))
    cost = np.empty(BINS)
    cuts = np.empty(CHILDREN + 1, dtype=np.int64)
    while top > 0:
        top -= 1
        node, start, stop, level = stack[top]
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
            stack[top] = used + k, cuts[k], cuts[k + 1], level + 1
            top += 1
        used += parts
    return used


@inner
def _cut(segments, order, start, stop, weight, bin_box, cost):
    """Order the walls by the cheapest cut of their middles; the first row behind the cut."""
    low = np.array([np.inf, np.inf])
    high = -low
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
        scale = BINS / (high[axis] - low[axis])
        weight[:] = 0
        bin_box[:, :2] = np.inf
        bin_box[:, 2:] = -np.inf
        for row in range(start, stop):
            wall = segments[order[row]]
            b = min(BINS - 1, int((wall[axis] + wall[axis + 2] - low[axis]) * scale))
            weight[b] += 1
            _widen(bin_box[b], wall)
        box = np.array([np.inf, np.inf, -np.inf, -np.inf])
        below = 0
        for b in range(BINS - 1):
            below += weight[b]
            _join(box, bin_box[b])
            cost[b] = below * _half_perimeter(box) if below > 0 else np.inf
        box[:2] = np.inf
        box[2:] = -np.inf
        above = 0
        for b in range(BINS - 1, 0, -1):
            above += weight[b]
            _join(box, bin_box[b])
            total = cost[b - 1] + above * _half_perimeter(box) if above > 0 else np.inf
            if total < best:
                best, best_axis, best_bin = total, axis, b
    if best_bin < 0:
        # All middles are one point: cut by number, so that no leaf grows without bound.
        return (start + stop) // 2
    scale = BINS / (high[best_axis] - low[best_axis])
    left, right = start, stop - 1
    while left <= right:
        wall = segments[order[left]]
        place = (wall[best_axis] + wall[best_axis + 2] - low[best_axis]) * scale
        if min(BINS - 1, int(place)) < best_bin:
            left += 1
        else:
            order[left], order[right] = order[right], order[left]
            right -= 1
    return left


@inner
def _half_perimeter(box):
    return (box[2] - box[0]) + (box[3] - box[1])


@inner
def _widen(box, wall):
    box[0] = min(box[0], wall[0], wall[2])
    box[1] = min(box[1], wall[1], wall[3])
    box[2] = max(box[2], wall[0], wall[2])
    box[3] = max(box[3], wall[1], wall[3])


@inner
def _join(box, other):
    box[0] = min(box[0], other[0])
    box[1] = min(box[1], other[1])
    box[2] = max(box[2], other[2])
    box[3] = max(box[3], other[3])


@inner
def _bound(segments, order, start, stop, box):
    box[:2] = np.inf
    box[2:] = -np.inf
    for row in range(start, stop):
        _widen(box, segments[order[row]])
