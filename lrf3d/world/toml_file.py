"""World files in TOML: what a person writes, checked; errors name the key that is wrong.

A path enters, with the converters of the tables of settings, which belong to what they describe; a
:class:`WorldFile` leaves: the walls, and the tables, of which :mod:`lrf3d.simulation.scenario`
makes a scenario. A world is written as text that is read again to the last bit.
"""

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, check_names
from lrf3d.base.files import check_ordinary, data_folder, own_name, write_text
from lrf3d.base.interrupts import reading
from lrf3d.base.isolation import read_file
from lrf3d.geometry.lines import Float
from lrf3d.world import schema
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.materials import BUILT_IN, Material, named
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import Part, runs_of, walls, world_of_parts


@dataclass(frozen=True)
class WorldFile:
    """The walls of a world file, its tables on the robot, the noise, …, lasers and obstacles."""

    world: World
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    obstacles: tuple[Mapping[str, Any], ...] = ()
    path: Path = Path()
    lasers: tuple[Mapping[str, Any], ...] = ()

    def scaled(self, factor: float) -> "WorldFile":
        """The file with its plan and its routes scaled by a factor; heights stay the same."""
        if factor == 1.0:
            return self
        robot = dict(self.tables.get("robot", {}))
        for key in {"start", "route", "poses", "goals"} & set(robot):
            # Positions are scaled, headings stay.
            robot[key] = robot[key] * ([factor, factor, 1.0][: robot[key].shape[-1]])
        if "keep_out" in robot:
            robot["keep_out"] = tuple(area * factor for area in robot["keep_out"])
        tables = {**self.tables, "robot": robot}
        obstacles = tuple(
            {**obstacle, "route": obstacle["route"] * factor} for obstacle in self.obstacles
        )
        return replace(self, world=self.world.scaled(factor), tables=tables, obstacles=obstacles)

    def at(self, key: str) -> AbstractContextManager[None]:
        """Let errors name the file and a key in it."""
        return schema.at(f"{self.path}: {key}")


def _place(found: Any, key: str) -> tuple[float, ...]:
    """A longitude and latitude [°]."""
    return tuple(schema.row("longitude", "latitude")(found, key).tolist())


def read_world_file(path: Path, settings: Mapping[str, schema.Converter]) -> WorldFile:
    """Read a world file, with the converters of its settings; errors name the file and the key."""
    # In the order in which they are checked.
    keys: dict[str, schema.Converter] = {
        "name": schema.text(),
        "place": _place,
        "object": schema.tables(schema.table(schema.OBJECT)),
        **settings,
        "obstacle": schema.tables(schema.table(schema.OBSTACLE, needs=["route"])),
        "camera": schema.tables(schema.made(FixedCamera)),
        "material": schema.tables(schema.made(Material)),
        "free": FreeCells.from_dict,
    }
    with reading(), schema.at(str(path)):
        data = toml_values(path)
        check_names(str(path), data, keys)
        values = {key: keys[key](data[key], key) for key in keys if key in data}
        obstacles = values.get("obstacle", [])
        for place, obstacle in enumerate(obstacles):
            if "radius" in obstacle and "points" in obstacle:
                raise InputError(f"obstacle[{place}]: expected a radius or points, found both")
        lasers = tuple(values.pop("laser", ()))
        tables = {key: values[key] for key in settings if key in values}
        return WorldFile(_world(values, path), tables, tuple(obstacles), path, lasers)


def toml_values(path: Path) -> dict[str, Any]:
    """The values of a TOML file; a large file is read in a process of its own.

    The time for keys with many parts grows quadratically; up to this size it is a second.
    """
    small = 1 << 14
    check_ordinary(path)
    apart = path.stat().st_size > small and path.parent != data_folder("worlds")
    return dict(json.loads(read_file("lrf3d.base.files:toml_as_json", path, {}, isolated=apart)))


def _world(values: Mapping[str, Any], path: Path) -> World:
    own = values.get("material", [])
    schema.check_unique("material", [material.name for material in own])
    parts = list[Part]()
    known = set[int]()
    for place, each in enumerate(values.get("object", [])):
        key = f"object[{place}]"
        number = each.get("number", parts[-1].number + 1 if parts else 0)
        looks = {name: each[name] for name in ("name", "colour", "material") if name in each}
        if looks and number in known:
            twice = "stands with another object of the same number"
            raise InputError(f"{key}.{next(iter(looks))}: {twice}")
        walled = _walled(each, key)
        if "material" in looks:
            looks["material"] = named(looks["material"], own, f"{key}.material")
        parts.append(Part(number, *walled, **looks))
        known.add(number)
    if not any(len(part.segments) for part in parts):
        raise InputError("object: expected at least one table [[object]] with points")
    return world_of_parts(
        parts,
        values.get("name", own_name(path)),
        cameras=values.get("camera", ()),
        place=values.get("place"),
        free=values.get("free"),
    )


def _walled(values: Mapping[str, Any], key: str) -> tuple[Float, Float]:
    """The walls (n, 4) of an object, and their height [m], or one for each."""
    segments = _segments(values, key)
    height = values.get("height", DEFAULT_HEIGHT)
    if isinstance(height, tuple) and len(height) != len(segments):
        found = f"{len(height)} heights for {len(segments)} walls"
        raise InputError(f"{key}.height: {found}, expected one for each")
    return segments, np.array(height)


def _segments(values: Mapping[str, Any], key: str) -> Float:
    """The walls (n, 4) of an object."""
    if ("points" in values) == ("lines" in values):
        raise InputError(f"{key}: expected points, a list of [x, y], or lines, a list of such")
    lines = {f"{key}.lines[{place}]": line for place, line in enumerate(values.get("lines", ()))}
    lines |= {f"{key}.points": values["points"]} if "points" in values else {}
    closed = values.get("closed", False)
    pieces = [np.empty((0, 4))]
    for inside, points in lines.items():
        if closed and len(points) < 3:
            raise InputError(f"{inside}: closed with {len(points)} points, expected at least 3")
        pieces.append(walls(points, closed))
        for wall in np.flatnonzero((pieces[-1][:, :2] == pieces[-1][:, 2:]).all(axis=1)):
            found = "the next point is ({:g}, {:g}), too".format(*points[wall])
            raise InputError(f"{inside}[{wall}]: {found}, a segment of no length; remove one")
    return np.concatenate(pieces)


def write_toml(world: World, path: Path) -> None:
    """Write a world as TOML."""
    write_text(path, world_text(world))


def world_text(world: World) -> str:
    """The text of a world file."""
    place = {} if world.place is None else {"place": world.place}
    blocks = [toml_table("", {"name": world.name, **place})]
    described: set[int] = set()
    for number, own_looks, lines, height in runs_of(world):
        looks = {} if number in described else own_looks
        described.add(number)
        if "material" in looks:
            looks["material"] = looks["material"].name
        values = {"number": number, **looks, **_outline(lines, height)}
        blocks.append(toml_table("[[object]]", values))
    used = dict.fromkeys(material for material in world.materials if material is not None)
    own = [material for material in used if BUILT_IN.get(material.name) != material]
    blocks += [toml_table("[[material]]", material.as_dict()) for material in own]
    blocks += [toml_table("[[camera]]", asdict(camera)) for camera in world.cameras]
    if world.free is not None:
        blocks.append(toml_table("[free]", world.free.as_dict()))
    return "\n".join(blocks)


def _outline(lines: list[Any], height: Any) -> dict[str, Any]:
    """The keys of the lines and the heights of an object."""
    if not lines:
        return {"lines": []}
    # A ring needs no point twice.
    closed = all(len(line) > 3 and str(line[0]) == str(line[-1]) for line in lines)
    lines = [line[:-1] for line in lines] if closed else lines
    outline = {"points": lines[0]} if len(lines) == 1 else {"lines": lines}
    return outline | ({"closed": True} if closed else {}) | {"height": height}


def toml_table(head: str, values: Mapping[str, Any]) -> str:
    """A table of TOML."""
    lines = [f"{key} = {_toml(value)}" for key, value in values.items()]
    # The name of a file may hold half a pair of surrogates, which no text can.
    text = "\n".join([head, *lines, ""]).lstrip().replace("\x7f", "\\u007f")
    return text.encode(errors="replace").decode()


def _toml(value: Any) -> str:
    """A value as TOML; for texts, numbers and lists this is JSON, except for one character."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False)
