"""Several robots at once: each drives, scans and maps, and sees the others."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.collecting import simulate
from lrf3d.geometry import generator
from lrf3d.interrupts import Progress, silent
from lrf3d.laser import LaserRangeFinder
from lrf3d.robot import Trajectory
from lrf3d.robot.unicycle import RADIUS
from lrf3d.run import Run
from lrf3d.sensor import caster_of
from lrf3d.simulation import Mapper
from lrf3d.world import World


def simulate_fleet(
    world: World,
    trajectories: Sequence[Trajectory],
    lrf: LaserRangeFinder | None = None,
    *,
    radius: float = RADIUS,
    height: float = 1.0,
    mapper: Callable[[], Mapper] | None = None,
    rng: np.random.Generator | int | None = None,
    progress: Progress = silent,
    **settings: Any,
) -> list[Run]:
    """Drive several robots through a world at the same time.

    Args:
        world: The walls.
        trajectories: The drive of each robot; before and after it the robot is at rest.
        lrf: The laser range finder of each robot; it does not see its own robot.
        radius: Radius of the robots as others see them [m].
        height: Height of the robots [m].
        mapper: Makes the mapper of each robot; a LineMapper set up for the noise if not given.
        rng: A generator for the noise, or a seed; each robot has its own noise.
        progress: Called with the number of finished scans, and of all.
        **settings: ``caster``, ``noise`` and other arguments of `Simulation`.

    Raises:
        InputError: A scan takes longer than the interval to the next.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> drives = [lrf3d.follow_route([[1, 1], [2, 1]]), lrf3d.follow_route([[1, 2], [2, 2]])]
        >>> runs = lrf3d.simulate_fleet(room, drives, rng=0)
        >>> len(runs)
        2
    """
    settings["caster"] = caster_of(settings.get("caster", "embree"), world)
    outline = round_outline(radius)
    bodies = [DynamicObstacle(outline, trajectory, height) for trajectory in trajectories]
    generators = generator(rng).spawn(len(trajectories))
    total, runs = sum(map(len, trajectories)), list[Run]()
    for robot, trajectory in enumerate(trajectories):
        settings["obstacles"] = bodies[:robot] + bodies[robot + 1 :]
        settings["mapper"] = None if mapper is None else mapper()
        settings["radius"] = radius
        settings["rng"], before = generators[robot], sum(map(len, runs))
        report = partial(lambda before, done, _: progress(before + done, total), before)
        runs.append(simulate(world, trajectory, lrf, progress=report, **settings))
    return runs
