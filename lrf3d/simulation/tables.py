"""What a robot carries: the lasers, the wheels and the IMU of a world file.

The tables of a file enter, overridden by settings; range finders with their noise, and the errors
of the motion sensors leave.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from lrf3d.geometry.lines import number
from lrf3d.laser import LaserRangeFinder, Noise, imperfect
from lrf3d.laser.imperfections import NOISES
from lrf3d.laser.noise import SIGMA
from lrf3d.laser.range_finder import lasers_of
from lrf3d.mapping.mapper import LineMapper
from lrf3d.robot.odometry import Imu, WheelOdometry
from lrf3d.world.cameras import FilmPlan
from lrf3d.world.schema import Converter, keys_of, several
from lrf3d.world.toml_file import WorldFile


def laser_with_noise(
    noise: Mapping[str, Any] | None = None, **laser: Any
) -> tuple[LaserRangeFinder, Noise]:
    """The laser of a table, and its noise."""
    errors = dict(noise or {})
    for key in [key for key in laser if key.endswith("_deg")]:
        laser[key.removesuffix("_deg")] = math.radians(laser.pop(key))
    lrf = LaserRangeFinder(**laser)
    sigma = errors.pop("sigma", SIGMA)
    return lrf, imperfect(sigma[0] if isinstance(sigma, tuple) else sigma, lrf, **errors)


def settings(table: str) -> tuple[Mapping[str, Converter], Callable[..., Any]]:
    """The keys of a table of settings, and what checks the values that a file has for them."""
    if table == "noise":
        keys: dict[str, Converter] = dict.fromkeys((key for kind in NOISES for key in kind), number)
        # Of several standard deviations the maps are compared.
        keys["sigma"] = several(number, "sigmas", alone=True)
        return keys, lambda **values: laser_with_noise(values)
    if table == "laser":
        return keys_of(LaserRangeFinder), laser_with_noise
    kinds = {"odometry": WheelOdometry, "imu": Imu, "mapper": LineMapper, "film": FilmPlan}
    keys = keys_of(kinds[table])
    if table == "mapper":
        # It is that of the noise.
        del keys["sigma"]
    return keys, kinds[table]


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
    for place, table in enumerate(file.lasers or [{}]):
        key = f"laser[{place}]" if len(file.lasers) > 1 else "laser"
        with file.at(f"{key} with settings" if settings else key):
            own = {**noise, **table.get("noise", {})}
            found.append(laser_with_noise(**{**table, **settings, "noise": own}))
    with file.at("laser"):
        lasers_of([lrf for lrf, _ in found])
    return found
