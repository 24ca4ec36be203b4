"""A robot that obeys commands as they come, in simulated time.

A scenario and commands enter; true poses, odometry and scans leave. The page and the live topics of
ROS drive it; a simulation, which knows its whole drive, does not need it.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.casting.collision import Body, CollisionChecker, robots_among
from lrf3d.casting.crowd import Crowd, move_of
from lrf3d.geometry.lines import Float, generator
from lrf3d.geometry.pose import Pose, between, compose
from lrf3d.laser import DepthImage, LaserScan, LidarScan
from lrf3d.laser.cloud_sensors import CloudSensors
from lrf3d.robot import Trajectory
from lrf3d.robot.attitude import Tilting
from lrf3d.robot.kinematics import able
from lrf3d.robot.odometry import InertialUnit, OdometryBelief, WheelOdometry
from lrf3d.simulation.clouds import Clouds, RobotState
from lrf3d.simulation.driven import STILL, Driven
from lrf3d.simulation.fleet import places_along
from lrf3d.simulation.loop import motion_streams
from lrf3d.simulation.scenario import Scenario
from lrf3d.simulation.sensor import Caster, Sensor, caster_of


class LiveRobot(Driven):
    """A driven body with lasers, wheels and an IMU, from where a scenario starts.

    Without errors of the wheels the odometry is exact.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        rng: np.random.Generator | int | None = 0,
        wheels: WheelOdometry | None = None,
        crowd: Crowd | None = None,
        caster: Caster | str = "embree",
    ) -> None:
        self._crowd = Crowd(scenario.obstacles) if crowd is None else crowd
        self.wheels = wheels
        # How it moves.
        self.moves = scenario.robot
        self._imu = scenario.imu
        self._rng = generator(rng)
        self._streams = motion_streams(self._rng, wheels, scenario.imu)
        body = Body(scenario.radius, scenario.outline)
        self.start = scenario.beginning
        self.odometry = self.start
        # The uncertainty of the odometry since the start; None if it is exact.
        self.belief = None if wheels is None else OdometryBelief(wheels)
        # The exact odometry after the robot was carried: the pose of the world in its odometry
        # frame.
        self._carried_by: Pose | None = None
        super().__init__(self.start, 0.0, body, CollisionChecker(scenario.world, self._crowd))
        # Nobody knows where it will drive while a beam turns, so a scan takes no time.
        lasers = [(scenario.lrf, scenario.noise), *scenario.further]
        caster = caster_of(caster, scenario.world)
        self._sensors = [
            Sensor(
                scenario.world,
                replace(lrf, scan_duration=0.0),
                caster=caster,
                noise=noise,
                obstacles=self._crowd,
            )
            for lrf, noise in lasers
        ]
        still = [replace(lidar, scan_duration=0.0) for lidar in scenario.lidars]
        sensors = CloudSensors.of(still, scenario.depth_cameras, scenario.noise)
        self._clouds = Clouds(scenario.world, sensors.seeded(self._rng), self._crowd)
        self._attitude = scenario.attitude
        self._restart_motion()

    def clouds(self) -> tuple[Iterator[LidarScan], Iterator[DepthImage]]:
        """Measure with each lidar and each depth camera from the robot's current pose."""
        return self._clouds.at(RobotState(np.array(self.pose), self.time, self.tilt))

    @property
    def speed(self) -> float:
        """Speed ahead [m/s]."""
        return self.twist[0]

    @property
    def turning(self) -> float:
        """Turn rate [rad/s]."""
        return self.twist[2]

    @property
    def bumped(self) -> bool:
        """Whether it touched something while it held the last command."""
        return self.collision is not None

    def restart(self) -> None:
        """Put the robot back at the start, whatever stands there; time goes on."""
        self._put(self.start)

    def carry(self, pose: Pose) -> None:
        """Put the robot elsewhere, at rest; its odometry does not measure this, and does not jump.

        Raises:
            InputError: The robot would stand in a wall or an obstacle.
        """
        if self.touched(pose, STILL, 0.0) is not None:
            raise InputError(f"({pose.x:g}, {pose.y:g}): the robot would stand in a wall")
        self._put(pose)

    def _put(self, pose: Pose) -> None:
        self._carried_by = self.odometry @ pose.inverse()
        self.place(pose)
        self._restart_motion()

    def _restart_motion(self) -> None:
        self._tilting = Tilting(self._attitude)
        self._tilt()
        self._carried = None if self._imu is None else InertialUnit(self._imu, self._streams[1])

    def _tilt(self) -> None:
        """Set the robot's pitch and roll [rad] by its motion up to now."""
        self.tilt = self._tilting.drive(self.time, np.array(self.pose))

    def drive(self, seconds: float, speed: float, turning: float, sideways: float = 0.0) -> None:
        """Drive an exact arc for a time, and rest where the body touches something."""
        last = self.pose
        self.hold(able(self.moves, (speed, sideways, turning)), seconds)
        self._tilt()
        if self.wheels is None or self.belief is None:
            moved = self._carried_by
            self.odometry = self.pose if moved is None else moved @ self.pose
        elif self.pose != last:
            increment = between(np.array(last), np.array(self.pose))
            measured = self.wheels(increment, self._streams[0])
            before = np.array(self.odometry)
            self.belief.drive(before, measured)
            self.odometry = Pose(*compose(before, measured).tolist())

    def scans(self) -> tuple[LaserScan, ...]:
        """Measure with each laser from the robot's current pose."""
        return tuple(
            sensor.noisy(sensor.cast(np.array(self.pose), self.time, self.tilt), self._rng)
            for sensor in self._sensors
        )

    def show(self, speed: float, turning: float, sideways: float = 0.0) -> None:
        """Show the other robots of a fleet where this one is, and how it drives from now on."""
        if self._crowd.own >= 0:
            twist = able(self.moves, (speed, sideways, turning))
            self._crowd.hold(move_of(self.time, self.pose, twist), self._crowd.own)

    def imu(self) -> Float:
        """What the IMU measured since the last call: rows (m, 4), see `InertialUnit`."""
        if self._carried is None:
            return np.empty((0, 4))
        return self._carried.drive(self.time, np.array(self.pose))


def live_fleet(
    scenario: Scenario, count: int, *, rng: int = 0, wheels: WheelOdometry | None = None
) -> list[LiveRobot]:
    """Robots that see and touch each other, spread along the route of a scenario.

    Raises:
        InputError: The route is too short for them.
    """
    if count == 1:
        return [LiveRobot(scenario, rng=rng, wheels=wheels)]
    path = scenario.with_route().trajectory()
    body = Body(scenario.radius, scenario.outline)
    starts = [Pose(*pose) for pose in path.poses[places_along(path, count, body)].tolist()]
    _, crowd = robots_among(
        body, [Trajectory([0.0], [start]) for start in starts], scenario.obstacles
    )
    caster = caster_of("embree", scenario.world)
    return [
        LiveRobot(
            replace(scenario, start=start),
            rng=own,
            wheels=wheels,
            crowd=crowd.without(k),
            caster=caster,
        )
        for k, (start, own) in enumerate(zip(starts, generator(rng).spawn(count), strict=True))
    ]
