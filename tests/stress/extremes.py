"""The cases of degenerate and enormous worlds: no wall, one, a million; all on one line.

Each is cast at with both casters, against the certificate's error bounds; mapped; planned in; and
extruded. An error that lrf3d raises on purpose is an answer, such as that there is no room.
"""

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.mapping.mapper import MODES
from lrf3d.robot.collision import find_collision
from lrf3d.robot.following import follow_route
from lrf3d.robot.planner import plan_route
from lrf3d.world import World
from lrf3d.world.extrude import extrude
from lrf3d.world.generators import generate_city
from stress.cases import Case, check
from stress.casting import PLANAR_ULP
from stress.certificate import directions
from stress.certify import UNDECIDED, certify

MANY = 1_000_000
"""Walls of enormous worlds."""

LRF = LaserRangeFinder(-np.pi, np.pi * (1.0 - 2.0 / 45), 45)
"""The range finder: few beams all around, for each is certified against every wall."""

RADIUS = 0.35
"""Radius of the robot that is planned for [m]."""


def _none(rng: np.random.Generator) -> Float:
    return np.empty((0, 4))


def _one(rng: np.random.Generator) -> Float:
    return rng.uniform(-20.0, 20.0, (1, 4))


def _collinear(rng: np.random.Generator, count: int) -> Float:
    """Walls on one line of 200 m, which overlap, touch and leave gaps."""
    place = np.sort(rng.uniform(-100.0, 100.0, (count, 2)), axis=1)
    place[:, 1] = place[:, 0] + np.minimum(place[:, 1] - place[:, 0], 200.0 / count) + 1e-3
    turn = rng.choice([0.0, rng.uniform(-np.pi, np.pi)])
    unit = np.array([np.cos(turn), np.sin(turn)])
    return np.asarray(np.column_stack([place[:, :1] * unit, place[:, 1:] * unit]))


def _star(rng: np.random.Generator, count: int) -> Float:
    """Walls through one point, in all directions."""
    turn = np.pi * (np.arange(count) + rng.random()) / count
    half = rng.uniform(2.0, 15.0, (count, 1)) * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.column_stack([-half, half])


def _enormous(rng: np.random.Generator) -> Float:
    return _city()


@cache
def _city() -> Float:
    return generate_city(MANY).segments


KINDS: dict[str, tuple[Callable[[np.random.Generator], Float], bool]] = {
    "no wall": (_none, False),
    "one wall": (_one, False),
    "100 walls on one line": (partial(_collinear, count=100), False),
    "100 walls through one point": (partial(_star, count=100), False),
    "1,000,000 walls": (_enormous, True),
    "1,000,000 on one line": (partial(_collinear, count=MANY), True),
    "1,000,000 through one point": (partial(_star, count=MANY), True),
}
"""Worlds, and whether they are enormous."""

CROWDED: dict[str, Callable[[np.random.Generator], Float]] = {
    "10,000 on one line": partial(_collinear, count=10_000),
    "10,000 through one point": partial(_star, count=10_000),
}
"""Worlds that are planned in instead of those where a million walls stand within one view: a
planner that weighs what each place sees takes minutes there."""


def cast(make: Callable[[np.random.Generator], Float], rng: np.random.Generator) -> Float:
    """Ranges of both casters where bounds are certain, in ulp; a wrong wall is infinitely off."""
    world = World(make(rng))
    poses = _poses(rng, world, 2 if len(world.segments) == MANY else 20)
    shape = len(poses), LRF.beams
    walls = np.empty(shape, dtype=np.int64)
    ranges, rest, slack = (np.empty(shape) for _ in range(3))
    limits = LRF.range_min, LRF.range_max
    beams = directions(LRF, poses)
    places = np.ascontiguousarray(poses[:, :2])
    certify(world.segments, places, beams, limits, walls, ranges, rest, slack)
    known, hits = walls != UNDECIDED, walls >= 0
    errors = np.zeros(shape)
    for caster in (PlanarCaster(world), EmbreeCaster(world)):
        found, named = caster.scan_batch(LRF, poses)
        with np.errstate(invalid="ignore"):
            off = np.abs((found - ranges) - rest) + slack
        off = np.where(hits, off / np.spacing(np.where(hits, ranges, 1.0)), found != ranges)
        wrong = (named != walls) | (~hits & (found != ranges))
        errors = np.maximum(errors, np.where(known, np.where(wrong, np.inf, off), 0.0))
    return np.asarray(errors[known], dtype=np.float64)


def mapped(make: Callable[[np.random.Generator], Float], rng: np.random.Generator) -> Float:
    """Maps in both modes: finite, and with no more segments than there were beams."""
    world = World(make(rng))
    caster, noise = PlanarCaster(world), ProportionalNoise(0.04)
    mappers = [LineMapper(mode) for mode in MODES]
    for pose in _poses(rng, world, 5):
        scan = noise(caster.cast(LRF, pose), rng)
        for mapper in mappers:
            mapper.update(scan)
    maps = [mapper.map for mapper in mappers]
    right = all(
        np.isfinite(one.segments).all() and np.isfinite(one.lines).all() and len(one) <= 5 * 45
        for one in maps
    )
    return np.array([0.0 if right else np.inf])


def planned(make: Callable[[np.random.Generator], Float], rng: np.random.Generator) -> Float:
    """A route that a robot can follow without a collision, or the word that there is none."""
    world = World(make(rng))
    try:
        route = plan_route(world, radius=RADIUS)
    except InputError:
        return np.zeros(1)
    drive = follow_route(route, speed=3.0, lookahead=1.0, dt=0.1)
    met = find_collision(drive, world, RADIUS)
    return np.array([0.0 if met is None and np.isfinite(route).all() else np.inf])


def extruded(make: Callable[[np.random.Generator], Float], rng: np.random.Generator) -> Float:
    """Meshes: two triangles a wall, as large as the wall, to float64's rounding."""
    world = World(make(rng))
    mesh = extrude(world)
    count = len(world.segments)
    if mesh.faces.shape != (2 * count, 3):
        return np.array([np.inf])
    if not count:
        return np.zeros(1)
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.sqrt((sides**2).sum(axis=1)).reshape(count, 2).sum(axis=1)
    true = np.hypot(*(world.segments[:, 2:] - world.segments[:, :2]).T) * world.heights
    size = np.spacing(np.abs(world.segments).max()) * world.heights
    return np.array([np.abs(areas - true).max() / size.max()])


def _poses(rng: np.random.Generator, world: World, count: int) -> Float:
    """Poses about the middle of a world, 50 m around at most."""
    ends = world.segments.reshape(-1, 2)
    middle = ends.mean(axis=0) if len(ends) else np.zeros(2)
    size = min(50.0, float(np.abs(ends - middle).max(initial=1.0)))
    places = middle + rng.uniform(-size, size, (count, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, count)])


def _cases() -> tuple[Case, ...]:
    found = []
    for name, (make, huge) in KINDS.items():
        once = 1 if huge else 10
        found += [
            check("worlds", f"{name}: cast at", partial(cast, make), bound=PLANAR_ULP,
                  unit="ulp of the range", tries=50 if huge else 20_000,
                  each=50 if huge else 5_000, heavy=huge),
            check("worlds", f"{name}: mapped", partial(mapped, make), bound=0.0,
                  unit="maps that are none", tries=once, heavy=huge),
            check("worlds", f"{name}: extruded", partial(extruded, make), bound=8.0,
                  unit="ulp of the coordinates", tries=once, heavy=huge),
        ]  # fmt: skip
    places = {name: (make, True) for name, make in CROWDED.items()} | {
        name: (make, huge) for name, (make, huge) in KINDS.items() if not huge or make is _enormous
    }
    for name, (make, huge) in places.items():
        found.append(
            check("worlds", f"{name}: planned in", partial(planned, make), bound=0.0,
                  unit="routes into walls", tries=1 if huge else 4, each=1, heavy=huge)
        )  # fmt: skip
    return tuple(found)


EXTREMES = _cases()
"""The cases of degenerate and enormous worlds."""
