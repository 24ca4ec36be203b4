"""Ablation: each piece of work that lrf3d skips, timed with it skipped and with it done."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.kernels.tree import SMALL
from lrf3d.casting.wall_tree import build_tree
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.study.bench.determinants import cast_determinants
from lrf3d.study.bench.probes import probe
from lrf3d.study.timing import take_turns
from lrf3d.world import World
from lrf3d.world.generate import city_crossings, generate_city

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


@dataclass(frozen=True, slots=True)
class Saving:
    """What skipping one piece of work saves.

    Args:
        name: What is skipped.
        skipped: Time without it, which is how lrf3d does it [s].
        done: Time with it [s].
    """

    name: str
    skipped: float
    done: float

    def as_dict(self) -> dict[str, Any]:
        """The saving in JSON's types."""
        return {
            "skipped_work": self.name,
            "skipped_s": self.skipped,
            "done_s": self.done,
            "saved_share": 1.0 - self.skipped / self.done,
        }


def ablate(
    *, seconds: float, huge: int = 1_000_000, progress: Callable[[int, int], None]
) -> list[Saving]:
    """Time every piece of skipped work on and off.

    Args:
        seconds: Time for all together [s]; building the huge city comes on top.
        huge: Walls of the city in which walls beyond range_max are many.
        progress: Called with the parts done, and of how many.
    """
    parts: list[Callable[[float], list[Saving]]] = [
        _fresh,
        _meshes,
        lambda time: _far_walls(time, huge),
        _noise,
        _static,
        _trees,
        _walls,
        _rays,
    ]
    found: list[Saving] = []
    for number, part in enumerate(parts):
        found += part(seconds / len(parts))
        progress(number + 1, len(parts))
    return found


def _fresh(seconds: float) -> list[Saving]:
    """Libraries that a planar cast does not load."""
    took: dict[str, list[float]] = {"planar": [], "embree": []}
    for _ in range(FRESH):
        for caster, times in took.items():
            times.append(probe("first_call", caster, QUARTER)["until_first_scan_s"])
    name = "Embree and its mesh for a planar cast: from the import to the first scan"
    # Others that use the machine only ever add to what a process takes to start.
    return [Saving(name, min(took["planar"]), min(took["embree"]))]


def _meshes(seconds: float) -> list[Saving]:
    """The scene that a planar cast does not build."""
    world, lrf = generate_city(TOWN), LaserRangeFinder()
    pose = (0.0, 0.0, 0.0)
    name = f"the mesh of {TOWN:,} walls for a planar cast"
    return [
        _pair(
            name,
            lambda turn: PlanarCaster(world).cast(lrf, pose),
            lambda turn: EmbreeCaster(world).cast(lrf, pose),
            seconds,
        )
    ]


def _far_walls(seconds: float, huge: int) -> list[Saving]:
    """Walls beyond range_max, which no beam visits."""
    caster = PlanarCaster(generate_city(huge))
    poses = [tuple(pose) for pose in city_crossings(huge, POSES).tolist()]
    endless = replace(LaserRangeFinder(), range_max=UNBOUNDED)

    def scan(lrf: LaserRangeFinder) -> Callable[[int], object]:
        return lambda turn: caster.cast(lrf, poses[turn % POSES])

    return [
        _pair(
            f"walls beyond {reach:g} m among {huge:,}, a scan",
            scan(replace(endless, range_max=reach)),
            scan(endless),
            seconds / 2,
        )
        for reach in (LaserRangeFinder().range_max, SHORT)
    ]


def _noise(seconds: float) -> list[Saving]:
    """Random numbers that no noise does not draw."""
    scan = PlanarCaster(generate_city(QUARTER)).cast(LaserRangeFinder(), (10.0, 10.0, 0.0))
    silent, noisy = ProportionalNoise(0.0), ProportionalNoise(0.04)
    rng = np.random.default_rng(0)
    return [
        _pair(
            "drawing noise at σ = 0, a scan",
            lambda turn: silent(scan, rng),
            lambda turn: noisy(scan, rng),
            seconds,
        )
    ]


def _static(seconds: float) -> list[Saving]:
    """Scenes that are built once for all scans."""
    world, lrf = generate_city(QUARTER), LaserRangeFinder()
    poses = [tuple(pose) for pose in city_crossings(QUARTER, POSES).tolist()]

    def pair(made: type[PlanarCaster] | type[EmbreeCaster]) -> Saving:
        kept = made(world)
        return _pair(
            f"building the static {QUARTER} walls for every scan, {made.__name__}",
            lambda turn: kept.cast(lrf, poses[turn % POSES]),
            lambda turn: made(world).cast(lrf, poses[turn % POSES]),
            seconds / 2,
        )

    return [pair(PlanarCaster), pair(EmbreeCaster)]


def _trees(seconds: float) -> list[Saving]:
    """Trees: none over few walls, and what one saves over many."""
    many = generate_city(QUARTER)
    few, more = many.segments[:SMALL], many.segments[: SMALL + 1]
    lrf, caster = LaserRangeFinder(), PlanarCaster(many)
    poses = city_crossings(QUARTER, POSES)
    plain = [tuple(pose) for pose in poses.tolist()]
    return [
        _pair(
            f"a tree over {SMALL} walls (against {SMALL + 1}, the first to have one)",
            lambda turn: build_tree(few),
            lambda turn: build_tree(more),
            seconds / 2,
        ),
        _pair(
            f"walls that no beam comes near, among {QUARTER} (against all of them, in NumPy)",
            lambda turn: caster.cast(lrf, plain[turn % POSES]),
            lambda turn: cast_determinants(
                many.segments, poses[turn % POSES, :2], lrf.directions(poses[turn % POSES])
            ),
            seconds / 2,
        ),
    ]


def _walls(seconds: float) -> list[Saving]:
    """The walls of the hits, which a batch writes only where they are asked for."""
    caster, lrf = PlanarCaster(generate_city(QUARTER)), LaserRangeFinder()
    poses = city_crossings(QUARTER, BATCH)
    return [
        _pair(
            f"writing which walls were hit, a batch of {BATCH}",
            lambda turn: caster.cast_batch(lrf, poses),
            lambda turn: caster.scan_batch(lrf, poses),
            seconds,
        )
    ]


def _rays(seconds: float) -> list[Saving]:
    """Rays for beams whose neighbours on both sides end on one wall."""
    city, lrf = generate_city(QUARTER), LaserRangeFinder()
    lone = city.segments.max() + np.array([[0.0, 0.0, 1.0, 0.0]])
    # Where one wall stands alone, anything might stand between two beams.
    sparing, asking = EmbreeCaster(city), EmbreeCaster(World(np.vstack([city.segments, lone])))
    poses = city_crossings(QUARTER, BATCH)
    return [
        _pair(
            f"rays between neighbours on one wall, EmbreeCaster, a batch of {BATCH}",
            lambda turn: sparing.cast_batch(lrf, poses),
            lambda turn: asking.cast_batch(lrf, poses),
            seconds,
        )
    ]


def _pair(
    name: str, skipped: Callable[[int], object], done: Callable[[int], object], seconds: float
) -> Saving:
    timed = take_turns({"skipped": skipped, "done": done}, seconds=seconds)
    return Saving(name, timed["skipped"].median, timed["done"].median)
