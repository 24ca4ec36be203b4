"""What does a scan cost when obstacles move, and how far is its worst range off the exact one?

A robot scans at crossings of a city, with five obstacles around it that are elsewhere each time.
lrf3d takes them as they are; the peers that are installed are given them in their own way. Exact
ranges are those of PlanarCaster among walls and the obstacles' sides, which the stress tests
compare with fractions.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.ranges import LRF, bare_embree, city_crossings, errors, limited, mujoco_boxes
from benchmarks.report import Report
from benchmarks.timing import take_turns
from lrf3d.casting import PlanarCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import compose
from lrf3d.laser import ProportionalNoise
from lrf3d.robot import Trajectory
from lrf3d.simulation.sensor import Sensor
from lrf3d.world import World
from lrf3d.world.generators import generate_city

MOMENTS, OBSTACLES, WALLS = 32, 5, 400
"""Moments at which the robot scans, obstacles around it, and walls of the city."""

WRONG = 1e-9
"""A range is wrong when it is off by more than this [m]."""

Scan = Callable[[int], Float]
"""What casts the scan of a moment."""


def moving_scenes(report: Report, seconds: float) -> None:
    """Time and judge the scans of all libraries that are installed, which take turns."""
    world, poses = generate_city(WALLS), city_crossings(WALLS, MOMENTS)
    times, around = np.arange(float(MOMENTS)), np.linspace(-3.0, 3.0, OBSTACLES)
    paths = [
        Trajectory(times, compose(poses, np.array([2.5 * np.cos(a), 2.5 * np.sin(a), a])))
        for a in around
    ]
    obstacles = [DynamicObstacle(round_outline(0.4), path) for path in paths]
    sides = [np.concatenate([each.walls(time) for each in obstacles]) for time in times.tolist()]
    exact = np.array([
        PlanarCaster(World(np.vstack([world.segments, own]))).cast(LRF, pose).ranges
        for own, pose in zip(sides, poses, strict=True)
    ])  # fmt: skip
    scans: dict[str, Scan] = {}
    for name, make in (("lrf3d", _lrf3d), ("embreex", _embreex), ("MuJoCo", _mujoco),
                       ("irsim-x", _irsim)):  # fmt: skip
        try:
            scans[name] = make(world, obstacles, sides, poses)
            scans[name](0)
        except ImportError as error:
            report.notes.append(f"moving scenes: left out: {error}")
    spent = take_turns({name: partial(_at, scan) for name, scan in scans.items()}, seconds=seconds)
    for name, scan in scans.items():
        off = errors(np.array([scan(k) for k in range(MOMENTS)]), exact, LRF)
        report.add(
            "moving scenes",
            library=name,
            walls=len(world.segments),
            obstacles=OBSTACLES,
            scan_s=spent[name].median,
            error_m=float(off.max()),
            wrong_share=float((off > WRONG).mean()),
        )


def _at(scan: Scan, turn: int) -> Float:
    return scan(turn % MOMENTS)


def _lrf3d(world: World, obstacles: Any, sides: Any, poses: Float) -> Scan:
    silent = ProportionalNoise(0.0)
    sensor = Sensor(world, LRF, caster="planar", noise=silent, obstacles=obstacles)
    return lambda k: sensor.cast(poses[k], float(k)).ranges


def _embreex(world: World, obstacles: Any, sides: Any, poses: Float) -> Scan:
    """A scene of all walls and sides, built for each moment."""
    return lambda k: bare_embree(World(np.vstack([world.segments, sides[k]])))[0](
        LRF, poses[k : k + 1]
    )[0]


def _mujoco(world: World, obstacles: Any, sides: Any, poses: Float) -> Scan:
    """Sides as boxes on bodies that are placed for each moment."""
    library: Any = import_module("mujoco")
    spec = library.MjSpec()
    mujoco_boxes(spec.worldbody, world.segments, library)
    for each in obstacles:
        corners = np.asarray(each.outline)
        own = np.hstack([corners, np.roll(corners, -1, axis=0)])
        mujoco_boxes(spec.worldbody.add_body(mocap=True), own, library)
    model = spec.compile()
    data, met = library.MjData(model), np.empty(LRF.beams, np.int32)

    def scan(k: int) -> Float:
        for number, each in enumerate(obstacles):
            x, y, theta = each.path.poses[k]
            data.mocap_pos[number] = x, y, 0.0
            data.mocap_quat[number] = np.cos(0.5 * theta), 0.0, 0.0, np.sin(0.5 * theta)
        library.mj_kinematics(model, data)
        beams, found = np.pad(LRF.directions(poses[k]), ((0, 0), (0, 1))), np.empty(LRF.beams)
        eye = np.append(poses[k, :2], 0.0)
        library.mj_multiRay(
            model, data, eye, beams.ravel(), None, 1, -1, met, found, None, LRF.beams, LRF.range_max
        )
        return limited(np.where(found < 0.0, np.inf, found), LRF)

    return scan


def _irsim(world: World, obstacles: Any, sides: Any, poses: Float) -> Scan:
    """The compiled laser of IR-SIM, with walls as lines and obstacles as polygons."""
    cast = import_module("cpp._core").lidar_raycast
    origin = {"x": 0.0, "y": 0.0}
    lines = [
        {"type": "linestring", "vertices": wall.reshape(2, 2).tolist(), **origin}
        for wall in world.segments
    ]
    angles, around = LRF.angles.astype(np.float32), len(obstacles[0].outline)

    def scan(k: int) -> Float:
        bodies = [
            {"type": "polygon", "vertices": own[:, :2].tolist(), **origin}
            for own in sides[k].reshape(len(obstacles), around, 4)
        ]
        found = cast(*poses[k].tolist(), angles, LRF.range_max, [*lines, *bodies])
        far = np.asarray(found, np.float64)
        return limited(np.where(far >= LRF.range_max, np.inf, far), LRF)

    return scan
