"""Tree: walls in a tree of boxes, so that a scan visits only what its beams can meet.

Boxes are split where the surface-area heuristic finds it cheapest (in the plane: half the
perimeter of a box is in proportion to the beams that meet it). Unlike the cells of a grid, boxes
take worlds of any density and scale, and a wall lies in one leaf however long it is.
"""

from typing import Any, NamedTuple, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.predicates import Wall, index_of
from lrf3d.compiling import LANES, borrower, by_lanes, choose, compiled, inner, record
from lrf3d.geometry.lines import Float, Int, Records

# Places tried for a cut; more make a tree that is hardly better.
SPLIT_BINS = 16

# Walls that a leaf may always hold: visiting them costs no more than another two boxes.
LEAF = 8

# Boxes below a node, looked at together.
CHILDREN = LANES

# Walls up to which a world gets one leaf and no tree.
SMALL = 24

# Levels from the root on that are cut where it is cheapest. Below, walls are halved by number:
# walls whose scales span many powers of ten could else make a tree as deep as they are many.
FREE_LEVELS = 20

# Boxes that may wait on the path through a tree: seven for each of at most 20 + 11 levels.
STACK = 256

# Room for rounding and for directions that are not quite of unit length.
ROOM = 1.0 + 1e-9

# Which of LANES boxes or walls are met, as bits: the first one, and the place of the lowest of all.
ONE = index_of(1)
LOWEST = np.array([0, *((met & -met).bit_length() - 1 for met in range(1, 1 << LANES))], np.uint8)

# A box that waits on a ray's path, and how far away it is at least [m]; the nearest is on top.
BOX = record(node=int, near=float)


class Stack(NamedTuple):
    """The boxes that wait on a ray's path, and how far away it enters those below a node [m]."""

    waiting: Records
    entries: Float


class Tree(NamedTuple):
    """Boxes over walls (n, 4), in the order of the leaves, and their rows (n,) in a world.

    A box is the smallest x, y and the largest x, y [m] of a node; node 0 is the root. Links (m, 2)
    are for a leaf the row of its first wall and how many it holds; for a node above others the
    first of its children, which lie side by side, and minus how many. Boxes, and the walls again,
    are also there as columns (4, …), with whole vectors of zeros behind.
    """

    boxes: Float
    links: NDArray[np.int32]
    walls: Float
    columns: Float
    rows: NDArray[np.int32]


# A node that waits to be cut: which walls it has, and how far below the root it is.
PART = record(**dict.fromkeys(("node", "start", "stop", "level"), int))

# A named tuple as Python passes it, as a tuple: Numba takes ten times as long to find its type.
Plain = Any


class Way(NamedTuple):
    """The path of a ray: a place [m], where the ray begins as seen from there, and its direction.

    Seen from the place no digits of a ray's origin are lost far away.
    """

    ox: float
    oy: float
    x: float
    y: float
    across: float  # One over the direction along x,
    along: float  # and along y.


@borrower
def way_of(ox: float, oy: float, x: float, y: float, dx: float, dy: float) -> Way:
    """The path of a ray: see `Way`."""
    # A zero without its sign is as good as a small number above it.
    return Way(ox, oy, x, y, 1.0 / (dx + 0.0), 1.0 / (dy + 0.0))


@inner
def new_stack() -> Stack:
    """Room for the boxes on a ray's path."""
    return Stack(np.empty(STACK, BOX), np.empty(LANES))


@inner
def whole(count: int) -> Any:
    """A number of lanes, rounded up to whole vectors."""
    return index_of(count + LANES - 1) // index_of(LANES) * index_of(LANES)


@inner
def column_at(columns: Float, row: SupportsIndex) -> Wall:
    """The box or the wall in a row of columns."""
    return Wall(
        columns[index_of(0), row],
        columns[index_of(1), row],
        columns[index_of(2), row],
        columns[index_of(3), row],
    )


@inner
def first_lanes(count: int) -> Any:
    """The bits of the first of all lanes, up to a number of them."""
    return (ONE << index_of(min(count, LANES))) - ONE


@borrower
def wait(first: int, met: Any, entries: Float, waiting: Records, top: int) -> int:
    """Let boxes of a node wait, of which some are met: the nearest on top."""
    if met == 0:
        return top
    node = index_of(first) + LOWEST[met]
    near = entries[LOWEST[met]]
    met &= met - ONE
    while met != 0:
        child = index_of(first) + LOWEST[met]
        entered = entries[LOWEST[met]]
        waiting[top].node = child if entered >= near else node
        waiting[top].near = max(entered, near)
        node = node if entered >= near else child
        near = min(entered, near)
        top += 1
        met &= met - ONE
    waiting[top].node = node
    waiting[top].near = near
    return top + 1


@borrower
def next_leaf(tree: Tree, way: Way, limit: float, stack: Stack, top: int) -> tuple[int, int, int]:
    """The next leaf on a path up to a limit [m]: its first row and its end, which are 0 after all.

    The last number is that of the boxes that still wait.
    """
    boxes = tree.boxes
    waiting = stack.waiting
    entries = stack.entries
    while top > 0:
        top -= 1
        if waiting[top].near > limit * ROOM:
            continue
        node = index_of(waiting[top].node)
        first = tree.links[node, 0]
        count = tree.links[node, 1]
        if count > 0:
            return first, first + count, top
        met = boxes_met(boxes, first, way, limit, entries) & first_lanes(-count)
        top = wait(first, met, entries, waiting, top)
    return 0, 0, 0


def _reaches(box: Any, way: Way, limit: float) -> tuple[bool, float]:
    """Whether a ray meets a box up to a limit, and how far away it enters it; 0 from inside."""
    left, low, right, high = box
    near = 0.0
    far = limit
    for first, second in (
        ((left - way.ox - way.x) * way.across, (right - way.ox - way.x) * way.across),
        ((low - way.oy - way.y) * way.along, (high - way.oy - way.y) * way.along),
    ):
        # Along an axis 0 times infinity is no number, and no bound.
        entry = choose(second < first, second, first)
        near = choose(entry > near, entry, near)
        end = choose(first > second, first, second)
        far = choose(end < far, end, far)
    return near <= far * ROOM, near


boxes_met = by_lanes(_reaches)


@inner
def enter(tree: Tree, stack: Stack) -> int:
    """Let the root of a tree wait, if it has walls; the number of boxes that do."""
    root = stack.waiting[0]
    root.node = 0
    root.near = 0.0
    return 1 if len(tree.rows) > 0 else 0


def build_tree(segments: Float, index: NDArray[np.int32] | None = None) -> Tree:
    """Build the tree over segments (n, 4); index names them where they are a part of a world."""
    # A copy: numba compiles a kernel twice if some arrays are read-only and some are not.
    segments = np.array(segments, dtype=np.float64, order="C")
    count = len(segments)
    order = np.arange(count, dtype=np.int32)
    capacity = 1 if count <= SMALL else 2 * count
    boxes = np.empty((capacity, 4))
    links = np.zeros((capacity, 2), dtype=np.int32)
    used = _build(segments, order, boxes, links)
    walls = segments[order]
    names = order if index is None else index[order]
    return Tree(_columns(boxes[:used]), links[:used].copy(), walls, _columns(walls), names)


def _columns(rows: Float) -> Float:
    """Columns (4, …) of rows (n, 4), and zeros behind."""
    return np.ascontiguousarray(np.pad(rows, ((0, LANES), (0, 0))).T)


@compiled
def _build(
    segments: Float, order: NDArray[np.int32], boxes: Float, links: NDArray[np.int32]
) -> int:
    """Sort `order` into leaves and fill boxes and links; the number of nodes."""
    waiting = np.empty(STACK, PART)
    room = np.empty((SPLIT_BINS, 4))
    weight = np.empty(SPLIT_BINS, np.int64)
    cost = np.empty(SPLIT_BINS)
    cuts = np.empty(CHILDREN + 1, dtype=np.int64)
    leaf = SMALL if len(links) == 1 else LEAF
    root = waiting[0]
    used = top = 1
    root.node = root.start = root.level = 0
    root.stop = len(order)
    _bound(segments, order, 0, len(order), boxes[root.node])
    while top > 0:
        top -= 1
        part = waiting[top]
        node = part.node
        level = part.level
        parts = 1
        cuts[0] = part.start
        cuts[parts] = part.stop
        while parts < CHILDREN:
            # The part with most walls is cut next.
            widest = 0
            for k in range(1, parts):
                if cuts[k + 1] - cuts[k] > cuts[widest + 1] - cuts[widest]:
                    widest = k
            start = cuts[widest]
            stop = cuts[widest + 1]
            if stop - start <= leaf:
                break
            middle = (start + stop) // 2
            if level < FREE_LEVELS:
                middle = _cut(segments, order, start, stop, weight, room, cost)
            for k in range(parts, widest, -1):
                cuts[k + 1] = cuts[k]
            cuts[widest + 1] = middle
            parts += 1
        if parts == 1:
            links[node, 0] = part.start
            links[node, 1] = part.stop - part.start
            continue
        links[node, 0] = used
        links[node, 1] = -parts
        for k in range(parts):
            child = waiting[top]
            child.node = used
            child.level = level + 1
            child.start = cuts[k]
            child.stop = cuts[k + 1]
            _bound(segments, order, child.start, child.stop, boxes[used])
            used += 1
            top += 1
    return used


@inner
def _cut(
    segments: Float, order: NDArray[np.int32], start: int, stop: int, weight: Int, boxes: Float,
    cost: Float,
) -> int:  # fmt: skip
    """Order the walls by the cheapest cut of their middles; the first row behind the cut."""
    best = np.inf
    best_axis = 0
    best_bin = -1
    best_low = best_scale = 0.0
    box = np.empty(4)
    for axis in range(2):
        low = np.inf
        high = -np.inf
        for row in range(start, stop):
            middle = segments[order[row], axis] + segments[order[row], axis + 2]
            low = min(low, middle)
            high = max(high, middle)
        if not high > low:
            continue
        scale = SPLIT_BINS / (high - low)
        for b in range(SPLIT_BINS):
            weight[b] = 0
            _empty(boxes[b])
        for row in range(start, stop):
            wall = segments[order[row]]
            b = min(SPLIT_BINS - 1, int((wall[axis] + wall[axis + 2] - low) * scale))
            weight[b] += 1
            _widen(boxes[b], wall)
        # What is below a cut behind each bin, and then what is above.
        for side in range(2):
            _empty(box)
            count = 0
            for k in range(SPLIT_BINS - 1):
                b = k if side == 0 else SPLIT_BINS - 1 - k
                if weight[b] > 0:
                    _widen(box, boxes[b])
                count += weight[b]
                part = count * _half_perimeter(box) if count > 0 else np.inf
                if side == 0:
                    cost[b] = part
                if side == 1 and cost[b - 1] + part < best:
                    best = cost[b - 1] + part
                    best_axis = axis
                    best_bin = b
                    best_low = low
                    best_scale = scale
    if best_bin < 0:
        # All middles are one point: cut by number, so that no leaf grows without bound.
        return (start + stop) // 2
    left = start
    right = stop - 1
    while left <= right:
        wall = segments[order[left]]
        place = (wall[best_axis] + wall[best_axis + 2] - best_low) * best_scale
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
    box[:2] = np.inf
    box[2:] = -np.inf


@inner
def _widen(box: Float, wall: Float) -> None:
    """Widen a box by a wall, or by a box that is not empty."""
    for axis in range(2):
        box[axis] = min(box[axis], wall[axis], wall[axis + 2])
        box[axis + 2] = max(box[axis + 2], wall[axis], wall[axis + 2])


@inner
def _bound(segments: Float, order: NDArray[np.int32], start: int, stop: int, box: Float) -> None:
    _empty(box)
    for row in range(start, stop):
        _widen(box, segments[order[row]])
