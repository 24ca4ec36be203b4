"""How long does a scan take until its map is there, on maps of any size, at one density of walls?

In robust mode a generated town is scanned from every crossing until the map holds its walls. In
paper mode new segments are compared with all others, so that would take hours: there the true
walls are put into the map as if they had been seen.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.result import Result, Table
from benchmarks.timing import Timing, timed
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, lengths
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.mapping import LineMapper
from lrf3d.mapping.paper import PaperMapper
from lrf3d.mapping.segment_table import SegmentTable
from lrf3d.world import World
from lrf3d.world.generators import BLOCK_SIDE, city_blocks, city_crossings, generate_city

SIZES = (100, 1_000, 10_000, 100_000)
"""Walls of the towns."""

SURVEYOR = LaserRangeFinder(-np.pi, np.pi * (1.0 - 2.0 / 361), 361, range_max=30.0)
"""Scans a town from its crossings: all around, and as far as the next crossing and a bit."""

UPDATES, LEAST_UPDATES = 300, 5
"""Updates that are timed at most, and at least however long they take."""

SPREAD = 5
"""Crossings a way, around the middle, that the timed scans are taken at, as on a drive."""

POINTS = 50
"""Points of a wall that is put into a map as if it had been seen."""


UPDATES_BY_SIZE = Table(
    "map_sizes",
    {
        "walls": "walls of a town",
        "mode": "mode",
        "map_segments": "segments",
        "update": "update and map",
        "update.quartiles": "quartiles",
    },
    names=("walls", "mode"),
    time="update",
)
"""The time of an update with a scan of 181 beams and a look at the map, on maps of each size."""


def measure_sizes(
    result: Result,
    sizes: Sequence[int],
    *,
    seconds: float,
    until: float,
    step: Callable[[], None] = lambda: None,
) -> None:
    """Time updates on maps of towns, the smallest first.

    Args:
        result: Where the rows go.
        sizes: Walls of the towns.
        seconds: Time for the updates of one row [s].
        until: When to stop [s], on the clock of time.monotonic.
        step: Called after each row, measured or left out.
    """
    built = 0.0
    for walls in sorted(sizes):
        world = generate_city(walls)
        caster = PlanarCaster(world)
        for mode in ("robust", "paper"):
            expected = seconds + (built * walls if mode == "robust" else 0.0)
            if time.monotonic() + expected > until:
                words = f"a map of {walls:,} segments, {mode} mode"
                result.skipped.append(f"{words}: the time does not suffice")
                step()
                continue
            start = time.monotonic()
            mapper = surveyed(caster, walls) if mode == "robust" else prefilled(world)
            if mode == "robust":
                built = (time.monotonic() - start) / walls
            segments = len(mapper.map)
            update = _updates(mapper, caster, walls, seconds)
            result.add(
                UPDATES_BY_SIZE, mode=mode, walls=walls, map_segments=segments, update=update
            )
            step()


def surveyed(caster: PlanarCaster, walls: int) -> LineMapper:
    """A mapper that has scanned a generated city from every crossing, the outermost included."""
    columns, rows = city_blocks(walls)
    y, x = np.mgrid[0 : rows + 1, 0 : columns + 1].reshape(2, -1)
    poses: Float = np.column_stack(
        [BLOCK_SIDE * (x - 0.5), BLOCK_SIDE * (y - 0.5), np.zeros(len(x))]
    )
    mapper, noise, rng = LineMapper(sigma=SIGMA), _noise(), np.random.default_rng(0)
    for pose in poses:
        mapper.update(noise(caster.cast(SURVEYOR, pose), rng))
    return mapper


def prefilled(world: World) -> LineMapper:
    """A mapper in paper mode whose map holds the walls of a world."""
    mapper = LineMapper("paper", sigma=SIGMA)
    inner = mapper._mapper
    assert isinstance(inner, PaperMapper)
    walls, count = world.segments, len(world.segments)
    half = 0.5 * (walls[:, 2:] - walls[:, :2])
    # Points spread evenly over a length L scatter by L²/12 about its middle.
    along = POINTS * lengths(walls) ** 2 / 12.0
    unit = half / (0.5 * lengths(walls)[:, None])
    moments = np.column_stack(
        [
            np.full(count, POINTS),
            walls[:, :2] + half,
            along * unit[:, 0] ** 2,
            along * unit[:, 0] * unit[:, 1],
            along * unit[:, 1] ** 2,
        ]
    )
    table = SegmentTable(walls, moments, np.full(count, POINTS), world.objects)
    inner._table = table
    return mapper


def _updates(mapper: LineMapper, caster: PlanarCaster, walls: int, seconds: float) -> Timing:
    """Time updates with new scans of 181 beams, after each of which the map is looked at."""
    lrf, noise, rng = LaserRangeFinder(), _noise(), np.random.default_rng(1)
    spent: list[float] = []
    for pose in city_crossings(walls, UPDATES, seed=1, spread=SPREAD):
        scan = noise(caster.cast(lrf, pose), rng)
        spent.append(timed(mapper.update, scan) + timed(lambda: mapper.map.segments))
        if len(spent) >= LEAST_UPDATES and sum(spent) > seconds:
            break
    return Timing.of(spent)


def _noise() -> ProportionalNoise:
    return ProportionalNoise(SIGMA)
