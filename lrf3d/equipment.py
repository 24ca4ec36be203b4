"""What a robot carries: the lasers, the wheels and the IMU of a world file.

The tables of a file enter, overridden by settings; range finders with their noise, and the errors
of the motion sensors leave.
"""

import math
from collections.abc import Mapping
from typing import Any

from lrf3d.laser import LaserRangeFinder, Noise, imperfect
from lrf3d.laser.noise import SIGMA
from lrf3d.laser.range_finder import lasers_of
from lrf3d.robot.odometry import Imu, WheelOdometry
from lrf3d.world.toml_file import WorldFile


def motion_sensors(file: WorldFile, tables: Mapping[str, Any]) -> dict[str, Any]:
    """The wheels and the IMU, where the file or the settings have a table for them."""
    found = dict[str, Any]()
    for name, kind in (("odometry", WheelOdometry), ("imu", Imu)):
        if name in file.tables or tables[name]:
            with file.at(name):
                found[name] = kind(**tables[name])
    return found


def lasers_with_noise(
    file: WorldFile, settings: Mapping[str, Any], noise: Mapping[str, Any]
) -> list[tuple[LaserRangeFinder, Noise]]:
    """The lasers of a file, each with its own noise or the file's; settings hold for all."""
    found = []
    for number, table in enumerate(file.lasers or [{}]):
        with file.at(f"laser[{number}]" if len(file.lasers) > 1 else "laser"):
            given: dict[str, Any] = {**table, **settings}
            errors = {**noise, **given.pop("noise", {})}
            sigma = errors.pop("sigma", SIGMA)
            for key in [key for key in given if key.endswith("_deg")]:
                given[key.removesuffix("_deg")] = math.radians(given.pop(key))
            lrf = LaserRangeFinder(**given)
            sigma = sigma[0] if isinstance(sigma, tuple) else sigma
            found.append((lrf, imperfect(sigma, lrf, **errors)))
    with file.at("laser"):
        lasers_of([lrf for lrf, _ in found])
    return found
