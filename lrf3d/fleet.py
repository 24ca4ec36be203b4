"""Several robots at once: each drives, scans and maps, and sees the others."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.casting.timed import Caster
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.noise import Noise
from lrf3d.progress import Progress, silent
from lrf3d.robot import Trajectory
from lrf3d.robot.unicycle import RADIUS
from lrf3d.run import Run
from lrf3d.sensor import caster_of
from lrf3d.simulation import Mapper, simulate
from lrf3d.world import World

HEIGHT = 1.0
"""Default height of a robot [m]."""


def simulate_fleet(
    world: World,
    trajectories: Sequence[Trajectory],
    lrf: LaserRangeFinder | None = None,
    *,
    radius: float = RADIUS,
    height: float = HEIGHT,
    caster: Caster | str = "embree",
    noise: Noise | None = None,
    mapper: Callable[[], Mapper] | None = None,
    rng: np.random.Generator | int | None = None,
    progress: Progress = silent,
) -> list[Run]:
    """Drive several robots through a world at the same time.

    Args:
        world: The walls.
        trajectories: The drive of each robot; before and after it the robot is at rest.
        lrf: The laser range finder of each robot; it does not see its own robot.
        radius: Radius of the robots as others see them [m].
        height: Height of the robots [m].
        caster: Casts the beams: ``embree``, ``planar``, or an object with ``cast``.
        noise: Turns true scans into measured ones; no noise if not given.
        mapper: Makes the mapper of each robot; a LineMapper set up for the noise if not given.
        rng: A generator for the noise, or a seed; each robot has its own noise.
        progress: Called with the number of finished scans, and of all.

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
    caster = caster_of(caster, world)
    outline = round_outline(radius)
    bodies = [DynamicObstacle(outline, trajectory, height) for trajectory in trajectories]
    total, done, runs = sum(map(len, trajectories)), 0, []
    for robot, (trajectory, robot_rng) in enumerate(
        zip(trajectories, np.random.default_rng(rng).spawn(len(trajectories)), strict=True)
    ):
        runs.append(
            simulate(
                world,
                trajectory,
                lrf,
                caster=caster,
                noise=noise,
                mapper=None if mapper is None else mapper(),
                rng=robot_rng,
                obstacles=bodies[:robot] + bodies[robot + 1 :],
                progress=partial(_report, progress, done, total),
            )
        )
        done += len(trajectory)
    return runs


def _report(progress: Progress, before: int, total: int, done: int, _: int) -> None:
    """Report the scans of one robot as a part of all scans."""
    progress(before + done, total)
