"""Simulation: a robot drives, scans and maps, step by step, as in Fig. 2 of Teslić et al.

The input is a world and a drive; steps are yielded one by one, and only the mapper keeps anything.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, check_names, each_of, expect
from lrf3d.casting.collision import Body, CollisionChecker
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.geometry.lines import Float, generator, sealed, whole_number
from lrf3d.geometry.pose import Pose
from lrf3d.laser import (
    DepthCamera,
    DepthImage,
    LaserRangeFinder,
    LaserScan,
    Lidar,
    LidarScan,
    ProportionalNoise,
)
from lrf3d.laser.cloud_sensors import CloudSensors
from lrf3d.laser.noise import FLOOR, SIGMA, Noise, noises_of, spread_of
from lrf3d.laser.range_finder import lasers_of
from lrf3d.mapping import LineMapper
from lrf3d.robot import Attitude, EstimatedTrajectory, Trajectory
from lrf3d.robot.attitude import Tilting
from lrf3d.robot.following import SCAN_INTERVAL
from lrf3d.robot.kinematics import RADIUS
from lrf3d.robot.odometry import Imu, InertialUnit, Odometer, WheelOdometry
from lrf3d.simulation.clouds import Clouds, RobotState
from lrf3d.simulation.mappers import Mapper, OptionalParts
from lrf3d.simulation.sensor import (
    Caster,
    Sensor,
    caster_of,
    check_duration,
    motion_along,
)
from lrf3d.simulation.steering import ControlledDrive, Controller, Robot, as_drive
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan

# What a body does that touches something: the drive is an error, the body rests there, or nothing
# happens and it drives through.
ON_COLLISION = ("raise", "stop", "ignore")


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a simulation: the measured scans and the true ones, and the map after them.

    There is a scan for each laser. The ``index`` counts from 0; the ``time`` [s] is that of the
    first beams, and the ``pose`` that of the robot then. Where the robot has them, ``odometry``
    (3,) is its pose by the wheels, and ``imu`` (m, 4) what its IMU measured since the step before:
    times [s], turn rates [rad/s], accelerations ahead and to the left [m/s²]. The ``attitude`` is
    the robot's true pitch and roll [rad].

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
    _simulation: Simulation = field(repr=False)
    odometry: Float = field(repr=False)
    imu: Float = field(repr=False)
    sweeps: Float = field(repr=False)
    attitude: tuple[float, float] = field(repr=False)

    @property
    def lidar_scans(self) -> tuple[LidarScan, ...]:
        """The measured scan of each lidar, cast again on each access."""
        return tuple(self._simulation.clouds.at(self._state)[0])

    @property
    def depth_images(self) -> tuple[DepthImage, ...]:
        """The measured image of each depth camera, cast again on each access."""
        return tuple(self._simulation.clouds.at(self._state)[1])

    @property
    def _state(self) -> RobotState:
        return RobotState(np.array(self.pose), self.time, self.attitude, self.sweeps)

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
            controller's up to the next scan, any other for good, or ``ignore`` for one that drives
            through.
        odometry: The errors of the wheels, if odometry is to be measured.
        imu: The errors of the IMU, if the robot has one. Both draw random numbers of their own, so
            that scans stay the same.
        robot: How a controller's robot moves: a Unicycle if not given, a DifferentialDrive, an
            AckermannDrive or an OmniDrive.
        film: The default settings of the film.
        lidars: A `Lidar`, or several, whose scans are in ``step.lidar_scans``. They have the noise
            of the first laser, with random numbers of their own.
        depth_cameras: A `DepthCamera`, or several: ``step.depth_images``.
        attitude: The pitch and roll of the robot, which tilt all its sensors; the mapper takes them
            to be level. On even ground if not given.

    Raises:
        InputError: An argument is invalid, or the robot or the mount of a lidar is in a wall.

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
        film: FilmPlan = USUAL_FILM,
        lidars: Lidar | Sequence[Lidar] = (),
        depth_cameras: DepthCamera | Sequence[DepthCamera] = (),
        attitude: Attitude | None = None,
    ) -> None:
        check_names("on_collision", [on_collision], ON_COLLISION)
        expect(world, World, "world")
        self.world = world
        self.lasers, noises = _equipped(lrf, noise)
        self.mapper: Mapper = line_mapper(noises[0]) if mapper is None else mapper
        self._mapper = OptionalParts(self.mapper)
        self.rng = generator(rng)
        moves = as_drive(drive)
        self.scans, end = _ends(moves, scans, scan_interval)
        self.obstacles, crowd = _surroundings(obstacles, end)
        body, solid = _body(radius, outline)
        # Radius of the robot [m], that around its outline.
        self.radius = body.reach
        cloud_sensors = CloudSensors.of(lidars, depth_cameras, noises[0])
        checks = solid and on_collision != "ignore"
        checker = CollisionChecker(world, crowd) if checks else None
        stops = on_collision == "stop"
        self.drive: Trajectory | ControlledDrive
        if not isinstance(moves, Trajectory):
            lasers = max(self.lasers, key=lambda each: each.scan_duration).scan_duration
            sweep = max(lasers, cloud_sensors.sweep)
            self.drive = ControlledDrive(
                moves, start, scan_interval, checker, body, stops=stops, sweep=sweep, robot=robot
            )
        else:
            self.drive = moves if checker is None else checker.checked(moves, body, stops)
        shared = caster_of(caster, world)
        self.sensors = tuple(
            Sensor(world, each, caster=shared, noise=own, obstacles=crowd, path=self.drive)
            for each, own in zip(self.lasers, noises, strict=True)
        )
        # The errors of the wheels and of the IMU.
        expect(odometry, WheelOdometry | None, "odometry")
        expect(imu, Imu | None, "imu")
        expect(attitude, Attitude | None, "attitude")
        expect(film, FilmPlan, "film")
        self.motion_sensors = odometry, imu
        wheels, inertial = motion_streams(self.rng, odometry, imu)
        self._odometer = None if odometry is None else Odometer(odometry, wheels)
        self._imu = None if imu is None else InertialUnit(imu, inertial)
        check_duration(cloud_sensors.sweep, self.drive)
        self.clouds = Clouds(world, cloud_sensors.seeded(self.rng), crowd)
        self.check_mounts(on_collision)
        self.attitude = attitude
        self._tilting = Tilting(attitude)
        # The pose by odometry at the last scan, and what the IMU measured before it.
        self.odometry = np.zeros(3)
        self.inertial = np.empty((0, 4))
        self.film = film
        self.done = 0
        self._seconds = 0.0

    @property
    def cloud_sensors(self) -> CloudSensors:
        """Its lidars and depth cameras."""
        return self.clouds.sensors

    @property
    def motion_shapes(self) -> dict[str, tuple[int, ...]]:
        """What a run keeps of the robot's motion at each scan, by the names of its attributes."""
        lidars = self.cloud_sensors.lidars
        kinds = {"wheels": (3,), "sweeps": (len(lidars), 3), "attitudes": (2,)}
        exist = self._odometer, lidars, self.attitude
        return {name: shape for (name, shape), has in zip(kinds.items(), exist, strict=True) if has}

    @property
    def lrf(self) -> LaserRangeFinder:
        """The first laser."""
        return self.lasers[0]

    @property
    def map(self) -> Any:
        """The map after all scans so far, of whatever kind; None if the mapper makes none."""
        return self._mapper.map

    @property
    def estimate(self) -> EstimatedTrajectory | None:
        """The trajectory that the mapper estimates, if it does."""
        return self._mapper.estimate

    def check_mounts(self, on_collision: object = None) -> None:
        """Check that the drive, or its start, brings no lidar or depth camera into a wall.

        Drives that may go through walls are not checked.
        """
        if callable(on_collision) or on_collision == "ignore":
            return
        if isinstance(self.drive, Trajectory):
            self.clouds.check(self.drive.times, self.drive.poses)
        else:
            self.clouds.check(np.zeros(1), np.array([self.drive.driven.pose]))

    def __iter__(self) -> Iterator[Step]:
        """The remaining steps."""
        drive = self.drive
        while (time := self.next_time) < math.inf:
            index = self.done
            if isinstance(drive, Trajectory):
                place = Pose(*drive.poses[index].tolist())
            else:
                place = drive.driven.pose
            pose = np.array(place)
            tilt = self._tilting.drive(time, pose)
            truth = tuple(sensor.cast(pose, time, tilt) for sensor in self.sensors)
            scans = tuple(
                sensor.noisy(scan, self.rng)
                for sensor, scan in zip(self.sensors, truth, strict=True)
            )
            sweeps = [
                motion_along(drive, pose, time, each.scan_duration)
                for each in self.cloud_sensors.lidars
            ]
            self.take(scans, pose)
            measured = self.odometry, self.inertial, sealed(np.array(sweeps).reshape(-1, 3)), tilt
            yield Step(index, time, place, scans, truth, self, *measured)

    def take(self, scans: Sequence[LaserScan], pose: Float) -> None:
        """Take the next measured scan of each laser, with the robot at (3,): map and drive on.

        Taking recorded scans brings a new simulation to the state of an interrupted one.
        """
        if self._odometer is not None:
            self.odometry = sealed(self._odometer.drive(pose))
            if self._mapper.drive is not None:
                self._mapper.drive(self._odometer.increment)
        self._tilting.drive(scans[0].time, pose)
        if self._imu is not None:
            self.inertial = sealed(self._imu.drive(scans[0].time, pose))
        begin = perf_counter()
        self._mapper.update(scans)
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
        return drive.driven.time if drive.goes_on else math.inf

    @property
    def total(self) -> int:
        """The largest number of scans, which must be known to keep them."""
        if self.scans is None:
            raise InputError("scans: not given, and a controller may drive for ever; give scans=")
        return self.scans

    @property
    def milliseconds_an_update(self) -> float | None:
        """Mean time of the mapper's updates after the first [ms]; None if there are none."""
        return 1000 * self._seconds / (self.done - 1) if self.done > 1 else None


def _equipped(
    lrf: LaserRangeFinder | Sequence[LaserRangeFinder] | None, noise: Noise | Sequence[Noise] | None
) -> tuple[tuple[LaserRangeFinder, ...], Sequence[Noise]]:
    """The lasers of a robot, and the noise of each."""
    lasers = lasers_of(LaserRangeFinder() if lrf is None else lrf)
    return lasers, noises_of(ProportionalNoise(0.0) if noise is None else noise, lasers)


def _ends(
    drive: Trajectory | Controller, scans: int | None, interval: float
) -> tuple[int | None, float | None]:
    """Number of scans of a drive, and its end [s]; None where it may go on for ever."""
    scans = None if scans is None else whole_number(scans, "scans")
    if isinstance(drive, Trajectory):
        return min(scans or len(drive), len(drive)), float(drive.times[-1])
    return scans, None if scans is None else scans * interval


def _surroundings(
    obstacles: Sequence[DynamicObstacle] | Crowd, end: float | None
) -> tuple[tuple[DynamicObstacle, ...], Crowd]:
    """The obstacles as a run stores them, with poses up to its end [s], and their crowd.

    An endless drive is not stored.
    """
    if isinstance(obstacles, Crowd):
        return (), obstacles
    known = tuple(each_of(obstacles, DynamicObstacle, "obstacle"))
    known = known if end is None else tuple(each.until(end) for each in known)
    return known, Crowd(known)


def _body(radius: float | None, outline: ArrayLike | None) -> tuple[Body, bool]:
    """The body of a robot, and whether it is solid: without a radius or an outline it is not."""
    solid = radius is not None or outline is not None
    return Body(RADIUS if radius is None else radius, outline), solid


def motion_streams(
    rng: np.random.Generator, odometry: WheelOdometry | None, imu: Imu | None
) -> Sequence[np.random.Generator]:
    """Random streams of the wheels and of the IMU, so that scans depend on neither."""
    return rng.spawn(2) if odometry or imu else (rng, rng)


def line_mapper(noise: object, **settings: Any) -> LineMapper:
    """The default mapper: a LineMapper set up for the spread of a noise, or by settings."""
    constant, sigma = spread_of(noise) or (0.0, SIGMA)
    usual = {"sigma": sigma}
    if constant:
        usual["floor"] = float(np.hypot(FLOOR, constant))
    return LineMapper(**{**usual, **settings})
