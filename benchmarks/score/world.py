"""How near does a map come to the walls of a world, seen from random poses?

A world enters; for each mode, number of beams and seed of poses and noise, a map score leaves,
with the time of an update. Both modes see the very same scans.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.result import Row
from benchmarks.timing import time_updates
from lrf3d.casting import PlanarCaster
from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.progress import Progress, silent
from lrf3d.robot import Trajectory
from lrf3d.robot.sides import buildings_around
from lrf3d.scoring import score_run
from lrf3d.simulation import simulate
from lrf3d.world import World

CLEARANCE = 1.0
"""Least distance of a random pose to any wall [m]."""

TRIES = 1000
"""Rounds of drawing after which a world is taken to have no room."""


def score_world(
    world: World,
    *,
    modes: Sequence[str],
    beams: Sequence[int],
    seeds: int,
    poses: int = 200,
    sigma: float = 0.04,
    progress: Progress = silent,
) -> list[Row]:
    """Score the maps of a world.

    Args:
        world: The world.
        modes: Modes of the mapper.
        beams: Numbers of beams of a scan.
        seeds: How many seeds, from 0.
        poses: How many random poses.
        sigma: Noise [m] at range_max, which the mapper knows.
        progress: Called with the maps done, and of how many.

    Raises:
        InputError: The world has no room for a laser.
    """
    caster, noise = PlanarCaster(world), ProportionalNoise(sigma)
    for mode in modes:
        # What is compiled at the first scan is no part of an update.
        scan = caster.cast(LaserRangeFinder(), random_poses(world, 1, np.random.default_rng(0))[0])
        LineMapper(mode, sigma=sigma).update(scan)
    rows: list[Row] = []
    for number in beams:
        lrf = replace(LaserRangeFinder(), beams=number)
        for seed in range(seeds):
            places = random_poses(world, poses, np.random.default_rng(seed))
            drive = Trajectory(np.arange(len(places), dtype=np.float64), places)
            for mode in modes:
                mapper = LineMapper(mode, sigma=sigma)
                spent = time_updates(mapper)
                run = simulate(
                    world, drive, lrf, caster=caster, noise=noise, mapper=mapper, rng=seed,
                    snapshots=1,
                )  # fmt: skip
                rows.append(
                    {
                        "mode": mode,
                        "beams": number,
                        "seed": seed,
                        **score_run(run).as_dict(),
                        "update_s": float(np.median(spent)),
                    }
                )
                progress(len(rows), len(modes) * len(beams) * seeds)
    return rows


def random_poses(world: World, count: int, rng: np.random.Generator) -> Float:
    """Poses (count, 3), evenly spread over the bounds of a world, in no building and off all walls.

    Raises:
        InputError: There is no such room in the world.
    """
    import shapely

    local = world.segments - np.tile(world.origin, 2)
    ends = local.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    tree = shapely.STRtree(shapely.linestrings(local.reshape(-1, 2, 2)))
    found: list[Float] = []
    for _ in range(TRIES):
        places = rng.uniform(low, high, (count, 2))
        close, _ = tree.query(shapely.points(places), predicate="dwithin", distance=CLEARANCE)
        free = buildings_around(world, places) < 0
        free[close] = False
        found.extend(places[free])
        if len(found) >= count:
            heading = rng.uniform(-np.pi, np.pi, count)
            return np.column_stack([np.array(found[:count]) + world.origin, heading])
    raise InputError(f"{world.name or 'world'}: no room {CLEARANCE:g} m off all walls")
