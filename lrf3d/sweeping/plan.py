"""Plan: all runs of a grid, with keys and seeds that are derived from their contents."""

import inspect
import pickle
from collections.abc import Callable
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
from lrf3d.sweeping.grid import COLUMNS, SettingValue, SweepGrid, setting
from lrf3d.world.size import size_warning

KEY_DIGITS = 32
"""Hexadecimal digits of a key: 128 bits, so that no two keys are equal by chance."""

FORMAT = 2
"""Incremented when the same run gives other figures, so that old and new ones are not mixed."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A combination of settings, by column of the table, in a world.

    Its place is the pickled scenario and drive, which cells with other noises and mappers share.
    The mapper is a dict of keyword arguments of the LineMapper, or a user's mapper or its class.
    """

    world: str
    place: bytes
    columns: dict[str, SettingValue]
    noise: Noise
    mapper: Any


class PlannedRun(NamedTuple):
    """A run: its key, its cell, its number among the seeds, and the seed itself."""

    key: str
    cell: Cell
    seed: int
    noise_seed: int

    @property
    def columns(self) -> dict[str, SettingValue]:
        """The columns of its row that are known before it is made."""
        known = {"key": self.key, "world": self.cell.world, **self.cell.columns}
        return {**known, "seed": self.seed, "noise_seed": self.noise_seed}


@dataclass(frozen=True)
class Plan:
    """All runs of a grid, and its cells, both in the order of the table."""

    grid: SweepGrid
    cells: tuple[Cell, ...]
    runs: tuple[PlannedRun, ...]

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

    Routes are planned on the given side of the walls, which ``say`` is called with; ``collision``
    is called with the message of a collision, after which the drive continues.
    """
    cells: list[Cell] = []
    runs: list[PlannedRun] = []
    places: dict[str, bytes] = {}
    for name in grid.worlds:
        file = read_scenario_file(name)
        if any(cell.world == file.world.name for cell in cells):
            raise InputError(f"{name}: another world of the sweep is called {file.world.name}, too")
        if warning := size_warning(file.world):
            warn(f"{name}: {warning}")
        world = file.world
        walls = digest((world.segments, world.objects, world.heights, *world.materials))
        drives: dict[str, Trajectory] = {}
        for values in grid.combinations:
            scenario = scenario_of(file, [setting(*each) for each in values.items()])
            robot = digest(
                (scenario.start, scenario.route, scenario.poses, scenario.speed, scenario.radius,
                 scenario.scan_interval, scenario.lookahead, scenario.lrf.range_max)
            )  # fmt: skip
            if robot not in drives:
                routed = scenario.with_route(where=where, say=warn)
                if routed.planned is not None:
                    say(f"{name}: the route is planned {routed.planned} the walls")
                drive, used = (
                    routed.trajectory(on_collision=collision),
                    slice(None, None, grid.every),
                )
                drives[robot] = Trajectory(drive.times[used], drive.poses[used])
                if len(drives[robot]) == 1 < len(drive):
                    warn(f"{name}: one scan in {grid.every} leaves one of {len(drive)} to score")
            drive = drives[robot]
            place = digest(
                (walls, scenario.lrf, scenario.obstacles, scenario.radius, drive.times, drive.poses)
            )
            if place not in places:
                places[place] = pickle.dumps((replace(scenario, mapper={}), drive), protocol=5)
            for label, chosen in grid.mappers.items():
                cell = _cell(scenario, places[place], label, chosen, values)
                cells.append(cell)
                # The repr of a noise contains its class as well as its numbers.
                identity = digest((repr(cell.noise), _identity(label, cell.mapper)))
                for seed in range(grid.seeds):
                    key = digest((FORMAT, cell.world, place, identity, seed))[:KEY_DIGITS]
                    # All mappers and noises have the same seeds, to be compared run by run.
                    runs.append(PlannedRun(key, cell, seed, seed_of((place, seed))))
    return Plan(grid, tuple(cells), tuple(runs))


def _cell(
    scenario: Scenario, place: bytes, label: str, chosen: Any, values: dict[str, SettingValue]
) -> Cell:
    """The cell of a combination of settings and a mapper."""
    mapper = {"mode": chosen} if isinstance(chosen, str) else chosen
    if isinstance(mapper, dict):
        mapper = {**scenario.mapper, **mapper}
        line_mapper(scenario.noise, **mapper)  # An invalid threshold is found here.
    columns: dict[str, SettingValue] = {
        "mapper": label,
        "sigma_m": scenario.sigmas[0],
        "beams": scenario.lrf.beams,
    }
    columns |= {COLUMNS.get(key, key): value for key, value in values.items()}
    return Cell(scenario.name, place, columns, scenario.noise, mapper)


def _identity(label: str, mapper: Any) -> Any:
    """What a mapper holds: its settings, or the name and the source of a user's own."""
    if isinstance(mapper, dict):
        return mapper
    source = b""
    with suppress(OSError, TypeError):
        kind = mapper if inspect.isroutine(mapper) or inspect.isclass(mapper) else type(mapper)
        source = Path(inspect.getsourcefile(kind) or "").read_bytes()
    return label, name_of(mapper), source.hex()
