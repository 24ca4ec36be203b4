"""The cases of light: beams through mirrors and glass, followed by fractions as the paper's Eq. 2.

The reference here shares no code with lrf3d: it meets every wall with every leg, as fractions, and
knows no tree, no bound and no integers. Both casters must name the walls of a way that it finds.
Beams that meet two walls at one place are left to tests of their own.
"""

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from math import ulp

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World
from stress.cases import check

TURNS = 8
"""How often a beam is turned."""

BEAMS = 60
"""Beams of a fan."""

Scene = tuple[Float, list[str], Float]
"""Walls (n, 4), their materials, and a pose (3,)."""

Pair = tuple[Fraction, Fraction]


class Touching(Exception):
    """Two walls are met at one place."""


def ways(
    walls: list[list[Fraction]], kinds: list[str], origin: Pair, direction: Pair, limit: Fraction
) -> Iterator[tuple[tuple[int, ...], Fraction]]:
    """The walls and lengths of all ways up to a limit on which light may return to the laser."""
    waiting: list[tuple[Pair, Pair, tuple[int, ...], Fraction, int]] = [
        (origin, direction, (), Fraction(0), 0)
    ]
    while waiting:
        place, turn, chain, way, turns = waiting.pop()
        last = chain[-1] if chain else -1
        met = sorted(
            (t, wall)
            for wall, ends in enumerate(walls)
            if wall != last and (t := _meet(ends, place, turn)) is not None
        )
        if not met or way + met[0][0] > limit:
            continue
        if len(met) > 1 and met[0][0] == met[1][0]:
            raise Touching
        t, wall = met[0]
        place = place[0] + t * turn[0], place[1] + t * turn[1]
        chain, way = (*chain, wall), way + t
        if kinds[wall] != "mirror":
            yield chain, way
        if kinds[wall] in ("mirror", "glass") and turns < TURNS:
            waiting.append((place, _mirrored(walls[wall], turn), chain, way, turns + 1))
        if kinds[wall] == "glass" and len(chain) < 16:
            waiting.append((place, turn, chain, way, turns))


def _meet(ends: list[Fraction], place: Pair, turn: Pair) -> Fraction | None:
    """How far along a ray a wall is met."""
    ex, ey = ends[2] - ends[0], ends[3] - ends[1]
    ax, ay = ends[0] - place[0], ends[1] - place[1]
    slope = turn[0] * ey - turn[1] * ex
    if slope == 0:
        if ax * ey == ay * ex:
            raise Touching
        return None
    t, share = (ax * ey - ay * ex) / slope, (ax * turn[1] - ay * turn[0]) / slope
    if not 0 <= share <= 1 or t < 0:
        return None
    if t == 0:
        raise Touching
    return t


def _mirrored(ends: list[Fraction], turn: Pair) -> Pair:
    nx, ny = ends[1] - ends[3], ends[2] - ends[0]
    twice = 2 * (turn[0] * nx + turn[1] * ny) / (nx * nx + ny * ny)
    return turn[0] - twice * nx, turn[1] - twice * ny


def lit(make: Callable[[np.random.Generator], Scene], rng: np.random.Generator) -> Float:
    """Errors (k,) of the ranges of a fan in units of the last place for each leg; a wrong way is ∞.

    The ranges of both casters are compared, which must be equal.
    """
    walls, kinds, pose = make(rng)
    world = World(walls, np.arange(len(walls)), materials=kinds)
    lrf = LaserRangeFinder(-np.pi, np.pi, beams=BEAMS, range_max=60.0, echo="last")
    casters = PlanarCaster(world), EmbreeCaster(world)
    scan, other = (caster.cast(lrf, pose) for caster in casters)
    chains = [caster.chains(lrf, pose) for caster in casters]
    exact = [[Fraction(value) for value in row] for row in walls.tolist()]
    origin = Fraction(float(pose[0])), Fraction(float(pose[1]))
    errors = np.zeros(BEAMS)
    for beam, (dx, dy) in enumerate(lrf.directions(pose).tolist()):
        direction = Fraction(dx), Fraction(dy)
        try:
            found = list(ways(exact, kinds, origin, direction, Fraction(60)))
        except Touching:
            continue
        named = [tuple(row[beam][row[beam] >= 0].tolist()) for row in chains]
        distance = float(scan.ranges[beam])
        if named[0] != named[1] or distance != other.ranges[beam]:
            errors[beam] = np.inf
        elif not named[0]:
            # All light may be lost on the way through glass, but not among mirrors alone.
            missed = not found or "glass" in kinds
            errors[beam] = 0.0 if missed and distance == np.inf else np.inf
        else:
            # Glass may mirror a beam onto the same wall that it lets it through to.
            off = [abs(Fraction(distance) - way) for chain, way in found if chain == named[0]]
            least = float(min(off) / Fraction(ulp(distance))) if off else np.inf
            errors[beam] = least / len(named[0])
    return errors


def anywhere(rng: np.random.Generator, kinds: list[str], far: float = 0.0) -> Scene:
    """Walls anywhere about the laser, of random materials."""
    count = int(rng.integers(4, 10))
    walls = rng.uniform(-9.0, 9.0, (count, 4)) + far
    pose = np.array([*(far + rng.uniform(-3.0, 3.0, 2)), rng.uniform(-3.0, 3.0)])
    return walls, rng.choice(kinds, count).tolist(), pose


def on_a_grid(rng: np.random.Generator) -> Scene:
    """Walls between whole metres, whose ends beams meet after their turns."""
    walls = rng.integers(-5, 6, (8, 4)).astype(np.float64)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    pose = np.array([*(rng.integers(-4, 5, 2) + 0.5), np.pi / 4 * rng.integers(-4, 5)])
    return walls, rng.choice(["mirror", "mirror", "brick"], len(walls)).tolist(), pose


def gallery(rng: np.random.Generator) -> Scene:
    """Two mirrors side by side, all but parallel, with walls at the ends."""
    width, tilt = rng.uniform(0.5, 4.0), rng.uniform(-1e-3, 1e-3)
    walls = np.array(
        [
            [-8.0, 0.0, 8.0, 0.0],
            [-8.0, width, 8.0, width + tilt],
            [-8.0, -1.0, -8.0, 5.0],
            [8.0, -1.0, 8.0, 5.0],
        ]
    )
    pose = np.array([rng.uniform(-7.0, 7.0), rng.uniform(0.1, 0.9) * width, rng.uniform(-3, 3)])
    return walls, ["mirror", "mirror", "plaster", "brick"], pose


MIRRORS, PANES = ["mirror", "mirror", "brick"], ["mirror", "glass", "glass", "brick"]

LIGHT = tuple(
    check("light", name, partial(lit, make), bound=1.0, unit="ulp", tries=tries, each=BEAMS)
    for name, make, tries in (
        ("mirrors anywhere", partial(anywhere, kinds=MIRRORS), 6_000),
        ("mirrors, 1e6 m away", partial(anywhere, kinds=MIRRORS, far=1e6), 3_000),
        ("mirrors between whole metres", on_a_grid, 6_000),
        ("two mirrors all but parallel", gallery, 6_000),
        ("mirrors and glass", partial(anywhere, kinds=PANES), 1_800),
    )
)
"""The cases of light."""
