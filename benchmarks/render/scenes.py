"""Runs to draw in benchmarks: the city, and generated cities of any size at one density."""

from dataclasses import replace

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory, follow_route
from lrf3d.scenario import SIGMA, load_scenario
from lrf3d.simulation import Run, simulate
from lrf3d.study.experiment import trajectory_of
from lrf3d.world import World
from lrf3d.world.generate import BLOCK, city_blocks, generate_city

SCANS = 60
"""Scans of a run: enough to see walls near and far."""

LOWEST, HIGHEST = 5.0, 18.0
"""Heights of generated buildings [m]."""


def city_run(scans: int = SCANS) -> Run:
    """The first scans of the drive through ``city``."""
    scenario = load_scenario("city")
    drive = trajectory_of(scenario)
    every = Trajectory(drive.times[:scans], drive.poses[:scans])
    return _run(scenario.world, every, scenario.lrf)


def generated_run(buildings: int, scans: int = SCANS) -> Run:
    """A drive round a corner in the middle of a generated city of so many buildings."""
    heights = np.random.default_rng(0).uniform(LOWEST, HIGHEST, buildings)
    world = replace(generate_city(4 * buildings), heights=np.repeat(heights, 4))
    middle = BLOCK * ((np.array(city_blocks(4 * buildings)) - 1) // 2 + 0.5)
    route = middle + BLOCK * np.array([[-1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    drive = follow_route(route, speed=4.0, dt=0.2)
    return _run(world, Trajectory(drive.times[:scans], drive.poses[:scans]), LaserRangeFinder())


def _run(world: World, drive: Trajectory, lrf: LaserRangeFinder) -> Run:
    return simulate(
        world,
        drive,
        lrf,
        caster=PlanarCaster(world),
        noise=ProportionalNoise(SIGMA),
        mapper=LineMapper(sigma=SIGMA),
        rng=0,
    )
