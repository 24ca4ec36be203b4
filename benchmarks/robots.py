"""``scripts/bench robots``: how many robots can learn at once, and what does simulating them cost?

Robots drive through a world as environments of Gymnasium do, with actions drawn at random; each
step moves all of them, checks for collisions, casts all beams and makes what they see.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks.results import Result
from lrf3d.cores import core_count
from lrf3d.gym import DriveVectorEnv
from lrf3d.tables import table

WARM_UP = 5
"""Steps before the watch is started: what is compiled at the first is no part of a step."""


@dataclass(kw_only=True)
class RobotsResult(Result):
    """What was measured of many robots.

    Args:
        world: Name of the world.
        robots: How many robots drove.
        beams: Beams of each scan.
        cores: Cores that the process may use.
        steps: Steps of all robots that were timed.
        milliseconds_a_step: Median time of a step of all robots [ms].
        slowest_tenth_ms: What nine tenths of the steps stay below [ms].
        robot_steps_a_second: Steps of single robots a second, which is their scans a second.
        beams_a_second: Beams a second.
        episodes: Episodes that ended meanwhile.
    """

    benchmark = "robots"
    world: str
    robots: int
    beams: int
    cores: int
    steps: int
    milliseconds_a_step: float
    slowest_tenth_ms: float
    robot_steps_a_second: float
    beams_a_second: float
    episodes: int

    def tables(self) -> Iterable[str]:
        yield table(
            ("world", "robots", "beams", "cores", "a step", "nine tenths below", "scans a second",
             "beams a second"),
            [(
                self.world,
                f"{self.robots:,}",
                f"{self.beams}",
                f"{self.cores}",
                f"{self.milliseconds_a_step:.2f} ms",
                f"{self.slowest_tenth_ms:.2f} ms",
                f"{self.robot_steps_a_second:,.0f}",
                f"{self.beams_a_second / 1e6:.1f} M",
            )],
        )  # fmt: skip


def bench_robots(
    world: str = "city",
    *,
    robots: int = 1024,
    seconds: float = 10.0,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> RobotsResult:
    """Let robots drive at random for a time.

    Args:
        world: A built-in world or a world file.
        robots: How many.
        seconds: For how long [s].
        seed: Seed of the places, the goals and the actions.
        progress: Called with the seconds that have passed, and all.
    """
    envs = DriveVectorEnv(robots, world)
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
    return RobotsResult(
        world=envs.task.scenario.name,
        robots=robots,
        beams=beams,
        cores=core_count(),
        steps=len(spent),
        milliseconds_a_step=1e3 * median,
        slowest_tenth_ms=1e3 * slow,
        robot_steps_a_second=robots / median,
        beams_a_second=robots / median * beams,
        episodes=episodes,
        took_s=passed,
    )
