"""How many robots can learn at once, and what does simulating them cost?

Robots drive through a world as environments of Gymnasium do, with actions drawn at random; each
step moves all of them, checks for collisions, casts all beams and makes what they see.
"""

import time
from typing import Annotated

import numpy as np

from benchmarks.report import Report
from lrf3d.cores import core_count
from lrf3d.gym import DriveVectorEnv

WARM_UP = 5
"""Steps before the watch is started: what is compiled at the first is no part of a step."""


def bench(
    world: Annotated[str, "The world."] = "city",
    *,
    robots: Annotated[int, "Number of robots."] = 1024,
    seconds: Annotated[float, "How long to measure [s]."] = 10.0,
    seed: Annotated[int, "Seed of places, goals and actions."] = 0,
) -> Report:
    """Drive many robots at once, as environments of Gymnasium: steps and beams a second."""
    envs = DriveVectorEnv(robots, world, sigma=0.0)
    envs.reset(seed=seed)
    rng = np.random.default_rng(seed)
    spent: list[float] = []
    begin = time.monotonic()
    while time.monotonic() < begin + seconds or len(spent) <= WARM_UP:
        actions = rng.uniform(-1.0, 1.0, (robots, 2))
        start = time.perf_counter()
        envs.step(actions)
        spent.append(time.perf_counter() - start)
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
        scans_a_second=float(robots / median),
        beams_a_second=float(robots / median * envs.lrf.beams),
    )
    return report
