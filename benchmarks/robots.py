"""``bench robots``: how fast do many robots learn at once, and what does the simulator take of it?

Robots drive through a world as environments of Gymnasium do, with actions drawn at random; each
step moves all of them, looks for collisions, casts all beams and makes what they see.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lrf3d.cores import core_count
from lrf3d.gym import DriveVectorEnv

WARM_UP = 5
"""Steps before the watch is started: what is compiled at the first is no part of a step."""


@dataclass(frozen=True, slots=True)
class RobotsBenchmark:
    """What was measured.

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

    def as_dict(self) -> dict[str, Any]:
        """The benchmark in JSON's types."""
        return {"benchmark": "robots", **asdict(self)}

    def rows(self) -> list[tuple[str, str]]:
        """The benchmark in a few lines for people."""
        median, slow = self.milliseconds_a_step, self.slowest_tenth_ms
        return [
            ("robots", f"{self.robots:,} in {self.world}, {self.beams} beams each"),
            ("a step", f"{median:.2f} ms, nine tenths below {slow:.2f} ms, {self.cores} cores"),
            ("rate", f"{self.robot_steps_a_second:,.0f} scans a second"),
            ("beams", f"{self.beams_a_second / 1e6:.1f} million a second"),
        ]


def bench_robots(
    world: str = "city",
    *,
    robots: int = 1024,
    seconds: float = 10.0,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> RobotsBenchmark:
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
    episodes = 0
    begin = time.monotonic()
    for number in range(10**9):
        actions = rng.uniform(-1.0, 1.0, (robots, 2))
        start = time.perf_counter()
        _, _, ended, cut, _ = envs.step(actions)
        if number >= WARM_UP:
            spent.append(time.perf_counter() - start)
            episodes += int((ended | cut).sum())
        passed = time.monotonic() - begin
        progress(min(int(passed), int(seconds)), int(seconds))
        if passed > seconds and spent:
            break
    median, slow = np.percentile(spent, [50.0, 90.0]).tolist()
    rate = robots / median
    beams = envs.task.lrf.beams
    return RobotsBenchmark(
        envs.task.scenario.name,
        robots,
        beams,
        core_count(),
        len(spent),
        1e3 * median,
        1e3 * slow,
        rate,
        rate * beams,
        episodes,
    )
