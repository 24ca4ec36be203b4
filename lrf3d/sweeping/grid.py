"""What a sweep varies: worlds, mappers, settings of world files with several values, and seeds."""

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, shown
from lrf3d.files import read_text
from lrf3d.geometry import whole_number
from lrf3d.mapping.mapper import MODES
from lrf3d.world.schema import TABLES, known_key, read_settings, value_of

SIGMAS = (0.01, 0.04, 0.07, 0.21, 0.42, 0.63)
"""Default noises [m]: those of the paper's figures, and some between."""

SEEDS = 20
"""Default number of seeds of each setting."""

USUAL = {"robust": "robust", "paper": "paper"}
"""Default mappers: both modes of the LineMapper."""

MOST_RUNS = 1_000_000
"""Largest number of seeds, of ``every``, and of runs: the plan of all runs is held in memory, and
even the fastest take hours on one core."""

SIGMA, MODE, BEAMS = "noise.sigma", "mapper.mode", "laser.beams"
"""The settings that have an option of their own."""

COLUMNS = {SIGMA: "sigma_m", BEAMS: "beams"}
"""Columns of the table for the settings that every sweep lists; others keep their names."""

SettingValue = float | int | str | bool


@dataclass(frozen=True, slots=True)
class SweepGrid:
    """What a sweep varies; every combination is run with every seed.

    Args:
        worlds: Names or paths of worlds.
        axes: Values by setting, as ``noise.sigma``: those of world files, each of them once.
        mappers: Mappers by their labels: a mode of the LineMapper, a dict of its settings, a class
            to instantiate for each run, or an object with ``update(scan)``, copied for each run.
        seeds: Number of seeds, from 0.
        every: Use every n-th scan of a drive.
    """

    worlds: tuple[str, ...]
    axes: Mapping[str, tuple[SettingValue, ...]] = field(default_factory=dict)
    mappers: Mapping[str, Any] = field(default_factory=lambda: USUAL)
    seeds: int = SEEDS
    every: int = 1

    def __post_init__(self) -> None:
        if not self.worlds:
            raise InputError("sweep: no world; name one, such as city")
        for label, mapper in self.mappers.items():
            if isinstance(mapper, str) and mapper not in MODES:
                known = ", ".join(MODES)
                raise InputError(f"sweep: mapper {shown(mapper)}: expected {known} or FILE.py:NAME")
            if not (isinstance(mapper, str | dict) or callable(getattr(mapper, "update", mapper))):
                raise InputError(f"sweep: mapper {label}: has no method update(scan)")
        for name in ("seeds", "every"):
            number = whole_number(getattr(self, name), f"sweep: {name}", most=MOST_RUNS)
            object.__setattr__(self, name, number)
        if MODE in self.axes:
            raise InputError(f"sweep: {MODE}: vary it by --mapper robust,paper")
        axes = {name: tuple(_checked(name, v) for v in vs) for name, vs in self.axes.items()}
        object.__setattr__(self, "axes", axes)
        runs = self.seeds
        for axis, values in {"mappers": tuple(self.mappers), **axes}.items():
            if not values or len(set(values)) < len(values):
                why = f"has a value twice: {values}" if values else "has no value"
                raise InputError(f"sweep: {axis} {why}")
            runs *= len(values)
        if (runs := len(self.worlds) * runs) > MOST_RUNS:
            raise InputError(
                f"sweep: {runs:,} runs with {self.seeds:,} seeds; at most {MOST_RUNS:,}"
            )

    @property
    def combinations(self) -> list[dict[str, SettingValue]]:
        """Every combination of values, the last axis the fastest."""
        return [dict(zip(self.axes, row, strict=True)) for row in product(*self.axes.values())]

    @property
    def varied(self) -> dict[str, tuple[SettingValue, ...]]:
        """The values of each axis, by column of the table, the mappers first."""
        axes = {COLUMNS.get(name, name): values for name, values in self.axes.items()}
        return {"mapper": tuple(self.mappers), **axes}


def setting(name: str, value: SettingValue) -> str:
    """A setting in the form of ``lrf3d run --set``."""
    try:
        return f"{name}={json.dumps(value, ensure_ascii=False)}"
    except ValueError:
        raise InputError(f"sweep: {name}: {shown(value)} cannot be a value") from None


def _checked(name: str, value: object) -> SettingValue:
    """A value in the type of its setting."""
    if isinstance(value, SettingValue):
        [table] = read_settings([setting(name, value)]).values()
        [value] = table.values()
    if not isinstance(value, SettingValue):
        raise InputError(f"sweep: {name}: only single values can be varied, not {shown(value)}")
    return value


def parse_axis(text: str) -> tuple[str, tuple[SettingValue, ...]]:
    """An axis written as ``mapper.gap=0.5,1,2.5``."""
    name, equals, values = text.partition("=")
    if not equals:
        raise InputError(f"--vary {text}: expected TABLE.KEY=VALUE,VALUE,…, as mapper.gap=1,2.5")
    return name.strip(), parse_values(values, f"--vary {name.strip()}")


def parse_values(text: str, flag: str) -> tuple[SettingValue, ...]:
    """Comma-separated values, each a number, a word, true or false."""
    parts = [part for part in text.split(",") if part.strip()]
    if not parts:
        raise InputError(f"{flag} {text!r}: expected values with commas between them")
    return tuple(map(value_of, parts))


def read_grid(path: Path, axes: Mapping[str, tuple[SettingValue, ...]], **rest: Any) -> SweepGrid:
    """Read a grid file: the tables of a world file with lists of values, worlds and seeds.

    Paths of worlds are relative to its folder; axes and the rest override what it holds.
    """
    text = read_text(path, what="a grid")
    try:
        return _grid_of(tomllib.loads(text), path, axes, rest)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from None


def _grid_of(
    data: dict[str, Any],
    path: Path,
    axes: Mapping[str, tuple[SettingValue, ...]],
    rest: Mapping[str, Any],
) -> SweepGrid:
    found: dict[str, Any] = {}
    for name, value in data.items():
        known_key(name, ("worlds", "seeds", "every", *TABLES), "grid")
        if name not in TABLES:
            continue
        if not isinstance(value, dict):
            raise InputError(f"{name}: expected a table [{name}], found {shown(value)}")
        for key, values in value.items():
            found[f"{name}.{key}"] = tuple(values if isinstance(values, list) else [values])
    chosen = {name: value for name, value in data.items() if name not in TABLES}
    worlds = chosen.get("worlds", [])
    if not isinstance(worlds, list) or not all(isinstance(world, str) for world in worlds):
        raise InputError('worlds: expected a list of texts, such as ["city"]')
    beside = {world: path.parent / world for world in worlds}
    chosen["worlds"] = tuple(str(b) if b.is_file() else w for w, b in beside.items())
    chosen["mappers"] = {str(mode): mode for mode in found.pop(MODE, USUAL)}
    chosen |= {name: value for name, value in rest.items() if value}
    return SweepGrid(axes={SIGMA: SIGMAS, **found, **axes}, **chosen)
