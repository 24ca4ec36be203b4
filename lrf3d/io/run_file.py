"""run.npz: a run on disk, as plain NumPy arrays; reading it never unpickles anything.

The page on file formats lists the arrays (docs/formats.md). The file is a plain .npz, which
``numpy.load`` reads as well. Its arrays are not packed and begin at multiples of 64 bytes, so that
`load_run` maps the large ones and a run of any length can be looked at. Where a program was
stopped, a journal lies in its place: see `recording`.
"""

import json
import os
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.files import check_ordinary
from lrf3d.io.npz import DAMAGES, Column, read_arrays, write_npz
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
    write_npz(
        path,
        [
            *head_columns(run.world, run.lrf, run.film),
            *obstacle_columns(run.obstacles),
            Column.of("times", run.trajectory.times),
            Column.of("poses", run.trajectory.poses),
            Column.of("ranges", run.ranges),
            Column.of("truth", run.truth),
            Column.of("walls", run.walls),
            *(Column.of(name, values) for name, values in run.light.items()),
            *map_columns(run.snapshot_scans, run.maps),
            *estimate_columns(run.estimate),
        ],
    )


def head_columns(world: World, lrf: LaserRangeFinder, film: FilmPlan) -> list[Column]:
    """The columns that are known before the first scan."""
    arrays = {
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
    return [Column.of(name, array) for name, array in arrays.items()]


def obstacle_columns(obstacles: "Sequence[DynamicObstacle]") -> list[Column]:
    """The columns of the dynamic obstacles; empty without any."""
    if not obstacles:
        return []
    arrays = {
        "obstacle_heights": np.array([obstacle.height for obstacle in obstacles]),
        "obstacle_corners": np.array([len(obstacle.outline) for obstacle in obstacles]),
        "obstacle_outlines": np.concatenate([obstacle.outline for obstacle in obstacles]),
        "obstacle_stops": np.array([len(obstacle.poses) for obstacle in obstacles]),
        "obstacle_times": np.concatenate([obstacle.poses.times for obstacle in obstacles]),
        "obstacle_poses": np.concatenate([obstacle.poses.poses for obstacle in obstacles]),
    }
    return [Column.of(name, array) for name, array in arrays.items()]


def map_columns(snapshot_scans: Iterable[int], maps: Sequence[LineMap]) -> list[Column]:
    """The columns of the map snapshots."""
    none = LineMap.empty()
    arrays = {
        "snapshot_scans": np.array(list(snapshot_scans), dtype=np.int64),
        "map_sizes": np.array([len(line_map) for line_map in maps], dtype=np.int64),
        "map_segments": np.concatenate([none.segments, *(part.segments for part in maps)]),
        "map_objects": np.concatenate([none.objects, *(part.objects for part in maps)]),
        "map_points": np.concatenate([none.points, *(part.points for part in maps)]),
    }
    codes = np.concatenate([none.codes, *(part.codes for part in maps)])
    if codes.any():
        arrays["map_kinds"] = codes
    return [Column.of(name, array) for name, array in arrays.items()]


def estimate_columns(estimate: EstimatedTrajectory | None) -> list[Column]:
    """The columns of the estimate; empty if the poses were given to the robot."""
    if estimate is None:
        return []
    arrays = {
        "estimate_poses": estimate.poses,
        "estimate_scans": estimate.known_scans,
        "estimate_covariances": estimate.covariances,
        "estimate_closures": estimate.closures,
        "estimate_dropped": estimate.dropped_closures,
        "estimate_odometry": estimate.odometry,
    }
    return [Column.of(name, array) for name, array in arrays.items()]


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
    "sweep.parquet": "a sweep",
    "metadata.yaml": "a ROS 2 bag",
    "map.geojson": "a map that was made from a log",
}
"""What a folder is that holds such a file and no run."""


def _cameras(arrays: dict[str, Any]) -> tuple[FixedCamera, ...]:
    names, rows = arrays["camera_names"], arrays["cameras"]
    return tuple(
        FixedCamera(str(name), (x, y, z), (u, v, w), field, bool(track))
        for name, (x, y, z, u, v, w, field, track) in zip(names, rows.tolist(), strict=True)
    )


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


def _estimate(arrays: dict[str, Any]) -> EstimatedTrajectory | None:
    if "estimate_poses" not in arrays:
        return None
    parts = ("poses", "scans", "covariances", "closures", "dropped", "odometry")
    return EstimatedTrajectory(*(arrays[f"estimate_{part}"] for part in parts))


def _receiver(arrays: dict[str, Any]) -> tuple[float, float, str, int]:
    if "receiver" not in arrays:
        return LaserRangeFinder().light
    threshold, near_field, echo, echoes = arrays["receiver"].tolist()
    return threshold, near_field, ECHO_CHOICES[int(echo)], int(echoes)


def _run(arrays: dict[str, Any]) -> Run:
    walls, sizes = arrays["walls"], arrays["map_sizes"]
    if walls.size and not -1 <= walls.min() <= walls.max() < len(arrays["segments"]):
        raise ValueError(f"walls from {walls.min()} to {walls.max()}, which the world has not")
    if (sizes < 0).any() or int(sizes.sum()) != len(arrays["map_segments"]):
        raise ValueError(f"map_sizes do not sum to {len(arrays['map_segments'])} segments")
    world = World(
        arrays["segments"],
        arrays["objects"],
        arrays["heights"],
        str(arrays["world_name"]),
        object_names=tuple(str(name) for name in arrays["object_names"]),
        colours=arrays["colours"],
        cameras=_cameras(arrays),
        materials=[material_of(json.loads(str(one))) for one in arrays.get("materials", ())],
    )
    angle_min, angle_max, beams, range_min, range_max, height = arrays["lrf"].tolist()
    lrf = LaserRangeFinder(
        angle_min,
        angle_max,
        int(beams),
        range_min,
        range_max,
        height,
        float(arrays["scan_duration"]),
        *_receiver(arrays),
    )
    codes = arrays.get("map_kinds", np.zeros(len(arrays["map_objects"]), np.int64))
    bounds = np.concatenate([[0], np.cumsum(sizes)])
    maps = tuple(
        LineMap.of_codes(
            arrays["map_segments"][first:last],
            arrays["map_objects"][first:last],
            arrays["map_points"][first:last],
            codes[first:last],
        )
        for first, last in pairwise(bounds)
    )
    return Run(
        world,
        lrf,
        Trajectory(arrays["times"], arrays["poses"]),
        arrays["ranges"],
        arrays["truth"],
        walls,
        tuple(arrays["snapshot_scans"].tolist()),
        maps,
        _obstacles(arrays),
        FilmPlan(
            str(arrays["film_view"]),
            float(arrays["film_playback"]),
            str(arrays.get("film_points_by", USUAL_FILM.points_by)),
        ),
        _estimate(arrays),
        **{name: arrays[name] for name in LIGHT if name in arrays},
    )
