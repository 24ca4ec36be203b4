"""Generated worlds: cities of any number of walls at one density, to measure by."""

import math

import numpy as np

from lrf3d.geometry import Float
from lrf3d.world.model import World

BLOCK = 20.0
"""From the middle of one building to the next [m]."""

SHIFT, HALF, TURN = 2.0, (4.0, 7.0), 0.3
"""How far a building stands off its block's middle at most [m], from what to what half its sides
are long [m], and how far it is turned at most [rad]: the least street is 3 m wide."""

AISLE = 1.5
"""How far a pose at a crossing stands off its middle at most [m]: clear of all buildings."""


def generate_city(walls: int, *, seed: int = 0) -> World:
    """A city of a number of walls, as square as possible: buildings of four walls, one to a block.

    The city grows with its walls and its density stays, so a laser meets as many walls in it
    whatever its size.

    Args:
        walls: How many walls, a multiple of four or rounded down to one.
        seed: The same seed, the same city.
    """
    rng = np.random.default_rng(seed)
    count = walls // 4
    row, column = np.divmod(np.arange(count), city_blocks(walls)[0])
    middles = BLOCK * np.column_stack([column, row]) + rng.uniform(-SHIFT, SHIFT, (count, 2))
    halves = rng.uniform(*HALF, (count, 1, 2)) * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    turn = rng.uniform(-TURN, TURN, count)
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    corners = middles[:, None] + np.stack(
        [cos * halves[..., 0] - sin * halves[..., 1], sin * halves[..., 0] + cos * halves[..., 1]],
        axis=2,
    )
    segments = np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)
    return World(segments, np.repeat(np.arange(count), 4), name=f"city of {4 * count:,} walls")


def city_blocks(walls: int) -> tuple[int, int]:
    """Width and height in blocks of a city of a number of walls; its last row may be shorter."""
    columns = max(1, math.isqrt(max(1, walls // 4) - 1) + 1)
    return columns, -(-(walls // 4) // columns)


def city_crossings(walls: int, count: int, *, seed: int = 0, spread: int | None = None) -> Float:
    """Poses (count, 3) at the crossings of a generated city, at any heading.

    Args:
        walls: How many walls the city was asked to have.
        count: How many poses.
        seed: The same seed, the same poses.
        spread: Only this number of crossings each way around the middle, as on a drive; all of the
            city where not given.
    """
    rng = np.random.default_rng(seed)
    crossings = np.maximum(np.array(city_blocks(walls)) - 1, 1)
    wide = crossings if spread is None else np.minimum(spread, crossings)
    cells = (crossings - wide) // 2 + rng.integers(0, wide, (count, 2))
    places = BLOCK * (cells + 0.5) + rng.uniform(-AISLE, AISLE, (count, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, count)])
