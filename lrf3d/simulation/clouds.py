"""Clouds: the scans of a robot's lidars and the images of its depth cameras, cast on request.

A run does not store clouds, which would take gigabytes, but what is needed to cast them again, bit
for bit: the sensors, their noise, a seed, and the motion of the robot during each scan.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.casting import PlanarCaster
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.skyline import Conditions, in_walls
from lrf3d.geometry.lines import Float, sealed
from lrf3d.geometry.pose import as_pose, compose
from lrf3d.laser import (
    Chain,
    DepthImage,
    LaserRangeFinder,
    LaserScan,
    Lidar,
    LidarScan,
    Noise,
)
from lrf3d.laser.cloud_sensors import CloudSensors
from lrf3d.laser.lidar import tilted
from lrf3d.laser.range_finder import CENTRE
from lrf3d.laser.scan import ScanBatch
from lrf3d.robot.attitude import LEVEL
from lrf3d.world import World


class RobotState(NamedTuple):
    """A robot at a pose (3,) and a time [s], with its pitch and roll [rad].

    It moves by sweeps (lidars, 3) during the scans of its lidars, or stands.
    """

    pose: Float
    time: float
    attitude: tuple[float, float] = LEVEL
    sweeps: Float | None = None


class Clouds:
    """Casts the lidars and depth cameras of a robot among walls and dynamic obstacles."""

    def __init__(
        self, world: World, sensors: CloudSensors, obstacles: Sequence[DynamicObstacle] | Crowd
    ) -> None:
        self.sensors = sensors
        self._world = world
        self._crowd = obstacles if isinstance(obstacles, Crowd) else Crowd(obstacles)

    @cached_property
    def _caster(self) -> PlanarCaster:
        # Most robots have no lidar and no depth camera.
        return PlanarCaster(self._world)

    def check(self, times: Float, poses: Float) -> None:
        """Check that no sensor is in a wall with the robot at poses (n, 3) at times (n,) [s]."""
        for sensor in self.sensors:
            places = compose(poses, np.array(sensor.planar.mount))[:, :2]
            inside = in_walls(self._world, poses[:, :2], places, sensor.mount[2])
            for k in np.flatnonzero(inside)[:1]:
                x, y = places[k]
                raise InputError(
                    f"{sensor.name}: at {times[k]:g} s it is in or behind a wall, at ({x:.2f},"
                    f" {y:.2f}), {sensor.mount[2]:g} m high; give another mount or drive"
                )

    def at(self, state: RobotState) -> tuple[Iterator[LidarScan], Iterator[DepthImage]]:
        """The scans of all lidars and the images of all depth cameras, cast one by one."""
        numbers = range(len([*self.sensors]))
        lidars = len(self.sensors.lidars)
        return (
            (self.measure(k, state) for k in numbers[:lidars]),
            (self.measure(k, state) for k in numbers[lidars:]),
        )

    def measure(self, number: int, state: RobotState, *, noisy: bool = True) -> Any:
        """The scan or the image of a sensor, by its number: lidars first, then depth cameras."""
        sensor = carried([*self.sensors][number], state)
        fan = sensor.planar
        motion = None
        if isinstance(sensor, Lidar):
            name = "ranges"
            cast: Any = self._caster.cast_lidar
            place = fan.placed(state.pose)
            if state.sweeps is not None and np.any(state.sweeps[number]):
                motion = state.sweeps[number]
        else:
            name = "depth"
            cast = self._caster.cast_depth
            place = as_pose(compose(np.asarray(state.pose), np.array(fan.mount)))
        true: Any = cast(sensor, place, Conditions(state.time, motion, self._crowd))
        if not noisy:
            return true
        # The time seeds the noise.
        moment = int(np.float64(state.time).view(np.uint64))
        rng = np.random.default_rng([self.sensors.seed, number, moment])
        found = measured(self.sensors.noise, fan, getattr(true, name), true.walls, rng)
        walls = np.where(np.isfinite(found), true.walls, np.int32(-1))
        return replace(true, walls=sealed(walls), **{name: sealed(found)})


def carried(sensor: Any, state: RobotState) -> Any:
    """A sensor as it is on its robot, with the tilt of the robot in its mount."""
    if not any(state.attitude):
        return sensor
    return replace(sensor, mount=tilted(sensor.mount, state.attitude))


def measured(
    noise: Noise, fan: LaserRangeFinder, ranges: Float, walls: Any, rng: np.random.Generator
) -> Float:
    """Measured ranges (…, beams) from true ones and the walls that they hit."""
    # Noises of users are checked once, where a chain is made.
    chain = noise if isinstance(noise, Chain) else Chain([noise])
    if chain.batched:
        batch = ScanBatch(fan.angles, ranges, walls, fan.range_min, fan.range_max)
        found = chain(batch, rng).ranges
    else:
        rows = zip(ranges.reshape(-1, fan.beams), walls.reshape(-1, fan.beams), strict=True)
        scans = [LaserScan.unchecked(fan, CENTRE, *row) for row in rows]
        found = np.array([chain(scan, rng).ranges for scan in scans]).reshape(ranges.shape)
    return np.where(found < fan.range_min, -np.inf, found)
