"""Small worlds that are hard for ray casting: segments (n, 4) within about 10 m of the origin."""

from collections.abc import Callable

import numpy as np

from lrf3d.geometry import Float

WorldMaker = Callable[[np.random.Generator, int], Float]
"""Makes a world of about four times a number of walls."""


def boxes(rng: np.random.Generator, count: int) -> Float:
    """Rectangles at any angle: walls that share corners."""
    return _rectangles(rng, 10.0, rng.uniform(0.3, 2.0, (count, 1, 2)))


def posts(rng: np.random.Generator, count: int, width: float) -> Float:
    """Posts of about a width at any angle in a room of four walls."""
    room = 12.0 * np.array([[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]])
    half = 0.5 * width * rng.uniform(1.0, 1.2, (count, 1, 2))
    return np.concatenate([_closed(room), _rectangles(rng, 11.0, half)])


def blocks(rng: np.random.Generator, count: int) -> Float:
    """Rectangles on whole metres: walls that double, overlap and line up with the laser."""
    low = rng.integers(-8, 8, (count, 1, 2)).astype(np.float64)
    size = rng.integers(1, 4, (count, 1, 2))
    return _closed(low + size * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))


def crossing(rng: np.random.Generator, count: int) -> Float:
    """Walls in any place that cross each other."""
    return rng.uniform(-10, 10, (4 * count, 4))


def alike(rng: np.random.Generator, count: int) -> Float:
    """Each wall twice, the same."""
    return _shuffled(rng, np.tile(crossing(rng, count)[: 2 * count], (2, 1)))


def turned_round(rng: np.random.Generator, count: int) -> Float:
    """Each wall twice, once from its other end."""
    walls = crossing(rng, count)[: 2 * count]
    return _shuffled(rng, np.concatenate([walls, walls[:, [2, 3, 0, 1]]]))


def partly_doubled(rng: np.random.Generator, count: int) -> Float:
    """Each wall with a part of it as another; some on whole metres, where that is exact."""
    walls = crossing(rng, count)[: 2 * count]
    whole = rng.random(len(walls)) < 0.5
    walls[whole] = np.round(walls[whole])
    middle = 0.5 * (walls[:, :2] + walls[:, 2:])
    return _shuffled(rng, np.concatenate([walls, np.column_stack([middle, walls[:, 2:]])]))


def a_hair_apart(rng: np.random.Generator, count: int) -> Float:
    """Each wall with another 1e-16 to 1e-6 m beside it, hardly turned."""
    walls = crossing(rng, count)[: 2 * count]
    hair = 10.0 ** rng.uniform(-16, -6, (len(walls), 1)) * rng.normal(size=walls.shape)
    return _shuffled(rng, np.concatenate([walls, walls + hair]))


def slivers(rng: np.random.Generator, count: int) -> Float:
    """Walls of 1e-9 m, and behind them longer ones: the first half are the slivers."""
    small = rng.uniform(-5, 5, (2 * count, 2))
    tiny = np.column_stack([small, small + 1e-9 * rng.normal(size=small.shape)])
    return np.concatenate([tiny, crossing(rng, count)[: 2 * count]])


def star(rng: np.random.Generator, count: int) -> Float:
    """Walls with one end in common, and walls that only just miss that point."""
    ends = rng.uniform(-10, 10, (4 * count, 2))
    apart = np.where(rng.random((4 * count, 1)) < 0.5, 0.0, 1e-12)
    return np.column_stack([np.array([1.0, 2.0]) + apart * ends, ends])


def room_of_corners(rng: np.random.Generator, count: int) -> Float:
    """A regular room around the origin with 4 · count corners, 1 to 9 m away."""
    corners = 4 * count
    angle = 2.0 * np.pi * np.arange(corners) / corners
    ring = rng.uniform(1, 9) * np.column_stack([np.cos(angle), np.sin(angle)])
    return _closed(ring[None])


def short(rng: np.random.Generator, walls: Float, count: int) -> Float:
    """Walls of one ulp of their coordinates up to all of the world, at and between its walls.

    They begin at ends of the walls, on whole metres, and at all distances from the middle of the
    walls and from the origin.
    """
    ends = walls.reshape(-1, 2)
    middle = ends.mean(axis=0)
    size = np.abs(ends - middle).max()
    away = size * 10.0 ** rng.uniform(-16.0, 0.0, (count, 1)) * rng.normal(size=(count, 2))
    at_end = ends[rng.integers(len(ends), size=count)]
    whole = np.round(middle + away) + rng.integers(1, 3, (count, 2))
    return stretched(rng, mixed(rng, at_end, middle + away, away, whole), size)


def far_away(rng: np.random.Generator, walls: Float) -> Float:
    """The walls and one more, up to 1e6 times as far as they reach: their middle is far off."""
    size = np.abs(walls - np.tile(walls[0, :2], 2)).max()
    turn = rng.uniform(-np.pi, np.pi)
    away = size * 10.0 ** rng.uniform(0.0, 6.0) * np.array([np.cos(turn), np.sin(turn)])
    one = walls[0] + np.tile(away, 2) + size * rng.uniform(-1.0, 1.0, 4)
    return np.concatenate([walls, one[None]])


def of_all_sizes(rng: np.random.Generator, count: int, least: float, most: float) -> Float:
    """Walls whose lengths and distances from the origin spread over all powers of ten [m]."""
    low, high = np.log10(least), np.log10(most)
    turn = rng.uniform(-np.pi, np.pi, 4 * count)
    unit = np.column_stack([np.cos(turn), np.sin(turn)])
    unit[rng.random(unit.shape) < 0.1] = 0.0
    begin = 10.0 ** rng.uniform(low, high, (4 * count, 1)) * unit
    level = rng.random((4 * count, 2)) < 0.2
    begin = np.where(level, begin[rng.permutation(4 * count)], begin)
    length = 10.0 ** rng.uniform(low, high, (4 * count, 1))
    way = rng.normal(size=begin.shape) * (rng.random(begin.shape) < 0.8)
    walls = np.column_stack([begin, begin + length * way])
    few = stretched(rng, begin[: count + 1], 1e-9, 1e8 * least)
    walls = np.concatenate([walls, few])
    return _shuffled(rng, walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)])


def stretched(rng: np.random.Generator, begin: Float, size: float, least: float = 1e-28) -> Float:
    """A wall from each of the points (n, 2), of one ulp of its coordinates up to a size [m].

    Half of them are of a few ulps; a third are level or upright. Coordinates below `least` [m] have
    its ulp.
    """
    ulp = np.spacing(np.maximum(np.abs(begin), least))
    most = np.clip(np.log2(size) - np.log2(ulp), 2.0, 60.0)
    few = rng.random(begin.shape) < 0.5
    steps = np.round(2.0 ** rng.uniform(0.0, np.where(few, 2.0, most)))
    steps *= rng.choice([-1.0, 1.0], begin.shape)
    level = rng.random(len(begin)) < 1.0 / 3.0
    steps[level, rng.integers(2, size=np.count_nonzero(level))] = 0.0
    walls = np.column_stack([begin, begin + steps * ulp])
    kept: Float = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    return kept


def any_world(rng: np.random.Generator, count: int) -> Float:
    """A world of one of the kinds above."""
    kinds: tuple[WorldMaker, ...] = (
        boxes, blocks, crossing, alike, turned_round, partly_doubled, a_hair_apart, slivers, star,
        room_of_corners,
    )  # fmt: skip
    return kinds[rng.integers(len(kinds))](rng, count)


def placed(segments: Float, scale: float, offset: Float) -> Float:
    """The segments scaled, then moved by the offset (2,); what shrinks to a point is left out."""
    walls = segments * scale + np.tile(offset, 2)
    return walls[np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]) > 0.0]


def _closed(corners: Float) -> Float:
    """Walls around each ring of corners (rings, corners, 2)."""
    return np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)


def _rectangles(rng: np.random.Generator, reach: float, half: Float) -> Float:
    """Rectangles of half sizes (count, 1, 2), in the middle and at any angle."""
    count = len(half)
    middle = rng.uniform(-reach, reach, (count, 1, 2))
    angle = rng.uniform(0, np.pi, count)
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return _closed(middle + np.einsum("jkn,nik->nij", turn, corners))


def mixed(rng: np.random.Generator, *choices: Float) -> Float:
    """Row for row one of the choices."""
    pick = rng.integers(len(choices), size=len(choices[0]))
    return np.asarray(np.stack(choices)[pick, np.arange(len(pick))])


def _shuffled(rng: np.random.Generator, walls: Float) -> Float:
    return walls[rng.permutation(len(walls))]
