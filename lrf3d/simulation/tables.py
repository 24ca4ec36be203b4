"""The tables of a world file: the robot, its lasers, wheels and IMU, the mapper and the film.

Each table has the keys of what it describes, and is checked by making that. The tables of a file
enter, overridden by settings; range finders with their noise, and the errors of the motion sensors
leave.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning, check_names, each_of, shown
from lrf3d.geometry.lines import Radians, is_finite, number, whole_number
from lrf3d.laser import DepthCamera, LaserRangeFinder, Lidar, Noise, imperfect
from lrf3d.laser.imperfections import NOISES
from lrf3d.laser.lidar import mounted
from lrf3d.laser.noise import SIGMA
from lrf3d.laser.range_finder import lasers_of
from lrf3d.mapping.mapper import LineMapper
from lrf3d.robot import AckermannDrive, Attitude, DifferentialDrive, OmniDrive, Unicycle
from lrf3d.robot.odometry import Imu, WheelOdometry
from lrf3d.world import schema
from lrf3d.world.cameras import FilmPlan
from lrf3d.world.model import World
from lrf3d.world.schema import Converter, at, poses, row, rows, several
from lrf3d.world.toml_file import WorldFile, read_world_file


def in_radians(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a table with its angles, which are in degrees, in radians."""
    return {
        key.removesuffix("_deg"): math.radians(each) if key.endswith("_deg") else each
        for key, each in values.items()
    }


def laser_of(noise: Any = None, **laser: Any) -> LaserRangeFinder:
    """The laser of a table, without its noise."""
    lrf = LaserRangeFinder(**in_radians(laser))
    width = 2.0 * math.degrees(lrf.spread[1])
    # [°] Bounds on the field of view of range finders; radians, read as degrees, lie below them.
    narrowest = 10.0
    widest = 361.0
    if width and not narrowest <= width <= widest:
        text = f"laser: its angles, read as degrees, are a field of {width:.4g}°"
        warnings.warn(f"{text}; expected 10° to 360°", Lrf3dWarning, 1)
    return lrf


def noise_of(lrf: LaserRangeFinder, **errors: Any) -> Noise:
    """The noise of a table, and of a laser."""
    sigma = errors.pop("sigma", SIGMA)
    return imperfect(sigma[0] if isinstance(sigma, tuple) else sigma, lrf, **errors)


# The drives that a robot may have.
DRIVES = ("unicycle", "differential", "ackermann", "omni")


def robot_of(
    kind: Annotated[str, DRIVES] = "unicycle",
    track: float = 0.5,
    wheel_radius: float = 1.0,
    wheelbase: float = 1.0,
    steering: Radians = math.pi / 4,
) -> Any:
    """How the robot of a table moves."""
    if kind == "differential":
        return DifferentialDrive(track, wheel_radius)
    if kind == "ackermann":
        return AckermannDrive(wheelbase, steering)
    return OmniDrive() if kind == "omni" else Unicycle()


def drive_of(**values: Any) -> dict[str, Any]:
    """What a table says of the drive: how the robot moves, and how it is tilted."""
    tilt = {key: values.pop(key) for key in TILT if key in values}
    found = {"robot": robot_of(**values)} if values else {}
    return {**found, "attitude": Attitude(**tilt)} if tilt else found


# What tilts a robot, and the rows [m, °, °] of a profile.
TILT = [each.name for each in fields(Attitude)]
tilts = rows("distance", "pitch", "roll")

# The keys of the table of the drive.
DRIVE: Mapping[str, Converter] = {
    **schema.keys_of(robot_of),
    **dict.fromkeys((f"{name}_deg" for name in TILT[:-1]), schema.in_degrees),
    "profile": lambda found, key: tilts(found, key) * [1.0, *np.radians([1.0, 1.0])],
}

# The keys of the table of the robot.
ROBOT: Mapping[str, Converter] = {
    "start": poses(row("x", "y", "degrees")),
    "route": rows("x", "y"),
    "poses": poses(rows("x", "y", "degrees")),
    "outline": rows("x", "y", least=3),
    "goals": rows("x", "y"),
    "keep_out": several(rows("x", "y", least=3), "areas, each a list of [x, y]"),
    **dict.fromkeys(("speed", "scan_interval", "lookahead", "radius"), schema.LENGTH),
}

# What checks the values of each table, in the order in which tables are checked.
TABLES: Mapping[str, Callable[..., object]] = {
    "robot": dict,
    "drive": lambda **values: drive_of(**in_radians(values)),
    "laser": lambda noise=None, **values: noise_of(laser_of(**values), **(noise or {})),
    "noise": lambda **values: noise_of(LaserRangeFinder(), **values),
    "odometry": WheelOdometry,
    "imu": Imu,
    "mapper": LineMapper,
    "film": FilmPlan,
}


def mount_of(found: Any, key: str) -> tuple[float, ...]:
    """A mount x, y, z [m], and perhaps yaw, pitch, roll [°]."""
    given = found if isinstance(found, list) else []
    turns = [math.radians(each) if is_finite(each) else each for each in given[3:]]
    return mounted([*given[:3], *turns] or found, key)


def lidar_of(preset: str = "", **values: Any) -> Lidar:
    """The lidar of a table: a preset, or layers at elevations, with other keys that change it."""
    if steep := values.pop("elevations_deg", None):
        values["elevations"] = np.radians(steep)
    if preset and "elevations" not in values:
        return Lidar.preset(preset, **values)
    if preset or "elevations" not in values:
        raise InputError("expected a preset or elevations_deg")
    return Lidar(**values)


# The keys of the table of a lidar.
LIDAR: Mapping[str, Converter] = {
    "preset": schema.text(),
    "elevations_deg": several(partial(number, least=-90, most=90), "elevations"),
    "columns": partial(whole_number, least=1),
    **dict.fromkeys(("range_min", "range_max", "scan_duration"), partial(number, least=0.0)),
    "mount": mount_of,
    "name": schema.text(),
}

# The keys of the table of a depth camera.
DEPTH_CAMERA: Mapping[str, Converter] = {
    **{key: LIDAR[key] for key in ("range_min", "range_max", "mount", "name")},
    **dict.fromkeys(("width", "height"), LIDAR["columns"]),
    "fov_deg": partial(number, positive=True, most=179),
}


def depth_camera_of(**values: Any) -> DepthCamera:
    """The depth camera of a table."""
    if missing := [key for key in ("width", "height", "fov_deg") if key not in values]:
        raise InputError(f"expected a {missing[0]}")
    return DepthCamera(**in_radians(values))


# What makes the sensors of tables of which a file may have several, beside lasers.
SENSORS: Mapping[str, Callable[..., Any]] = {"lidar": lidar_of, "depth_camera": depth_camera_of}

# The keys of tables that are not those of what is made of them.
KEYS = {"robot": ROBOT, "drive": DRIVE, "lidar": LIDAR, "depth_camera": DEPTH_CAMERA}


def keys_of_table(name: str) -> Mapping[str, Converter]:
    """The keys of a table; those of the noise are those of all kinds that are entered."""
    if name in KEYS:
        return KEYS[name]
    if name == "laser":
        return schema.keys_of(LaserRangeFinder)
    if name == "noise":
        keys: dict[str, Converter] = dict.fromkeys((key for kind in NOISES for key in kind), number)
        # Of several standard deviations the maps are compared.
        return {**keys, "sigma": several(number, "sigmas", alone=True)}
    keys = schema.keys_of(TABLES[name])
    if name == "mapper":
        # It is that of the noise.
        del keys["sigma"]
    return keys


def checked(name: str) -> Converter:
    """A table of settings, checked by making what it describes; the values stay as they are."""
    # A laser of several may have a noise of its own.
    own = {"noise": schema.table(keys_of_table("noise"))} if name == "laser" else {}
    convert = schema.table({**keys_of_table(name), **own})
    make = {**TABLES, **SENSORS}[name]

    def check(found: Any, key: str) -> Any:
        values = convert(found, key)
        with at(key):
            make(**values)
        return values

    return check


def read_file(path: Path) -> WorldFile:
    """Read a world file with all its tables."""
    several = {n: schema.tables(checked(n), alone=True) for n in ("laser", *SENSORS)}
    return read_world_file(path, {n: checked(n) for n in TABLES} | several)


def read_toml(path: Path) -> World:
    """The walls of a world file, all tables of which are checked."""
    return read_file(path).world


def read_settings(texts: Iterable[str]) -> dict[str, dict[str, Any]]:
    """The values of settings by table and key; the last one counts if a key is set twice."""
    tables: dict[str, dict[str, Any]] = {}
    for text in each_of(texts, str, "settings"):
        name, equals, value = text.partition("=")
        table, dot, key = name.strip().partition(".")
        if not (equals and dot):
            expected = "expected TABLE.KEY=VALUE, such as laser.range_max=20"
            raise InputError(f"setting {shown(text)}: {expected}")
        place = f"setting {name[:80]}"
        with at(place):
            check_names(place, [table], [*TABLES, *SENSORS])
            keys = keys_of_table(table)
            check_names(place, [key], keys)
            tables.setdefault(table, {})[key] = keys[key](schema.value_of(value), place)
    return tables


def motion_sensors(file: WorldFile, tables: Mapping[str, Any]) -> dict[str, Any]:
    """The wheels and the IMU, where the file or the settings have a table for them."""
    found = dict[str, Any]()
    for name, kind in (("odometry", WheelOdometry), ("imu", Imu)):
        if name in file.tables or tables[name]:
            with file.at(name):
                found[name] = kind(**tables[name])
    return found


def cloud_sensors(file: WorldFile, name: str, settings: Mapping[str, Any]) -> tuple[Any, ...]:
    """The lidars or the depth cameras of a file by settings, which make one where it has none."""
    tables: Any = file.tables.get(name, [])
    found = []
    for place, table in enumerate(tables or [{}] * bool(settings)):
        key = f"{name}[{place}]" if len(tables) > 1 else name
        with file.at(f"{key} with settings" if settings else key):
            found.append(SENSORS[name](**{**table, **settings}))
    return tuple(found)


def lasers_with_noise(
    file: WorldFile, settings: Mapping[str, Any], noise: Mapping[str, Any]
) -> list[tuple[LaserRangeFinder, Noise]]:
    """The lasers of a file, each with its own noise or the file's; settings hold for all."""
    found = []
    for place, table in enumerate(file.lasers or [{}]):
        key = f"laser[{place}]" if len(file.lasers) > 1 else "laser"
        with file.at(f"{key} with settings" if settings else key):
            lrf = laser_of(**{**table, **settings})
        with file.at(f"{key}.noise" if "noise" in table else "noise"):
            found.append((lrf, noise_of(lrf, **{**noise, **table.get("noise", {})})))
    with file.at("laser"):
        lasers_of([lrf for lrf, _ in found])
    return found
