"""Kinds of beams that are hard to cast, each as a function that makes a batch of about so many.

Where nothing else is said a world stands at the origin, a kilometre or a thousand kilometres away,
and is measured in millimetres, metres or kilometres.
"""

from functools import cache

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from stress import aims, worlds
from stress.aims import Batch

FAR = 1e7
"""Sizes of walls and distances [m] go up to this."""

RATIONAL_SHARE, EXACT_SHARE, RATIONAL_BEAMS = 0.5, 0.7, 100
"""How many of the worlds of all sizes have numbers that only rationals cast, how many of these and
of those with short walls have beams exactly through the ends of walls, and how many beams at most
are cast in such a world: each takes as long as hundreds of others."""

SHORT_SHARE = 0.25
"""How many of the worlds have short walls among the others."""

REACH = 1e3
"""Range of the range finders in a world of 20 m: all of it, and room beyond."""

MOST = 16
"""Worlds have up to four times this number of walls; casters make a tree of 25 or more."""

FANS = (
    (1, 0.0), (2, 0.0), (3, 1e-10), (9, 1e-6), (7, 1e-3), (37, 0.5 * np.pi), (19, np.pi),
    (61, np.pi), (13, 2.0 * np.pi), (181, 2.0 * np.pi), (25, 7.0), (33, 15.0), (5, 3.0),
)  # fmt: skip
"""Beams and width [rad] of ordinary and odd fans; some go round more than once."""

LEAST = 1e-30
"""Coordinates [m] below which none but 0 are tried: products of smaller ones could underflow."""

SETTINGS = ((1.0, 0.0), (1.0, 0.0), (1.0, 1e3), (1.0, 1e6), (1e-3, 0.0), (1e3, 1e6))
"""Scales and offsets [m]."""


def mixture(
    rng: np.random.Generator, beams: int, *, scale: float = 1.0, offset: float = 0.0
) -> Batch:
    """Any world, seen from anywhere in any way."""
    walls = _world(rng, worlds.any_world, scale, offset)
    lrf = aims.fan(rng, *FANS[rng.integers(len(FANS))], REACH * scale)
    places = aims.all_sorts(rng, walls, _poses(beams, lrf.beams))
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, aims.all_ways(rng, walls, places)))


def at_corners(rng: np.random.Generator, beams: int) -> Batch:
    """Beams aimed at corners to the last bit, a third of them exactly through one."""
    return (_rounded_to_corners, _level_with_corners, _corners_on_beams)[rng.integers(3)](
        rng, beams
    )


def _rounded_to_corners(rng: np.random.Generator, beams: int) -> Batch:
    """From the middle of a regular room, each beam at a corner."""
    count = int(rng.integers(1, MOST + 1))
    scale, offset = SETTINGS[rng.integers(len(SETTINGS))]
    walls = worlds.placed(worlds.room_of_corners(rng, count), scale, np.full(2, offset))
    lrf = aims.fan(rng, 4 * count + 1, 2.0 * np.pi, REACH * scale)
    poses = _poses(beams, lrf.beams)
    middle = np.full((poses, 2), offset) + np.where(
        rng.random((poses, 1)) < 0.5, 0.0, 1e-16 * scale * rng.normal(size=(poses, 2))
    )
    return Batch(walls, lrf, aims.aimed(rng, lrf, middle, np.zeros(poses)))


def _level_with_corners(rng: np.random.Generator, beams: int) -> Batch:
    """From places level with a corner a beam along x, which goes through it exactly."""
    walls, scale = _some_world(rng)
    lrf = LaserRangeFinder(0.0, 0.0, 1, 0.0, REACH * scale)
    corners = aims.corners(rng, walls, beams)
    away = scale * rng.uniform(-1.0, 15.0, beams)
    return Batch(
        walls, lrf, np.column_stack([corners[:, 0] - away, corners[:, 1], np.zeros(beams)])
    )


def _corners_on_beams(rng: np.random.Generator, beams: int) -> Batch:
    """From the origin at walls with corners at powers of two along the beams: all exact."""
    lrf = aims.fan(rng, 7, rng.uniform(0.1, 6.0), REACH)
    theta = rng.uniform(-4.0, 4.0, 2)
    through = np.concatenate([lrf.directions((0.0, 0.0, turn)) for turn in theta])
    corners = 2.0 ** rng.integers(-2, 4, (3, len(through), 1)) * through
    ends = corners.reshape(-1, 2)
    others = np.where(rng.random((len(ends), 1)) < 0.3, ends[::-1], rng.uniform(-9, 9, ends.shape))
    walls = worlds.placed(np.column_stack([ends, others]), 1.0, np.zeros(2))
    poses = _poses(beams, lrf.beams)
    return Batch(
        walls[rng.permutation(len(walls))],
        lrf,
        np.column_stack([np.zeros((poses, 2)), rng.choice(theta, poses)]),
    )


def by_corners(rng: np.random.Generator, beams: int, *, low: float, high: float) -> Batch:
    """Narrow fans about corners, all beams within `low` to `high` [rad]."""
    walls, scale = _some_world(rng)
    width = 2.0 * 10.0 ** rng.uniform(np.log10(low), np.log10(high))
    lrf = LaserRangeFinder(-0.5 * width, 0.5 * width, 12, 0.0, REACH * scale)
    places = aims.anywhere(rng, walls, _poses(beams, lrf.beams))
    headings = aims.heading(places, aims.corners(rng, walls, len(places)))
    return Batch(walls, lrf, np.column_stack([places, headings]))


def grazing(rng: np.random.Generator, beams: int) -> Batch:
    """Beams that meet a wall under an angle of 1e-12 to 1e-2 rad."""
    walls, scale = _some_world(rng)
    angle = 10.0 ** rng.uniform(-12, -2)
    lrf = aims.fan(rng, 5, angle, REACH * scale)
    chosen = aims.some(rng, walls, _poses(beams, lrf.beams))
    target = aims.points_on(rng, chosen, 0.0, 1.0)
    away = aims.along(rng, chosen) + angle * rng.uniform(0.5, 2.0, len(chosen))
    distance = scale * rng.uniform(0.1, 10.0, (len(chosen), 1))
    places = target - distance * np.column_stack([np.cos(away), np.sin(away)])
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, aims.heading(places, target)))


def along_walls(rng: np.random.Generator, beams: int) -> Batch:
    """Beams along walls: to the last bit, or exactly where walls and beams are level."""
    if rng.random() < 0.5:
        walls, scale = _some_world(rng)
        lrf = aims.fan(rng, 3, rng.choice([0.0, 1e-15, 1e-12]), REACH * scale)
        chosen = aims.some(rng, walls, _poses(beams, lrf.beams))
        places = aims.points_on(rng, chosen, -2.0, 3.0)
        return Batch(walls, lrf, aims.aimed(rng, lrf, places, aims.along(rng, chosen)))
    walls = worlds.blocks(rng, int(rng.integers(1, MOST + 1)))
    lrf = LaserRangeFinder(0.0, 0.0, 1, 0.0, REACH)
    places = np.column_stack([rng.uniform(-10, 10, beams), aims.corners(rng, walls, beams)[:, 1]])
    return Batch(walls, lrf, np.column_stack([places, np.zeros(beams)]))


def at_slivers(rng: np.random.Generator, beams: int) -> Batch:
    """Fans about walls of 1e-9 m, as wide as these are seen and up to 1000 times wider."""
    count = int(rng.integers(1, MOST + 1))
    offset = rng.choice([0.0, 0.0, 1e3, 1e5])
    walls = worlds.placed(worlds.slivers(rng, count), 1.0, np.full(2, offset))
    width = 10.0 ** rng.uniform(-10, -6)
    lrf = LaserRangeFinder(-0.5 * width, 0.5 * width, 9, 0.0, REACH)
    places = aims.anywhere(rng, walls, _poses(beams, lrf.beams))
    targets = aims.some(rng, walls[: 2 * count], len(places))[:, :2]
    return Batch(walls, lrf, np.column_stack([places, aims.heading(places, targets)]))


def at_short_walls(rng: np.random.Generator, beams: int) -> Batch:
    """Beams at walls of one ulp and more: through their ends, along them and past them."""
    if rng.random() < 1.0 - EXACT_SHARE:
        return _by_short_walls(rng, beams)
    make = (_short_on_beams, _level_with_short_walls)[rng.integers(2)]
    return make(rng, min(beams, RATIONAL_BEAMS))


def _by_short_walls(rng: np.random.Generator, beams: int) -> Batch:
    """Any fan at short walls among others."""
    walls, few, scale = _with_short_walls(rng)
    lrf = aims.fan(rng, *FANS[rng.integers(len(FANS))], REACH * scale)
    places = aims.all_sorts(rng, walls, _poses(beams, lrf.beams))
    headings = aims.all_ways(rng, few, places)
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, headings))


def _level_with_short_walls(rng: np.random.Generator, beams: int) -> Batch:
    """Single beams along x through ends of short walls exactly, and along those that are level."""
    walls, few, scale = _with_short_walls(rng)
    lrf = LaserRangeFinder(0.0, 0.0, 1, 0.0, REACH * scale)
    targets = aims.corners(rng, few, beams)
    away = scale * 10.0 ** rng.uniform(-12.0, 1.5, beams)
    places = np.column_stack([targets[:, 0] - away, targets[:, 1]])
    return Batch(walls, lrf, np.column_stack([places, np.zeros(beams)]))


def _short_on_beams(rng: np.random.Generator, beams: int) -> Batch:
    """From the origin at short walls that begin on a beam exactly, in a world far from there."""
    lrf = aims.fan(rng, 7, rng.uniform(0.0, 6.0), FAR)
    theta = rng.uniform(-4.0, 4.0)
    through = lrf.directions((0.0, 0.0, theta))
    begin = 2.0 ** rng.integers(-30, 24, (len(through), 1)) * through
    walls, _ = _some_world(rng)
    walls = worlds.far_away(rng, walls) if rng.random() < 0.5 else walls
    walls = np.concatenate([worlds.stretched(rng, begin, rng.choice([1e-9, 10.0])), walls])
    # Every beam of this heading is the same: each world is another try.
    return Batch(walls[rng.permutation(len(walls))], lrf, np.array([[0.0, 0.0, theta]]))


def _with_short_walls(rng: np.random.Generator) -> tuple[Float, Float, float]:
    """A world with short walls among the others, those walls, and its scale."""
    walls, scale = _some_world(rng)
    return *_and_short_walls(rng, walls), scale


def _and_short_walls(rng: np.random.Generator, walls: Float) -> tuple[Float, Float]:
    """Walls with short ones among them, half of the time one far away, and the short ones."""
    few = worlds.short(rng, walls, int(rng.integers(1, MOST + 1)))
    walls = np.concatenate([few, walls])
    if rng.random() < 0.5:
        walls = worlds.far_away(rng, walls)
    return walls[rng.permutation(len(walls))], few


def of_all_sizes(rng: np.random.Generator, beams: int) -> Batch:
    """Beams among walls of 1e-36 m or of the least float64 up to 1e7 m, from places as spread.

    A part has numbers that compiled casting does not take, of which rationals cast every beam.
    """
    tiniest = rng.random() < RATIONAL_SHARE
    least = 5e-324 if tiniest else 1e-36
    beams = min(beams, RATIONAL_BEAMS) if tiniest else beams
    walls = worlds.of_all_sizes(rng, int(rng.integers(1, 2 if tiniest else MOST // 4)), least, FAR)
    far = FAR * rng.choice([10.0, 10.0, 1e3, 1e301])
    if rng.random() < EXACT_SHARE:
        # Single beams along x through ends of walls exactly.
        lrf = LaserRangeFinder(0.0, 0.0, 1, 0.0, far)
        targets = aims.corners(rng, walls, min(beams, RATIONAL_BEAMS))
        away = 10.0 ** rng.uniform(np.log10(least), np.log10(FAR), len(targets))
        level = np.column_stack([targets[:, 0] - away, targets[:, 1], np.zeros(len(targets))])
        return Batch(walls, lrf, level)
    lrf = aims.fan(rng, *FANS[rng.integers(9)], far)
    count = _poses(beams, lrf.beams)
    chosen = aims.some(rng, walls, count)
    turn = rng.uniform(-np.pi, np.pi, count)
    size = 10.0 ** rng.uniform(np.log10(least), np.log10(FAR), (count, 1))
    free = size * np.column_stack([np.cos(turn), np.sin(turn)])
    beside = chosen[:, :2] + size * rng.normal(size=free.shape)
    along = chosen[:, :2] + rng.choice([-3.0, -0.5, 0.5, 2.0]) * (chosen[:, 2:] - chosen[:, :2])
    on_wall = worlds.mixed(rng, chosen[:, :2], along, np.zeros((count, 2)))
    places = worlds.mixed(rng, free, free, beside, beside, on_wall)
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, aims.all_ways(rng, walls, places)))


def at_crossings(rng: np.random.Generator, beams: int) -> Batch:
    """Narrow and wide fans about the points where walls cross."""
    walls, scale = _some_world(rng, worlds.crossing)
    lrf = aims.fan(rng, 9, rng.choice([0.0, 1e-15, 1e-12, 1e-9, 1e-4, 2.0]), REACH * scale)
    places = aims.anywhere(rng, walls, _poses(beams, lrf.beams))
    headings = aims.heading(places, aims.crossings(rng, walls, len(places)))
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, headings))


def at_doubles(rng: np.random.Generator, beams: int, *, make: worlds.WorldMaker) -> Batch:
    """Fans at walls that stand twice."""
    walls, scale = _some_world(rng, make)
    lrf = aims.fan(rng, 19, rng.choice([1e-12, 1e-6, 1.0, 2.0 * np.pi]), REACH * scale)
    places = aims.anywhere(rng, walls, _poses(beams, lrf.beams))
    targets = aims.points_on(rng, aims.some(rng, walls, len(places)), 0.0, 1.0)
    headings = aims.heading(places, targets)
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, headings))


def from_walls(rng: np.random.Generator, beams: int) -> Batch:
    """Poses on walls: exactly on level and upright ones, else to the last bit."""
    walls, scale = _some_world(rng, (worlds.blocks, worlds.any_world)[rng.integers(2)])
    lrf = aims.fan(rng, *FANS[rng.integers(len(FANS))], REACH * scale)
    places = aims.points_on(rng, aims.some(rng, walls, _poses(beams, lrf.beams)), 0.0, 1.0)
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, aims.all_ways(rng, walls, places)))


def from_corners(rng: np.random.Generator, beams: int) -> Batch:
    """Poses on ends of walls, and a few of the smallest floats beside them."""
    walls, scale = _some_world(rng)
    lrf = aims.fan(rng, *FANS[rng.integers(len(FANS))], REACH * scale)
    places = aims.corners(rng, walls, _poses(beams, lrf.beams))
    step = np.spacing(np.maximum(np.abs(places), LEAST))
    beside = places + rng.integers(-2, 3, places.shape) * step
    places = np.where(rng.random((len(places), 1)) < 0.5, places, beside)
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, aims.all_ways(rng, walls, places)))


def on_limits(rng: np.random.Generator, beams: int) -> Batch:
    """Beams whose range is that of range_min or range_max, exactly or to a few ulps."""
    walls, scale = _some_world(rng, (worlds.blocks, worlds.any_world)[rng.integers(2)])
    limit = scale * rng.choice([float(rng.integers(1, 6)), rng.uniform(0.1, 5.0)])
    low, high = ((0.0, limit), (limit, REACH * scale))[rng.integers(2)]
    lrf = aims.fan(rng, 3, rng.choice([0.0, 1e-15, 1e-12]), high, low)
    target = aims.points_on(rng, aims.some(rng, walls, _poses(beams, lrf.beams)), 0.0, 1.0)
    # Straight along x or y the place is as exact as can be.
    count = len(target)
    free, square = rng.uniform(-4, 4, count), rng.choice(aims.QUARTERS, count)
    away = worlds.mixed(rng, free, np.zeros(count), square)
    places = target - limit * np.column_stack([np.cos(away), np.sin(away)])
    return Batch(walls, lrf, aims.aimed(rng, lrf, places, away))


def by_posts(rng: np.random.Generator, beams: int) -> Batch:
    """Fans in a room with posts about as wide as the gap between beams some way apart."""
    scale, offset = SETTINGS[rng.integers(len(SETTINGS))]
    width = rng.uniform(0.5, 2.0) * np.pi
    lrf = aims.fan(rng, int(rng.integers(45, 721)), width, scale * rng.uniform(10.0, 40.0))
    gap = rng.choice([4, 8]) * width / (lrf.beams - 1)
    size = rng.uniform(0.3, 1.5) * gap * lrf.range_max / scale
    walls = worlds.posts(rng, int(rng.integers(1, 4 * MOST)), size)
    walls = worlds.placed(walls, scale, np.full(2, offset))
    places = aims.anywhere(rng, walls, _poses(beams, lrf.beams))
    return Batch(walls, lrf, np.column_stack([places, rng.uniform(-np.pi, np.pi, len(places))]))


def in_a_city(rng: np.random.Generator, beams: int) -> Batch:
    """Ordinary fans at any place of a city of streets and blocks."""
    walls = _city()
    lrf = LaserRangeFinder()
    places = aims.anywhere(rng, walls, _poses(beams, lrf.beams))
    return Batch(walls, lrf, np.column_stack([places, rng.uniform(-np.pi, np.pi, len(places))]))


@cache
def _city() -> Float:
    from lrf3d.world import load_world

    return load_world("city").segments


def _some_world(
    rng: np.random.Generator, make: worlds.WorldMaker = worlds.any_world
) -> tuple[Float, float]:
    """A world at one of the scales and offsets, and the scale."""
    scale, offset = SETTINGS[rng.integers(len(SETTINGS))]
    return _world(rng, make, scale, offset), scale


def _world(rng: np.random.Generator, make: worlds.WorldMaker, scale: float, offset: float) -> Float:
    """A world at a scale, moved along x, y or both."""
    move = offset * np.array([(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])[rng.integers(3)]
    while True:
        walls = worlds.placed(make(rng, int(rng.integers(1, MOST + 1))), scale, move)
        if len(walls) and rng.random() < SHORT_SHARE:
            walls = _and_short_walls(rng, walls)[0]
        if len(walls):
            return walls


def _poses(beams: int, each: int) -> int:
    """The number of poses with some beams each that gives about a number of beams."""
    return -(-beams // each)
