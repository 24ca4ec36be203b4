"""How does the time of a scan grow with walls, beams and obstacles, and that of a step with robots?

Times are CPU times, medians over poses of a generated city, of the planar caster and its crowd.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Annotated

import numpy as np

from benchmarks.ranges import LRF, city_crossings, errors
from benchmarks.report import Figure, Report, scatter
from lrf3d.casting import PlanarCaster
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.geometry.lines import Float, Int
from lrf3d.gym import DriveVectorEnv
from lrf3d.laser import LaserRangeFinder
from lrf3d.robot import Trajectory
from lrf3d.simulation.scenario import load_scenario
from lrf3d.world import World
from lrf3d.world.generators import generate_city

WALLS = 400
"""Walls of the city in which beams and obstacles grow."""

POSES = 64
"""Poses of scans."""


def bench(
    *,
    most: Annotated[int, "Largest number of walls; others grow up to its share of 10⁶."] = 1000000,
    figure: Figure = None,
) -> Report:
    """Time scans and steps for growing numbers of walls, beams, obstacles and robots."""
    report = Report(__doc__.splitlines()[0])
    _walls(report, max(100, most))
    _beams(report, max(1, 4096 * most // 10**6))
    _obstacles(report, max(1, 1000 * most // 10**6))
    _robots(report, max(10, 10000 * most // 10**6))
    if figure is not None:
        rows = report.tables["growth"]
        scatter(figure, rows, "number", "cpu_s", "of", ("number", "CPU time [s]"))
    return report


def _steps(first: int, most: int, factor: int) -> list[int]:
    count = 1 + int(np.log(most / first) / np.log(factor) + 1e-9)
    return [first * factor**k for k in range(count)]


def _cpu(work: Callable[[int], object], calls: int) -> float:
    """The median CPU time of calls with numbers [s], after one that compiles."""
    spent = list[float]()
    work(0)
    for number in range(calls):
        begin = time.process_time()
        work(number)
        spent.append(time.process_time() - begin)
    return float(np.median(spent))


def _cast(caster: PlanarCaster, lrf: LaserRangeFinder, poses: Float, k: int) -> None:
    caster.cast(lrf, poses[k])


def _stop(crowd: Crowd, poses: Float, ranges: Float, met: Int, k: int) -> None:
    part = slice(k, k + 1)
    # At a new time obstacles are placed, as in a drive; they rest.
    crowd.stop_scans(LRF, poses[part], 1e-3 * k, ranges[part], met[part])


def _step(envs: DriveVectorEnv, actions: Float, k: int) -> None:
    envs.step(actions[k])


def _walls(report: Report, most: int) -> None:
    for walls in _steps(100, most, 10):
        caster = PlanarCaster(generate_city(walls))
        poses = city_crossings(walls, POSES)
        spent = _cpu(partial(_cast, caster, LRF, poses), POSES)
        report.add("growth", of="walls: a scan of 181 beams", number=walls, cpu_s=spent)


def _beams(report: Report, most: int) -> None:
    caster = PlanarCaster(generate_city(WALLS))
    poses = city_crossings(WALLS, POSES)
    for beams in _steps(1, most, 4):
        lrf = LaserRangeFinder(beams=beams)
        spent = _cpu(partial(_cast, caster, lrf, poses), POSES)
        report.add("growth", of="beams: a scan among 400 walls", number=beams, cpu_s=spent)


def _obstacles(report: Report, most: int) -> None:
    world = generate_city(WALLS)
    caster = PlanarCaster(world)
    poses = city_crossings(WALLS, POSES)
    true, walls = caster.scan_batch(LRF, poses)
    low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
    rng = np.random.default_rng(0)
    for count in _steps(1, most, 10):
        places = np.column_stack([rng.uniform(low, high, (count, 2)), np.zeros(count)])
        crowd = Crowd(
            [DynamicObstacle(round_outline(0.4), Trajectory([0.0], [place])) for place in places]
        )
        ranges, met = true.copy(), walls.copy()
        spent = _cpu(partial(_stop, crowd, poses, ranges, met), POSES)
        sides = np.concatenate([each.walls(0.0) for each in crowd.obstacles])
        exact = PlanarCaster(World(np.vstack([world.segments, sides]))).cast_batch(LRF, poses)
        off = float(errors(ranges, exact, LRF).max())
        report.add(
            "growth", of="obstacles: added to a scan of 181 beams", number=count, cpu_s=spent,
            error_m=off,
        )  # fmt: skip


def _robots(report: Report, most: int) -> None:
    rng = np.random.default_rng(0)
    scenario = load_scenario("city", ["laser.beams=64"])
    for together in (False, True):
        for robots in _steps(1, most, 10):
            envs = DriveVectorEnv(robots, scenario, together=together)
            envs.reset(seed=0)
            actions = rng.uniform(-1.0, 1.0, (8, robots, 2))
            spent = _cpu(partial(_step, envs, actions), 8)
            kind = "together: a robot's step" if together else "robots: a robot's step alone"
            report.add("growth", of=kind, number=robots, cpu_s=spent / robots)
