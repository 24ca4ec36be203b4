"""Simulation: a robot drives, scans and maps, step by step, as in Fig. 2 of Teslić et al.

The input is a world and a drive; steps are yielded one by one, and only the mapper keeps anything.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, check_names, each_of, expect, shown
from lrf3d.casting.collision import Body, CollisionChecker
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.geometry.lines import Float, generator, sealed, whole_number
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserRangeFinder, LaserScan, ProportionalNoise
from lrf3d.laser.noise import FLOOR, SIGMA, Noise, noises_of, spread_of
from lrf3d.laser.range_finder import lasers_of
from lrf3d.mapping import LineMapper
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.following import SCAN_INTERVAL
from lrf3d.robot.kinematics import RADIUS
from lrf3d.robot.odometry import Imu, InertialUnit, Odometer, WheelOdometry
from lrf3d.simulation.sensor import Caster, Sensor, caster_of
from lrf3d.simulation.steering import ControlledDrive, Controller, Robot, trajectory_of
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan


class Mapper(Protocol):
    """Anything that builds a map from scans.

    The map after a scan is the mapper's attribute ``map``, a LineMap or anything else. A mapper
    without it returns the map from `update`. A mapper that estimates the poses may have the
    attribute ``estimate``, an EstimatedTrajectory, which pictures and films show next to the truth.
    One with a method ``drive(increment)`` gets the odometry increment before each scan, if there is
    odometry. It gets the scans of several lasers one by one, or, if its attribute ``several`` is
    true, those of a moment as a tuple.
    """

    def update(self, scan: LaserScan) -> Any:
        """Add a scan; a return value other than None is the map."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a simulation: the measured scans and the true ones, and the map after them.

    There is a scan for each laser. The ``index`` counts from 0; the ``time`` [s] is that of the
    first beams, and the ``pose`` that of the robot then. Where the robot has them, ``odometry``
    (3,) is its pose by the wheels, and ``imu`` (m, 4) what its IMU measured since the step before:
    times [s], turn rates [rad/s], accelerations ahead and to the left [m/s²].

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> step = next(iter(lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)])))
        >>> step.index, step.time, len(step.scan.ranges)
        (0, 0.0, 181)
    """

    index: int
    time: float
    pose: Pose
    scans: tuple[LaserScan, ...]
    true_scans: tuple[LaserScan, ...]
    _simulation: "Simulation" = field(repr=False)
    odometry: Float = field(repr=False)
    imu: Float = field(repr=False)

    @property
    def scan(self) -> LaserScan:
        """The measured scan of the first laser."""
        return self.scans[0]

    @property
    def true_scan(self) -> LaserScan:
        """The true scan of the first laser."""
        return self.true_scans[0]

    @property
    def map(self) -> Any:
        """The map after this scan, of whatever kind; read it before the next step."""
        if self._simulation.done != self.index + 1:
            raise InputError(
                f"map of step {self.index}: the simulation has gone on to scan"
                f" {self._simulation.done - 1}; read step.map before the next step"
            )
        return self._simulation.map


class Simulation:
    """A robot with one or several laser range finders that drives through a world, step by step.

    Each iteration of ``for step in simulation`` scans, maps and drives on. The loop may be left and
    continued at any time. Earlier steps are not kept, so a simulation can run forever.

    Args:
        world: The walls.
        drive: A Trajectory, poses (k, 3) a second apart, or a controller: anything with
            ``command(time, pose, scan) -> (v, w)``, speed [m/s] and turn rate [rad/s] up to the
            next scan, or None to end the drive. With several lasers it gets a tuple of their scans.
            Where a scan takes some time it decides at the end of the scan.
        lrf: The laser range finder, or several; 181 beams over 180° up to 80 m if not given.
        caster: Casts the beams: ``embree``, ``planar``, or an object with ``cast``.
        noise: Turns true scans into measured ones, ``noise(scan, rng)``, or one for each laser;
            none if not given.
        mapper: Builds the map, anything with ``update(scan)``, which is called for each laser; a
            LineMapper set up for the noise if not given.
        rng: A generator for the noise, or a seed.
        obstacles: The dynamic obstacles.
        start: Initial pose of a controller's drive.
        scan_interval: Time between two scans [s] of a controller's drive.
        scans: Number of scans; if not given, those of the trajectory, or any number until a
            controller ends the drive.
        radius: Radius [m] of the robot, which may not touch a wall or a dynamic obstacle; without
            it and an outline it drives through them.
        outline: (n, 2) its outline [m] instead, x ahead.
        on_collision: ``raise``, or ``stop`` for a robot that rests where it touches something, a
            controller's up to the next scan, any other for good.
        odometry: The errors of the wheels, if odometry is to be measured.
        imu: The errors of the IMU, if the robot has one. Both draw random numbers of their own, so
            that scans stay the same.
        robot: How a controller's robot moves: a Unicycle if not given, a DifferentialDrive, an
            AckermannDrive or an OmniDrive.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> simulation = lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> [step.pose.x for step in simulation]
        [1.0, 2.0]
    """

    def __init__(
        self,
        world: World,
        drive: Trajectory | ArrayLike | Controller,
        lrf: LaserRangeFinder | Sequence[LaserRangeFinder] | None = None,
        *,
        caster: Caster | str = "embree",
        noise: Noise | Sequence[Noise] | None = None,
        mapper: Mapper | None = None,
        rng: np.random.Generator | int | None = None,
        obstacles: Sequence[DynamicObstacle] | Crowd = (),
        start: Sequence[float] | Float = (0.0, 0.0, 0.0),
        scan_interval: float = SCAN_INTERVAL,
        scans: int | None = None,
        radius: float | None = None,
        outline: ArrayLike | None = None,
        on_collision: str = "raise",
        odometry: WheelOdometry | None = None,
        imu: Imu | None = None,
        robot: Robot | None = None,
    ) -> None:
        check_names("on_collision", [on_collision], ("raise", "stop"))
        scans = None if scans is None else whole_number(scans, "scans")
        expect(world, World, "world")
        self.world = world
        self.lasers = lasers_of(LaserRangeFinder() if lrf is None else lrf)
        noises = noises_of(ProportionalNoise(0.0) if noise is None else noise, self.lasers)
        self.mapper: Mapper = line_mapper(noises[0]) if mapper is None else mapper
        if not callable(getattr(self.mapper, "update", None)):
            raise InputError(f"mapper {shown(self.mapper)}: expected an object with update(scan)")
        self.rng = generator(rng)
        path = None
        controlled = callable(getattr(drive, "command", None))
        if controlled:
            end = None if scans is None else scans * scan_interval
        else:
            path = trajectory_of(drive)
            scans = min(scans or len(path), len(path))
            end = float(path.times[-1])
        self.obstacles = tuple[DynamicObstacle, ...]()
        crowd = obstacles
        if not isinstance(crowd, Crowd):
            crowd = tuple(each_of(crowd, DynamicObstacle, "obstacle"))
            # A run stores the paths of its obstacles as poses, up to its end; an endless drive is
            # not stored.
            self.obstacles = tuple(each if end is None else each.until(end) for each in crowd)
            crowd = Crowd(self.obstacles)
        solid = radius is not None or outline is not None
        stops = on_collision == "stop"
        body = Body(RADIUS if radius is None else radius, outline) if solid else None
        checker = CollisionChecker(world, crowd) if body else None
        if path is not None and body is not None and checker is not None:
            path = checker.checked(path, body, stops)
        if path is None:
            self.drive: Trajectory | ControlledDrive = ControlledDrive(
                drive,  # type: ignore[arg-type]
                start, scan_interval, checker, body, stops=stops,
                sweep=max(each.scan_duration for each in self.lasers), robot=robot,
            )  # fmt: skip
        else:
            self.drive = path
        shared = caster_of(caster, world)
        self.sensors = tuple(
            Sensor(world, each, caster=shared, noise=own, obstacles=crowd, path=self.drive)
            for each, own in zip(self.lasers, noises, strict=True)
        )
        wheels, inertial = self.rng.spawn(2) if odometry or imu else (self.rng, self.rng)
        self._odometer = None if odometry is None else Odometer(odometry, wheels)
        self._imu = None if imu is None else InertialUnit(imu, inertial)
        self.motion_sensors = odometry, imu
        """The errors of the wheels and of the IMU."""
        self.odometry = np.zeros(3)
        self.inertial = np.empty((0, 4))
        """The pose by odometry at the last scan, and what the IMU measured before it."""
        self.film: FilmPlan = USUAL_FILM
        """The default settings of the film."""
        self.radius = RADIUS if radius is None else radius
        """Radius of the robot [m]."""
        self.scans = scans
        self.done = 0
        self._seconds = 0.0
        self._returned: Any = None

    @property
    def lrf(self) -> LaserRangeFinder:
        """The first laser."""
        return self.lasers[0]

    @property
    def sensor(self) -> Sensor:
        """The first laser among the walls, with its noise."""
        return self.sensors[0]

    @property
    def map(self) -> Any:
        """The map after all scans so far, of whatever kind; None if the mapper makes none."""
        return getattr(self.mapper, "map", None) if self._returned is None else self._returned

    @property
    def estimate(self) -> EstimatedTrajectory | None:
        """The trajectory that the mapper estimates, if it does."""
        estimate = getattr(self.mapper, "estimate", None)
        return estimate if isinstance(estimate, EstimatedTrajectory) else None

    def __iter__(self) -> Iterator[Step]:
        """The remaining steps."""
        drive = self.drive
        while self.scans is None or self.done < self.scans:
            index = self.done
            if isinstance(drive, Trajectory):
                time = float(drive.times[index])
                pose = drive.poses[index]
                place = Pose(*pose.tolist())
            elif drive.goes_on:
                time = drive.time
                pose = np.array(drive.pose)
                place = drive.pose
            else:
                return
            truth = tuple(sensor.cast(pose, time) for sensor in self.sensors)
            scans = tuple(
                sensor.noisy(scan, self.rng)
                for sensor, scan in zip(self.sensors, truth, strict=True)
            )
            self.take(scans, pose)
            yield Step(index, time, place, scans, truth, self, self.odometry, self.inertial)

    def take(self, scans: Sequence[LaserScan], pose: Float) -> None:
        """Take the next measured scan of each laser, with the robot at (3,): map and drive on.

        Taking recorded scans brings a new simulation to the state of an interrupted one.
        """
        if self._odometer is not None:
            self.odometry = sealed(self._odometer.drive(pose))
            if callable(getattr(self.mapper, "drive", None)):
                self.mapper.drive(self._odometer.increment)  # type: ignore[attr-defined]
        if self._imu is not None:
            self.inertial = sealed(self._imu.drive(scans[0].time, pose))
        begin = perf_counter()
        self._returned = update_mapper(self.mapper, scans)
        # The first update is not counted: it may compile or load the mapper.
        if self.done:
            self._seconds += perf_counter() - begin
        if isinstance(self.drive, ControlledDrive):
            self.drive.after(scans[0] if len(scans) == 1 else scans)
        self.done += 1

    @property
    def next_time(self) -> float:
        """The time of the next scan [s]; infinity after the last."""
        drive = self.drive
        if self.done == self.scans:
            return math.inf
        if isinstance(drive, Trajectory):
            return float(drive.times[self.done])
        return drive.time if drive.goes_on else math.inf

    @property
    def total(self) -> int:
        """The largest number of scans, which must be known to keep them."""
        if self.scans is None:
            raise InputError("scans: not given, and a controller may drive for ever; give scans=")
        return self.scans

    @property
    def milliseconds_an_update(self) -> float | None:
        """Mean time of the mapper's updates after the first [ms]; None if there are none."""
        return 1e3 * self._seconds / (self.done - 1) if self.done > 1 else None


def update_mapper(mapper: Any, scans: Sequence[LaserScan]) -> Any:
    """Update a mapper by the scans of a moment: one by one, or all at once where it takes several.

    It returns what the mapper does.
    """
    if len(scans) > 1 and getattr(mapper, "several", False):
        return mapper.update(tuple(scans))
    returned = None
    for scan in scans:
        returned = mapper.update(scan)
    return returned


def line_mapper(noise: object, **settings: Any) -> LineMapper:
    """The default mapper: a LineMapper set up for the spread of a noise, or by settings."""
    constant, sigma = spread_of(noise) or (0.0, SIGMA)
    usual = {"sigma": sigma}
    if constant:
        usual["floor"] = float(np.hypot(FLOOR, constant))
    return LineMapper(**{**usual, **settings})
