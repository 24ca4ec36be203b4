"""Plan: all runs of a grid, with keys and seeds that are derived from their contents.

A plan holds places, each a world with its drive and range finder, and the runs at them.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.robot import Trajectory
from lrf3d.robot.free_space import Side
from lrf3d.scenario import Scenario
from lrf3d.scenario_file import read_scenario_file, scenario_of
from lrf3d.simulation import line_mapper
from lrf3d.sweep.grid import BEAMS, MODE, SIGMA, SettingValue, SweepGrid, setting
from lrf3d.sweep.task import Order, Place
from lrf3d.world import World
from lrf3d.world.size import size_warning

SETTING_COLUMNS = {MODE: "mode", SIGMA: "sigma_m", BEAMS: "beams"}
"""Columns of the table for the settings that every sweep lists; others keep their names."""

KEY_DIGITS = 32
"""Hexadecimal digits of a key: 128 bits, so that no two keys are equal by chance."""

FORMAT = 1
"""Incremented when the same run gives other figures, so that old and new ones are not mixed."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A combination of settings in a world.

    Args:
        world: Name of the world.
        place: Digest of the place where its runs are made.
        columns: Its settings, by column of the table.
    """

    world: str
    place: str
    columns: dict[str, SettingValue]


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """A run: its order, the index of its cell, and its seed."""

    order: Order
    cell: int
    seed: int


@dataclass(frozen=True)
class Plan:
    """All runs of a grid.

    Args:
        grid: The grid.
        places: The places by their digests.
        cells: The combinations.
        runs: The runs, in the order of the table.
    """

    grid: SweepGrid
    places: dict[str, Place]
    cells: tuple[Cell, ...]
    runs: tuple[PlannedRun, ...]

    def described(self, run: PlannedRun) -> dict[str, SettingValue]:
        """The columns of a run that are known before it is made."""
        cell = self.cells[run.cell]
        return {
            "key": run.order.key,
            "world": cell.world,
            **cell.columns,
            "seed": run.seed,
            "noise_seed": run.order.seed,
        }

    @property
    def worlds(self) -> list[str]:
        """The names of the worlds."""
        return list(dict.fromkeys(cell.world for cell in self.cells))

    @property
    def axes(self) -> dict[str, tuple[SettingValue, ...]]:
        """The values of each axis, by column."""
        return {column_of(name): values for name, values in self.grid.axes.items()}


def column_of(name: str) -> str:
    """The column of a setting."""
    return SETTING_COLUMNS.get(name, name)


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
        where: The side of the walls on which routes are planned; it depends on the world if not
            given.
        say: Called with the side on which routes are planned.
        warn: Called with warnings.

    Raises:
        InputError: A world, a setting or a drive is invalid.
        CollisionError: A drive would hit a wall.
    """
    places: dict[str, Place] = {}
    cells: list[Cell] = []
    runs: list[PlannedRun] = []
    for name in grid.worlds:
        file = read_scenario_file(name)
        known = next((cell for cell in cells if cell.world == file.world.name), None)
        if known is not None:
            raise InputError(f"{name}: another world of the sweep is called {known.world}, too")
        warning = size_warning(file.world)
        if warning is not None:
            warn(f"{name}: {warning}")
        drives = _Drives(file.world, grid.every, collision, where, warn)
        for values in grid.combinations:
            scenario = scenario_of(file, [setting(*each) for each in values.items()])
            place_key, place = drives.place(scenario)
            # An invalid threshold is found here, not on a worker.
            mode = line_mapper(scenario.noise, **scenario.mapper).mode
            usual: dict[str, SettingValue] = {
                "mode": mode,
                "sigma_m": scenario.sigmas[0],
                "beams": scenario.lrf.beams,
            }
            varied = {column_of(key): value for key, value in values.items()}
            places.setdefault(place_key, place)
            cells.append(Cell(scenario.name, place_key, {**usual, **varied}))
            cell = len(cells) - 1
            runs += [_run(scenario, place_key, cell, seed) for seed in range(grid.seeds)]
        for side in sorted(drives.planned):
            say(f"{name}: the route is planned {side} the walls")
    return Plan(grid, places, tuple(cells), tuple(runs))


def _run(scenario: Scenario, place_key: str, cell: int, seed: int) -> PlannedRun:
    noise, mapper = scenario.noise, dict(scenario.mapper)
    # The repr of a noise contains its class as well as its numbers.
    key = digest((FORMAT, scenario.name, place_key, repr(noise), mapper, seed))[:KEY_DIGITS]
    # All mappers and noises have the same seeds, so that they can be compared run by run.
    return PlannedRun(Order(key, noise, mapper, seed_of((place_key, seed))), cell, seed)


class _Drives:
    """The drives through one world, each computed once."""

    def __init__(
        self,
        world: World,
        every: int,
        collision: Callable[[str], None] | None,
        where: Side | None,
        warn: Callable[[str], None],
    ) -> None:
        self._walls = digest((world.segments, world.objects, world.heights))
        self._every, self._collision, self._where = every, collision, where
        self._warn = warn
        self.planned: set[str] = set()
        self._driven: dict[str, Trajectory] = {}

    def place(self, scenario: Scenario) -> tuple[str, Place]:
        """The place of a scenario, and its digest."""
        robot = (
            scenario.start, scenario.route, scenario.poses, scenario.speed,
            scenario.scan_interval, scenario.radius,
        )  # fmt: skip
        # A planned route depends on range_max.
        drive_key = digest((robot, scenario.lrf.range_max if scenario.route is None else None))
        if drive_key not in self._driven:
            routed = scenario.with_route(where=self._where)
            if routed.planned is not None:
                self.planned.add(routed.planned)
            drive = routed.trajectory(on_collision=self._collision)
            used = slice(None, None, self._every)
            if len(drive) > 1 and len(drive.times[used]) == 1:
                self._warn(
                    f"{scenario.name}: one scan in {self._every} leaves one of {len(drive)}, whose"
                    " map is all that is scored; use more with a smaller --every"
                )
            self._driven[drive_key] = Trajectory(drive.times[used], drive.poses[used])
        trajectory = self._driven[drive_key]
        place_key = digest(
            (self._walls, scenario.lrf, scenario.obstacles, scenario.radius, trajectory.times,
             trajectory.poses)
        )  # fmt: skip
        return place_key, Place(scenario, trajectory)


def digest(value: Any) -> str:
    """A digest (64 hexadecimal digits) of arrays, dataclasses, mappings, rows and plain values."""
    text = json.dumps(_plain(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def seed_of(value: Any) -> int:
    """A seed of 63 bits for NumPy's SeedSequence, from the contents of a value."""
    return int(digest(value)[:16], 16) >> 1


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        # A fixed byte order makes the digest the same on all machines; −0 counts as 0.
        kind = "<f8" if value.dtype.kind == "f" else "<i8"
        ordered = np.ascontiguousarray(value + 0, dtype=kind)
        return ["array", value.shape, hashlib.sha256(ordered.tobytes()).hexdigest()]
    if is_dataclass(value):
        held = {each: getattr(value, each.name) for each in fields(value)}
        return {
            each.name: _plain(one)
            for each, one in held.items()
            if not (each.metadata.get("later") and one == each.default)
        }
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return value
