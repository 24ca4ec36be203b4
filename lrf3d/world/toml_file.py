"""World files in TOML: what a person writes, checked; errors name the key that is wrong.

A path enters; a :class:`WorldFile` leaves: the walls, and the tables on the robot, the laser,
the noise, the mapper and the film that :mod:`lrf3d.scenario` turns into a scenario.
"""

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, WorldError
from lrf3d.files import own_name, read_text
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.materials import Material, named
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import walls
from lrf3d.world.schema import (
    CAMERA,
    MATERIAL,
    OBJECT,
    OBSTACLE,
    TABLES,
    Converter,
    Invalid,
    known_key,
    row,
    text,
)

KEYS = ["name", "object", *TABLES, "obstacle", "camera", "material", "place", "free"]
"""The tables and keys of a world file."""


@dataclass(frozen=True)
class WorldFile:
    """The contents of a world file.

    Args:
        world: The walls.
        tables: The converted values of the tables robot, laser, noise, mapper and film.
        obstacles: The converted values of each table ``obstacle``, a dynamic obstacle.
        path: The file.
    """

    world: World
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    obstacles: tuple[Mapping[str, Any], ...] = ()
    path: Path = Path()

    def scaled(self, factor: float) -> "WorldFile":
        """The file with its plan and its routes scaled by a factor; heights stay the same.

        Raises:
            WorldError: The factor is invalid.
        """
        if factor == 1.0:
            return self
        robot = dict(self.tables.get("robot", {}))
        for key in {"start", "route", "poses"} & set(robot):
            # Positions are scaled, headings stay.
            robot[key] = robot[key] * ([factor, factor, 1.0][: robot[key].shape[-1]])
        tables = {**self.tables, "robot": robot}
        obstacles = tuple(
            {**obstacle, "route": obstacle["route"] * factor} for obstacle in self.obstacles
        )
        return replace(self, world=self.world.scaled(factor), tables=tables, obstacles=obstacles)

    @contextmanager
    def at(self, key: str) -> Iterator[None]:
        """Let errors name the file and a key in it."""
        with _at(f"{self.path}: {key}: "):
            yield


@contextmanager
def _at(place: str) -> Iterator[None]:
    """Let errors name a place."""
    try:
        yield
    except InputError as error:
        raise WorldError(f"{place}{error}") from None


def read_toml(path: Path) -> World:
    """The walls of a world file; :func:`read_world_file` reads its tables, too.

    Raises:
        WorldError: As for :func:`read_world_file`.
    """
    return read_world_file(path).world


def read_world_file(path: Path) -> WorldFile:
    """Read a world file.

    Raises:
        WorldError: The file cannot be read, does not parse, or is not a valid world; the message
            names the file and the key.
    """
    content = read_text(path, what="a world file", error=WorldError)
    with _at(f"{path}: "):
        try:
            data = tomllib.loads(content)
        except RecursionError:
            raise InputError("nested too deeply for a world file") from None
        except ValueError as error:
            raise InputError(f"not TOML: {error}") from None
        for key in data:
            known_key(key, KEYS, key)
        tables = {
            key: _table(data[key], converters, key)
            for key, converters in TABLES.items()
            if key in data
        }
        obstacles = tuple(_tables(data, "obstacle", OBSTACLE, "route"))
        for index, obstacle in enumerate(obstacles):
            if "radius" in obstacle and "points" in obstacle:
                raise InputError(f"obstacle[{index}]: expected a radius or points, found both")
        return WorldFile(_world(data, path), tables, obstacles, path)


def _value(convert: Converter, value: object, key: str) -> Any:
    try:
        return convert(value)
    except Invalid as problem:
        raise InputError(f"{key}{problem.inside}: {problem}") from None


def _table(table: object, converters: Mapping[str, Converter], key: str) -> dict[str, Any]:
    if not isinstance(table, dict):
        raise InputError(f"{key}: expected a table [{key}]")
    return {
        name: _value(converters[known_key(name, converters, key)], value, f"{key}.{name}")
        for name, value in table.items()
    }


def _tables(
    data: Mapping[str, Any], key: str, converters: Mapping[str, Converter], *needed: str
) -> Iterator[dict[str, Any]]:
    """The tables [[key]], each with the keys that are needed."""
    tables = data.get(key, [])
    if not isinstance(tables, list):
        view = "; view and playback stand in [film]" if key == "camera" else ""
        raise InputError(f"{key}: expected tables [[{key}]]{view}")
    for index, table in enumerate(tables):
        values = _table(table, converters, f"{key}[{index}]")
        for each in needed:
            if each not in values:
                raise InputError(f"{key}[{index}]: expected a {each}")
        yield values


def _world(data: Mapping[str, Any], path: Path) -> World:
    cameras, own, free = [], list[Material](), None
    for index, values in enumerate(_tables(data, "camera", CAMERA, "name", "position", "target")):
        with _at(f"camera[{index}]: "):
            cameras.append(FixedCamera(**values))
    for index, values in enumerate(_tables(data, "material", MATERIAL, "name")):
        with _at(f"material[{index}]: "):
            own.append(Material(**values))
            if own[-1].name in [material.name for material in own[:-1]]:
                raise InputError(f"a second material {own[-1].name!r}")
    if "free" in data:
        with _at("free: "):
            free = FreeCells.from_dict(data["free"])
    objects = list(_tables(data, "object", OBJECT))
    if not objects:
        raise InputError("object: expected at least one table [[object]] with points")
    segments, heights, numbers = [], [], list[int]()
    first: dict[int, int] = {}
    for index, values in enumerate(objects):
        key = f"object[{index}]"
        segments.append(_segments(values, key))
        height = values.get("height", DEFAULT_HEIGHT)
        if isinstance(height, tuple) and len(height) != len(segments[-1]):
            raise InputError(
                f"{key}.height: {len(height)} heights for {len(segments[-1])} walls, expected one"
                " for each"
            )
        heights.append(np.broadcast_to(np.asarray(height), (len(segments[-1]),)))
        numbers.append(values.get("number", numbers[-1] + 1 if numbers else 0))
        before = first.setdefault(numbers[-1], index)
        for each in ("name", "colour", "material"):
            if before != index and each in values:
                raise InputError(f"{key}.{each}: stands with object[{before}] of the same number")
    owned = np.repeat(numbers, [len(part) for part in segments])
    if not len(owned):
        raise InputError("object: no object has a wall; give one at least two points")
    count = int(owned.max()) + 1
    names, colours = [""] * count, np.full((count, 3), np.nan)
    materials: list[Material | None] = [None] * count
    for number, index in first.items():
        if number < count:
            names[number] = objects[index].get("name", "")
            colours[number] = objects[index].get("colour", np.nan)
            if "material" in objects[index]:
                with _at(f"object[{index}].material: "):
                    materials[number] = named(objects[index]["material"], own)
    place = (
        _value(row("longitude", "latitude"), data["place"], "place") if "place" in data else None
    )
    name = _value(text(), data["name"], "name") if "name" in data else own_name(path)
    return World(
        np.concatenate(segments),
        owned,
        np.concatenate(heights),
        name,
        object_names=names if any(names) else (),
        colours=colours,
        cameras=cameras,
        place=None if place is None else tuple(place.tolist()),
        free=free,
        materials=materials,
    )


def _segments(values: Mapping[str, Any], key: str) -> Any:
    """The walls (n, 4) of an object."""
    if ("points" in values) == ("lines" in values):
        raise InputError(f"{key}: expected points, a list of [x, y], or lines, a list of such")
    closed = values.get("closed", False)
    if "points" in values:
        lines = {f"{key}.points": values["points"]}
    else:
        lines = {f"{key}.lines[{place}]": line for place, line in enumerate(values["lines"])}
    pieces = [np.empty((0, 4))]
    for inside, points in lines.items():
        if closed and len(points) < 3:
            raise InputError(f"{inside}: closed with {len(points)} points, expected at least 3")
        pieces.append(walls(points, closed))
        empty = np.flatnonzero((pieces[-1][:, :2] == pieces[-1][:, 2:]).all(axis=1))
        if len(empty):
            wall = int(empty[0])
            following = (wall + 1) % len(points)
            x, y = points[wall]
            fix = "remove one" if following else "closed joins them already"
            raise InputError(
                f"{inside}[{following or wall}]: points {wall} and {following} are both"
                f" ({x:g}, {y:g}), a segment of no length; {fix}"
            )
    return np.concatenate(pieces)
