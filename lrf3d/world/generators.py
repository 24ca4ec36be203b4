"""Generated worlds: a city, a maze, an office floor, rooms; each from a seed.

Cities with any number of walls at one density serve benchmarks.
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import ROUNDING, Float
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import TOUCHING, Part, walls, world_of_parts
from lrf3d.world.schema import parse_colour

# Thickness of walls [m].
THICKNESS = 0.2

# Clear width of a door [m]: three robots of usual size.
DOOR = 2.2

# Width [m] of an office's corridor.
CORRIDOR = 2.6

# Depth [m] of an office's rooms.
ROOM_DEPTH = 5.0

# Least and largest width [m] of an office's rooms.
ROOM_WIDTHS = (3.8, 6.0)

# Distance [m] between the centres of neighbouring buildings of a city.
BLOCK_SIDE = 20.0

# Distance [m] between neighbouring walls of a maze: as wide as a corridor.
PASSAGE = CORRIDOR

# The left, lower, right and upper side of a part of a plan [m].
Box = tuple[float, float, float, float]


class FloorPlan:
    """Centre lines of walls, and boxes between them, of which a world is made."""

    def __init__(self) -> None:
        self.lines = list[Float]()
        self.boxes = list[Part]()

    def wall(self, x1: float, y1: float, x2: float, y2: float, *doors: float) -> None:
        """Add a wall along an axis, with doors at these distances from its first end [m]."""
        begin = np.array([x1, y1])
        span = np.array([x2 - x1, y2 - y1])
        length = float(np.abs(span).sum())
        gap = 0.5 * (DOOR + THICKNESS)
        posts = [post for door in sorted(doors) for post in (door - gap, door + gap)]
        for start, end in np.reshape([0.0, *posts, length], (-1, 2)):
            if end > start:
                self.lines.append((begin + np.outer([start, end], span / length)).ravel())

    def outer_walls(self, wide: float, high: float) -> None:
        """Add the outer walls of a plan, without doors, so that a drive stays inside."""
        for y in (0.0, high):
            self.wall(0.0, y, wide, y)
        for x in (0.0, wide):
            self.wall(x, 0.0, x, high)

    def box(self, kind: str, corner: Float, size: Float, height: float, colour: Any) -> None:
        """Add furniture of a size (2,) [m] with its lower left corner (2,) [m]."""
        points = np.round(corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size, 3)
        name = f"{kind} {len(self.boxes)}"
        self.boxes.append(Part(0, walls(points, closed=True), np.array(height), name, colour))

    def world(self, name: str) -> World:
        """The world: walls that touch are one object, and so is each box."""
        ends = np.array(self.lines).reshape(-1, 2, 2)
        low = ends.min(axis=1) - 0.5 * THICKNESS
        high = ends.max(axis=1) + 0.5 * THICKNESS
        # A grid of a millimetre keeps walls that should meet from missing each other by rounding.
        union = shapely.union_all(shapely.box(*low.T, *high.T), grid_size=TOUCHING)
        parts = list[Part]()
        for part in shapely.get_parts([shapely.simplify(union, ROUNDING)]):
            rings = [np.array(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)]
            outline = np.concatenate([walls(np.round(ring, 3), closed=True) for ring in rings])
            called = f"walls {len(parts)}" if parts else "walls"
            parts.append(
                Part(0, outline, np.array(DEFAULT_HEIGHT), called, parse_colour("#ccc4b5"))
            )
        parts += self.boxes
        return world_of_parts([p._replace(number=n) for n, p in enumerate(parts)], name)


def generate(kind: str, *, size: float | None = None, seed: int = 0) -> World:
    """Generate a world in which a robot can drive.

    Args:
        kind: ``city``, ``maze``, ``office`` or ``rooms``.
        size: Approximate width [m].
        seed: The same seed gives the same world.
    """
    if kind not in KINDS:
        raise InputError(f"{kind}: unknown kind of world; known are {', '.join(KINDS)}")
    make, usual = KINDS[kind]
    size = usual if size is None else size
    if not 12.0 <= size <= 1000.0:
        raise InputError(f"size {size:g} m: expected 12 to 1000 m")
    return make(size, seed)


def city(size: float, seed: int) -> World:
    """Buildings in blocks, of different heights and façades."""
    blocks = max(2, round(size / BLOCK_SIDE))
    plain = generate_city(4 * blocks**2, seed=seed)
    rng = np.random.default_rng([seed, 1])
    heights = np.repeat(np.round(rng.uniform(5.0, 16.0, blocks**2), 1), 4)
    # Brick, sandstone, clay, slate and plaster.
    facades = "#b5654e #c8b494 #a88468 #929aa2 #cfc4b0".split()
    shades = np.array([parse_colour(each) for each in facades])
    colours = shades[rng.integers(0, len(shades), blocks**2)]
    return World(
        np.round(plain.segments, 3), plain.objects, heights, f"city {seed}", colours=colours
    )


def office(size: float, seed: int) -> World:
    """An office floor: corridors with rooms on both sides, joined across, desks and shelves."""
    plan = FloorPlan()
    rng = np.random.default_rng(seed)
    pitch = 2.0 * ROOM_DEPTH + CORRIDOR
    across = 0.5 * size - 0.5 * CORRIDOR
    storeys = max(1, round(0.6 * size / pitch))
    top = storeys * pitch
    plan.outer_walls(size, top)
    wings = [(0.0, across), (across + CORRIDOR, size)]
    for storey in range(storeys):
        low = storey * pitch
        for left, right in wings if storey else ():
            plan.wall(left, low, right, low)
        sides = ((low, low + ROOM_DEPTH, 1.0), (low + pitch - ROOM_DEPTH, low + pitch, -1.0))
        for bottom, end, faces in sides:
            crossed = storeys > 1 and not (bottom == 0.0 or end == top)
            for left, right in wings if crossed else [(0.0, size)]:
                _row_of_rooms(plan, rng, (left, bottom, right, end), faces)
    return plan.world(f"office {seed}")


def _row_of_rooms(plan: FloorPlan, rng: np.random.Generator, box: Box, faces: float) -> None:
    """Rooms side by side, whose doors are in their upper (1) or lower (−1) wall."""
    left, bottom, right, top = box
    corridor = top if faces > 0.0 else bottom
    count = max(1, round((right - left) / float(np.mean(ROOM_WIDTHS))))
    shares = rng.uniform(*ROOM_WIDTHS, count)
    edges = left + (right - left) * np.concatenate([[0.0], np.cumsum(shares) / shares.sum()])
    doors = []
    room = 0.5 * DOOR + THICKNESS
    for start, end in pairwise(np.round(edges, 2).tolist()):
        doors.append(float(rng.uniform(start + room, end - room)) - left)
        if end < right:
            plan.wall(end, bottom, end, top)
        _furnish(plan, rng, (start, bottom, end, top), faces)
    plan.wall(left, corridor, right, corridor, *doors)
    for x in (left, right):
        plan.wall(x, bottom, x, top)


def _furnish(plan: FloorPlan, rng: np.random.Generator, room: Box, faces: float) -> None:
    """A desk by the outer wall of a room, and often a shelf along a side."""
    left, bottom, right, top = room
    desk = np.array([min(1.8, right - left - 2.0), 0.8])
    clear = 0.4  # Least distance of a desk from the sides of its room [m].
    x = float(rng.uniform(left + clear, right - clear - desk[0]))
    y = _beside(bottom, top, 0.3, desk[1], faces > 0.0)
    wood = parse_colour("#a8805c")  # The colour of furniture.
    plan.box("desk", np.array([x, y]), desk, 0.75, wood)
    if rng.random() < 0.5:
        shelf = np.array([0.4, 1.6])
        x = _beside(left, right, 0.15, shelf[0], rng.random() < 0.5)
        y = _beside(bottom, top, 1.5, shelf[1], faces > 0.0)
        plan.box("shelf", np.array([x, y]), shelf, 1.9, wood)


def _beside(low: float, high: float, gap: float, size: float, is_low: bool) -> float:
    """The low side [m] of furniture that stands a gap [m] from the low or the high wall."""
    return low + gap if is_low else high - gap - size


def rooms(size: float, seed: int) -> World:
    """A house: a floor, divided into rooms recursively, each wall with a door; pillars."""
    plan = FloorPlan()
    corner = np.array([size, round(0.75 * size, 2)])
    plan.outer_walls(*corner.tolist())
    _divide(plan, np.random.default_rng(seed), np.zeros(2), corner, [])
    return plan.world(f"rooms {seed}")


def _divide(
    plan: FloorPlan,
    rng: np.random.Generator,
    low: Float,
    high: Float,
    doors: list[tuple[int, float, float]],
) -> None:
    """Divide a box from its low to its high corner (2,) [m] by a wall with a door, then its parts.

    No wall ends in front of one of the doors so far: the axes of their walls, the positions of
    these, and those of the doors along them.
    """
    clear = 0.5 * DOOR + 2.0 * THICKNESS
    sides = high - low
    axis = int(np.argmax(sides * rng.uniform(0.8, 1.2, 2)))
    smallest_room = 4.0  # Smallest side of a room of a house [m].
    if sides[axis] < 2.0 * smallest_room:
        axis = 1 - axis
    free = [
        cut
        for cut in np.arange(low[axis] + smallest_room, high[axis] - smallest_room + ROUNDING, 0.1)
        if not any(
            along == axis and at in (low[1 - axis], high[1 - axis]) and abs(cut - door) < clear
            for along, at, door in doors
        )
    ]
    if not free or sides[axis] < float(rng.uniform(2.0, 3.0)) * smallest_room:
        if sides.min() > 1.8 * smallest_room:
            pillar = np.full(2, 0.6)  # Its sides [m].
            corner = np.round(low + 0.5 * sides - 0.5 * pillar, 2)
            plan.box("pillar", corner, pillar, DEFAULT_HEIGHT, parse_colour("#9ea1a6"))
        return
    cut = float(np.round(rng.choice(free), 2))
    start = float(low[1 - axis])
    end = float(high[1 - axis])
    door = float(np.round(rng.uniform(start + clear, end - clear), 2))
    doors.append((1 - axis, cut, door))
    across = np.arange(2) == axis
    first = np.where(across, cut, low)
    last = np.where(across, cut, high)
    plan.wall(*first.tolist(), *last.tolist(), door - start)
    _divide(plan, rng, first, high, doors)
    _divide(plan, rng, low, last, doors)


def generate_city(walls: int, *, seed: int = 0) -> World:
    """A city with a number of walls, nearly square: buildings of four walls, one in each block.

    Its density does not depend on its size, so a laser sees as many walls in cities of any size.
    """
    rng = np.random.default_rng(seed)
    count = walls // 4
    row, column = np.divmod(np.arange(count), city_blocks(walls)[0])
    # The narrowest street is 3 m wide.
    middles = BLOCK_SIDE * np.column_stack([column, row]) + rng.uniform(-2.0, 2.0, (count, 2))
    halves = rng.uniform(4.0, 7.0, (count, 1, 2)) * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    most_turned = 0.3  # Largest angle of a building to the streets [rad].
    turn = rng.uniform(-most_turned, most_turned, count)
    cos = np.cos(turn)[:, None]
    sin = np.sin(turn)[:, None]
    x, y = np.moveaxis(halves, -1, 0)
    corners = middles[:, None] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=2)
    segments = np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)
    return World(segments, np.repeat(np.arange(count), 4), name=f"city of {4 * count:,} walls")


def city_blocks(walls: int) -> tuple[int, int]:
    """Width and height [blocks] of a city with a number of walls; its last row may be shorter."""
    columns = max(1, math.isqrt(max(1, walls // 4) - 1) + 1)
    return columns, -(-(walls // 4) // columns)


def maze(size: float, seed: int) -> World:
    """A maze, a random spanning tree of its cells: there is one path between any two places.

    It is the smallest spanning tree of the grid under random weights (Kruskal 1956).
    """
    count = max(3, int(size / PASSAGE))
    cell = np.arange(count * count).reshape(count, count)
    start = np.append(cell[:, :-1], cell[:-1])
    end = np.append(cell[:, 1:], cell[1:])
    weights = np.random.default_rng(seed).uniform(1.0, 2.0, len(start))
    tree = minimum_spanning_tree(coo_array((weights, (start, end)), shape=(cell.size, cell.size)))
    passages = set(zip(*(ends.tolist() for ends in tree.tocoo().coords), strict=True))
    plan = FloorPlan()
    plan.outer_walls(count * PASSAGE, count * PASSAGE)
    for one, other in sorted(zip(start.tolist(), end.tolist(), strict=True)):
        if (one, other) not in passages:
            x = PASSAGE * (one % count + 1)
            y = PASSAGE * (one // count + 1)
            is_right = other == one + 1
            plan.wall(*((x, y - PASSAGE) if is_right else (x - PASSAGE, y)), x, y)
    return plan.world(f"maze {seed}")


# The function that makes each kind of world from its size [m] and a seed, and the default size.
KINDS: dict[str, tuple[Callable[[float, int], World], float]] = {
    "city": (city, 160.0),
    "maze": (maze, 32.0),
    "office": (office, 40.0),
    "rooms": (rooms, 28.0),
}
