"""Recorded logs as runs and maps: ``lrf3d slam`` and ``lrf3d map`` from Python.

A log, or the path of one, enters. `slam_log` finds its poses and returns the drive as a `Run`;
`map_log` believes its poses, and returns the map with a score.
"""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from lrf3d.errors import InputError, Lrf3dWarning
from lrf3d.geometry import Float
from lrf3d.interrupts import check, stoppable
from lrf3d.io import LaserLog, load_log
from lrf3d.io.reading import CARMEN_ENDINGS
from lrf3d.laser import LaserScan, doubtful_ranges
from lrf3d.laser.free_space import distinct_poses, free_cells
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.progress import Progress, silent
from lrf3d.robot import EstimatedTrajectory
from lrf3d.run import Run
from lrf3d.scoring import LogScore, Relations, TrajectoryScore, score_log, score_trajectory
from lrf3d.slam.frames import compose
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.log import LogSolution, run_of, solve_log
from lrf3d.world.free_cells import FreeCells


def slam_log(log: LaserLog | str | Path, *, key_distance: float = KEY_DISTANCE) -> Run:
    """Find the poses and the map of a recorded drive from its scans and its odometry.

    Args:
        log: The log, or its path.
        key_distance: Distance driven from one key scan to the next [m].

    Returns:
        The drive as a run, in the walls that it mapped.

    Raises:
        InputError: The log is no drive that SLAM can solve; the line says why.

    Warns:
        Lrf3dWarning: Scans contradict each other, so that the map or a part of it is wrong.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> lrf3d.slam_log("drive.log").trajectory.poses[-1, :2].round(1).tolist()
        [1.9, 1.0]
    """
    solved = solved_log(log, key_distance=key_distance)
    for sentence in solved.solution.sentences():
        warnings.warn(f"slam: {solved.log.name}: {sentence}", Lrf3dWarning, stacklevel=2)
    return solved.run


class LogMap:
    """A log and the map of some of its scans."""

    log: LaserLog
    map: LineMap
    mapped: list[LaserScan]
    poses: Float
    estimate: EstimatedTrajectory | None = None

    def free_cells(self) -> FreeCells:
        """The cells that the mapped scans show to be free."""
        chosen = distinct_poses(np.array([scan.pose for scan in self.mapped]).reshape(-1, 3))
        return free_cells([self.mapped[index] for index in chosen])

    def draw(self, path: Path) -> None:
        """Draw the map over the points that it was built from, and the path, to a file."""
        from lrf3d.render.figures import draw_map

        draw_map(
            self.map,
            path,
            points=np.vstack([scan.points() for scan in self.mapped]),
            poses=self.poses,
            estimate=self.estimate,
            title=self.log.name,
        )

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        return {
            "name": self.log.name,
            "log": {
                "scans": len(self.log),
                "beams": len(self.log.scans[0].ranges),
                "bad_lines": self.log.bad_count,
                "readings_not_numbers": self.log.not_numbers,
            },
            "map": {"segments": len(self.map), "objects": self.map.object_count},
        }


class SolvedLog(LogMap):
    """A log, its poses, and their error against known relations (None without any)."""

    def __init__(
        self, log: LaserLog, solution: LogSolution, score: TrajectoryScore | None = None
    ) -> None:
        self.log, self.solution, self.score = log, solution, score
        self.run = run = run_of(solution, log.name)
        self.map, self.poses, self.estimate = run.map, run.trajectory.poses, run.estimate
        self.mapped = [run.scan(number) for number in solution.slam.key_scans.tolist()]

    def __repr__(self) -> str:
        return f"SolvedLog({self.log.name}, {self.solution})"

    def trajectory(self) -> tuple[Float, Float]:
        """Times (n,) [s] and poses (n, 3) of the robot at the odometry lines, as logged."""
        times = self.log.times if self.log.wheels is None else self.log.wheels.times
        return times, self.solution.line_poses

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        solution, slam, common = self.solution, self.solution.slam, super().summary()
        biases, tracked = slam.wheels.biases.tolist(), slam.tracked
        return {
            **common,
            "log": {
                **common["log"],
                "odometry_lines": len(solution.line_poses),
                "odometry": "the poses of the scans" if self.log.wheels is None else "ODOM lines",
                **solution.repairs.as_dict(),
            },
            "wheels": {
                "lag_lines": solution.lag,
                "turn_share": biases[0],
                "turn_rad_per_m": biases[1],
                "way_share": biases[2],
                "solved_times": solution.passes,
            },
            "slam": {
                "length_m": self.run.trajectory.length,
                "key_scans": len(slam.key_scans),
                "loop_closures": len(slam.closures),
                "loop_closures_dropped": len(slam.unconfirmed_closures),
                "scans_by_odometry_alone": sum(not scan.matched for scan in tracked[1:]),
                "scans_with_a_weak_direction": sum(scan.weak for scan in tracked[1:]),
            },
            "self_check": solution.check.as_dict(),
            "score": None if self.score is None else self.score.as_dict(),
            "milliseconds_a_scan": solution.milliseconds,
        }


def solved_log(
    log: LaserLog | str | Path,
    *,
    key_distance: float = KEY_DISTANCE,
    relations: Relations | None = None,
    progress: Progress = silent,
) -> SolvedLog:
    """Find the poses of a recorded drive, and score them by known relations between its lines."""
    if not isinstance(log, LaserLog):
        carmen = str(log).lower().endswith(CARMEN_ENDINGS)
        log = load_log(log, poses="auto" if carmen else "odom")
    poses, places, offset, times = log.poses, np.arange(len(log)), 0.0, log.times
    if log.wheels is not None:
        poses, times, offset = log.wheels.poses, log.wheels.times, log.wheels.laser_offset
        places = np.maximum(log.wheels.places, 0)
    solution = solve_log(
        log.scans,
        poses,
        places,
        times=times,
        laser_offset=offset,
        key_distance=key_distance,
        progress=progress,
        name=log.name,
    )
    if log.wheels is None:
        # The poses of the scans are those of the laser; what is asked for are those of the base.
        base = compose(solution.line_poses, np.array(log.mount.inverse()))
        base[:, 2] = np.unwrap(base[:, 2])
        solution = replace(solution, line_poses=base)
    score = None if relations is None else score_trajectory(solution.line_poses, relations)
    return SolvedLog(log, solution, score)


@dataclass(frozen=True, eq=False, repr=False)
class MappedLog(LogMap):
    """A log, the map of some of its scans, and how well that predicts the others."""

    log: LaserLog
    mode: str
    sigma: float | None
    map: LineMap
    score: LogScore
    milliseconds: tuple[float, ...]
    mapped: list[LaserScan]

    def __repr__(self) -> str:
        return f"MappedLog({self.log.name}, {len(self.mapped)} scans, {self.map.counts})"

    @property
    def poses(self) -> Float:  # type: ignore[override]
        """Poses (k, 3) of the scans that the map was built from."""
        return np.array([scan.pose for scan in self.mapped])

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        common = super().summary()
        bad = [{bad.kind: bad.number, "reason": bad.reason} for bad in self.log.bad_lines]
        return {
            **common,
            "mode": self.mode,
            "sigma_m": self.sigma,
            "log": {**common["log"], "poses": self.log.source, "first_bad_lines": bad},
            "score": self.score.as_dict(),
            "milliseconds_a_scan": float(np.mean(self.milliseconds)),
            "median_milliseconds_a_scan": float(np.median(self.milliseconds)),
        }


@stoppable()
def map_log(
    log: LaserLog | str | Path,
    *,
    mode: str = "robust",
    sigma: float | None = None,
    all_scans: bool = False,
    progress: Progress = silent,
) -> MappedLog:
    """Build a map from the even scans of a log, counted from 0, and test it on the odd ones.

    Args:
        log: The log, or its path; its poses are taken as they are.
        mode: Mode of the mapper.
        sigma: Noise [m] at the largest range; learnt from the scans if not given.
        all_scans: Build it from all scans instead, and test it on none.
        progress: Called with the number of finished scans, and of all.

    Raises:
        InputError: There is no such mode, the noise is invalid, or the scans show no wall.

    Warns:
        Lrf3dWarning: The ranges are hardly in metres.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> len(lrf3d.map_log("drive.log").map) > 3
        True
    """
    log = log if isinstance(log, LaserLog) else load_log(log)
    mapper = LineMapper(mode, sigma=sigma)
    even, odd = (log.scans, []) if all_scans else (log.scans[::2], log.scans[1::2])
    # Compiling at the first scan is not counted.
    mapper.local_map(even[0])
    milliseconds = []
    for done, scan in enumerate(even, 1):
        begin = perf_counter()
        mapper.update(scan)
        milliseconds.append(1e3 * (perf_counter() - begin))
        progress(done, len(even))
        check()
    line_map, doubt = mapper.map, doubtful_ranges(log.scans)
    if not len(line_map):
        reason = doubt or "expected walls within the laser's range"
        raise InputError(
            f"{log.name}: {len(even)} scans show no wall, so that there is no map; {reason}"
        )
    if doubt:
        warnings.warn(f"map: {log.name}: {doubt}", Lrf3dWarning, stacklevel=2)
    return MappedLog(
        log, mode, sigma, line_map, score_log(line_map, odd), tuple(milliseconds), even
    )
