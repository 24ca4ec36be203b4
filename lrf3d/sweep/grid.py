"""What a sweep varies: worlds, settings of world files with several values each, and seeds."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, shown
from lrf3d.input import read_text
from lrf3d.mapping.mapper import MODES
from lrf3d.world.schema import TABLES, read_settings, value_of

SIGMAS = (0.01, 0.04, 0.07, 0.21, 0.42, 0.63)
"""Default noises [m]: those of the paper's figures, and some between."""

SEEDS = 20
"""Default number of seeds of each setting."""

MOST_RUNS = 1_000_000
"""Largest number of seeds, of ``every``, and of runs: the plan of all runs is held in memory, and
even the fastest take hours on one core."""

SIGMA, MODE, BEAMS = "noise.sigma", "mapper.mode", "laser.beams"
"""The settings that have an option of their own."""

SettingValue = float | int | str | bool


@dataclass(frozen=True, slots=True)
class SweepGrid:
    """What a sweep varies; every combination is run with every seed.

    Args:
        worlds: Names or paths of worlds.
        axes: Values by setting, as ``noise.sigma``: those of world files, each of them once.
        seeds: Number of seeds, from 0.
        every: Use every n-th scan of a drive.

    Raises:
        InputError: There is no world, no value or no seed, or a setting is invalid.
    """

    worlds: tuple[str, ...]
    axes: Mapping[str, tuple[SettingValue, ...]] = field(default_factory=dict)
    seeds: int = SEEDS
    every: int = 1

    def __post_init__(self) -> None:
        if not self.worlds:
            raise InputError("sweep: no world; name one, such as city")
        for name, number in (("seeds", self.seeds), ("every", self.every)):
            if not 1 <= number <= MOST_RUNS:
                raise InputError(f"sweep: {name} is {shown(number)}, expected 1 to {MOST_RUNS:,}")
        axes = {name: tuple(_checked(name, v) for v in vs) for name, vs in self.axes.items()}
        for name, values in axes.items():
            if not values:
                raise InputError(f"sweep: {name} has no value")
            if len(set(values)) < len(values):
                raise InputError(f"sweep: {name} has a value twice: {values}")
        object.__setattr__(self, "axes", axes)
        settings = len(self.worlds) * prod(len(values) for values in axes.values())
        if settings * self.seeds > MOST_RUNS:
            raise InputError(
                f"sweep: {settings} settings with {self.seeds} seeds each are"
                f" {settings * self.seeds:,} runs; expected at most {MOST_RUNS:,}"
            )

    @classmethod
    def usual(
        cls, *worlds: str, axes: Mapping[str, tuple[SettingValue, ...]], **rest: Any
    ) -> "SweepGrid":
        """The grid with both modes and the usual noises, unless the axes contain them."""
        return cls(worlds, {MODE: MODES, SIGMA: SIGMAS, **axes}, **rest)

    @property
    def combinations(self) -> list[dict[str, SettingValue]]:
        """Every combination of values, the last axis the fastest."""
        return [dict(zip(self.axes, row, strict=True)) for row in product(*self.axes.values())]

    def as_dict(self) -> dict[str, Any]:
        """The grid in JSON's types."""
        axes = {name: list(values) for name, values in self.axes.items()}
        return {
            "worlds": list(self.worlds),
            "axes": axes,
            "seeds": self.seeds,
            "every": self.every,
        }


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
        rest: Worlds, seeds and every, which override those of the file.

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
    found: dict[str, tuple[SettingValue, ...]] = {}
    for table in TABLES:
        keys = data.get(table, {})
        if not isinstance(keys, dict):
            raise InputError(f"{path}: {table}: expected a table [{table}], found {shown(keys)}")
        for key, values in keys.items():
            found[f"{table}.{key}"] = tuple(values if isinstance(values, list) else [values])
    chosen: dict[str, Any] = {
        "worlds": _worlds(path, data.get("worlds", [])),
        "seeds": _count(path, data, "seeds", SEEDS),
        "every": _count(path, data, "every", 1),
        **{name: value for name, value in rest.items() if value},
    }
    try:
        return SweepGrid.usual(*chosen.pop("worlds"), axes={**found, **axes}, **chosen)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _worlds(path: Path, worlds: object) -> Sequence[str]:
    if not isinstance(worlds, list) or not all(isinstance(world, str) for world in worlds):
        raise InputError(f'{path}: worlds: expected a list of texts, such as ["city"]')
    beside = [path.parent / world for world in worlds]
    return [str(b) if b.is_file() else w for b, w in zip(beside, worlds, strict=True)]


def _count(path: Path, data: Mapping[str, Any], key: str, usual: int) -> int:
    value = data.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{path}: {key}: expected a whole number, found {shown(value)}")
    return value
