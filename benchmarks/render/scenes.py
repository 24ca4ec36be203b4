"""Runs to draw in benchmarks, and films of them.

The city, and generated cities of any size at one density.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from benchmarks.render.stock import StockFilm
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.mapping import LineMapper
from lrf3d.render.film import Film
from lrf3d.robot import Trajectory, follow_route
from lrf3d.run import Run
from lrf3d.scenario_file import load_scenario
from lrf3d.scene.moments import LAYERS
from lrf3d.simulation import simulate
from lrf3d.world import World
from lrf3d.world.generators import BLOCK_SIDE, city_blocks, generate_city

FRAMES = 24
"""Moments of a run that are drawn in turn."""

PLAYBACK = 4.0
"""Seconds of a run in a second of its film."""

SCANS = 60
"""Scans of a run: enough to see walls near and far."""

LOWEST, HIGHEST = 5.0, 18.0
"""Heights of generated buildings [m]."""


def city_run(scans: int = SCANS) -> Run:
    """The first scans of the drive through ``city``."""
    scenario = load_scenario("city")
    drive = scenario.trajectory()
    every = Trajectory(drive.times[:scans], drive.poses[:scans])
    return _run(scenario.world, every, scenario.lrf)


def generated_run(buildings: int, scans: int = SCANS) -> Run:
    """A drive round a corner in the middle of a generated city."""
    heights = np.random.default_rng(0).uniform(LOWEST, HIGHEST, buildings)
    world = replace(generate_city(4 * buildings), heights=np.repeat(heights, 4))
    middle = BLOCK_SIDE * ((np.array(city_blocks(4 * buildings)) - 1) // 2 + 0.5)
    route = middle + BLOCK_SIDE * np.array([[-1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
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


def make_film(
    run: Run, size: tuple[int, int], samples: int = 0, *, layers: Sequence[str] | None = None
) -> Film:
    """A film from the chase camera, in the full look where no layers are given."""
    chosen = LAYERS if layers is None else layers
    return Film(run, size=size, view="chase", samples=samples, playback=PLAYBACK, layers=chosen)


def moments(run: Run) -> Float:
    """Moments of a run [s] that are drawn in turn; no two are alike."""
    first, last = run.trajectory.times[[0, -1]].tolist()
    return np.linspace(first, last, FRAMES)


def frames(film: Film | StockFilm, times: Float) -> Callable[[int], object]:
    """What draws one frame after the other, whatever number it is called with."""
    order = cycle(times.tolist())

    def draw(number: int) -> object:
        # As in a film, one moment after the other.
        if isinstance(film, Film):
            film.forget()
        return film.draw(next(order))

    return draw
