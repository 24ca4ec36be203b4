"""World files in TOML: what a person writes, checked; errors name the key that is wrong.

A path enters; a :class:`WorldFile` leaves: the walls, and the tables on the robot, the laser,
the noise, the mapper and the film that :mod:`lrf3d.scenario` turns into a scenario. A world is
written as text that is read again to the last bit.
"""

import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, WorldError
from lrf3d.files import own_name, read_text, write_text
from lrf3d.geometry import Float
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.materials import BUILT_IN, Material, named
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import Part, WallRun, description, runs_of, walls, world_of_parts
from lrf3d.world.schema import (
    OBJECT,
    OBSTACLE,
    TABLES,
    at,
    converted,
    known_key,
    made_of,
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

    def at(self, key: str) -> AbstractContextManager[None]:
        """Let errors name the file and a key in it."""
        return at(f"{self.path}: {key}")


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
    with at(str(path)):
        try:
            data = tomllib.loads(content)
        except RecursionError:
            raise InputError("nested too deeply for a world file") from None
        except ValueError as error:
            raise InputError(f"not TOML: {error}") from None
        for key in data:
            known_key(key, KEYS, key)
        tables = {
            key: converted(data[key], keys, key) for key, keys in TABLES.items() if key in data
        }
        obstacles = []
        for key, table in _tables(data, "obstacle"):
            obstacles.append(converted(table, OBSTACLE, key))
            if "route" not in table:
                raise InputError(f"{key}: expected a route")
            if "radius" in table and "points" in table:
                raise InputError(f"{key}: expected a radius or points, found both")
        return WorldFile(_world(data, path), tables, tuple(obstacles), path)


def _tables(data: Mapping[str, Any], key: str) -> Iterator[tuple[str, Any]]:
    """The tables [[key]], each with its own path."""
    tables = data.get(key, [])
    if not isinstance(tables, list):
        raise InputError(f"{key}: expected tables [[{key}]]")
    for index, table in enumerate(tables):
        yield f"{key}[{index}]", table


def _world(data: Mapping[str, Any], path: Path) -> World:
    cameras = [made_of(FixedCamera, table, key) for key, table in _tables(data, "camera")]
    own = [made_of(Material, table, key) for key, table in _tables(data, "material")]
    parts = list[Part]()
    for key, table in _tables(data, "object"):
        values = converted(table, OBJECT, key)
        number = values.get("number", parts[-1].number + 1 if parts else 0)
        segments = _segments(values, key)
        height = values.get("height", DEFAULT_HEIGHT)
        if isinstance(height, tuple) and len(height) != len(segments):
            raise InputError(
                f"{key}.height: {len(height)} heights for {len(segments)} walls, expected one for"
                " each"
            )
        made = values.get("material")
        material = None if made is None else named(made, own, f"{key}.material")
        looks = values.get("name", ""), values.get("colour"), material
        parts.append(Part(number, segments, np.array(height), *looks))
    if not any(len(part.segments) for part in parts):
        raise InputError("object: expected at least one table [[object]] with points")
    with at("free"):
        free = FreeCells.from_dict(data["free"]) if "free" in data else None
    place = row("longitude", "latitude")(data["place"], "place") if "place" in data else None
    return world_of_parts(
        parts,
        text()(data["name"], "name") if "name" in data else own_name(path),
        cameras=cameras,
        place=None if place is None else tuple(place.tolist()),
        free=free,
    )


def _segments(values: Mapping[str, Any], key: str) -> Float:
    """The walls (n, 4) of an object."""
    if ("points" in values) == ("lines" in values):
        raise InputError(f"{key}: expected points, a list of [x, y], or lines, a list of such")
    if "points" in values:
        lines = {f"{key}.points": values["points"]}
    else:
        lines = {f"{key}.lines[{place}]": line for place, line in enumerate(values["lines"])}
    closed = values.get("closed", False)
    pieces = [np.empty((0, 4))]
    for inside, points in lines.items():
        if closed and len(points) < 3:
            raise InputError(f"{inside}: closed with {len(points)} points, expected at least 3")
        pieces.append(walls(points, closed))
        for wall in np.flatnonzero((pieces[-1][:, :2] == pieces[-1][:, 2:]).all(axis=1)):
            raise InputError(
                f"{inside}[{wall}]: the next point is ({points[wall][0]:g}, {points[wall][1]:g}),"
                " too, a segment of no length; remove one"
            )
    return np.concatenate(pieces)


def write_toml(world: World, path: Path) -> None:
    """Write a world as TOML.

    Raises:
        OutputError: The file cannot be written.
    """
    place = {} if world.place is None else {"place": world.place}
    blocks = [_table("", {"name": world.name, **place})]
    described: set[int] = set()
    for run in runs_of(world):
        values = {} if run.number in described else description(world, run.number)
        if "material" in values:
            values["material"] = values["material"].name
        described.add(run.number)
        blocks.append(_table("[[object]]", {"number": run.number, **values, **_outline(run)}))
    used = dict.fromkeys(material for material in world.materials if material is not None)
    own = [material for material in used if BUILT_IN.get(material.name) != material]
    blocks += [_table("[[material]]", material.as_dict()) for material in own]
    blocks += [_table("[[camera]]", asdict(camera)) for camera in world.cameras]
    if world.free is not None:
        blocks.append(_table("[free]", world.free.as_dict()))
    write_text(path, "\n".join(blocks))


def _outline(run: WallRun) -> dict[str, Any]:
    """The points and the heights of walls."""
    closed = bool(run.pieces) and all(piece.closed for piece in run.pieces)
    lines = [(piece.points if closed else piece.outline).tolist() for piece in run.pieces]
    return {
        **({"points": lines[0]} if len(lines) == 1 else {"lines": lines}),
        **({"closed": True} if closed else {}),
        **({"height": run.height_value} if len(run.heights) else {}),
    }


def _table(head: str, values: Mapping[str, Any]) -> str:
    """A table of TOML: JSON writes texts, numbers and lists as TOML does, but for one character."""
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]
    # The name of a file may hold half a pair of surrogates, which no text can.
    text = "\n".join([head, *lines, ""]).lstrip().replace("\x7f", "\\u007f")
    return text.encode(errors="replace").decode()
