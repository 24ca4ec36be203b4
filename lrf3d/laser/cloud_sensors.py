"""CloudSensors: the lidars and depth cameras of a robot, as a run stores them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, check_names, each_of
from lrf3d.geometry.lines import Value
from lrf3d.laser.depth_camera import DepthCamera
from lrf3d.laser.imperfections import AngleNoise, DropOuts, MixedPixels
from lrf3d.laser.lidar import Lidar
from lrf3d.laser.noise import (
    Chain,
    ConstantNoise,
    Limits,
    Noise,
    ProportionalNoise,
    Quantised,
    as_noise,
)

# Noises that files hold, by their names.
_WRITTEN = {
    kind.__name__: kind
    for kind in (
        AngleNoise, ConstantNoise, DropOuts, Limits, MixedPixels, ProportionalNoise, Quantised
    )
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class CloudSensors(Value):
    """The lidars and depth cameras of a robot, with the noise of all and its seed."""

    lidars: tuple[Lidar, ...] = ()
    depth_cameras: tuple[DepthCamera, ...] = ()
    noise: Noise = ProportionalNoise(0.0)  # noqa: RUF009  It is a value that nothing changes.
    seed: int = 0

    def __post_init__(self) -> None:
        names = [each.name for each in self]
        if twice := [name for name in names if names.count(name) > 1]:
            raise InputError(f"sensors: two of the name {twice[0]!r}; give each its own name=")

    def __iter__(self) -> Any:
        return iter((*self.lidars, *self.depth_cameras))

    @classmethod
    def of(cls, lidars: Any, depth_cameras: Any, noise: Noise) -> "CloudSensors":
        """Sensors from arguments of users: one or several of each kind."""
        one = [lidars] if isinstance(lidars, Lidar) else lidars
        other = [depth_cameras] if isinstance(depth_cameras, DepthCamera) else depth_cameras
        return cls(
            tuple(each_of(one, Lidar, "lidar")),
            tuple(each_of(other, DepthCamera, "depth camera")),
            as_noise(noise),
        )

    def seeded(self, rng: np.random.Generator) -> "CloudSensors":
        """The sensors, if there are any, with a seed for their noise."""
        return replace(self, seed=int(rng.spawn(1)[0].integers(1 << 62))) if [*self] else self

    @property
    def sweep(self) -> float:
        """The duration of the longest scan [s]."""
        return max((each.scan_duration for each in self.lidars), default=0.0)

    def as_dict(self) -> dict[str, Any]:
        """The sensors as plain values, for a file."""
        parts = Chain([self.noise]).noises
        for each in parts:
            if type(each) not in _WRITTEN.values():
                raise InputError(f"noise {each!r} of a lidar: a file cannot hold a noise of yours")
        return {
            "lidars": [
                {**asdict(each), "elevations": each.elevations.tolist()} for each in self.lidars
            ],
            "depth_cameras": [asdict(each) for each in self.depth_cameras],
            "noise": [[type(each).__name__, asdict(each)] for each in parts],  # type: ignore[call-overload]
            "seed": self.seed,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "CloudSensors":
        """The sensors from the plain values of a file."""
        check_names("noise", [name for name, _ in values["noise"]], _WRITTEN)
        return cls(
            tuple(Lidar(**each) for each in values["lidars"]),
            tuple(DepthCamera(**each) for each in values["depth_cameras"]),
            Chain([_WRITTEN[name](**fields) for name, fields in values["noise"]]),
            int(values["seed"]),
        )


# No lidars and no depth cameras.
NO_SENSORS = CloudSensors()
