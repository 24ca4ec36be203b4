"""run.npz: a run on disk, as plain NumPy arrays; reading it never unpickles anything.

The page on file formats lists the arrays (docs/formats.md). The file is a plain .npz, which
``numpy.load`` reads as well. Its arrays are not packed and begin at multiples of 64 bytes, so that
`load_run` maps the large ones and a run of any length can be looked at. Where a program was
stopped, a journal lies in its place: see `recording`.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.base.errors import InputError, expect
from lrf3d.base.files import as_path, check_ordinary
from lrf3d.base.interrupts import reading
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.cloud_sensors import NO_SENSORS, CloudSensors
from lrf3d.laser.scan import LIGHT
from lrf3d.mapping import LineMap
from lrf3d.recordings.formats.npz import DAMAGES, Array, read_arrays, write_npz
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.kinematics import RADIUS
from lrf3d.robot.odometry import ImuRecord
from lrf3d.simulation.run import MOTION, Run
from lrf3d.world import World
from lrf3d.world.cameras import FilmPlan, FixedCamera
from lrf3d.world.materials import material_of, material_value

if TYPE_CHECKING:
    from lrf3d.simulation.loop import Simulation

# Version of the format of runs that is written and read.
VERSION = 2

# What a file holds of each map snapshot, in the order of `LineMap.of_codes`.
_MAP = ("segments", "objects", "points", "codes")

# What a file holds of an estimated trajectory.
_ESTIMATE = tuple(each.name for each in fields(EstimatedTrajectory))


def save_run(run: Run, path: str | Path) -> None:
    """Write a run to a file whole or not at all.

    Raises:
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> lrf3d.save_run(lrf3d.load_scenario("paper_room").run(rng=0), "run.npz")
        >>> len(lrf3d.load_run("run.npz"))
        3
    """
    expect(run, Run, "run")
    rows: dict[str, Array] = {"times": run.trajectory.times, "poses": run.trajectory.poses}
    maps = dict(zip(run.snapshot_scans, run.maps, strict=True))
    write_npz(path, run_arrays(run, rows | run.rows, maps, run.imu))


def run_arrays(
    run: "Run | Simulation",
    rows: Mapping[str, Array],
    maps: Mapping[int, LineMap],
    imu: ImuRecord | None = None,
) -> dict[str, Array]:
    """The arrays of a run's file, from what it keeps of each scan and the maps after some scans."""
    world = run.world
    robots = [each.is_robot for each in run.obstacles]
    settings = {
        "name": world.name,
        "object_names": world.object_names,
        "materials": [one and material_value(one) for one in world.materials],
        "cameras": [asdict(camera) for camera in world.cameras],
        "laser": asdict(run.lasers[0]),
        **({"further": [asdict(each) for each in run.lasers[1:]]} if len(run.lasers) > 1 else {}),
        "film": asdict(run.film),
        "radius": run.radius,
        "obstacle_heights": [each.height for each in run.obstacles],
        **({"robots": robots} if any(robots) else {}),
    }
    sensors = run.cloud_sensors
    if [*sensors]:
        settings["sensors"] = sensors.as_dict()
    arrays: dict[str, Any] = {
        "version": np.array(VERSION),
        "settings": np.array(json.dumps(settings, default=float)),
        "segments": world.segments,
        "objects": world.objects,
        "heights": world.heights,
        "colours": world.colours,
    }
    for number, each in enumerate(run.obstacles):
        parts = each.outline, each.poses.times, each.poses.poses
        arrays |= zip(_obstacle(number), parts, strict=True)
    arrays |= rows
    # Arrays without rows have their shape and type from the empty map.
    maps_kept = [LineMap.empty(), *maps.values()]
    arrays["snapshot_scans"] = np.array(list(maps), dtype=np.int64)
    arrays["map_sizes"] = np.array([len(each) for each in maps.values()], dtype=np.int64)
    for name in _MAP:
        arrays[f"map_{name}"] = np.concatenate([getattr(each, name) for each in maps_kept])
    if imu is not None:
        arrays |= {f"imu_{each.name}": getattr(imu, each.name) for each in fields(imu)}
    if run.estimate is not None:
        arrays |= {f"estimate_{each}": getattr(run.estimate, each) for each in _ESTIMATE}
    return arrays


def _obstacle(number: int) -> list[str]:
    """The names of the arrays of a dynamic obstacle, in the order of outline, times and poses."""
    return [f"obstacle_{number}_{name}" for name in ("outline", "times", "poses")]


@reading()
def load_run(path: str | Path) -> Run:
    """Read a run from a file or from the folder that ``lrf3d run`` wrote it to.

    Arrays over 64 MiB are memory-mapped, so that a run may be larger than the memory.

    Raises:
        InputError: The file is missing, damaged or not a run of lrf3d.

    Examples:
        >>> import lrf3d
        >>> lrf3d.save_run(lrf3d.load_scenario("paper_room").run(rng=0), "run.npz")
        >>> lrf3d.load_run("run.npz").ranges.shape
        (3, 181)
    """
    path = run_path(path)
    try:
        arrays = read_arrays(path)
        if int(arrays["version"]) != VERSION:
            raise InputError(
                f"{path}: version {int(arrays['version'])} of the run format, this lrf3d reads"
                f" version {VERSION}; run the simulation again"
            )
        return _run(arrays)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    except KeyError as error:
        raise InputError(f"{path}: not a run of lrf3d, it holds no {error}") from None
    except DAMAGES as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: not a run of lrf3d or damaged ({reason})") from None


def run_path(path: str | Path) -> Path:
    """The file of a run that is given by its name or by its folder."""
    path = as_path(path)
    folder, file = (path, path / "run.npz") if path.is_dir() else (path.parent, path)
    if os.path.lexists(file):
        check_ordinary(file, what="a run.npz")
        return file
    fix = "`lrf3d run WORLD` writes one"
    if file.with_suffix(".journal").exists():
        raise InputError(
            f"{file}: no such file; the run was stopped; the same `lrf3d run` with --resume ends it"
        )
    for name, what in _OTHERS.items():
        if folder == path and (folder / name).is_file():
            raise InputError(f"{folder}: the folder of {what}, with no run.npz in it; {fix}")
    raise InputError(f"{file}: no such file; {fix}")


# What a folder is that holds such a file and no run.
_OTHERS = {
    "sweep.jsonl": "a sweep",
    "runs.csv": "a sweep",  # Of jobs, whose rows are in files of their own.
    "metadata.yaml": "a ROS 2 bag",
    "map.geojson": "a map that was made from a log",
}


def _run(arrays: dict[str, Any]) -> Run:
    settings = json.loads(str(arrays["settings"]))
    walls = arrays["walls"]
    sizes = arrays["map_sizes"]
    if walls.size and not -1 <= walls.min() <= walls.max() < len(arrays["segments"]):
        raise ValueError(f"walls from {walls.min()} to {walls.max()}, which the world has not")
    if (sizes < 0).any() or int(sizes.sum()) != len(arrays["map_segments"]):
        raise ValueError(f"map_sizes do not sum to {len(arrays['map_segments'])} segments")
    world = World(
        arrays["segments"],
        arrays["objects"],
        arrays["heights"],
        str(settings["name"]),
        object_names=tuple(map(str, settings["object_names"])),
        colours=arrays["colours"],
        cameras=tuple(FixedCamera(**each) for each in settings["cameras"]),
        materials=[material_of(each) for each in settings["materials"]],
    )
    # np.split gives a part more than there are ends.
    columns = [np.split(arrays[f"map_{name}"], np.cumsum(sizes))[: len(sizes)] for name in _MAP]
    obstacles = []
    heights = settings["obstacle_heights"]
    robots = settings.get("robots", [False] * len(heights))
    for number, (height, is_robot) in enumerate(zip(heights, robots, strict=True)):
        # Casting loads the compiler, which takes time that most runs need not spend.
        from lrf3d.casting.dynamic_obstacle import DynamicObstacle

        outline, times, poses = (arrays[name] for name in _obstacle(number))
        obstacles.append(DynamicObstacle(outline, Trajectory(times, poses), height, is_robot))
    estimate = None
    if "estimate_poses" in arrays:
        estimate = EstimatedTrajectory(*(arrays[f"estimate_{each}"] for each in _ESTIMATE))
    imu = None
    if "imu_times" in arrays:
        imu = ImuRecord(*(arrays[f"imu_{each.name}"] for each in fields(ImuRecord)))
    lasers = (settings["laser"], *settings.get("further", ()))
    lrf, *further = (LaserRangeFinder(**each) for each in lasers)
    return Run(
        world,
        lrf,
        Trajectory(arrays["times"], arrays["poses"]),
        arrays["ranges"],
        arrays["truth"],
        walls,
        tuple(arrays["snapshot_scans"].tolist()),
        tuple(LineMap.of_codes(*part) for part in zip(*columns, strict=True)),
        tuple(obstacles),
        FilmPlan(**settings["film"]),
        estimate,
        radius=settings.get("radius", RADIUS),
        **{name: arrays[name] for name in (*LIGHT, *MOTION) if name in arrays},
        imu=imu,
        further=tuple(further),
        cloud_sensors=CloudSensors.from_dict(settings["sensors"])
        if "sensors" in settings
        else NO_SENSORS,
    )
