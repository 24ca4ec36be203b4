"""Stress: beams aimed where casting is hardest, against fractions.

A kind makes a world and a range finder at some poses. Both casters cast it, and each beam is cast
by rational numbers: the wall must be the right one, and the range right to half a unit in the last
place. In worlds of mirrors and glass each wall of the way must be the right one, and the range
right within a nanometre, but for beams that pass an end of a wall by less than `CORNER`.
"""

import math
import warnings
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from itertools import count
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from exact_light import ExactLight
from rational import ExactWorld

from lrf3d import EmbreeCaster, LaserRangeFinder, PlanarCaster, World
from lrf3d.apps.cli import main
from lrf3d.apps.cli.parser import read_value
from lrf3d.base.cores import core_count, process_pool
from lrf3d.base.errors import Lrf3dWarning
from lrf3d.base.interrupts import Progress, silent
from lrf3d.geometry.lines import Float

Rng = np.random.Generator

# By how many units in the last place a range may be off among opaque walls.
MOST_ULP = 0.52

# How far a range may be off behind mirrors and glass [m]; beams whose way changes when they are
# turned by CORNER [rad] are left out, and counted.
LIGHT_METRES, CORNER = 1e-9, 1e-9

# Failures that are kept whole, to be repeated by hand.
EXAMPLES = 3

# Batches of each kind that a process casts at a time.
ROUND = 25


class Batch(NamedTuple):
    """Beams to cast together: walls (n, 4), a range finder, and poses (k, 3)."""

    walls: Float
    lrf: LaserRangeFinder
    poses: Float


# --- worlds, within about 10 m of the origin -----------------------------------------------------


def boxes(rng: Rng) -> Float:
    """Rectangles at any angle: walls that share corners."""
    count = int(rng.integers(1, 9))
    turn, middle = rng.uniform(0, np.pi, (count, 1)), rng.uniform(-9, 9, (count, 1, 2))
    half = rng.uniform(0.2, 2.0, (count, 1, 2)) * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    x, y = np.moveaxis(half, -1, 0)
    corners = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y])
    return closed(middle + np.moveaxis(corners, 0, -1))


def blocks(rng: Rng) -> Float:
    """Rectangles on whole metres: walls that double, overlap and line up with the laser."""
    low = rng.integers(-8, 8, (8, 1, 2)).astype(np.float64)
    size = rng.integers(1, 4, (8, 1, 2))
    return closed(low + size * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))


def closed(corners: Float) -> Float:
    """Walls around each ring of corners (rings, corners, 2)."""
    return np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)


def crossing(rng: Rng) -> Float:
    """Walls in any place that cross each other."""
    return rng.uniform(-10, 10, (int(rng.integers(1, 40)), 4))


def star(rng: Rng) -> Float:
    """Walls with one end in common, and walls that only just miss that point."""
    ends = rng.uniform(-10, 10, (12, 2))
    apart = np.where(rng.random((12, 1)) < 0.5, 0.0, 1e-12)
    return np.column_stack([np.array([1.0, 2.0]) + apart * ends, ends])


def doubled(rng: Rng) -> Float:
    """Walls, the same turned round, a half of each, and the same a hair away."""
    walls = crossing(rng)[:10]
    walls[::2] = np.round(walls[::2])
    hair = 10.0 ** rng.uniform(-16, -3, (len(walls), 1)) * rng.normal(size=walls.shape)
    half = np.column_stack([0.5 * (walls[:, :2] + walls[:, 2:]), walls[:, 2:]])
    every = np.concatenate([walls, walls[:, [2, 3, 0, 1]], half, walls + hair])
    return every[rng.permutation(len(every))]


def slivers(rng: Rng) -> Float:
    """Walls of one ulp of their coordinates to a micrometre, alone and at ends of others."""
    walls = crossing(rng)[:10]
    start = np.concatenate([walls[:, :2], rng.uniform(-9, 9, (10, 2))])
    ulps = np.spacing(np.abs(start) + 1e-9) * np.round(2.0 ** rng.uniform(0, 30, start.shape))
    ulps *= rng.choice([-1.0, 0.0, 1.0], start.shape)
    return np.concatenate([walls, np.column_stack([start, start + ulps])])


WORLDS: tuple[Callable[[Rng], Float], ...] = (boxes, blocks, crossing, star, doubled, slivers)

# Scales, and offsets [m] along x, y or both.
SETTINGS = ((1.0, 0.0), (1.0, 0.0), (1.0, 1e3), (1.0, 1e6), (1e-3, 0.0), (1e3, 1e7))


def some_world(rng: Rng) -> tuple[Float, float]:
    """A world of any kind, scaled and moved, without walls that shrank to a point; its scale."""
    scale, offset = SETTINGS[rng.integers(len(SETTINGS))]
    move = offset * np.array([(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])[rng.integers(3)]
    walls = WORLDS[rng.integers(len(WORLDS))](rng) * scale
    walls = np.vstack([walls, scale * rng.uniform(-9, 9, 4)]) + np.tile(move, 2)
    if rng.random() < 0.1:
        # The middle of the world lies far from most of its walls.
        walls[-1] += np.tile(scale * 10.0 ** rng.uniform(1, 6, 2), 2)
    return walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)], scale


# --- where lasers stand and what they aim at ------------------------------------------------------

# Beams and width [rad] of ordinary and odd fans; some go round more than once.
FANS = (
    (1, 0.0), (2, 0.0), (3, 1e-10), (9, 1e-6), (7, 1e-3), (19, np.pi), (13, 2.0 * np.pi),
    (25, 7.0), (33, 15.0),
)  # fmt: skip


def some_fan(rng: Rng, range_max: float) -> LaserRangeFinder:
    """A fan about straight ahead, from there on, or anywhere."""
    beams, width = FANS[rng.integers(len(FANS))]
    first = float(rng.choice([-0.5 * width, 0.0, rng.uniform(-4.0, 4.0)]))
    return fan(first, first + width, beams, 0.0, range_max)


def fan(*values: float) -> LaserRangeFinder:
    """A range finder that may go round more than once, which is warned of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Lrf3dWarning)
        return LaserRangeFinder(*values)  # type: ignore[arg-type]


def some_places(rng: Rng, walls: Float, scale: float, count: int) -> Float:
    """Anywhere, on walls, on their lines and ends, level with ends, and a hair beside all these."""
    wall = walls[rng.integers(len(walls), size=count)]
    share = rng.choice([0.0, 0.5, 1.0, 2.0, rng.random()], (count, 1))
    on_line = wall[:, :2] + share * (wall[:, 2:] - wall[:, :2])
    free = wall[:, :2] + scale * rng.uniform(-12, 12, (count, 2))
    level = np.column_stack([free[:, 0], wall[:, 1]])
    hair = scale * 10.0 ** rng.uniform(-16, -3, (count, 1)) * rng.normal(size=(count, 2))
    kinds = np.stack([free, free, on_line, on_line + hair, level, np.round(free)])
    return np.asarray(kinds[rng.integers(len(kinds), size=count), np.arange(count)])


def some_headings(rng: Rng, walls: Float, places: Float) -> Float:
    """At ends of walls, within 1e-16 to 1e-3 rad of them, along walls, square, and anywhere."""
    count = len(places)
    wall = walls[rng.integers(len(walls), size=count)]
    away, along = wall[:, :2] - places, wall[:, 2:] - wall[:, :2]
    at = np.arctan2(away[:, 1], away[:, 0])
    near = at + rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-16, -3, count)
    parallel = np.arctan2(along[:, 1], along[:, 0]) + rng.choice([0.0, np.pi], count)
    grazing = parallel + 10.0 ** rng.uniform(-12, -2, count)
    square = 0.5 * np.pi * rng.integers(-4, 5, count)
    kinds = np.stack([at, near, parallel, grazing, square, rng.uniform(-10, 10, count)])
    return np.asarray(kinds[rng.integers(len(kinds), size=count), np.arange(count)])


def aimed(rng: Rng, poses: int = 8) -> Batch:
    """Any world, seen from anywhere in any way."""
    walls, scale = some_world(rng)
    lrf = some_fan(rng, 1e3 * scale)
    places = some_places(rng, walls, scale, poses)
    beam = lrf.angles[rng.integers(lrf.beams, size=poses)]
    return Batch(walls, lrf, np.column_stack([places, some_headings(rng, walls, places) - beam]))


def at_limits(rng: Rng) -> Batch:
    """A range_max or range_min that is the range of some beam, or its neighbour among floats."""
    walls, lrf, poses = aimed(rng)
    ranges = PlanarCaster(World(walls)).cast_batch(lrf, poses)
    ranges = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    if not len(ranges):
        return Batch(walls, lrf, poses)
    limit = float(np.nextafter(rng.choice(ranges), rng.choice([0.0, 1e12, 1.0])))
    near, far = (limit, 1e10) if rng.random() < 0.5 else (0.0, limit)
    limited = fan(lrf.angle_min, lrf.angle_max, lrf.beams, near, min(far, 1e9))
    return Batch(walls, limited, poses)


def through_corners(rng: Rng) -> Batch:
    """From the origin at walls with corners at powers of two along the beams: all exact."""
    lrf = LaserRangeFinder(0.0, float(rng.uniform(0.1, 6.0)), 7, range_max=1e3)
    theta = rng.uniform(-4.0, 4.0, 2)
    through = np.concatenate([lrf.directions((0.0, 0.0, turn)) for turn in theta])
    ends = (2.0 ** rng.integers(-2, 4, (2, len(through), 1)) * through).reshape(-1, 2)
    others = np.where(rng.random((len(ends), 1)) < 0.3, ends[::-1], rng.uniform(-9, 9, ends.shape))
    walls = np.column_stack([ends, others])
    walls = walls[rng.permutation(np.flatnonzero((ends != others).any(axis=1)))]
    return Batch(walls, lrf, np.column_stack([np.zeros((8, 2)), rng.choice(theta, 8)]))


# --- checks ---------------------------------------------------------------------------------------


@dataclass
class Findings:
    """Beams that were tried, how many of them are wrong, and the largest error of the others."""

    beams: int = 0
    wrong: int = 0
    left_out: int = 0
    largest_error: float = 0.0
    examples: list[dict[str, Any]] = field(default_factory=list)

    def add(self, other: "Findings") -> None:
        """Add what others tried."""
        self.beams, self.wrong = self.beams + other.beams, self.wrong + other.wrong
        self.left_out += other.left_out
        self.largest_error = max(self.largest_error, other.largest_error)
        self.examples = (self.examples + other.examples)[:EXAMPLES]

    def note(self, right: bool, error: float, batch: Batch, pose: int, beam: int) -> None:
        """Note a beam; a wrong one is kept with all that is needed to repeat it."""
        self.beams += 1
        self.wrong += not right
        if right:
            self.largest_error = max(self.largest_error, error)
        elif len(self.examples) < EXAMPLES:
            self.examples.append({"walls": batch.walls.tolist(), "laser": repr(batch.lrf),
                                  "pose": batch.poses[pose].tolist(), "beam": beam})  # fmt: skip


def check_batch(batch: Batch, casters: tuple[Any, ...] = (PlanarCaster, EmbreeCaster)) -> Findings:
    """Compare the walls and ranges of casters with fractions."""
    walls, lrf, poses = batch
    world, findings = World(walls), Findings()
    answers = [caster(world).scan_batch(lrf, poses) for caster in casters]
    exact = ExactWorld(walls, poses)
    for k, pose in enumerate(poses):
        for i, direction in enumerate(lrf.directions(pose)):
            wall, t = exact.cast(k, direction)
            if t is None or t > lrf.range_max:
                wall, t, rounded = -1, None, math.inf
            elif t < lrf.range_min:
                wall, t, rounded = -1, None, -math.inf
            right, worst = True, 0.0
            for ranges, hits in answers:
                found = float(ranges[k, i])
                right &= bool(hits[k, i] == wall)
                if t is None or not math.isfinite(found):
                    right &= t is None and found == rounded
                    continue
                error = float(abs(Fraction(found) - t) / Fraction(math.ulp(float(t))))
                inside = lrf.range_min <= found <= lrf.range_max
                right, worst = right and inside and error <= MOST_ULP, max(worst, error)
            findings.note(right, worst, batch, k, i)
    return findings


NAMES = ["mirror", "glass", "plaster", "metal", "retro-reflector"]


def lit(rng: Rng) -> Batch:
    """Mirrors, glass and walls: anywhere, on whole metres, drawn over each other, far away."""
    walls = rng.uniform(-9.0, 9.0, (int(rng.integers(3, 14)), 4))
    kind = rng.integers(4)
    if kind == 1:
        walls = np.concatenate([walls, np.round(walls)])
    elif kind == 2:
        walls = np.concatenate([walls, walls[:3][:, [2, 3, 0, 1]], walls[1:4]])
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    offset = 1e5 if kind == 3 else 0.0
    poses = np.column_stack([rng.uniform(-3, 3, (4, 2)) + offset, rng.uniform(-4, 4, 4)])
    return Batch(walls + offset, LaserRangeFinder(-np.pi, np.pi, 25, range_max=40.0), poses)


def check_light(batch: Batch, rng: Rng) -> Findings:
    """Compare the ways and ranges of beams in a world of mirrors and glass with fractions."""
    walls, lrf, poses = batch
    names = rng.choice(NAMES, len(walls), p=[0.45, 0.3, 0.15, 0.05, 0.05]).tolist()
    world, findings = World(walls, np.arange(len(walls)), materials=names), Findings()
    exact, caster = ExactLight(world.segments, list(world.materials)), PlanarCaster(world)

    def strongest(pose: Float, direction: Float) -> tuple[float, set[tuple[int, ...]]]:
        found = exact.echoes((pose[0], pose[1]), tuple(direction), range_max=lrf.range_max)
        if not found:
            return math.inf, {()}
        bright = 0.999 * found[0].intensity
        return float(found[0].way), {echo.chain for echo in found if echo.intensity >= bright}

    for k, pose in enumerate(poses):
        ranges, chains = caster.cast(lrf, pose).ranges, caster.chains(lrf, pose)
        for i, direction in enumerate(lrf.directions(pose)):
            away, ways = strongest(pose, direction)
            way = tuple(chains[i][chains[i] >= 0].tolist())
            error = 0.0 if ranges[i] == away else abs(float(ranges[i]) - away)
            right = way in ways and (len(ways) > 1 or error <= LIGHT_METRES)
            if not right:
                # Turned by a hair such a beam goes another way.
                x, y = direction
                turned = [np.array([x - h * y, y + h * x]) for h in (-CORNER, CORNER)]
                if any(strongest(pose, other)[1] != ways for other in turned):
                    findings.left_out += 1
                    continue
            findings.note(right, 0.0 if len(ways) > 1 else error, batch, k, i)
    return findings


KINDS: dict[str, Callable[[Rng], Findings]] = {
    "anything aimed anywhere": lambda rng: check_batch(aimed(rng)),
    "limits on the range itself": lambda rng: check_batch(at_limits(rng)),
    "exactly through corners": lambda rng: check_batch(through_corners(rng)),
    "mirrors and glass": lambda rng: check_light(lit(rng), rng),
}


def try_kind(name: str, rounds: int, seed: tuple[int, ...]) -> Findings:
    """Cast batches of a kind."""
    rng, findings = np.random.default_rng(seed), Findings()
    for _ in range(rounds):
        findings.add(KINDS[name](rng))
    return findings


def stress(
    beams: int, *, seconds: float = math.inf, seed: int = 0, progress: Progress = silent
) -> dict[str, Findings]:
    """Try at least a number of beams, over all cores, unless the time [s] is over before."""
    found, least = {name: Findings() for name in KINDS}, beams / len(KINDS)
    begin, number = perf_counter(), count()
    with process_pool(core_count()) as pool:
        while perf_counter() - begin <= seconds:
            lacking = [n for n, one in found.items() if one.beams + one.left_out < least]
            if not lacking:
                break
            jobs = [(name, pool.submit(try_kind, name, ROUND, (seed, next(number))))
                    for name in lacking for _ in range(core_count())]  # fmt: skip
            for name, job in jobs:
                found[name].add(job.result())
            progress(min(beams, sum(one.beams for one in found.values())), beams)
    return found


def command(words: Sequence[str]) -> int:
    """Cast the hardest beams with both casters, and compare each with rational numbers.

    Returns 1 where one wall is wrong, or one range off by more than rounding.
    """
    parser = ArgumentParser(
        prog="scripts/stress", description=command.__doc__, epilog="Example: scripts/stress --quick"
    )
    number, time, seed = (partial(read_value, kind) for kind in ("N", "S", "SEED"))
    parser.add_argument("--beams", type=number, default=1_000_000, help="Beams to cast, at least.")
    parser.add_argument("--quick", action="store_true", help="Some thousand beams.")
    parser.add_argument("--seconds", type=time, default=480.0, help="Stop after this time.")
    parser.add_argument("--seed", type=seed, default=0, help="The same seed, the same beams.")
    parser.add_argument("--json", action="store_true", help="Print one JSON object.")
    args = parser.parse_args(words)
    from lrf3d.apps.cli.console import print_json, print_table, progress_bar

    begin = perf_counter()
    with progress_bar("stress") as progress:
        beams = min(args.beams, 8_000) if args.quick else args.beams
        found = stress(beams, seconds=args.seconds, seed=args.seed, progress=progress)
    passed = not any(one.wrong for one in found.values())
    if args.json:
        print_json({
            "passed": passed,
            "beams": sum(one.beams for one in found.values()),
            "seconds": perf_counter() - begin,
            "rows": [{"name": name, **vars(one)} for name, one in found.items()],
        })  # fmt: skip
    else:
        print_table([
            (name, f"{one.beams:,} beams, {one.wrong} wrong, {one.left_out} at corners left out,"
                   f" largest error {one.largest_error:.3g} {'m' if 'glass' in name else 'ulp'}")
            for name, one in found.items()
        ])  # fmt: skip
    return 0 if passed else 1


if __name__ == "__main__":
    main(command, "scripts/stress")
