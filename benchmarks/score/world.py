"""How near does a map come to the walls of a world, seen from random poses?

A world enters; for each mode, number of beams and seed of poses and noise, a map score leaves,
with the time of an update. Both modes see the very same scans.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory
from lrf3d.scoring import MapScore, score_run
from lrf3d.simulation import simulate
from lrf3d.study.bench.map_accuracy import TimedMapper
from lrf3d.study.bench.random_poses import random_poses
from lrf3d.world import World


@dataclass(frozen=True, slots=True)
class Survey:
    """What is seen of a world.

    Args:
        poses: How many random poses.
        sigma: Noise [m] at range_max, which the mapper knows.
    """

    poses: int = 200
    sigma: float = 0.04


@dataclass(frozen=True, slots=True)
class WorldEntry:
    """The map of one mode with one seed.

    Args:
        mode: Mode of the mapper.
        beams: Beams of a scan.
        seed: Seed of the poses and of the noise.
        score: The score of the map.
        update: Median time of an update [s].
    """

    mode: str
    beams: int
    seed: int
    score: MapScore
    update: float

    def as_dict(self) -> dict[str, Any]:
        """The entry in JSON's types."""
        own = {"mode": self.mode, "beams": self.beams, "seed": self.seed}
        return {**own, **self.score.as_dict(), "update_s": self.update}


def score_world(
    world: World,
    *,
    modes: Sequence[str],
    beams: Sequence[int],
    seeds: int,
    survey: Survey | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[WorldEntry]:
    """Score the maps of a world.

    Args:
        world: The world.
        modes: Modes of the mapper.
        beams: Numbers of beams of a scan.
        seeds: How many seeds, from 0.
        survey: What is seen of the world; the usual where not given.
        progress: Called with the maps done, and of how many.

    Raises:
        InputError: The world has no room for a laser.
    """
    survey = Survey() if survey is None else survey
    entries = []
    for entry in _entries(world, modes, beams, seeds, survey):
        entries.append(entry)
        progress(len(entries), len(modes) * len(beams) * seeds)
    return entries


def _entries(
    world: World, modes: Sequence[str], beams: Sequence[int], seeds: int, survey: Survey
) -> Iterator[WorldEntry]:
    caster, noise = PlanarCaster(world), ProportionalNoise(survey.sigma)
    for mode in modes:
        # What is compiled at the first scan is no part of an update.
        scan = caster.cast(LaserRangeFinder(), random_poses(world, 1, np.random.default_rng(0))[0])
        LineMapper(mode, sigma=survey.sigma).update(scan)
    for number in beams:
        lrf = replace(LaserRangeFinder(), beams=number)
        for seed in range(seeds):
            poses = random_poses(world, survey.poses, np.random.default_rng(seed))
            trajectory = Trajectory(np.arange(len(poses), dtype=np.float64), poses)
            for mode in modes:
                mapper = TimedMapper(LineMapper(mode, sigma=survey.sigma))
                run = simulate(
                    world, trajectory, lrf, caster=caster, noise=noise, mapper=mapper, rng=seed
                )
                update = float(np.median(mapper.spent))
                yield WorldEntry(mode, number, seed, score_run(run), update)
