"""run.npz: a run on disk, as plain NumPy arrays; reading it never unpickles anything.

The page on file formats lists the arrays (docs/formats.md). The file is a plain .npz, which
``numpy.load`` reads as well. Its arrays are not packed and begin at multiples of 64 bytes, so that
`load_run` maps the large ones and a run of any length can be looked at. Where a program was
stopped, a journal lies in its place: see `recording`.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.files import check_ordinary
from lrf3d.io.npz import DAMAGES, Array, read_arrays, write_npz
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.range_finder import ECHO_CHOICES
from lrf3d.mapping import LineMap
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.run import LIGHT, Run
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan, FixedCamera
from lrf3d.world.materials import material_of, material_value

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle
    from lrf3d.simulation import Simulation

VERSION = 1


def save_run(run: Run, path: str | Path) -> None:
    """Write a run to a file whole or not at all.

    Raises:
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> lrf3d.save_run(run, "run.npz")
        >>> len(lrf3d.load_run("run.npz"))
        2
    """
    rows: dict[str, Array] = {"times": run.trajectory.times, "poses": run.trajectory.poses}
    rows |= {"ranges": run.ranges, "truth": run.truth, "walls": run.walls, **run.light}
    maps = dict(zip(run.snapshot_scans, run.maps, strict=True))
    write_npz(path, run_arrays(run, rows, maps))


def run_arrays(
    run: "Run | Simulation", rows: Mapping[str, Array], maps: Mapping[int, LineMap]
) -> dict[str, Array]:
    """The arrays of a run's file, from what it keeps of each scan and the maps after some scans."""
    world, lrf, film, obstacles = run.world, run.lrf, run.film, run.obstacles
    arrays: dict[str, Any] = {
        "version": np.array(VERSION),
        "world_name": np.array(world.name),
        "segments": world.segments,
        "objects": world.objects,
        "heights": world.heights,
        "object_names": np.array(world.object_names, dtype=np.str_),
        "colours": world.colours,
        "camera_names": np.array([camera.name for camera in world.cameras], dtype=np.str_),
        "cameras": np.array(
            [(*c.position, *c.target, c.field_deg, c.track) for c in world.cameras],
            dtype=np.float64,
        ).reshape(-1, 8),
        "lrf": np.array(
            [lrf.angle_min, lrf.angle_max, lrf.beams, lrf.range_min, lrf.range_max, lrf.height]
        ),
        "scan_duration": np.array(lrf.scan_duration),
        "film_view": np.array(film.view),
        "film_playback": np.array(film.playback),
    }
    if film.points_by != USUAL_FILM.points_by:
        arrays["film_points_by"] = np.array(film.points_by)
    if lrf.light != LaserRangeFinder().light:
        threshold, near_field, echo, echoes = lrf.light
        arrays["receiver"] = np.array([threshold, near_field, ECHO_CHOICES.index(echo), echoes])
    if world.materials:
        values = [one and material_value(one) for one in world.materials]
        arrays["materials"] = np.array([json.dumps(value) for value in values], dtype=np.str_)
    if obstacles:
        arrays["obstacle_heights"] = np.array([each.height for each in obstacles])
        arrays["obstacle_corners"] = np.array([len(each.outline) for each in obstacles])
        arrays["obstacle_outlines"] = np.concatenate([each.outline for each in obstacles])
        arrays["obstacle_stops"] = np.array([len(each.poses) for each in obstacles])
        arrays["obstacle_times"] = np.concatenate([each.poses.times for each in obstacles])
        arrays["obstacle_poses"] = np.concatenate([each.poses.poses for each in obstacles])
    arrays |= rows
    # Arrays without rows have their shape and type from the empty map.
    parts = [LineMap.empty(), *maps.values()]
    arrays["snapshot_scans"] = np.array(list(maps), dtype=np.int64)
    arrays["map_sizes"] = np.array([len(part) for part in parts[1:]], dtype=np.int64)
    arrays["map_segments"] = np.concatenate([part.segments for part in parts])
    arrays["map_objects"] = np.concatenate([part.objects for part in parts])
    arrays["map_points"] = np.concatenate([part.points for part in parts])
    if (codes := np.concatenate([part.codes for part in parts])).any():
        arrays["map_kinds"] = codes
    if run.estimate is not None:
        arrays |= {name: getattr(run.estimate, field) for name, field in _ESTIMATE.items()}
    return arrays


_ESTIMATE = {
    "estimate_poses": "poses",
    "estimate_scans": "known_scans",
    "estimate_covariances": "covariances",
    "estimate_closures": "closures",
    "estimate_dropped": "dropped_closures",
    "estimate_odometry": "odometry",
}
"""Arrays of the file, and the fields of an EstimatedTrajectory that they hold."""


def load_run(path: str | Path) -> Run:
    """Read a run from a file or from the folder that ``lrf3d run`` wrote it to.

    Arrays over 64 MiB are memory-mapped, so that a run may be larger than the memory.

    Raises:
        InputError: The file is missing, damaged or not a run of lrf3d.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> lrf3d.save_run(run, "run.npz")
        >>> lrf3d.load_run("run.npz").trajectory.length
        1.0
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
    path = Path(path)
    folder, file = (path, path / "run.npz") if path.is_dir() else (path.parent, path)
    if os.path.lexists(file):
        check_ordinary(file, what="a run.npz")
        return file
    mend = "`lrf3d run WORLD` writes one"
    if file.with_suffix(".journal").exists():
        raise InputError(
            f"{file}: no such file; the run was stopped; the same `lrf3d run` with --resume ends it"
        )
    for name, what in _OTHERS.items():
        if folder == path and (folder / name).is_file():
            raise InputError(f"{folder}: the folder of {what}, with no run.npz in it; {mend}")
    raise InputError(f"{file}: no such file; {mend}")


_OTHERS = {
    "sweep.jsonl": "a sweep",
    "runs.csv": "a sweep",  # Of jobs, whose rows are in files of their own.
    "metadata.yaml": "a ROS 2 bag",
    "map.geojson": "a map that was made from a log",
}
"""What a folder is that holds such a file and no run."""


def _obstacles(arrays: dict[str, Any]) -> "tuple[DynamicObstacle, ...]":
    if "obstacle_heights" not in arrays:
        return ()
    # Casting loads the compiler, which takes time that most runs need not spend.
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle

    outlines = np.split(arrays["obstacle_outlines"], np.cumsum(arrays["obstacle_corners"])[:-1])
    ends = np.cumsum(arrays["obstacle_stops"])[:-1]
    times, poses = (np.split(arrays[f"obstacle_{part}"], ends) for part in ("times", "poses"))
    return tuple(
        DynamicObstacle(outline, Trajectory(*path), height)
        for outline, *path, height in zip(
            outlines, times, poses, arrays["obstacle_heights"].tolist(), strict=True
        )
    )


def _run(arrays: dict[str, Any]) -> Run:
    walls, sizes = arrays["walls"], arrays["map_sizes"]
    if walls.size and not -1 <= walls.min() <= walls.max() < len(arrays["segments"]):
        raise ValueError(f"walls from {walls.min()} to {walls.max()}, which the world has not")
    if (sizes < 0).any() or int(sizes.sum()) != len(arrays["map_segments"]):
        raise ValueError(f"map_sizes do not sum to {len(arrays['map_segments'])} segments")
    views = zip(arrays["camera_names"], arrays["cameras"].tolist(), strict=True)
    world = World(
        arrays["segments"],
        arrays["objects"],
        arrays["heights"],
        str(arrays["world_name"]),
        object_names=tuple(map(str, arrays["object_names"])),
        colours=arrays["colours"],
        cameras=tuple(
            FixedCamera(str(name), tuple(row[:3]), tuple(row[3:6]), row[6], bool(row[7]))
            for name, row in views
        ),
        materials=[material_of(json.loads(str(one))) for one in arrays.get("materials", ())],
    )
    angle_min, angle_max, beams, range_min, range_max, height = arrays["lrf"].tolist()
    light = LaserRangeFinder().light
    if "receiver" in arrays:
        threshold, near_field, echo, echoes = arrays["receiver"].tolist()
        light = threshold, near_field, ECHO_CHOICES[int(echo)], int(echoes)
    sight = range_min, range_max, height, float(arrays["scan_duration"])
    lrf = LaserRangeFinder(angle_min, angle_max, int(beams), *sight, *light)
    codes = arrays.get("map_kinds", np.zeros(len(arrays["map_objects"]), np.int64))
    columns = arrays["map_segments"], arrays["map_objects"], arrays["map_points"], codes
    # np.split gives a part more than there are ends.
    parts = [np.split(column, np.cumsum(sizes))[: len(sizes)] for column in columns]
    estimate = None
    if "estimate_poses" in arrays:
        held = {field: arrays[name] for name, field in _ESTIMATE.items()}
        estimate = EstimatedTrajectory(**held)
    film = FilmPlan(
        str(arrays["film_view"]),
        float(arrays["film_playback"]),
        str(arrays.get("film_points_by", USUAL_FILM.points_by)),
    )
    return Run(
        world,
        lrf,
        Trajectory(arrays["times"], arrays["poses"]),
        arrays["ranges"],
        arrays["truth"],
        walls,
        tuple(arrays["snapshot_scans"].tolist()),
        tuple(LineMap.of_codes(*part) for part in zip(*parts, strict=True)),
        _obstacles(arrays),
        film,
        estimate,
        **{name: arrays[name] for name in LIGHT if name in arrays},
    )
