"""Clouds: the scans of a robot's lidars and the images of its depth cameras, cast on request.

A run does not store clouds, which would take gigabytes, but what is needed to cast them again, bit
for bit: the sensors, their noise, a seed, and the motion of the robot during each scan.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.casting.crowd import Crowd, moves_of
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.kernels.movers import poses_along
from lrf3d.casting.skyline import Conditions
from lrf3d.geometry.lines import Float, sealed
from lrf3d.geometry.pose import as_pose, between, compose
from lrf3d.laser import (
    Chain,
    DepthCamera,
    DepthImage,
    LaserRangeFinder,
    LaserScan,
    Lidar,
    LidarScan,
    Noise,
)
from lrf3d.laser.cloud_sensors import CloudSensors
from lrf3d.laser.scan import ScanBatch
from lrf3d.robot import Trajectory
from lrf3d.world import World


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

    def at(
        self, pose: Float, time: float, sweeps: Float | None = None
    ) -> tuple[Iterator[LidarScan], Iterator[DepthImage]]:
        """The scans of all lidars and the images of all depth cameras, cast one by one.

        The robot is at a pose (3,) and moves by sweeps (lidars, 3) during the scans, or stands.
        """
        motions = [None] * len(self.sensors.lidars) if sweeps is None else sweeps
        return (
            (self.lidar(k, pose, time, motion) for k, motion in enumerate(motions)),
            (self.depth(k, pose, time) for k in range(len(self.sensors.depth_cameras))),
        )

    def lidar(
        self, number: int, pose: Float, time: float, motion: Float | None, *, noisy: bool = True
    ) -> LidarScan:
        """The scan of a lidar on a robot at a pose (3,), which moves during the scan."""
        lidar = self.sensors.lidars[number]
        place = lidar.planar.placed(pose)
        moves = None if motion is None or not np.any(motion) else motion
        scan = self._caster.cast_lidar(lidar, place, Conditions(time, moves, self._crowd))
        if not noisy:
            return scan
        ranges, walls = self._measured(scan.ranges, scan.walls, lidar.planar, number, time)
        return replace(scan, ranges=ranges, walls=walls)

    def depth(self, number: int, pose: Float, time: float, *, noisy: bool = True) -> DepthImage:
        """The image of a depth camera on a robot at a pose (3,)."""
        camera = self.sensors.depth_cameras[number]
        mount = np.array([*camera.mount[:2], camera.mount[3]])
        place = as_pose(compose(np.asarray(pose), mount))
        image = self._caster.cast_depth(camera, place, Conditions(time, None, self._crowd))
        if not noisy:
            return image
        stream = len(self.sensors.lidars) + number
        depth, walls = self._measured(image.depth, image.walls, fan_of(camera), stream, time)
        return replace(image, depth=depth, walls=walls)

    def _measured(
        self, ranges: Float, walls: Any, fan: LaserRangeFinder, stream: int, time: float
    ) -> tuple[Float, Any]:
        """Measured ranges (layers, beams) from true ones, and walls; the time seeds the noise."""
        moment = int(np.float64(time).view(np.uint64))
        rng = np.random.default_rng([self.sensors.seed, stream, moment])
        found = measured(self.sensors.noise, fan, ranges, walls, rng)
        return sealed(found), sealed(np.where(np.isfinite(found), walls, np.int32(-1)))


def fan_of(sensor: Lidar | DepthCamera) -> LaserRangeFinder:
    """The range finder of a row of beams, for noises."""
    if isinstance(sensor, Lidar):
        return sensor.planar
    half = 0.5 * sensor.fov
    return LaserRangeFinder(-half, half, sensor.width, sensor.range_min, sensor.range_max)


def measured(
    noise: Noise, fan: LaserRangeFinder, ranges: Float, walls: Any, rng: np.random.Generator
) -> Float:
    """Measured ranges (…, beams) from true ones and the walls that they hit."""
    # Noises of users are checked once, where a chain is made.
    chain = noise if isinstance(noise, Chain) else Chain([noise])
    near, far = fan.range_min, fan.range_max
    if chain.batched:
        found = chain(ScanBatch(fan.angles, ranges, walls, near, far), rng).ranges
    else:
        rows = zip(ranges.reshape(-1, fan.beams), walls.reshape(-1, fan.beams), strict=True)
        scans = [
            LaserScan((0.0, 0.0, 0.0), fan.angles, *row, range_min=near, range_max=far)
            for row in rows
        ]
        found = np.array([chain(scan, rng).ranges for scan in scans]).reshape(ranges.shape)
    return np.where((found < near) & (found > -np.inf), -np.inf, found)


def sweeps_of(lidars: Iterable[Lidar], path: Any, pose: Float, time: float) -> Float:
    """The robot's motion (lidars, 3) during each lidar's scan, along a path from a pose (3,)."""
    found = []
    for each in lidars:
        times = np.array([time, time + each.scan_duration])
        if not each.scan_duration:
            poses = np.zeros((2, 3))
        elif isinstance(path, Trajectory):
            poses = poses_along(moves_of(path.times, path.poses), times, np.array(as_pose(pose)))
        else:
            poses = path.at(times)
        found.append(between(poses[0], poses[1]))
    return sealed(np.array(found).reshape(-1, 3))
