"""Scenario files: a world file becomes a Scenario."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.errors import InputError
from lrf3d.files import own_name
from lrf3d.laser import Imperfections, LaserRangeFinder
from lrf3d.laser.noise import SIGMA
from lrf3d.pose import Pose
from lrf3d.robot.laps import Patrol
from lrf3d.robot.unicycle import RADIUS
from lrf3d.scenario import Scenario, start_of
from lrf3d.world import load_world
from lrf3d.world.cameras import check_view
from lrf3d.world.files import find_world
from lrf3d.world.model import DEFAULT_HEIGHT
from lrf3d.world.schema import read_settings
from lrf3d.world.toml_file import WorldFile, read_world_file


def load_scenario(name_or_path: str | Path, settings: Iterable[str] = ()) -> Scenario:
    """Read a scenario: a built-in one by its name, or a file by its path.

    Args:
        name_or_path: The name or the path.
        settings: Settings that override those of the file: ``laser.range_max=20``.

    Raises:
        WorldError: There is no such world, or its file cannot be used.
        InputError: A setting is invalid.

    Examples:
        >>> import lrf3d
        >>> scenario = lrf3d.load_scenario("city", ["laser.range_max=20"])
        >>> scenario.lrf.range_max
        20.0
    """
    return scenario_of(read_scenario_file(name_or_path), settings)


def read_scenario_file(name_or_path: str | Path, *, resolution: float | None = None) -> WorldFile:
    """Read the file of a world, given by its name or its path; a picture needs a resolution [m].

    Raises:
        WorldError: There is no such world, or its file cannot be used.
    """
    path = find_world(name_or_path)
    if path.suffix.lower() == ".toml" and resolution is None:
        return read_world_file(path)
    return WorldFile(load_world(path, resolution=resolution), path=path)


def scenario_of(file: WorldFile, settings: Iterable[str] = ()) -> Scenario:
    """The scenario that a file describes; all scenarios of one file share its world.

    Args:
        file: The file.
        settings: Settings that override those of the file: ``laser.range_max=20``.

    Raises:
        InputError: A setting is invalid.
    """
    tables = {name: dict(table) for name, table in file.tables.items()}
    for name, table in read_settings(settings).items():
        tables.setdefault(name, {}).update(table)
    return _scenario(replace(file, tables=tables))


def _scenario(file: WorldFile) -> Scenario:
    robot = dict(file.tables.get("robot", {}))
    if "route" in robot and "poses" in robot:
        file.refuse(("robot", "poses"), "stand beside a route; give one of them")
    if "poses" in robot:
        robot["poses"] = np.column_stack([robot["poses"][:, :2], np.radians(robot["poses"][:, 2])])
    if "start" in robot:
        x, y, degrees = robot["start"].tolist()
        robot["start"] = Pose(x, y, float(np.radians(degrees)))
    if "route" in robot:
        start = robot.setdefault("start", start_of(robot["route"]))
        if tuple(robot["route"][0]) != start[:2]:
            robot["route"] = np.vstack([start[:2], robot["route"]])
    noise = dict(file.tables.get("noise", {}))
    sigma = noise.pop("sigma", SIGMA)
    sigma, *compared = sigma if isinstance(sigma, tuple) else (sigma,)
    lrf = _range_finder(file)
    return Scenario(
        world=file.world,
        lrf=lrf,
        noise=Imperfections(**noise).noise(sigma, lrf),
        compared=tuple(compared),
        obstacles=_obstacles(file, robot.get("radius", RADIUS)),
        mapper=MappingProxyType(dict(file.tables.get("mapper", {}))),
        name=own_name(file.path, file.world.name),
        **robot,
        **_film(file),
    )


def _obstacles(file: WorldFile, radius: float) -> tuple[DynamicObstacle, ...]:
    """The dynamic obstacles; without a radius they are as wide as the robot."""
    obstacles = []
    for index, table in enumerate(file.obstacles):
        try:
            outline = table.get("points")
            obstacles.append(
                DynamicObstacle(
                    round_outline(table.get("radius", radius)) if outline is None else outline,
                    Patrol(table["route"], table.get("speed", 1.0)),
                    table.get("height", DEFAULT_HEIGHT),
                )
            )
        except InputError as error:
            file.refuse(("obstacle", index), str(error))
    return tuple(obstacles)


def _film(file: WorldFile) -> Mapping[str, Any]:
    values = file.tables.get("film", {})
    try:
        check_view(values.get("view", "story"), file.world.cameras)
    except InputError as error:
        file.refuse(("film", "view"), str(error))
    return values


def _range_finder(file: WorldFile) -> LaserRangeFinder:
    values = dict(file.tables.get("laser", {}))
    for key in ("angle_min", "angle_max"):
        if f"{key}_deg" in values:
            values[key] = float(np.radians(values.pop(f"{key}_deg")))
    try:
        return LaserRangeFinder(**values)
    except InputError as error:
        file.refuse(("laser",), str(error))
