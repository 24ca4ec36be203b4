"""World files in TOML: what a person writes, checked, with the line of whatever is wrong.

A path enters; a :class:`WorldFile` leaves: the walls, and the tables on the robot, the laser,
the noise, the mapper and the film that :mod:`lrf3d.scenario` turns into a scenario. A world
that is written is read again to the last bit.
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
from lrf3d.geometry import Float, lengths
from lrf3d.input import own_name, read_text
from lrf3d.output import write_text
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.locate import KeyPath, lines_of_keys, nearest_line
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import WallRun, parts_of, walls
from lrf3d.world.schema import (
    CAMERA,
    OBJECT,
    OBSTACLE,
    PLACE,
    TABLES,
    Check,
    Invalid,
    colour_value,
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


def read_toml(path: Path) -> WorldFile:
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
    keys = ["name", "object", *TABLES, "obstacle", "camera", "place", "free"]
    document.check_keys(data, keys, ())
    name = document.check(text(), data.get("name", own_name(path)), ("name",))
    place = document.check(PLACE, data["place"], ("place",)) if "place" in data else None
    tables = {
        key: document.check_table(data[key], checks, (key,))
        for key, checks in TABLES.items()
        if key in data
    }
    cameras = document.cameras(data.get("camera", []))
    world = document.world(data.get("object"), name, cameras, place)
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

    def free_cells(self, table: object) -> FreeCells:
        try:
            return FreeCells.from_dict(table)
        except InputError as error:
            self.refuse(("free",), str(error).removeprefix("free: "))

    def world(
        self, tables: object, name: str, cameras: tuple[FixedCamera, ...], place: Float | None
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
        for index, (number, item) in enumerate(zip(numbers, objects, strict=True)):
            first = numbers.index(number)
            for key in ("name", "colour"):
                if first != index and key in item.values:
                    self.refuse(
                        ("object", index, key), f"stands with object[{first}] of the same number"
                    )
            if first == index and number < len(names):
                names[number] = item.values.get("name", "")
                colours[number] = item.values.get("colour", np.nan)
        return World(
            np.concatenate([item.segments for item in objects]),
            wall_objects,
            np.concatenate([item.heights for item in objects]),
            name,
            object_names=tuple(names) if any(names) else (),
            colours=colours,
            cameras=cameras,
            place=None if place is None else (float(place[0]), float(place[1])),
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


def write_toml(world: World, path: Path) -> None:
    """Write a world as TOML.

    Raises:
        OutputError: The file cannot be written.
    """
    write_text(path, toml_text(world))


def toml_text(world: World) -> str:
    """The TOML text of a world."""
    blocks = [f"name = {_quoted(world.name)}\n"]
    if world.place is not None:
        blocks[0] += f"place = [{world.place[0]!r}, {world.place[1]!r}]\n"
    described: set[int] = set()
    expected = 0
    for part in [*_objects_without_walls(world), *parts_of(world)]:
        lines = ["[[object]]"]
        if part.number != expected:
            lines.append(f"number = {part.number}")
        expected = part.number + 1
        if part.number not in described:
            lines += _description(world, part.number)
        described.add(part.number)
        lines += _outline(part)
        if len(part.heights) and part.height_value != DEFAULT_HEIGHT:
            lines.append(f"height = {part.height_value!r}")
        blocks.append("\n".join(lines) + "\n")
    blocks += [_camera(camera) for camera in world.cameras]
    if world.free is not None:
        blocks.append(_free(world.free))
    return "\n".join(blocks)


def _camera(camera: FixedCamera) -> str:
    return (
        f"[[camera]]\nname = {_quoted(camera.name)}\n"
        f"position = {list(camera.position)!r}\ntarget = {list(camera.target)!r}\n"
        f"field_deg = {camera.field_deg!r}\n" + ("track = true\n" if camera.track else "")
    )


def _free(free: FreeCells) -> str:
    values = free.as_dict()
    rows = "".join(f"    {row},\n" for row in values["rows"])
    return (
        "# Cells that are known to be free: each row, from the bottom, as the lengths of its runs\n"
        "# that are not free, and free, in turn.\n"
        f"[free]\nresolution = {values['resolution']!r}\norigin = {values['origin']!r}\n"
        f"rows = [\n{rows}]\n"
    )


def _objects_without_walls(world: World) -> list[WallRun]:
    """Objects with a name or a colour but without walls, so that they are not lost."""
    bare = set(range(world.object_count)) - set(world.objects.tolist())
    return [WallRun(n, (), np.empty(0)) for n in sorted(bare) if _description(world, n)]


def _description(world: World, number: int) -> list[str]:
    lines = []
    if number < len(world.object_names) and world.object_names[number]:
        lines.append(f"name = {_quoted(world.object_names[number])}")
    if number < len(world.colours) and np.isfinite(world.colours[number]).all():
        value = colour_value(world.colours[number])
        lines.append(f"colour = {_quoted(value) if isinstance(value, str) else repr(value)}")
    return lines


def _outline(part: WallRun) -> list[str]:
    closed = bool(part.pieces) and all(piece.closed for piece in part.pieces)
    texts = [_points(piece.points if closed else piece.outline) for piece in part.pieces]
    lines = [f"points = {texts[0]}"] if len(texts) == 1 else [f"lines = [{', '.join(texts)}]"]
    return [*lines, "closed = true"] if closed else lines


def _points(points: Float) -> str:
    return "[" + ", ".join(f"[{float(x)!r}, {float(y)!r}]" for x, y in points) + "]"


def _quoted(value: str) -> str:
    escapes = {'"': '\\"', "\\": "\\\\"}
    return (
        '"' + "".join(escapes.get(c, c if _plain(c) else f"\\u{ord(c):04x}") for c in value) + '"'
    )


def _plain(character: str) -> bool:
    return character >= " " and character != "\x7f"
