"""``scripts/bench robots``: how many robots can learn at once, and what does simulating them cost?

Robots drive through a world as environments of Gymnasium do, with actions drawn at random; each
step moves all of them, checks for collisions, casts all beams and makes what they see.
"""

import time

import numpy as np

from benchmarks.result import Result, Table
from lrf3d.cores import core_count
from lrf3d.gym import DriveVectorEnv
from lrf3d.progress import Progress, silent

WARM_UP = 5
"""Steps before the watch is started: what is compiled at the first is no part of a step."""

ROBOTS = Table(
    "rates",
    {
        "world": "world",
        "robots": "robots",
        "beams": "beams",
        "cores": "cores",
        "milliseconds_a_step": ("a step", "{:.2f} ms".format),
        "slowest_tenth_ms": ("nine tenths below", "{:.2f} ms".format),
        "robot_steps_a_second": ("scans a second", "{:,.0f}".format),
        "beams_a_second": ("beams a second", lambda rate: f"{rate / 1e6:.1f} M"),
    },
)
"""The median time of a step of all robots [ms], what nine tenths of the steps stay below [ms],
steps of single robots a second, which are their scans a second, and beams a second."""


def bench_robots(
    world: str = "city",
    *,
    robots: int = 1024,
    seconds: float = 10.0,
    seed: int = 0,
    progress: Progress = silent,
) -> Result:
    """Let robots drive at random for a time.

    Args:
        world: A built-in world or a world file.
        robots: How many.
        seconds: For how long [s].
        seed: Seed of the places, the goals and the actions.
        progress: Called with the seconds that have passed, and all.
    """
    envs = DriveVectorEnv(robots, world, sigma=0.0)
    envs.reset(seed=seed)
    rng = np.random.default_rng(seed)
    spent: list[float] = []
    episodes = number = 0
    begin = time.monotonic()
    passed = 0.0
    while passed <= seconds or not spent:
        actions = rng.uniform(-1.0, 1.0, (robots, 2))
        start = time.perf_counter()
        _, _, ended, cut, _ = envs.step(actions)
        if number >= WARM_UP:
            spent.append(time.perf_counter() - start)
            episodes += int((ended | cut).sum())
        number += 1
        passed = time.monotonic() - begin
        progress(min(int(passed), int(seconds)), int(seconds))
    median, slow = np.percentile(spent, [50.0, 90.0]).tolist()
    beams = envs.task.lrf.beams
    figures = {
        "world": envs.task.scenario.name,
        "robots": robots,
        "beams": beams,
        "cores": core_count(),
        "steps": len(spent),
        "milliseconds_a_step": 1e3 * median,
        "slowest_tenth_ms": 1e3 * slow,
        "robot_steps_a_second": robots / median,
        "beams_a_second": robots / median * beams,
        "episodes": episodes,
    }
    question = "How many robots can learn at once, and what does simulating them cost?"
    result = Result("robots", question, figures, took_s=passed)
    result.add(ROBOTS, **figures)
    return result
