"""Scenario: a world with a robot, a laser, a noise and a mapper set up to drive through it.

A name or a path enters; all that a run needs leaves. What a file does not say has a default, so
that a file of walls alone serves as well.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Value, read_only
from lrf3d.input import own_name
from lrf3d.laser import Imperfections, LaserRangeFinder
from lrf3d.pose import Pose
from lrf3d.world import World, load_world
from lrf3d.world.cameras import check_view
from lrf3d.world.files import find_world
from lrf3d.world.settings import read_settings
from lrf3d.world.toml_file import WorldFile, read_toml

SIGMA = 0.04
"""Noise [m] at range_max where none is given: that of the paper's city (Fig. 7)."""


@dataclass(frozen=True, eq=False)
class Scenario(Value):
    """A world, and how it is driven through, scanned, mapped and filmed.

    Args:
        world: The walls.
        lrf: The laser range finder.
        sigmas: Standard deviations of the noise [m]; the first is the one to run with, the
            others stand beside it in figures.
        imperfections: What the range finder does beside this noise.
        movers: Tables of what moves beside the robot: route (m, 2) [m], speed [m/s], radius [m]
            or points (n, 2) [m], and height [m].
        start: Pose x, y [m], theta [rad] where the drive begins; None where nothing is said.
        route: (m, 2) way-points [m], the first at the start; None where the file names none.
        poses: (k, 3) poses x, y [m], theta [rad] to stand and scan at instead of a drive.
        planned: The side of the walls, inside or outside, on which the route was planned; None
            where it was not.
        speed: Speed of the drive [m/s].
        scan_interval: Time between two scans [s].
        lookahead: How far ahead on the route the robot steers at [m]: the default is about three
            of its radii, so that it cuts corners by no more than the clearance that routes keep.
        radius: Radius of the robot [m].
        mapper: Keyword arguments for the mapper.
        view: Where the film is seen from: ``chase``, ``first``, ``orbit``,
            ``top``, or the name of one of the world's cameras.
        playback: Simulated seconds in a second of film.
        name: What the scenario is called in files and pictures.

    Examples:
        >>> import lrf3d
        >>> scenario = lrf3d.load_scenario("city")
        >>> scenario.lrf.beams, scenario.sigmas
        (181, (0.04,))
    """

    world: World
    lrf: LaserRangeFinder = field(default_factory=LaserRangeFinder)
    sigmas: tuple[float, ...] = (SIGMA,)
    imperfections: Imperfections = field(default_factory=Imperfections)
    movers: tuple[Mapping[str, Any], ...] = ()
    start: Pose | None = None
    route: Float | None = None
    poses: Float | None = None
    planned: str | None = None
    speed: float = 3.0
    scan_interval: float = 0.25
    lookahead: float = 1.0
    radius: float = 0.35
    mapper: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    view: str = "chase"
    playback: float = 4.0
    name: str = ""

    def __post_init__(self) -> None:
        self._hold(*(name for name in ("route", "poses") if getattr(self, name) is not None))
        movers = tuple(
            {
                name: read_only(value, name) if isinstance(value, np.ndarray) else value
                for name, value in table.items()
            }
            for table in self.movers
        )
        object.__setattr__(self, "movers", movers)

    def __repr__(self) -> str:
        drive = "a route to plan"
        if self.poses is not None:
            drive = f"{len(self.poses)} poses to stand at"
        elif self.route is not None:
            drive = f"a route of {len(self.route)} way-points"
        return f"Scenario({self.name!r}, {self.world!r}, {self.lrf.beams} beams, {drive})"

    def __deepcopy__(self, memo: object) -> "Scenario":
        # Nothing changes a scenario, so that it serves as its own copy: Gymnasium makes them.
        return self


def load_scenario(name_or_path: str | Path, settings: Iterable[str] = ()) -> Scenario:
    """Read a scenario: a built-in one by its name, or a file by its path.

    Args:
        name_or_path: The name or the path.
        settings: What holds instead of what the file says: ``laser.range_max=20``.

    Raises:
        WorldError: There is no such world, or its file cannot be used.
        InputError: A setting is none.

    Examples:
        >>> import lrf3d
        >>> scenario = lrf3d.load_scenario("city", ["laser.range_max=20"])
        >>> scenario.lrf.range_max
        20.0
    """
    return scenario_of(read_scenario_file(name_or_path), settings)


def read_scenario_file(name_or_path: str | Path) -> WorldFile:
    """Read what a built-in world, or a file, says.

    Raises:
        WorldError: There is no such world, or its file cannot be used.
    """
    path = find_world(name_or_path)
    if path.suffix.lower() == ".toml":
        return read_toml(path)
    return WorldFile(load_world(path), path=path)


def scenario_of(file: WorldFile, settings: Iterable[str] = ()) -> Scenario:
    """The scenario that a file describes; those of one file share its world.

    Args:
        file: What was read.
        settings: What holds instead of what the file says: ``laser.range_max=20``.

    Raises:
        InputError: A setting is none.
    """
    tables = {name: dict(table) for name, table in file.tables.items()}
    for name, table in read_settings(settings).items():
        tables.setdefault(name, {}).update(table)
    return _scenario(replace(file, tables=tables))


def start_of(route: Float) -> Pose:
    """The pose at the first way-point of a route (m, 2) that looks towards the second."""
    dx, dy = route[1] - route[0] if len(route) > 1 else (1.0, 0.0)
    return Pose(float(route[0, 0]), float(route[0, 1]), float(np.arctan2(dy, dx)))


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
    return Scenario(
        world=file.world,
        lrf=_range_finder(file),
        sigmas=sigma if isinstance(sigma, tuple) else (sigma,),
        imperfections=Imperfections(**noise),
        movers=file.movers,
        mapper=MappingProxyType(dict(file.tables.get("mapper", {}))),
        name=own_name(file.path, file.world.name),
        **robot,
        **_film(file),
    )


def _film(file: WorldFile) -> Mapping[str, Any]:
    values = file.tables.get("film", {})
    try:
        check_view(values.get("view", "chase"), file.world.cameras)
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
