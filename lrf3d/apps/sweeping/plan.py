"""The plan of a sweep: all its runs, with keys and seeds that are derived from their contents."""

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

from lrf3d.base.digest import digest, name_of, seed_of
from lrf3d.base.errors import InputError, shown
from lrf3d.base.files import own_name
from lrf3d.geometry.lines import whole_number
from lrf3d.mapping.mapper import MODES
from lrf3d.robot import Trajectory
from lrf3d.simulation.loop import line_mapper
from lrf3d.simulation.scenario import Scenario, scenario_of
from lrf3d.simulation.tables import read_settings
from lrf3d.world.toml_file import WorldFile

# The settings that have an option of their own.
SIGMA = "noise.sigma"
MODE = "mapper.mode"
BEAMS = "laser.beams"

# Default noises [m]: those of the paper's figures, and some between.
SIGMAS = (0.01, 0.04, 0.07, 0.21, 0.42, 0.63)

# Default mappers: both modes of the LineMapper.
USUAL = {"robust": "robust", "paper": "paper"}

# Columns of the table for the settings that every sweep lists; others keep their names.
COLUMNS = {SIGMA: "sigma_m", BEAMS: "beams"}

SettingValue = float | int | str | bool
Row = dict[str, Any]


class PlannedRun(NamedTuple):
    """A run: its key, which is equal for equal runs, and what it is made of.

    The columns of its row are those that are known before it is made; the mapper is a dict of
    keyword arguments of the LineMapper, or a user's mapper or its class.
    """

    key: str
    columns: Row
    scenario: Scenario
    drive: Trajectory
    mapper: Any


@dataclass(frozen=True)
class SweepPlan:
    """All runs of a sweep in the order of its table, and the values of what is varied by column."""

    runs: tuple[PlannedRun, ...]
    worlds: list[str]
    varied: dict[str, tuple[SettingValue, ...]]
    seeds: int

    @property
    def columns(self) -> list[str]:
        """The columns that say what a run varies; runs that differ only in the seed share them."""
        return [name for name in self.runs[0].columns if name not in ("seed", "noise_seed")]


def make_plan(
    files: Sequence[WorldFile],
    axes: Mapping[str, Sequence[SettingValue]] | None,
    mappers: Mapping[str, Any],
    seeds: int,
    *,
    routed: Callable[[Scenario], Scenario] = Scenario.with_route,
    collision: Callable[[str], None] | None = None,
) -> SweepPlan:
    """Plan the runs of every combination of worlds, settings of world files, mappers and seeds.

    The other arguments are those of `sweep`. Each drive is computed once, on a route that is
    planned by ``routed``; ``collision`` is called with the message of a collision, after which the
    drive continues.
    """
    axes = {SIGMA: SIGMAS} if axes is None else axes
    values = {name: tuple(_checked(name, each) for each in axes[name]) for name in axes}
    seeds = whole_number(seeds, "sweep: seeds")
    worlds = [own_name(file.path, file.world.name) for file in files]
    _check({"worlds": worlds, "mappers": list(mappers), **values}, mappers, seeds)
    runs: list[PlannedRun] = []
    # Incremented when the same run gives other figures, so that old and new ones are not mixed.
    format_number = 2
    for file in files:
        drives: dict[Any, Trajectory] = {}
        for row in product(*values.values()):
            settings = dict(zip(values, row, strict=True))
            scenario = scenario_of(file, [_setting(*each) for each in settings.items()])
            # A route depends on how far the laser sees where it is planned.
            robot = [value for key, value in settings.items() if key.startswith("robot.")]
            driven = (*robot, scenario.lrf.range_max)
            if driven not in drives:
                drives[driven] = routed(scenario).trajectory(on_collision=collision)
            drive = drives[driven]
            place = _place_of(scenario, drive)
            known: Row = {"sigma_m": scenario.sigmas[0], "beams": scenario.lrf.beams}
            known |= {COLUMNS.get(key, key): value for key, value in settings.items()}
            bare = replace(scenario, mapper={})
            for label, given in mappers.items():
                mapper = _mapper_of(scenario, given)
                # The repr of a noise contains its class as well as its numbers.
                identity = digest((repr(scenario.noise), _identity(mapper)))
                named: Row = {"world": scenario.name, "mapper": label, **known}
                for seed in range(seeds):
                    # Runs under other names are other runs, so that the columns of all rows agree.
                    # With 128 bits no two keys are equal by chance.
                    key = digest((format_number, named, place, identity, seed))[:32]
                    # All mappers and noises have the same seeds, to be compared run by run.
                    columns = {**named, "seed": seed, "noise_seed": seed_of((place, seed))}
                    runs.append(PlannedRun(key, columns, bare, drive, mapper))
    varied = {COLUMNS.get(name, name): each for name, each in values.items()}
    return SweepPlan(tuple(runs), worlds, {"mapper": tuple(mappers), **varied}, seeds)


def _place_of(scenario: Scenario, drive: Trajectory) -> str:
    """The digest of what is seen on a drive, and by which lasers, but for noise and seed."""
    world = scenario.world
    held = digest((world.segments, world.objects, world.heights, *world.materials))
    others = [(lrf, repr(noise)) for lrf, noise in scenario.further]
    seen = (held, scenario.lrf, scenario.obstacles, scenario.radius)
    return digest((*seen, drive.times, drive.poses, *others))


def _mapper_of(scenario: Scenario, mapper: Any) -> Any:
    """The settings of a LineMapper in a scenario, checked; or a user's own mapper as it is."""
    if not isinstance(mapper, str | dict):
        return mapper
    settings = {**scenario.mapper, **({"mode": mapper} if isinstance(mapper, str) else mapper)}
    line_mapper(scenario.noise, **settings)
    return settings


def _check(varied: Mapping[str, Sequence[Any]], mappers: Mapping[str, Any], seeds: int) -> None:
    for name, values in varied.items():
        if not values or len(set(values)) < len(values):
            why = f"has a value twice: {', '.join(map(str, values))}" if values else "has no value"
            raise InputError(f"sweep: {name} {why}")
    if MODE in varied:
        raise InputError(f"sweep: {MODE}: vary it by --mapper robust,paper")
    for label, mapper in mappers.items():
        if isinstance(mapper, str) and mapper not in MODES:
            expected = f"expected {', '.join(MODES)} or FILE.py:NAME"
            raise InputError(f"sweep: mapper {shown(mapper)}: {expected}")
        if not (isinstance(mapper, str | dict) or callable(getattr(mapper, "update", mapper))):
            raise InputError(f"sweep: mapper {label}: has no method update(scan)")
    # Largest number of runs: their plan is held in memory, and even the fastest take hours on one
    # core.
    most_runs = 1_000_000
    if (runs := seeds * prod(map(len, varied.values()))) > most_runs:
        raise InputError(f"sweep: {runs:,} runs with {seeds:,} seeds; at most {most_runs:,}")


def _checked(name: str, value: object) -> SettingValue:
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
