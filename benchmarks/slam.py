"""``scripts/bench slam``: how far off is the trajectory of SLAM, and at what cost?

One recorded drive is solved at several distances between key scans. A simulated drive has its
truth; a log needs relations.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.chart import RING, draw, trade_offs
from benchmarks.result import Result, Table
from benchmarks.timing import Timing
from lrf3d.geometry import Float, Int
from lrf3d.io import LaserLog
from lrf3d.laser import LaserScan
from lrf3d.progress import Progress, silent
from lrf3d.scenario_file import load_scenario
from lrf3d.scoring.trajectory_score import Relations, score_trajectory
from lrf3d.slam import LogSolution, WheelErrors
from lrf3d.slam.frames import between, compose
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.log import solve_log

SPACINGS = (0.25, 0.35, 0.5, 0.7, 1.0)
"""Distances between key scans [m]."""

WORLD, SCANS = "corridor", 900
"""The world of the simulated drive, and its scans: there and back, and there once more."""

APART = (1, 10, 100)
"""How many scans the ends of the relations of a simulated drive lie apart, as in those of Kümmerle
et al.: some from one scan to the next, some to where the robot comes by again."""

ENTRIES = Table(
    "entries",
    {
        "log": "log",
        "spacing": "key spacing",
        "solve": "time",
        "error_m": ("error", "{:.4f} m".format),
        "std_m": ("±", "{:.4f} m".format),
        "rotation_deg": ("rotation", "{:.2f}°".format),
        "closures": "closures",
        "default": "",
    },
    "time: of one core, from the first scan on, reading left out; error: of the translation over\n"
    "all relations; default: that of lrf3d slam",
    names=("log", "spacing"),
    time="solve",
    error="error_m",
    left=2,
)
"""Each key spacing."""


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
    def recorded(cls, log: LaserLog, relations: Relations) -> "Drive":
        """A log with known relations between its odometry lines."""
        lines = log.wheels
        if lines is None:
            places = np.arange(len(log))
            return cls(log.name, log.scans, log.poses, log.times, places, 0.0, relations)
        places, offset = np.maximum(lines.places, 0), lines.laser_offset
        return cls(log.name, log.scans, lines.poses, lines.times, places, offset, relations)

    def solved(self, spacing: float, scans: int | None = None) -> LogSolution:
        """The drive, or its first scans, solved at a distance between key scans [m]."""
        return solve_log(
            self.scans[:scans],
            self.wheels,
            self.places[:scans],
            times=self.times,
            laser_offset=self.laser_offset,
            key_distance=spacing,
        )


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
        "How far is the trajectory of SLAM off, and how long does it take?",
        {"scans": len(drive.scans), "relations": len(drive.relations)},
        chart,
    )
    # Kernels are compiled or read from disk before anything is timed.
    drive.solved(2.0, scans=40)
    for number, spacing in enumerate(spacings, 1):
        start = time.process_time()
        solution = drive.solved(spacing)
        seconds = time.process_time() - start
        score = score_trajectory(solution.line_poses, drive.relations)
        result.add(
            ENTRIES,
            log=drive.name,
            spacing=f"{spacing:g} m",
            default=spacing == KEY_DISTANCE,
            solve=Timing.of([seconds]),
            error_m=score.translation_mean,
            std_m=score.translation_std,
            rotation_deg=score.rotation_mean,
            closures=len(solution.slam.closures),
        )
        progress(number, len(spacings))
    result.took_s = time.monotonic() - begin
    return result


def chart(result: Result) -> Figure:
    """Time and error at all key spacings."""
    how: dict[str, Any] = {
        "x": "solve",
        "y": "error_m",
        "by": "log",
        "labels": ("time of one core", "mean error of the translation [m]"),
        "note": "spacing",
    }
    return draw([trade_offs(result[ENTRIES], things="log", **how)], (
        "SLAM: run time against error",
        f"{result.facts['scans']:,} scans, {result.facts['relations']:,} relations  ·  beside the"
        f" points: distance between key scans  ·  {RING}",
    ))  # fmt: skip
