"""Where lasers stand and what they aim at, for batches of beams that are hard to cast."""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from stress.worlds import mixed

QUARTERS = 0.5 * np.pi * np.arange(-4.0, 5.0)
"""Headings [rad] along x and y."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Beams to cast together: one range finder at many poses in one world.

    Args:
        segments: (n, 4) walls [m].
        lrf: The range finder.
        poses: (k, 3) poses.
    """

    segments: Float
    lrf: LaserRangeFinder
    poses: Float


def fan(
    rng: np.random.Generator, beams: int, width: float, range_max: float, range_min: float = 0.0
) -> LaserRangeFinder:
    """A fan of a width [rad]: about straight ahead, from there on, or anywhere."""
    first = rng.choice([-0.5 * width, 0.0, rng.uniform(-4.0, 4.0)])
    return LaserRangeFinder(first, first + width, beams, range_min, range_max)


def aimed(rng: np.random.Generator, lrf: LaserRangeFinder, places: Float, headings: Float) -> Float:
    """Poses (k, 3) at places (k, 2) where some beam of the fan has the heading (k,) [rad]."""
    beam = rng.integers(lrf.beams, size=len(places))
    return np.column_stack([places, headings - lrf.angles[beam]])


def heading(places: Float, targets: Float) -> Float:
    """Headings (k,) [rad] from places to targets (k, 2), rounded to a float64."""
    away = targets - places
    return np.arctan2(away[:, 1], away[:, 0])


def some(rng: np.random.Generator, walls: Float, count: int) -> Float:
    """So many of the walls, any of them more than once."""
    return walls[rng.integers(len(walls), size=count)]


def corners(rng: np.random.Generator, walls: Float, count: int) -> Float:
    """So many ends (count, 2) of walls."""
    return some(rng, walls.reshape(-1, 2), count)


def points_on(rng: np.random.Generator, walls: Float, low: float, high: float) -> Float:
    """A point (n, 2) on the line of each wall, from `low` to `high` of the way, rounded."""
    share = rng.uniform(low, high, (len(walls), 1))
    points: Float = walls[:, :2] + share * (walls[:, 2:] - walls[:, :2])
    return points


def along(rng: np.random.Generator, walls: Float) -> Float:
    """The heading (n,) of each wall [rad], or the opposite one."""
    away = walls[:, 2:] - walls[:, :2]
    headings: Float = np.arctan2(away[:, 1], away[:, 0]) + rng.choice([0.0, np.pi], len(walls))
    return headings


def crossings(rng: np.random.Generator, walls: Float, count: int) -> Float:
    """Where lines of two walls cross (count, 2), rounded; corners where they are parallel."""
    one, two = some(rng, walls, count), some(rng, walls, count)
    e, f, gap = one[:, 2:] - one[:, :2], two[:, 2:] - two[:, :2], two[:, :2] - one[:, :2]
    across = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (gap[:, 0] * f[:, 1] - gap[:, 1] * f[:, 0]) / across
    return one[:, :2] + np.where(np.abs(share) < 10.0, share, 0.0)[:, None] * e


def anywhere(rng: np.random.Generator, walls: Float, count: int) -> Float:
    """Places (count, 2) all over the world, seldom outside."""
    ends = walls.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    return rng.uniform(low - 0.05 * (high - low), high + 0.05 * (high - low), (count, 2))


def all_sorts(rng: np.random.Generator, walls: Float, count: int) -> Float:
    """Places (count, 2): anywhere, on walls, on corners, on lines, on whole metres, a hair off."""
    chosen = some(rng, walls, count)
    free = anywhere(rng, walls, count)
    on_line = points_on(rng, chosen, -1.0, 2.0)
    spread = np.abs(walls - np.tile(walls.reshape(-1, 2).mean(axis=0), 2)).max()
    hair = spread * 10.0 ** rng.uniform(-16, -3, (count, 1)) * rng.normal(size=(count, 2))
    level = np.column_stack([free[:, 0], chosen[:, 1]])
    choices = (free, free, chosen[:, :2], on_line, on_line + hair, np.round(free), level)
    return mixed(rng, *choices)


def all_ways(rng: np.random.Generator, walls: Float, places: Float) -> Float:
    """Headings (k,) at corners, within 1e-15 to 1e-3 rad, along walls, square, and anywhere."""
    count = len(places)
    chosen = some(rng, walls, count)
    at = heading(places, chosen[:, :2])
    near = at + rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-15.5, -3, count)
    square = rng.choice(QUARTERS, count)
    return mixed(rng, at, near, along(rng, chosen), square, rng.uniform(-10, 10, count))
