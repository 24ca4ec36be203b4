"""What a sweep varies: worlds, mappers, settings of world files with several values, and seeds."""

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, shown
from lrf3d.files import read_text
from lrf3d.mapping.mapper import MODES
from lrf3d.world.schema import TABLES, read_settings, value_of

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

SETTING_COLUMNS = {SIGMA: "sigma_m", BEAMS: "beams"}
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

    Raises:
        InputError: There is no world, no value or no seed, or a setting is invalid.
    """

    worlds: tuple[str, ...]
    axes: Mapping[str, tuple[SettingValue, ...]] = field(default_factory=dict)
    mappers: Mapping[str, Any] = field(default_factory=lambda: dict(USUAL))
    seeds: int = SEEDS
    every: int = 1

    def __post_init__(self) -> None:
        if not self.worlds:
            raise InputError("sweep: no world; name one, such as city")
        if not self.mappers:
            raise InputError("sweep: no mapper; name one, such as robust")
        for label, mapper in self.mappers.items():
            if isinstance(mapper, str) and mapper not in MODES:
                known = ", ".join(MODES)
                raise InputError(f"sweep: mapper {shown(mapper)}: expected {known} or FILE.py:NAME")
            made = isinstance(mapper, str | dict | type) or callable(mapper)
            if not made and not callable(getattr(mapper, "update", None)):
                raise InputError(f"sweep: mapper {label}: has no method update(scan)")
        for name, number in (("seeds", self.seeds), ("every", self.every)):
            if not 1 <= number <= MOST_RUNS:
                raise InputError(f"sweep: {name} is {shown(number)}, expected 1 to {MOST_RUNS:,}")
        if MODE in self.axes:
            raise InputError(f"sweep: {MODE}: vary it by --mapper robust,paper")
        axes = {name: tuple(_checked(name, v) for v in vs) for name, vs in self.axes.items()}
        for name, values in axes.items():
            if not values:
                raise InputError(f"sweep: {name} has no value")
            if len(set(values)) < len(values):
                raise InputError(f"sweep: {name} has a value twice: {values}")
        object.__setattr__(self, "axes", axes)
        cells = len(self.worlds) * len(self.mappers) * prod(len(values) for values in axes.values())
        if cells * self.seeds > MOST_RUNS:
            raise InputError(
                f"sweep: {cells} settings with {self.seeds} seeds each are"
                f" {cells * self.seeds:,} runs; expected at most {MOST_RUNS:,}"
            )

    @property
    def combinations(self) -> list[dict[str, SettingValue]]:
        """Every combination of values, the last axis the fastest."""
        return [dict(zip(self.axes, row, strict=True)) for row in product(*self.axes.values())]

    @property
    def varied(self) -> dict[str, tuple[SettingValue, ...]]:
        """The values of each axis, by column of the table, the mappers first."""
        labels = {"mapper": tuple(self.mappers)}
        return labels | {column_of(name): values for name, values in self.axes.items()}

    def as_dict(self) -> dict[str, Any]:
        """The grid in JSON's types."""
        return {
            "worlds": list(self.worlds),
            "mappers": list(self.mappers),
            "axes": {name: list(values) for name, values in self.axes.items()},
            "seeds": self.seeds,
            "every": self.every,
        }


def column_of(name: str) -> str:
    """The column of a setting."""
    return SETTING_COLUMNS.get(name, name)


def setting(name: str, value: SettingValue) -> str:
    """A setting in the form of ``lrf3d run --set``."""
    try:
        return f"{name}={json.dumps(value, ensure_ascii=False)}"
    except ValueError:
        raise InputError(f"sweep: {name}: {shown(value)} cannot be a value") from None


def _checked(name: str, value: SettingValue) -> SettingValue:
    """A value in the type of its setting."""
    if not isinstance(value, float | int | str | bool):
        raise InputError(f"sweep: {name}: only single values can be varied, not {shown(value)}")
    [table] = read_settings([setting(name, value)]).values()
    [checked] = table.values()
    if not isinstance(checked, float | int | str | bool):
        raise InputError(f"sweep: {name}: only single values can be varied, not {shown(value)}")
    return checked


def parse_axis(text: str) -> tuple[str, tuple[SettingValue, ...]]:
    """An axis written as ``mapper.gap=0.5,1,2.5``.

    Raises:
        InputError: The text is not an axis.
    """
    name, equals, values = text.partition("=")
    if not equals:
        raise InputError(f"--vary {text}: expected TABLE.KEY=VALUE,VALUE,…, as mapper.gap=1,2.5")
    return name.strip(), parse_values(values, f"--vary {name.strip()}")


def parse_values(text: str, flag: str) -> tuple[SettingValue, ...]:
    """Comma-separated values, each a number, a word, true or false.

    Raises:
        InputError: The list is empty.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if not parts:
        raise InputError(f"{flag} {text!r}: expected values with commas between them")
    return tuple(_value(part) for part in parts)


def _value(text: str) -> SettingValue:
    try:
        value = value_of(text)
    except InputError:
        return text
    return value if isinstance(value, float | int | str | bool) else text


def read_grid(path: Path, axes: Mapping[str, tuple[SettingValue, ...]], **rest: Any) -> SweepGrid:
    """Read a grid file: the tables of a world file with lists of values, worlds and seeds.

    Args:
        path: The file; its paths of worlds are relative to its folder.
        axes: Axes that override those of the file.
        rest: Worlds, mappers, seeds and every, which override those of the file.

    Raises:
        InputError: The file cannot be read or used.
    """
    try:
        data = tomllib.loads(read_text(path, what="a grid"))
    except RecursionError:
        raise InputError(f"{path}: nested too deeply for a grid") from None
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    known = ["worlds", "seeds", "every", *TABLES]
    for key in data:
        if key not in known:
            near = get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
            raise InputError(f"{path}: there is no {key!r}; {hint}")
    found: dict[str, tuple[Any, ...]] = {}
    for table in TABLES:
        keys = data.get(table, {})
        if not isinstance(keys, dict):
            raise InputError(f"{path}: {table}: expected a table [{table}], found {shown(keys)}")
        for key, values in keys.items():
            found[f"{table}.{key}"] = tuple(values if isinstance(values, list) else [values])
    modes = found.pop(MODE, tuple(USUAL))
    if not all(isinstance(mode, str) for mode in modes):
        raise InputError(f"{path}: {MODE}: expected {' or '.join(MODES)}, found {shown(modes)}")
    chosen: dict[str, Any] = {
        "worlds": _worlds(path, data.get("worlds", [])),
        "mappers": {mode: mode for mode in modes},
        "seeds": _count(path, data, "seeds", SEEDS),
        "every": _count(path, data, "every", 1),
        **{name: value for name, value in rest.items() if value},
    }
    try:
        return SweepGrid(axes={SIGMA: SIGMAS, **found, **axes}, **chosen)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _worlds(path: Path, worlds: object) -> tuple[str, ...]:
    if not isinstance(worlds, list) or not all(isinstance(world, str) for world in worlds):
        raise InputError(f'{path}: worlds: expected a list of texts, such as ["city"]')
    beside = [path.parent / world for world in worlds]
    return tuple(str(b) if b.is_file() else w for b, w in zip(beside, worlds, strict=True))


def _count(path: Path, data: Mapping[str, Any], key: str, usual: int) -> int:
    value = data.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{path}: {key}: expected a whole number, found {shown(value)}")
    return value
