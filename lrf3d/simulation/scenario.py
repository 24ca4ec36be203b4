"""Scenario: a world with a robot, a laser, a noise and a mapper set up to drive through it.

It is read from a world file and run as a simulation. Everything but the walls has a default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, WorldError, check_names, each_of, expect
from lrf3d.base.files import own_name
from lrf3d.base.interrupts import Progress, silent
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.geometry.lines import Float, Value, as_rows, number, numbers, whole_number
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser import DepthCamera, LaserRangeFinder, Lidar, Noise, ProportionalNoise
from lrf3d.laser.noise import SIGMA, as_noise, at_sigma, spread_of
from lrf3d.mapping import LineMapper
from lrf3d.planning import Side
from lrf3d.robot import Attitude, Trajectory, follow_route, following
from lrf3d.robot.following import LOOKAHEAD, SCAN_INTERVAL, SPEED, Patrol
from lrf3d.robot.kinematics import RADIUS
from lrf3d.robot.odometry import Imu, WheelOdometry
from lrf3d.simulation.tables import (
    SENSORS,
    TABLES,
    cloud_sensors,
    drive_of,
    in_radians,
    lasers_with_noise,
    motion_sensors,
    read_file,
    read_settings,
)
from lrf3d.world.cameras import USUAL_FILM, FilmPlan, check_view
from lrf3d.world.files import find_world, load_world_file
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.toml_file import WorldFile

if TYPE_CHECKING:
    from lrf3d.casting.collision import Body
    from lrf3d.simulation.loop import Simulation
    from lrf3d.simulation.mappers import Mapper
    from lrf3d.simulation.run import Run
    from lrf3d.simulation.sensor import Caster
    from lrf3d.simulation.steering import Controller, Robot

# Time between two scans [s] at single poses: a film shows each for some seconds.
POSE_INTERVAL = 4.0

# Default number of scans of a controller's drive, which may have no end.
CONTROLLED_SCANS = 1000

# Largest number of scans, eleven days at 10 Hz: their poses are in memory, 32 bytes each.
MOST_SCANS = 10_000_000


@dataclass(frozen=True, eq=False)
class Scenario(Value):
    """A world with the settings for driving, scanning, mapping and filming.

    Args:
        world: The walls.
        lrf: The laser range finder, the first of several.
        noise: Its noise.
        compared: Standard deviations [m] at range_max of further noise levels, whose maps a figure
            compares with that of the run.
        obstacles: The dynamic obstacles.
        start: The initial pose x, y [m], theta [rad].
        route: (m, 2) way-points [m], the first at the start; None if it is to be planned.
        poses: (k, 3) poses x, y [m], theta [rad] to scan from instead of driving.
        planned: The side of the walls, inside or outside, on which the route was planned.
        speed: Speed of the drive [m/s].
        scan_interval: Time between two scans [s].
        lookahead: Distance [m] along the route to the point that the robot steers at.
        radius: Radius of the robot [m].
        outline: (n, 2) its outline [m] instead, x ahead; the radius is then that around it.
        mapper: Keyword arguments of the LineMapper.
        film: The default settings of its film.
        further: The other lasers, each with its noise.
        odometry: The errors of the wheels, if odometry is to be measured.
        imu: The errors of the IMU, if the robot has one.
        goals: (m, 2) places [m] through which a route is planned, instead of past all walls.
        keep_out: Areas (k, 2) [m] that a planned route avoids.
        lidars: Its lidars, with the noise of the first laser.
        depth_cameras: Its depth cameras.
        robot: How it moves by the commands of a controller, or live; a Unicycle if not given.
        attitude: The pitch and roll along its drive; on even ground if not given.

    Examples:
        >>> import lrf3d
        >>> scenario = lrf3d.load_scenario("city")
        >>> scenario.lrf.beams, scenario.noise
        (181, ProportionalNoise(sigma=0.04))
        >>> run = scenario.run(scans=3, rng=0, mode="paper", speed=2.0)
        >>> len(run)
        3
    """

    world: World
    lrf: LaserRangeFinder = field(default_factory=LaserRangeFinder)
    noise: Noise = ProportionalNoise(SIGMA)  # noqa: RUF009  It is a value that nothing changes.
    compared: tuple[float, ...] = ()
    obstacles: tuple[DynamicObstacle, ...] = ()
    start: Pose | None = None
    route: Float | None = None
    poses: Float | None = None
    planned: str | None = None
    speed: float = SPEED
    scan_interval: float = SCAN_INTERVAL
    lookahead: float = LOOKAHEAD
    radius: float = RADIUS
    outline: Float | None = None
    mapper: Mapping[str, Any] = field(default_factory=dict)
    film: FilmPlan = USUAL_FILM
    name: str = ""
    further: tuple[tuple[LaserRangeFinder, Noise], ...] = ()
    odometry: WheelOdometry | None = None
    imu: Imu | None = None
    goals: Float | None = field(default=None, repr=False)
    keep_out: tuple[Float, ...] = field(default=(), repr=False)
    lidars: tuple[Lidar, ...] = ()
    depth_cameras: tuple[DepthCamera, ...] = ()
    robot: Robot | None = None
    attitude: Attitude | None = None

    def __post_init__(self) -> None:
        for name, kind in (
            ("world", World), ("lrf", LaserRangeFinder), ("mapper", Mapping), ("film", FilmPlan),
            ("odometry", WheelOdometry | None), ("imu", Imu | None), ("name", str),
            ("attitude", Attitude | None),
        ):  # fmt: skip
            expect(getattr(self, name), kind, f"scenario: {name}")
        for name in ("speed", "scan_interval", "lookahead", "radius"):
            number(getattr(self, name), f"scenario: {name}", positive=True)
        for name, columns in (("route", 2), ("poses", 3), ("outline", 2), ("goals", 2)):
            if getattr(self, name) is not None:
                as_rows(getattr(self, name), f"scenario: {name}", columns, least=1)
        if self.start is not None:
            object.__setattr__(self, "start", as_pose(self.start))
        arrays = ("route", "poses", "outline", "goals")
        self._hold(*(name for name in arrays if getattr(self, name) is not None))
        if self.outline is not None:
            from lrf3d.casting.collision import Body

            object.__setattr__(self, "radius", Body(outline=self.outline).reach)
        obstacles = tuple(each_of(self.obstacles, DynamicObstacle, "scenario: obstacle"))
        levels = np.ravel(numbers(self.compared, "scenario: compared")).tolist()
        compared = tuple(number(each, "scenario: compared") for each in levels)
        given = {"compared": compared, "noise": as_noise(self.noise), "obstacles": obstacles}
        for name, value in given.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        drive = "a route to plan"
        if self.poses is not None:
            drive = f"{len(self.poses)} poses to stand at"
        elif self.route is not None:
            drive = f"a route of {len(self.route)} way-points"
        return f"Scenario({self.name!r}, {self.world!r}, {self.lrf.beams} beams, {drive})"

    @property
    def lasers(self) -> tuple[LaserRangeFinder, ...]:
        """All laser range finders of the robot."""
        return (self.lrf, *(lrf for lrf, _ in self.further))

    @property
    def beginning(self) -> Pose:
        """Where a robot begins that is driven by commands."""
        poses = np.zeros((1, 3)) if self.poses is None else self.poses
        return self.start or as_pose(poses[0])

    @property
    def sigmas(self) -> tuple[float, ...]:
        """Standard deviations [m] at range_max: that of the noise, and those compared with it."""
        _, sigma = spread_of(self.noise) or (0.0, SIGMA)
        return sigma, *self.compared

    def changed(self, **changes: Any) -> Scenario:
        """The scenario with other fields; a new world or route resets those that depend on it."""
        # `run` takes an rng, too, and passes the others on.
        check_names("scenario", changes, [*(each.name for each in fields(self)), "rng"])
        if {"world", "route", "poses"} & set(changes):
            reset = dict.fromkeys(("route", "poses", "planned", "start"))
            if "route" in changes and changes["route"] is not None:
                reset["start"] = start_of(np.asarray(changes["route"], dtype=np.float64))
            changes = {**reset, **changes}
        return replace(self, **changes) if changes else self

    def with_route(
        self, *, where: Side | None = None, say: Callable[[str], None] = lambda note: None
    ) -> Scenario:
        """The scenario, with a planned route past most of its walls if it has none.

        Indoors a robot whose speed is not given drives at 1 m/s, and one whose radius is not given
        is a smaller one where doors are too narrow for most of the rooms. Without a side of the
        walls, it depends on the world and the start; ``say`` is called with what the route does
        not reach, and why.
        """
        if self.poses is not None or self.route is not None:
            return self
        from lrf3d.planning.planner import find_route

        # Look-ahead [m] on planned routes, short enough for the doors of a house; with 1 m the
        # robot would cut their corners.
        planned_lookahead = 0.4
        found = find_route(
            self.world,
            radius=None if self.radius == RADIUS else self.radius,
            speed=None if self.speed == SPEED else self.speed,
            range_max=self.lrf.range_max,
            lookahead=min(self.lookahead, planned_lookahead),
            dt=self.scan_interval / self._commands,
            where=where,
            start=self.start,
            goals=self.goals,
            keep_out=self.keep_out,
        )
        for note in found.notes:
            say(str(note))
        return replace(
            self,
            route=found.waypoints,
            start=start_of(found.waypoints) if self.start is None else self.start,
            lookahead=found.lookahead,
            planned=found.side,
            radius=found.radius,
            speed=found.speed,
        )

    @property
    def _commands(self) -> int:
        """Number of commands between two scans: steering is finer than the interval."""
        return max(1, round(self.scan_interval / following.CONTROL_STEP))

    def trajectory(
        self,
        *,
        scans: int | None = None,
        on_collision: Callable[[str], None] | None = None,
        say: Callable[[str], None] = lambda note: None,
    ) -> Trajectory:
        """The drive along the route, or the single poses; for the arguments see `simulation`.

        ``say`` is called with the first collision with a dynamic obstacle, which ends no drive.
        """
        scans = None if scans is None else whole_number(scans, "scans", most=MOST_SCANS)
        if self.poses is not None:
            stops = np.arange(len(self.poses) if scans is None else scans)
            return Trajectory(POSE_INTERVAL * stops, self.poses[stops % len(self.poses)])
        # Imported here, so that films and figures do not load the compiler.
        from lrf3d.casting.collision import Body, find_collision

        body = Body(self.radius, self.outline)
        laps = self._laps(scans)
        self._check_walls(laps, body, on_collision)
        laps = tuple(lap.every(self._commands) for lap in laps)
        path = laps[0] if scans is None else following.chain_laps(laps, scans)
        if self.obstacles:
            nothing = World(np.empty((0, 4)))
            if (collision := find_collision(path, nothing, body, self.obstacles)) is not None:
                say(f"{collision}; the robot's route takes no notice of it")
        return path

    def _laps(self, scans: int | None) -> tuple[Trajectory, ...]:
        """The drive along the route, or for a number of scans two laps that are repeated."""
        if self.route is None:
            raise InputError(f"{self.name}: neither poses nor a route to drive")
        dt = self.scan_interval / self._commands
        settings: dict[str, Any] = {"speed": self.speed, "lookahead": self.lookahead, "dt": dt}
        if scans is None:
            return (follow_route(self.route, start=self.start, **settings),)
        most = (scans - 1) * self._commands + 1
        return following.drive_laps(self.route, start=self.start, most=most, **settings)

    def _check_walls(
        self, laps: Iterable[Trajectory], body: Body, note: Callable[[str], None] | None
    ) -> None:
        """Note the first collision of laps with a wall; without a function to call, raise it."""
        from lrf3d.casting.collision import check_drive, find_collision

        for lap in laps:
            if note is None:
                check_drive(lap, self.world, body)
            elif (collision := find_collision(lap, self.world, body)) is not None:
                note(str(collision))
                return

    def simulation(
        self,
        *,
        drive: Trajectory | ArrayLike | Controller | None = None,
        rng: np.random.Generator | int | None = None,
        mapper: Mapper | Mapping[str, Any] | None = None,
        caster: Caster | str = "embree",
        scans: int | None = None,
        on_collision: Callable[[str], None] | str | None = None,
        **changes: Any,
    ) -> Simulation:
        """The simulation of ``lrf3d run``; the same seed gives the same numbers.

        Args:
            drive: A trajectory, poses (k, 3) a second apart or a controller instead of the route.
            rng: A generator for the noise, or a seed: 5 gives the run of ``--seed 5``.
            mapper: A mapper, or other keyword arguments of the LineMapper.
            caster: ``embree``, ``planar``, or a caster.
            scans: Number of scans, for which the route is driven there and back.
            on_collision: Called with the message of a collision, after which the drive continues;
                walls do not stop a controller then. ``stop`` lets the robot rest where it touches a
                wall or a dynamic obstacle, ``raise`` makes this an error; if not given, it is one
                with a wall, and for a controller.
            **changes: Other values of any field of the Scenario; ``sigma``, another standard
                deviation of the noise [m] at range_max; ``mode``, that of the LineMapper. A noise
                that does not report its ``spread`` leaves the mapper set up for the scenario's.
        """
        # Imported here, so that films and figures do not load the compiler.
        from lrf3d.simulation.loop import Simulation
        from lrf3d.simulation.steering import is_controller

        if isinstance(mapper, Mapping):
            changes = {**changes, "mapper": mapper}
            mapper = None
        measured = [changes.pop(name, None) for name in ("sigma", "noise", "mode")]
        scenario = self.changed(**changes)
        settings = dict[str, Any]()
        checks = on_collision if isinstance(on_collision, str) else "ignore"
        if drive is None:
            scenario = scenario.with_route()
            noted = (lambda note: None) if isinstance(on_collision, str) else on_collision
            drive = scenario.trajectory(scans=scans, on_collision=noted)
        elif is_controller(drive):
            scans = CONTROLLED_SCANS if scans is None else scans
            scans = whole_number(scans, "scans", most=MOST_SCANS)
            settings = {"start": scenario.beginning, "scan_interval": scenario.scan_interval}
            checks = "raise" if on_collision is None else checks
            settings["robot"] = scenario.robot
        noises, usual = scenario.measuring(*measured)
        simulation = Simulation(
            scenario.world, drive, scenario.lasers, caster=caster, rng=rng, scans=scans,
            noise=noises, mapper=usual if mapper is None else mapper, film=scenario.film,
            obstacles=scenario.obstacles, odometry=scenario.odometry, imu=scenario.imu,
            radius=scenario.radius, outline=scenario.outline, on_collision=checks,
            lidars=scenario.lidars, depth_cameras=scenario.depth_cameras,
            attitude=scenario.attitude, **settings,
        )  # fmt: skip
        simulation.check_mounts(on_collision)
        return simulation

    def measuring(self, sigma: float | None, noise: Any, mode: str | None) -> tuple[Any, Mapper]:
        """The noises of the lasers, or the one given, and a LineMapper set up for them."""
        from lrf3d.simulation.loop import line_mapper

        noises = [self.noise, *(own for _, own in self.further)]
        noises = noises if sigma is None else [at_sigma(each, sigma) for each in noises]
        # It is set up for the noise whose spread is known: that of the sigma, if given.
        known = noises[0] if noise is None or sigma is not None or not spread_of(noise) else noise
        settings = self.mapper if mode is None else {**self.mapper, "mode": mode}
        return noises if noise is None else noise, line_mapper(known, **settings)

    def run(
        self, *, snapshots: int | None = None, progress: Progress = silent, **changes: Any
    ) -> Run:
        """Drive, scan and map, as ``lrf3d run`` does, and keep all of it in memory.

        It takes the arguments of `simulation` and of `simulate`.

        Examples:
            >>> import lrf3d
            >>> run = lrf3d.load_scenario("paper_room").run(rng=0, sigma=0.02)
            >>> run.map.object_count > 0
            True
        """
        from lrf3d.simulation.recorder import collect

        return collect(self.simulation(**changes), progress, snapshots=snapshots)


def start_of(route: Float) -> Pose:
    """The pose at the first way-point of a route (m, 2), facing the second."""
    dx, dy = route[1] - route[0] if len(route) > 1 else (1.0, 0.0)
    return Pose(float(route[0, 0]), float(route[0, 1]), float(np.arctan2(dy, dx)))


def load_scenario(name_or_path: str | Path, settings: Iterable[str] = ()) -> Scenario:
    """Read a built-in scenario by its name, or a file; settings override those of the file.

    Raises:
        WorldError: There is no such world, or its file or a setting cannot be used.

    Examples:
        >>> import lrf3d
        >>> scenario = lrf3d.load_scenario("city", ["laser.range_max=20"])
        >>> scenario.lrf.range_max
        20.0
    """
    return scenario_of(read_scenario_file(name_or_path), settings)


def read_scenario_file(name_or_path: str | Path, scale: float = 1.0, **options: Any) -> WorldFile:
    """Read the file of a world, given by its name or its path, by the options of `load_world`."""
    path = find_world(name_or_path)
    if path.suffix.lower() == ".toml" and not options:
        return read_file(path).scaled(scale)
    return load_world_file(path, scale=scale, **options)


def _path_along(route: Float, speed: float) -> Patrol | Trajectory:
    """The path of an obstacle along way-points (m, 2) [m]; if these are one place it stands."""
    if (route != route[0]).any():
        return Patrol(route, speed)
    return Trajectory([0.0, 1.0], np.tile(np.append(route[0], 0.0), (2, 1)))


def scenario_of(file: WorldFile, settings: Iterable[str] = ()) -> Scenario:
    """The scenario that a file describes, by settings; all of one file share its world."""
    chosen = read_settings(settings)
    tables: dict[str, Any] = {
        name: {**file.tables.get(name, {}), **chosen.get(name, {})} for name in TABLES
    }
    robot = tables["robot"]
    noise = tables["noise"]
    film = FilmPlan(**tables["film"])
    if {"route", "poses"} <= set(robot):
        raise WorldError(f"{file.path}: robot.poses: stand next to a route; give one of them")
    if "start" in robot:
        robot["start"] = Pose(*robot["start"].tolist())
    if "route" in robot:
        start = robot.setdefault("start", start_of(robot["route"]))
        if tuple(robot["route"][0]) != start[:2]:
            robot["route"] = np.vstack([start[:2], robot["route"]])
    (lrf, own), *further = lasers_with_noise(file, tables["laser"], noise)
    with file.at("film"):
        check_view(film.view, file.world.cameras)
    obstacles = []
    for index, given in enumerate(file.obstacles):
        with file.at(f"obstacle[{index}]"):
            # Without a radius it is as wide as the robot.
            outline = round_outline(given.get("radius", robot.get("radius", RADIUS)))
            path = _path_along(given["route"], given.get("speed", 1.0))
            height = given.get("height", DEFAULT_HEIGHT)
            obstacles.append(DynamicObstacle(given.get("points", outline), path, height))
    sigmas = noise.get("sigma", SIGMA)
    sensors = motion_sensors(file, tables)
    with file.at("drive"):
        sensors |= drive_of(**in_radians(tables["drive"]))
    lidars, cameras = (cloud_sensors(file, name, chosen.get(name, {})) for name in SENSORS)
    with file.at("mapper"):
        LineMapper(**tables["mapper"])
    with file.at("robot"):
        return Scenario(
            world=file.world,
            lrf=lrf,
            noise=own,
            further=tuple(further),
            compared=sigmas[1:] if isinstance(sigmas, tuple) else (),
            obstacles=tuple(obstacles),
            mapper=tables["mapper"],
            **sensors,
            film=film,
            lidars=lidars,
            depth_cameras=cameras,
            name=own_name(file.path, file.world.name),
            **robot,
        )
