"""Plan: all runs of a grid, with keys and seeds that are derived from their contents.

A grid enters; places leave, each a world with its drive and range finder, and the runs at them.
"""

import inspect
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from lrf3d.digest import digest, name_of, seed_of
from lrf3d.errors import InputError
from lrf3d.laser import Noise
from lrf3d.planning.ground import Side
from lrf3d.robot import Trajectory
from lrf3d.scenario import Scenario, read_scenario_file, scenario_of
from lrf3d.simulation import line_mapper
from lrf3d.sweeping.grid import MODE, SettingValue, SweepGrid, column_of, setting
from lrf3d.world.size import size_warning

KEY_DIGITS = 32
"""Hexadecimal digits of a key: 128 bits, so that no two keys are equal by chance."""

FORMAT = 2
"""Incremented when the same run gives other figures, so that old and new ones are not mixed."""


class Place(NamedTuple):
    """A scenario, whose noise and mapper are not used, and a drive: the scans without noise."""

    scenario: Scenario
    trajectory: Trajectory


@dataclass(frozen=True, slots=True)
class Cell:
    """A combination of settings in a world.

    Args:
        world: Name of the world.
        place: Digest of the place where its runs are made.
        columns: Its settings, by column of the table.
        noise: Turns true scans into measured ones.
        mapper: Keyword arguments of the LineMapper, or a user's mapper or its class.
        identity: Digest of the noise and the mapper.
    """

    world: str
    place: str
    columns: dict[str, SettingValue]
    noise: Noise
    mapper: Any
    identity: str


class PlannedRun(NamedTuple):
    """A run: its key, the index of its cell, its number among the seeds, and the seed itself."""

    key: str
    cell: int
    seed: int
    noise_seed: int


@dataclass(frozen=True)
class Plan:
    """All runs of a grid: places by their digests, cells, and the runs in the table's order."""

    grid: SweepGrid
    places: dict[str, Place]
    cells: tuple[Cell, ...]
    runs: tuple[PlannedRun, ...]

    def described(self, run: PlannedRun) -> dict[str, SettingValue]:
        """The columns of a run that are known before it is made."""
        cell = self.cells[run.cell]
        return {
            "key": run.key,
            "world": cell.world,
            **cell.columns,
            "seed": run.seed,
            "noise_seed": run.noise_seed,
        }

    @property
    def worlds(self) -> list[str]:
        """The names of the worlds."""
        return list(dict.fromkeys(cell.world for cell in self.cells))


def make_plan(
    grid: SweepGrid,
    *,
    collision: Callable[[str], None] | None = None,
    where: Side | None = None,
    say: Callable[[str], None] = lambda message: None,
    warn: Callable[[str], None] = lambda message: None,
) -> Plan:
    """Plan all runs of a grid: each world is read once, and each route and drive computed once.

    Args:
        grid: The grid.
        collision: Called with the message of a collision, after which the drive continues.
        where: The side of the walls on which routes are planned.
        say: Called with the side on which a route was planned.
        warn: Called with warnings.

    Raises:
        InputError: A world, a setting or a drive is invalid.
        CollisionError: A drive would hit a wall.
    """
    places: dict[str, Place] = {}
    cells: list[Cell] = []
    drives: dict[str, Trajectory] = {}
    for name in grid.worlds:
        file = read_scenario_file(name)
        if any(cell.world == file.world.name for cell in cells):
            raise InputError(f"{name}: another world of the sweep is called {file.world.name}, too")
        if warning := size_warning(file.world):
            warn(f"{name}: {warning}")
        for values in grid.combinations:
            scenario = scenario_of(file, [setting(*each) for each in values.items()])
            drive_key = _drive_key(scenario)
            if drive_key not in drives:
                routed = scenario.with_route(where=where, say=warn)
                if routed.planned is not None:
                    say(f"{name}: the route is planned {routed.planned} the walls")
                drive = routed.trajectory(on_collision=collision)
                drives[drive_key] = _thinned(drive, grid.every, scenario.name, warn)
            drive = drives[drive_key]
            place = digest(
                (_walls(scenario), scenario.lrf, scenario.obstacles, scenario.radius,
                 drive.times, drive.poses)
            )  # fmt: skip
            places.setdefault(place, Place(replace(scenario, mapper={}), drive))
            cells += _cells(scenario, place, values, grid)
    return Plan(grid, places, tuple(cells), tuple(_runs(cells, grid.seeds)))


def _cells(
    scenario: Scenario, place: str, values: dict[str, SettingValue], grid: SweepGrid
) -> Iterator[Cell]:
    """The cells of a combination of settings: one for each mapper."""
    for label, chosen in grid.mappers.items():
        mapper: Any = chosen
        if isinstance(chosen, str):
            mapper = {**scenario.mapper, "mode": chosen}
        elif isinstance(chosen, dict):
            mapper = {**scenario.mapper, **chosen}
        if isinstance(mapper, dict):
            line_mapper(scenario.noise, **mapper)  # An invalid threshold is found here.
        columns: dict[str, SettingValue] = {
            "mapper": label,
            "sigma_m": scenario.sigmas[0],
            "beams": scenario.lrf.beams,
        }
        columns |= {column_of(key): value for key, value in values.items() if key != MODE}
        # The repr of a noise contains its class as well as its numbers.
        identity = digest((repr(scenario.noise), _identity(label, mapper)))
        yield Cell(scenario.name, place, columns, scenario.noise, mapper, identity)


def _runs(cells: list[Cell], seeds: int) -> Iterator[PlannedRun]:
    for number, cell in enumerate(cells):
        for seed in range(seeds):
            key = digest((FORMAT, cell.world, cell.place, cell.identity, seed))[:KEY_DIGITS]
            # All mappers and noises have the same seeds, so that they can be compared run by run.
            yield PlannedRun(key, number, seed, seed_of((cell.place, seed)))


def _identity(label: str, mapper: Any) -> Any:
    """What a mapper holds: its settings, or the name and the source of a user's own."""
    if isinstance(mapper, dict):
        return mapper
    source = b""
    with suppress(OSError, TypeError):
        kind = mapper if inspect.isroutine(mapper) or inspect.isclass(mapper) else type(mapper)
        source = Path(inspect.getsourcefile(kind) or "").read_bytes()
    return label, name_of(mapper), source.hex()


def _walls(scenario: Scenario) -> str:
    world = scenario.world
    return digest((world.segments, world.objects, world.heights))


def _drive_key(scenario: Scenario) -> str:
    """A digest of what determines the drive; that of a planned route depends on range_max."""
    robot = (
        scenario.start, scenario.route, scenario.poses, scenario.speed, scenario.scan_interval,
        scenario.radius,
    )  # fmt: skip
    reach = scenario.lrf.range_max if scenario.route is None else None
    return digest((_walls(scenario), robot, reach))


def _thinned(drive: Trajectory, every: int, name: str, warn: Callable[[str], None]) -> Trajectory:
    """Every n-th pose of a drive."""
    used = slice(None, None, every)
    if len(drive) > 1 and len(drive.times[used]) == 1:
        warn(
            f"{name}: one scan in {every} leaves one of {len(drive)}, whose map is all that is"
            " scored; use more with a smaller --every"
        )
    return Trajectory(drive.times[used], drive.poses[used])
