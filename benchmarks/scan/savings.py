"""Ablation: each piece of work that lrf3d skips, timed with it skipped and with it done."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from benchmarks.result import Result
from benchmarks.scan.baselines import cast_determinants
from benchmarks.scan.processes import probe
from benchmarks.timing import take_turns
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.kernels.tree import SMALL, build_tree
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.world import World
from lrf3d.world.generators import city_crossings, generate_city

FRESH = 3
"""Fresh processes of each kind."""

POSES, BATCH = 32, 500
"""Poses that single scans turn through, and poses of a batch."""

UNBOUNDED = 1e9
"""A range_max [m] beyond every wall."""

SHORT = 10.0
"""The range_max [m] of a small indoor laser: where it saves the most."""

QUARTER, TOWN = 400, 10_000
"""Walls of a quarter and of a town."""

Pair = tuple[str, Callable[[int], object], Callable[[int], object]]
"""What is skipped, calls without it, and calls with it; both take the number of the call."""

PAIRS = 10
"""Pairs that share the time."""


def ablate(result: Result, *, seconds: float, huge: int = 1_000_000) -> None:
    """Time every piece of skipped work on and off.

    Args:
        result: Where the savings go.
        seconds: Time for all together [s]; building the huge city comes on top.
        huge: Walls of the city in which walls beyond range_max are many.
    """
    took: dict[str, list[float]] = {"planar": [], "embree": []}
    for _ in range(FRESH):
        for caster, times in took.items():
            times.append(probe("first_call", caster, QUARTER)["until_first_scan_s"])
    name = "Embree and its mesh for a planar cast: from the import to the first scan"
    # Others that use the machine only ever add to what a process takes to start.
    result.save(name, min(took["planar"]), min(took["embree"]))
    for name, skipped, done in _pairs(huge):
        timed = take_turns({"skipped": skipped, "done": done}, seconds=seconds / PAIRS)
        result.save(name, timed["skipped"].median, timed["done"].median)


def _pairs(huge: int) -> Iterator[Pair]:
    lrf = LaserRangeFinder()
    town, origin = generate_city(TOWN), (0.0, 0.0, 0.0)
    # The scene that a planar cast does not build.
    yield (
        f"the mesh of {TOWN:,} walls for a planar cast",
        lambda turn: PlanarCaster(town).cast(lrf, origin),
        lambda turn: EmbreeCaster(town).cast(lrf, origin),
    )
    yield from _far_walls(huge)
    quarter = generate_city(QUARTER)
    planar, embree = PlanarCaster(quarter), EmbreeCaster(quarter)
    scan = planar.cast(lrf, (10.0, 10.0, 0.0))
    silent, noisy, rng = ProportionalNoise(0.0), ProportionalNoise(0.04), np.random.default_rng(0)
    yield "drawing noise at σ = 0, a scan", lambda _: silent(scan, rng), lambda _: noisy(scan, rng)
    poses = city_crossings(QUARTER, POSES)
    plain = [tuple(pose) for pose in poses.tolist()]
    # Scenes that are built once for all scans.
    yield (
        f"building the static {QUARTER} walls for every scan, PlanarCaster",
        lambda turn: planar.cast(lrf, plain[turn % POSES]),
        lambda turn: PlanarCaster(quarter).cast(lrf, plain[turn % POSES]),
    )
    yield (
        f"building the static {QUARTER} walls for every scan, EmbreeCaster",
        lambda turn: embree.cast(lrf, plain[turn % POSES]),
        lambda turn: EmbreeCaster(quarter).cast(lrf, plain[turn % POSES]),
    )
    yield (
        f"a tree over {SMALL} walls (against {SMALL + 1}, the first to have one)",
        lambda turn: build_tree(quarter.segments[:SMALL]),
        lambda turn: build_tree(quarter.segments[: SMALL + 1]),
    )
    yield (
        f"walls that no beam comes near, among {QUARTER} (against all of them, in NumPy)",
        lambda turn: planar.cast(lrf, plain[turn % POSES]),
        lambda turn: cast_determinants(
            quarter.segments, poses[turn % POSES, :2], lrf.directions(poses[turn % POSES])
        ),
    )
    many = city_crossings(QUARTER, BATCH)
    yield (
        f"writing which walls were hit, a batch of {BATCH}",
        lambda turn: planar.cast_batch(lrf, many),
        lambda turn: planar.scan_batch(lrf, many),
    )
    # Rays for beams whose neighbours on both sides end on one wall: where one wall stands alone,
    # anything might stand between two beams.
    lone = quarter.segments.max() + np.array([[0.0, 0.0, 1.0, 0.0]])
    asking = EmbreeCaster(World(np.vstack([quarter.segments, lone])))
    yield (
        f"rays between neighbours on one wall, EmbreeCaster, a batch of {BATCH}",
        lambda turn: embree.cast_batch(lrf, many),
        lambda turn: asking.cast_batch(lrf, many),
    )


def _far_walls(huge: int) -> Iterator[Pair]:
    """Walls beyond range_max, which no beam visits."""
    caster = PlanarCaster(generate_city(huge))
    poses = [tuple(pose) for pose in city_crossings(huge, POSES).tolist()]

    def scan(reach: float) -> Callable[[int], object]:
        lrf = replace(LaserRangeFinder(), range_max=reach)
        return lambda turn: caster.cast(lrf, poses[turn % POSES])

    for reach in (LaserRangeFinder().range_max, SHORT):
        yield f"walls beyond {reach:g} m among {huge:,}, a scan", scan(reach), scan(UNBOUNDED)
