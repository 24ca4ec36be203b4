"""World files in TOML: what a person writes, checked, with the line of whatever is wrong.

A path enters; a :class:`WorldFile` leaves: the walls, and the tables on the robot, the laser,
the noise, the mapper and the film that :mod:`lrf3d.scenario` turns into a scenario.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from lrf3d.errors import InputError, WorldError
from lrf3d.files import own_name, read_text
from lrf3d.geometry import Float, lengths
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.locate import KeyPath, lines_of_keys, nearest_line
from lrf3d.world.materials import Material, named
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import walls
from lrf3d.world.schema import (
    CAMERA,
    MATERIAL,
    OBJECT,
    OBSTACLE,
    PLACE,
    TABLES,
    Check,
    Invalid,
    text,
)

_DEEP_KEY = re.compile(
    r"""(?:^|[\[{,])[ \t]*(?:(?:[\w-]{1,99}|"[^"\n]{0,99}")[ \t]*\.[ \t]*){40}""", re.M
)
"""A key of over forty parts; keys of world files have two."""


@dataclass(frozen=True)
class WorldFile:
    """The contents of a world file.

    Args:
        world: The walls.
        tables: The checked values of the tables robot, laser, noise, mapper and film.
        obstacles: The checked values of each table ``obstacle``, a dynamic obstacle.
        path: The file.
        text: Its text, in which :meth:`refuse` finds lines.
    """

    world: World
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    obstacles: tuple[Mapping[str, Any], ...] = ()
    path: Path = Path()
    text: str = ""

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

    def refuse(self, path: KeyPath, message: str) -> NoReturn:
        """Raise the error that a value of the file is invalid, with the line of its path."""
        _Document(self.path, self.text).refuse(path, message)


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
            names the file, the line and the key.
    """
    document = _Document(path, read_text(path, what="a world file", error=WorldError))
    data = document.parse()
    if "mover" in data:
        # What dynamic obstacles were called in earlier versions.
        data.setdefault("obstacle", data.pop("mover"))
    keys = ["name", "object", *TABLES, "obstacle", "camera", "material", "place", "free"]
    document.check_keys(data, keys, ())
    name = document.check(text(), data.get("name", own_name(path)), ("name",))
    place = document.check(PLACE, data["place"], ("place",)) if "place" in data else None
    tables = {
        key: document.check_table(data[key], checks, (key,))
        for key, checks in TABLES.items()
        if key in data
    }
    cameras = document.cameras(data.get("camera", []))
    materials = document.materials(data.get("material", []))
    world = document.world(data.get("object"), name, cameras, place, materials)
    if "free" in data:
        world = replace(world, free=document.free_cells(data["free"]))
    return WorldFile(
        world, tables, document.obstacles(data.get("obstacle", [])), path, document.text
    )


@dataclass(frozen=True, slots=True)
class _Document:
    """A TOML text and where it came from."""

    path: Path
    text: str

    def refuse(self, path: KeyPath, message: str) -> NoReturn:
        lines = lines_of_keys(self.text)
        if path[:1] == ("obstacle",) and path[:1] not in lines:
            line = nearest_line(lines, ("mover", *path[1:]))
        else:
            line = nearest_line(lines, path)
        place = f"{_shown(path)}: " if path else ""
        raise WorldError(f"{self.path}:{line}: {place}{message}")

    def parse(self) -> dict[str, Any]:
        # The time that tomllib takes grows with the cube of the number of parts of a key.
        deep = _DEEP_KEY.search(self.text)
        if deep:
            begin = self.text.count("\n", 0, deep.start()) + 1
            raise WorldError(f"{self.path}:{begin}: nested too deeply for a world file")
        try:
            return tomllib.loads(self.text)
        except RecursionError:
            raise WorldError(f"{self.path}:1: nested too deeply for a world file") from None
        except ValueError as error:
            # In Python 3.11 tomllib reports the line only in its message.
            place = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)$", str(error))
            reason = str(error)[: place.start()] if place else str(error)
            line = (place and place.group(1)) or max(len(self.text.splitlines()), 1)
            column = f" at column {place.group(2)}" if place and place.group(2) else ""
            raise WorldError(f"{self.path}:{line}: not TOML: {reason}{column}") from None

    def check(self, check: Check, value: object, path: KeyPath) -> Any:
        try:
            return check(value)
        except Invalid as problem:
            self.refuse((*path, *problem.inside), str(problem))

    def check_keys(self, table: object, known: list[str], path: KeyPath) -> dict[str, Any]:
        if not isinstance(table, dict):
            self.refuse(path, f"expected a table [{_shown(path)}]")
        for key in table:
            if key not in known:
                near = get_close_matches(key, known, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
                self.refuse((*path, key), f"unknown key; {hint}")
        return table

    def check_table(
        self, table: object, checks: Mapping[str, Check], path: KeyPath
    ) -> dict[str, Any]:
        values = self.check_keys(table, list(checks), path)
        return {key: self.check(checks[key], value, (*path, key)) for key, value in values.items()}

    def obstacles(self, tables: object) -> tuple[dict[str, Any], ...]:
        if not isinstance(tables, list):
            self.refuse(("obstacle",), "expected tables [[obstacle]]")
        obstacles = [
            self.check_table(table, OBSTACLE, ("obstacle", index))
            for index, table in enumerate(tables)
        ]
        for index, values in enumerate(obstacles):
            if "route" not in values or ("radius" in values and "points" in values):
                self.refuse(("obstacle", index), "expected a route, and a radius or points")
        return tuple(obstacles)

    def cameras(self, tables: object) -> tuple[FixedCamera, ...]:
        if not isinstance(tables, list):
            self.refuse(
                ("camera",),
                "expected tables [[camera]], each a camera that stands still; view and playback"
                " stand in [film]",
            )
        cameras: list[FixedCamera] = []
        for index, table in enumerate(tables):
            path: KeyPath = ("camera", index)
            values = self.check_table(table, CAMERA, path)
            for key in ("name", "position", "target"):
                if key not in values:
                    self.refuse(path, f"expected a {key}")
            if values["name"] in [camera.name for camera in cameras]:
                self.refuse((*path, "name"), f"a second camera {values['name']!r}")
            try:
                cameras.append(FixedCamera(**values))
            except WorldError as error:
                self.refuse(path, str(error))
        return tuple(cameras)

    def materials(self, tables: object) -> list[Material]:
        if not isinstance(tables, list):
            self.refuse(("material",), "expected tables [[material]], each with a name")
        materials: list[Material] = []
        for index, table in enumerate(tables):
            path: KeyPath = ("material", index)
            values = self.check_table(table, MATERIAL, path)
            if not values.get("name"):
                self.refuse(path, "expected a name")
            if values["name"] in [material.name for material in materials]:
                self.refuse((*path, "name"), f"a second material {values['name']!r}")
            try:
                materials.append(Material(**values))
            except WorldError as error:
                self.refuse(path, str(error))
        return materials

    def material(self, name: str, own: list[Material], index: int) -> Material:
        try:
            return named(name, own)
        except WorldError as error:
            self.refuse(("object", index, "material"), str(error))

    def free_cells(self, table: object) -> FreeCells:
        try:
            return FreeCells.from_dict(table)
        except InputError as error:
            self.refuse(("free",), str(error).removeprefix("free: "))

    def world(
        self,
        tables: object,
        name: str,
        cameras: tuple[FixedCamera, ...],
        place: Float | None,
        materials: list[Material],
    ) -> World:
        if not isinstance(tables, list) or not tables:
            self.refuse(("object",), "expected at least one table [[object]] with points")
        objects = [_Object(self, table, index) for index, table in enumerate(tables)]
        numbers: list[int] = []
        for item in objects:
            numbers.append(item.values.get("number", numbers[-1] + 1 if numbers else 0))
        counts = [len(item.segments) for item in objects]
        wall_objects = np.repeat(numbers, counts)
        if not len(wall_objects):
            self.refuse(("object",), "no object has a wall; give one at least two points")
        names = [""] * (int(wall_objects.max()) + 1)
        colours = np.full((len(names), 3), np.nan)
        made_of: list[Material | None] = [None] * len(names)
        for index, (number, item) in enumerate(zip(numbers, objects, strict=True)):
            first = numbers.index(number)
            for key in ("name", "colour", "material"):
                if first != index and key in item.values:
                    self.refuse(
                        ("object", index, key), f"stands with object[{first}] of the same number"
                    )
            if first == index and number < len(names):
                names[number] = item.values.get("name", "")
                colours[number] = item.values.get("colour", np.nan)
                if "material" in item.values:
                    made_of[number] = self.material(item.values["material"], materials, index)
        return World(
            np.concatenate([item.segments for item in objects]),
            wall_objects,
            np.concatenate([item.heights for item in objects]),
            name,
            object_names=tuple(names) if any(names) else (),
            colours=colours,
            cameras=cameras,
            place=None if place is None else (float(place[0]), float(place[1])),
            materials=made_of,
        )


class _Object:
    """The walls of one ``[[object]]`` table, checked."""

    def __init__(self, document: _Document, table: object, index: int) -> None:
        path: KeyPath = ("object", index)
        self.values = document.check_table(table, OBJECT, path)
        given = [key for key in ("points", "lines") if key in self.values]
        if len(given) != 1:
            document.refuse(path, "expected points, a list of [x, y], or lines, a list of such")
        closed = self.values.get("closed", False)
        lines = [self.values["points"]] if given == ["points"] else self.values["lines"]
        pieces = [np.empty((0, 4))]
        for place, points in enumerate(lines):
            inside = (*path, given[0], place) if given == ["lines"] else (*path, "points")
            if closed and len(points) < 3:
                document.refuse(inside, f"closed with {len(points)} points, expected at least 3")
            pieces.append(walls(points, closed))
            self._check_lengths(document, pieces[-1], inside, len(points))
        self.segments = np.concatenate(pieces)
        height = self.values.get("height", DEFAULT_HEIGHT)
        if isinstance(height, tuple) and len(height) != len(self.segments):
            document.refuse(
                (*path, "height"),
                f"{len(height)} heights for {len(self.segments)} walls, expected one for each",
            )
        self.heights: Float = np.broadcast_to(np.asarray(height), (len(self.segments),))

    def _check_lengths(
        self, document: _Document, segments: Float, path: KeyPath, point_count: int
    ) -> None:
        empty = np.flatnonzero(lengths(segments) == 0.0)
        if not len(empty):
            return
        wall = int(empty[0])
        following = (wall + 1) % point_count
        x, y = segments[wall, :2]
        called = f" of object {self.values['name']!r}" if self.values.get("name") else ""
        mend = "closed joins them already" if following == 0 else "remove one"
        document.refuse(
            (*path, following or wall),
            f"points {wall} and {following}{called} are both ({x:g}, {y:g}),"
            f" a segment of no length; {mend}",
        )


def _shown(path: KeyPath) -> str:
    """A path as a person writes it: ``object[2].points[0]``."""
    shown = ""
    for part in path:
        if isinstance(part, int):
            shown += f"[{part}]"
        else:
            # A quoted key may hold anything, also the end of a line.
            key = part if re.fullmatch(r"[\w-]+", part) else repr(part)
            shown += f".{key}" if shown else key
    return shown
