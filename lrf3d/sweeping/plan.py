"""Plan: all runs of a sweep, with keys and seeds that are derived from their contents."""

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

from lrf3d.digest import digest, name_of, seed_of
from lrf3d.errors import InputError, shown
from lrf3d.geometry import whole_number
from lrf3d.mapping.mapper import MODES
from lrf3d.planning.free_space import Side
from lrf3d.robot import Trajectory
from lrf3d.scenario import Scenario, read_scenario_file, scenario_of
from lrf3d.simulation import line_mapper
from lrf3d.world.schema import read_settings
from lrf3d.world.size import size_warning

SIGMA, MODE, BEAMS = "noise.sigma", "mapper.mode", "laser.beams"
"""The settings that have an option of their own."""

SIGMAS = (0.01, 0.04, 0.07, 0.21, 0.42, 0.63)
"""Default noises [m]: those of the paper's figures, and some between."""

SEEDS = 20
"""Default number of seeds of each setting."""

USUAL = {"robust": "robust", "paper": "paper"}
"""Default mappers: both modes of the LineMapper."""

MOST_RUNS = 1_000_000
"""Largest number of seeds and of runs: the plan of all runs is held in memory, and even the
fastest take hours on one core."""

COLUMNS = {SIGMA: "sigma_m", BEAMS: "beams"}
"""Columns of the table for the settings that every sweep lists; others keep their names."""

KEY_DIGITS = 32
"""Hexadecimal digits of a key: 128 bits, so that no two keys are equal by chance."""

FORMAT = 2
"""Incremented when the same run gives other figures, so that old and new ones are not mixed."""

SettingValue = float | int | str | bool
Row = dict[str, Any]
Say = Callable[[str], None]


class PlannedRun(NamedTuple):
    """A run: the columns of its row that are known before it is made, and what it is made of.

    The mapper is a dict of keyword arguments of the LineMapper, or a user's mapper or its class.
    """

    columns: Row
    scenario: Scenario
    drive: Trajectory
    mapper: Any

    @property
    def key(self) -> str:
        """The key, which is equal for equal runs."""
        return str(self.columns["key"])


@dataclass(frozen=True)
class Plan:
    """All runs of a sweep in the order of its table, and the values of what is varied by column."""

    runs: tuple[PlannedRun, ...]
    varied: dict[str, tuple[SettingValue, ...]]
    seeds: int

    @property
    def worlds(self) -> list[str]:
        """The names of the worlds."""
        return list(dict.fromkeys(str(run.columns["world"]) for run in self.runs))

    @property
    def columns(self) -> list[str]:
        """The columns that say what a run varies; runs that differ only in the seed share them."""
        return [name for name in self.runs[0].columns if name not in ("key", "seed", "noise_seed")]


def make_plan(
    worlds: Sequence[str],
    axes: Mapping[str, Sequence[SettingValue]] | None = None,
    *,
    mappers: Mapping[str, Any] = USUAL,
    seeds: int = SEEDS,
    collision: Say | None = None,
    where: Side | None = None,
    say: Say = lambda message: None,
    warn: Say = lambda message: None,
) -> Plan:
    """Plan the runs of every combination of worlds, settings of world files, mappers and seeds.

    The arguments are those of `sweep`. Each world is read once, and each route and drive computed
    once. Routes are planned on the given side of the walls, which ``say`` is called with;
    ``collision`` is called with the message of a collision, after which the drive continues.
    """
    axes = {SIGMA: SIGMAS} if axes is None else axes
    values = {name.strip(): tuple(_checked(name, each) for each in axes[name]) for name in axes}
    seeds = whole_number(seeds, "sweep: seeds", most=MOST_RUNS)
    _check(worlds, mappers, values, seeds)
    runs: list[PlannedRun] = []
    names: set[str] = set()
    for name in worlds:
        file = read_scenario_file(name)
        world = file.world
        if world.name in names:
            raise InputError(f"{name}: another world of the sweep is called {world.name}, too")
        names.add(world.name)
        if warning := size_warning(world):
            warn(f"{name}: {warning}")
        walls = digest((world.segments, world.objects, world.heights, *world.materials))
        drives: dict[Any, Trajectory] = {}
        for row in product(*values.values()):
            settings = dict(zip(values, row, strict=True))
            scenario = scenario_of(file, [_setting(*each) for each in settings.items()])
            # A route depends on how far the laser sees where it is planned.
            robot = [value for key, value in settings.items() if key.startswith("robot.")]
            driven = (*robot, scenario.lrf.range_max)
            if driven not in drives:
                routed = scenario.with_route(where=where, say=warn)
                if routed.planned is not None:
                    say(f"{name}: the route is planned {routed.planned} the walls")
                drives[driven] = routed.trajectory(on_collision=collision)
            drive = drives[driven]
            place = digest(
                (walls, scenario.lrf, scenario.obstacles, scenario.radius, drive.times, drive.poses)
            )
            known: Row = {"sigma_m": scenario.sigmas[0], "beams": scenario.lrf.beams}
            known |= {COLUMNS.get(key, key): value for key, value in settings.items()}
            bare = replace(scenario, mapper={})
            for label, mapper in mappers.items():
                if isinstance(mapper, str | dict):
                    own = {"mode": mapper} if isinstance(mapper, str) else mapper
                    mapper = {**scenario.mapper, **own}
                    line_mapper(scenario.noise, **mapper)  # An invalid threshold is found here.
                # The repr of a noise contains its class as well as its numbers.
                identity = digest((repr(scenario.noise), _identity(mapper)))
                named: Row = {"world": scenario.name, "mapper": label, **known}
                for seed in range(seeds):
                    # Runs under other names are other runs, so that the columns of all rows agree.
                    columns: Row = {
                        "key": digest((FORMAT, named, place, identity, seed))[:KEY_DIGITS],
                        **named,
                        "seed": seed,
                        # All mappers and noises have the same seeds, to be compared run by run.
                        "noise_seed": seed_of((place, seed)),
                    }
                    runs.append(PlannedRun(columns, bare, drive, mapper))
    varied = {COLUMNS.get(name, name): each for name, each in values.items()}
    return Plan(tuple(runs), {"mapper": tuple(mappers), **varied}, seeds)


def _check(
    worlds: Sequence[str],
    mappers: Mapping[str, Any],
    axes: Mapping[str, Sequence[SettingValue]],
    seeds: int,
) -> None:
    """Refuse what cannot be run, before any world is read."""
    if not worlds:
        raise InputError("sweep: no world; name one, such as city")
    for label, mapper in mappers.items():
        if isinstance(mapper, str) and mapper not in MODES:
            known = ", ".join(MODES)
            raise InputError(f"sweep: mapper {shown(mapper)}: expected {known} or FILE.py:NAME")
        if not (isinstance(mapper, str | dict) or callable(getattr(mapper, "update", mapper))):
            raise InputError(f"sweep: mapper {label}: has no method update(scan)")
    if MODE in axes:
        raise InputError(f"sweep: {MODE}: vary it by --mapper robust,paper")
    varied = {"mappers": tuple(mappers), **axes}
    for name, values in varied.items():
        if not values or len(set(values)) < len(values):
            why = f"has a value twice: {values}" if values else "has no value"
            raise InputError(f"sweep: {name} {why}")
    if (runs := len(worlds) * seeds * prod(map(len, varied.values()))) > MOST_RUNS:
        raise InputError(f"sweep: {runs:,} runs with {seeds:,} seeds; at most {MOST_RUNS:,}")


def _checked(name: str, value: object) -> SettingValue:
    """A value in the type of its setting."""
    try:
        setting = _setting(name, value)
    except (TypeError, ValueError):
        raise InputError(f"sweep: {name}: {shown(value)} cannot be a value") from None
    [table] = read_settings([setting]).values()
    [found] = table.values()
    if not isinstance(found, SettingValue):
        raise InputError(f"sweep: {name}: only single values can be varied, not {shown(value)}")
    return found


def _setting(name: str, value: object) -> str:
    return f"{name}={json.dumps(value, ensure_ascii=False)}"


def _identity(mapper: Any) -> Any:
    """What a mapper holds: its settings, or the name and the source of a user's own."""
    if isinstance(mapper, dict):
        return mapper
    source = b""
    with suppress(OSError, TypeError):
        kind = mapper if inspect.isroutine(mapper) or inspect.isclass(mapper) else type(mapper)
        source = Path(inspect.getsourcefile(kind) or "").read_bytes()
    return name_of(mapper), source.hex()
