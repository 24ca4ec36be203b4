"""What the lidars and depth cameras of robots see, as observations of environments."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lrf3d.casting import PlanarCaster
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.kernels.fleets import CHOICES, scatter_ranges
from lrf3d.casting.skyline import Conditions
from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import as_pose, compose
from lrf3d.laser import Chain, ConstantNoise, DepthCamera, Lidar, Noise, ProportionalNoise
from lrf3d.simulation.clouds import measured
from lrf3d.simulation.scenario import Scenario


class CloudObserver:
    """The lidars and depth cameras of robots in one world.

    An observation is ``lidar`` (layers, columns) [m] or ``depth`` (height, width) [m]; of several
    lidars or cameras it is ``lidar_NAME`` or ``depth_NAME``. No return is range_max, too near is 0.
    """

    def __init__(
        self, scenario: Scenario, caster: PlanarCaster, noise: Noise, crowd: Crowd
    ) -> None:
        self._caster = caster
        self._noise = chain = Chain([noise])
        # The constant and the growing part of noises that only scatter ranges.
        plain = all(isinstance(each, ConstantNoise | ProportionalNoise) for each in chain.noises)
        self._spread = chain.spread if plain else None
        self._crowd = crowd
        self._sensors: dict[str, Lidar | DepthCamera] = {}
        for kind, sensors in (("lidar", scenario.lidars), ("depth", scenario.depth_cameras)):
            for each in sensors:
                self._sensors[kind if len(sensors) == 1 else f"{kind}_{each.name}"] = each

    @property
    def spaces(self) -> dict[str, spaces.Box]:
        """The space of each observation."""
        return {
            name: spaces.Box(0.0, np.float32(each.range_max), _shape(each), np.float32)
            for name, each in self._sensors.items()
        }

    def observe(
        self, poses: Float, times: Float, own: Int, rng: np.random.Generator
    ) -> dict[str, NDArray[np.float32]]:
        """The observations of robots at poses (k, 3) and times (k,), with their numbers (k,)."""
        found = {}
        # The noise of range finders is the same with lidars and without them.
        own_rng = rng.spawn(1)[0]
        for name, sensor in self._sensors.items():
            seen = np.empty((len(poses), *_shape(sensor)), np.float32)
            key = np.uint64(own_rng.integers(1 << 63))
            far = sensor.range_max
            for numbers, ranges in self._cast(sensor, poses, times, own):
                if self._spread is not None:
                    floor, growth = self._spread
                    limits = sensor.range_min, far, floor, growth / far
                    rows = ranges.transpose(0, 2, 1).reshape(len(ranges), -1)
                    scatter_ranges(rows, numbers, limits, key, self._quantiles, seen)
                    continue
                walls = np.zeros(ranges.shape, np.int32)
                noisy = measured(self._noise, sensor.planar, ranges, walls, own_rng)
                seen[numbers] = noisy.clip(0.0, far, out=noisy)
            found[name] = seen
        return found

    @cached_property
    def _quantiles(self) -> NDArray[np.float32]:
        """The quantiles of the normal distribution in the middle of 65,536 equal shares."""
        from scipy.special import ndtri

        count = int(CHOICES) + 1
        return np.asarray(ndtri((np.arange(count) + 0.5) / count), np.float32)

    def _cast(
        self, sensor: Lidar | DepthCamera, poses: Float, times: Float, own: Int
    ) -> Iterator[tuple[Int, Float]]:
        """True ranges of some of the robots at a time, with their numbers."""
        places = compose(poses, np.array(sensor.planar.mount))
        if isinstance(sensor, Lidar) and not len(self._crowd):
            yield from self._caster.lidar_batches(sensor, places)
            return
        for number, (place, time) in enumerate(zip(places, times.tolist(), strict=True)):
            moment = Conditions(time, None, self._crowd.without(int(own[number])))
            pose = as_pose(place)
            if isinstance(sensor, Lidar):
                ranges = self._caster.cast_lidar(sensor, pose, moment).ranges
            else:
                ranges = self._caster.cast_depth(sensor, pose, moment).depth
            yield np.array([number]), ranges[None]


def _shape(sensor: Lidar | DepthCamera) -> tuple[int, int]:
    return len(sensor.slopes), sensor.planar.beams
