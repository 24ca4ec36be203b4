"""How many robots can learn at once, and what does simulating them cost?

Robots drive through a world as environments of Gymnasium do, with actions drawn at random; each
step moves all of them, checks for collisions, casts all beams and measures with the noise of the
world.
"""

import time
from typing import Annotated

import numpy as np

from benchmarks.moving import moving_scenes
from benchmarks.report import Report
from lrf3d.base.cores import core_count
from lrf3d.gym import DriveVectorEnv
from lrf3d.simulation.scenario import load_scenario

WARM_UP = 5
"""Steps before the watch is started: what is compiled at the first is no part of a step."""


def bench(
    world: Annotated[str, "The world."] = "city",
    *,
    robots: Annotated[int, "Number of robots."] = 1024,
    beams: Annotated[int, "Number of beams of each; that of the world if 0."] = 0,
    seconds: Annotated[float, "How long to measure [s]."] = 10.0,
    seed: Annotated[int, "Seed of places, goals and actions."] = 0,
) -> Report:
    """Drive many robots at once, as environments of Gymnasium: steps and beams a second.

    Then scans among moving obstacles are timed beside those of embreex, MuJoCo and irsim-x, where
    these are installed.
    """
    scenario = load_scenario(world, [f"laser.beams={beams}"] if beams else [])
    envs = DriveVectorEnv(robots, scenario)
    envs.reset(seed=seed)
    rng = np.random.default_rng(seed)
    spent, worked = list[float](), list[float]()
    begin = time.monotonic()
    while time.monotonic() < begin + seconds or len(spent) <= WARM_UP:
        actions = rng.uniform(-1.0, 1.0, (robots, 2))
        start, work = time.perf_counter(), time.process_time()
        envs.step(actions)
        spent.append(time.perf_counter() - start)
        worked.append(time.process_time() - work)
    median, slow = np.percentile(spent[WARM_UP:], [50.0, 90.0]).tolist()
    report = Report(__doc__.splitlines()[0])
    report.add(
        "robots",
        world=envs.scenario.name,
        robots=robots,
        beams=envs.lrf.beams,
        cores=core_count(),
        step_s=median,
        nine_tenths_below_s=slow,
        cpu_us_a_scan=1e6 * float(np.median(worked[WARM_UP:])) / robots,
        scans_a_second=float(robots / median),
        beams_a_second=float(robots / median * envs.lrf.beams),
    )
    moving_scenes(report, seconds / 2)
    return report
