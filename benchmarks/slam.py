"""``scripts/bench slam``: how far off is the trajectory after each step of SLAM, and at what cost?

One recorded drive is solved at several distances between key scans: by the front end alone, with
loops closed, with the walls adjusted, and with every scan matched once more. Each step adds its
time to that of the steps before it. A simulated drive has its truth; a log needs relations.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.chart import RING, draw, trade_offs
from benchmarks.result import Result, Table
from benchmarks.timing import Timing
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.progress import Progress, silent
from lrf3d.scenario_file import load_scenario
from lrf3d.scoring.trajectory_score import Relations, score_trajectory
from lrf3d.slam import Slam, WheelErrors
from lrf3d.slam.frames import between, compose
from lrf3d.slam.front_end import KEY_DISTANCE, FrontEnd
from lrf3d.slam.lag import WheelPath, matched_lag
from lrf3d.slam.log import Recording, line_poses
from lrf3d.slam.repair import repaired
from lrf3d.slam.resolution import Resolution
from lrf3d.slam.surface import surface_of_scan

SPACINGS = (0.25, 0.35, 0.5, 0.7, 1.0)
"""Distances between key scans [m]."""

WORLD, SCANS = "corridor", 900
"""The world of the simulated drive, and its scans: there and back, and there once more."""

APART = (1, 10, 100)
"""How many scans the ends of the relations of a simulated drive lie apart, as in those of Kümmerle
et al.: some from one scan to the next, some to where the robot comes by again."""

STEPS = ("front end alone", "loops closed", "walls adjusted", "scans matched again")
"""The steps, each of which goes on from the one before it."""

ENTRIES = Table(
    "entries",
    {
        "log": "log",
        "step": "step",
        "spacing": "key spacing",
        "solve": "time",
        "error_m": ("error", "{:.4f} m".format),
        "std_m": ("±", "{:.4f} m".format),
        "rotation_deg": ("rotation", "{:.2f}°".format),
        "closures": "closures",
        "default": "",
    },
    "time: of one core, from the first scan on, reading left out; error: of the translation over\n"
    "all relations; default: what lrf3d slam does by default",
    names=("log", "step", "spacing"),
    time="solve",
    error="error_m",
    left=3,
)
"""Each step at each key spacing."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A recorded drive with what is known of it.

    Args:
        name: What it is called.
        scans: The scans (k,).
        wheels: (n, 3) poses by odometry, line by line.
        times: (n,) their stamps [s].
        places: (k,) for each scan the index of the last line before it.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        relations: Known relative poses between lines.
    """

    name: str
    scans: Sequence[LaserScan]
    wheels: Float
    times: Float
    places: Int
    laser_offset: float
    relations: Relations

    @classmethod
    def simulated(cls, scans: int) -> "Drive":
        """A drive through a built-in world, with wheels that slip and drift."""

        class NoMap:
            def update(self, scan: LaserScan) -> None:
                """Nothing."""

        run = load_scenario(WORLD).run(rng=0, scans=scans, mapper=NoMap(), snapshots=1)
        true, errors, rng = run.trajectory.poses, WheelErrors(), np.random.default_rng(0)
        wheels = [true[0]]
        for step in between(true[:-1], true[1:]):
            wheels.append(compose(wheels[-1], errors(step, rng)))
        first, second = np.hstack(
            [[np.arange(len(true) - apart), np.arange(apart, len(true))] for apart in APART]
        )
        known = between(true[first], true[second])
        relations = Relations(first, second, known, np.ones(len(first), np.bool_))
        times, places = run.trajectory.times, np.arange(len(true))
        return cls(WORLD, list(run.scans), np.array(wheels), times, places, 0.0, relations)

    @classmethod
    def recorded(cls, log: Recording, relations: Relations) -> "Drive":
        """A log with known relations between its odometry lines."""
        lines = log.wheels
        if lines is None:
            times, places = np.array([s.time for s in log.scans]), np.arange(len(log.scans))
            return cls(log.name, log.scans, log.poses, times, places, 0.0, relations)
        places = np.maximum(lines.places, 0)
        offset = lines.laser_offset
        return cls(log.name, log.scans, lines.poses, lines.times, places, offset, relations)


def bench_slam(
    drive: Drive, spacings: Sequence[float] = SPACINGS, *, progress: Progress = silent
) -> Result:
    """Solve a drive at several distances between key scans [m].

    Args:
        drive: The drive.
        spacings: The distances.
        progress: Called with the spacings done, and of how many.
    """
    begin = time.monotonic()
    result = Result(
        "slam",
        "How far is the trajectory off after each step of SLAM, and how long does it take?",
        {"scans": len(drive.scans), "relations": len(drive.relations)},
        chart,
    )
    # Kernels are compiled or read from disk before anything is timed.
    list(_steps(drive, 2.0, scans=40))
    for number, spacing in enumerate(spacings, 1):
        for step, seconds, lines, closures in _steps(drive, spacing):
            score = score_trajectory(lines, drive.relations)
            result.add(
                ENTRIES,
                log=drive.name,
                step=step,
                spacing=f"{spacing:g} m",
                default=step == STEPS[-1] and spacing == KEY_DISTANCE,
                solve=Timing.of([seconds]),
                error_m=score.translation_mean,
                std_m=score.translation_std,
                rotation_deg=score.rotation_mean,
                closures=closures,
            )
        progress(number, len(spacings))
    result.took_s = time.monotonic() - begin
    return result


Step = tuple[str, float, Float, int]
"""Its name, the time up to its end [s], the poses (n, 3) of all lines, and the closures."""


def _steps(drive: Drive, spacing: float, *, scans: int | None = None) -> Iterator[Step]:
    """Solve a drive, or its first scans, step by step."""
    log = repaired(drive.scans[:scans], drive.wheels, drive.times, drive.places[:scans])
    laser = np.array([drive.laser_offset, 0.0])
    begin = time.process_time()
    path, resolution = WheelPath(log.wheels), Resolution.of(log.scans[0].angles)

    def surface(number: int) -> Float:
        return surface_of_scan(log.scans[number], laser, sparse=resolution.sparse)

    lag = matched_lag(surface, path, log.places, resolution)
    lagged = time.process_time() - begin
    increments = path.increments(log.places - lag)

    def lines(poses: Float) -> Float:
        return line_poses(path, log.places, lag, poses)[log.rows]

    begin = time.process_time()
    front, found = FrontEnd(key_distance=spacing), []
    for number, increment in enumerate(increments):
        seen = surface(number)
        found.append(front.track(seen, increment).pose)
        if front.key_due():
            front.add_key(seen)
    spent = lagged + time.process_time() - begin
    yield STEPS[0], spent, lines(np.array(found)), 0

    begin = time.process_time()
    start = path.at(log.places[:1] - lag)[0]
    slam = Slam(start=start, laser_offset=drive.laser_offset, key_distance=spacing)
    for scan, increment in zip(log.scans, increments, strict=True):
        slam.update(scan, increment)
    spent = lagged + time.process_time() - begin
    yield STEPS[1], spent, lines(slam.trajectory()), len(slam.closures)

    for name, act in ((STEPS[2], _adjusted), (STEPS[3], _refined)):
        begin = time.process_time()
        poses = act(slam, log.scans)
        spent += time.process_time() - begin
        yield name, spent, lines(poses), len(slam.closures)


def _adjusted(slam: Slam, scans: Sequence[LaserScan]) -> Float:
    slam.finish()
    return slam.trajectory()


def _refined(slam: Slam, scans: Sequence[LaserScan]) -> Float:
    return slam.refined(scans)


def chart(result: Result) -> Figure:
    """Time and error of each step, at all key spacings."""
    how: dict[str, Any] = {
        "x": "solve",
        "y": "error_m",
        "by": "step",
        "labels": ("time of one core", "mean error of the translation [m]"),
        "note": "spacing",
    }
    return draw([trade_offs(result[ENTRIES], things="log", **how)], (
        "SLAM: run time against error",
        f"{result.facts['scans']:,} scans, {result.facts['relations']:,} relations  ·  beside the"
        f" points: distance between key scans  ·  {RING}",
    ))  # fmt: skip
